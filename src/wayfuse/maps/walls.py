r"""Does a move cross a wall? Exactly, in constant time.

A move p -> q crosses a wall a-b when p and q lie on different sides of the line ab, and a and b on different
sides of the line pq, where a point *on* a line counts to its right side:

.. math:: [o(a,b,p) > 0] \ne [o(a,b,q) > 0] \;\wedge\; [o(p,q,a) > 0] \ne [o(p,q,b) > 0], \quad
          o(a,b,c) = (b-a) \times (c-a)

and when their bounding boxes share a point (which only decides collinear, rounded cases). Both the move and
the wall are first put in order, lower (x, then y) end first, so the answer does not depend on the direction
of either. What follows: sliding along a wall does not cross it; a move through the common corner of two
walls cannot slip between them; someone standing exactly on a wall is on one definite side of it and can
leave to that side.

`WallIndex` answers without looking at every wall, and with the same answer for every move: (1) a *clearance
field* of 0.25 m cells holds the distance that is free around the cell; a shorter move crosses nothing. (2) A
*cell list* of 1 m cells holds copies of all walls within the longest move (3 m) of the cell, nearest first:
those farther away than the move is long are not looked at. A move of more than 3 m is tested against every
wall.

>>> index = WallIndex.build(np.array([[0.0, 1.0, 2.0, 1.0]]))
>>> index.crosses([1.0, 3.0], [0.0, 0.0], [1.0, 3.0], [2.0, 2.0]).tolist()
[True, False]
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wayfuse.core.errors import MapError
from wayfuse.core.types import Array, BoolArray

__all__ = ["LARGEST", "WallArrays", "WallIndex"]

CLEARANCE_CELL = 0.25  # m
LIST_CELL = 1.0  # m, a whole multiple of the clearance cell
LONGEST_MOVE = 3.0  # m, more than any step; longer moves are exact too, but slow
CLEARANCE_UNIT = 1.0 / 64.0  # m, resolution of the clearance field: 255 units are 4 m
LARGEST = 3000.0  # m, a floor wider than this is a mistake (and its tables would not fit in memory)
SAFETY = 1e-3  # m, taken off the clearance: rounding (1e-12 m) can never turn a miss into a skip


class WallArrays(NamedTuple):
    """What the kernels need of an index, in the order of the last arguments of `crosses_one`."""

    grid: Array
    clearance: NDArray[np.uint8]
    start: NDArray[np.int32]
    packed: Array
    walls: Array


@dataclass(frozen=True, slots=True, eq=False)
class WallIndex:
    """Walls of a floor, ready to be asked.

    arrays : for kernels (`wayfuse.maps._kernels.crosses_one`). index, distance : walls of each list cell and
    how far they are (units of 1/64 m), nearest first, as stored.
    """

    arrays: WallArrays
    index: NDArray[np.int32]
    distance: NDArray[np.uint8]

    @classmethod
    def build(cls, walls: ArrayLike) -> WallIndex:
        """Index of walls (w, 4) m: x0, y0, x1, y1.

        Raises
        ------
        MapError : the array has another shape, holds numbers that are not finite, or spans more than 3 km.
        """
        from wayfuse.maps._kernels import build_cells, fill_clearance

        segments = _in_order(walls)
        origin, nx, ny = _extent(segments)
        k = round(LIST_CELL / CLEARANCE_CELL)
        clearance = np.full((ny * k, nx * k), 255, np.uint8)
        reach = 256 * CLEARANCE_UNIT
        fill_clearance(segments, origin[0], origin[1], CLEARANCE_CELL, reach, CLEARANCE_UNIT, clearance)
        clearance -= np.minimum(clearance, 1)  # one unit (> SAFETY) less
        reach = LONGEST_MOVE + SAFETY
        start = np.zeros(nx * ny + 1, np.int32)
        frame = (origin[0], origin[1], LIST_CELL, nx, ny, reach)
        build_cells(segments, *frame, start, np.empty(0, np.int32), np.empty(0))
        np.cumsum(start, out=start)
        index = np.empty(start[-1], np.int32)
        distance = np.empty(len(index))
        if len(index):
            build_cells(segments, *frame, start[:-1].copy(), index, distance)
        steps = np.maximum(np.floor(distance / CLEARANCE_UNIT) - 1, 0).astype(np.uint8)
        order = np.lexsort((index, steps, np.repeat(np.arange(nx * ny), np.diff(start))))
        return cls.from_tables(segments, clearance, start, index[order], steps[order])

    @classmethod
    def from_tables(
        cls,
        walls: ArrayLike,
        clearance: NDArray[np.uint8],
        start: NDArray[np.int32],
        index: NDArray[np.int32],
        distance: NDArray[np.uint8],
    ) -> WallIndex:
        """Index of walls and the tables that `build` made of them (stored with a site).

        Raises
        ------
        MapError : the tables are not those of the walls.
        """
        segments = _in_order(walls)
        origin, nx, ny = _extent(segments)
        k = round(LIST_CELL / CLEARANCE_CELL)
        fits = (
            clearance.shape == (ny * k, nx * k)
            and start.shape == (nx * ny + 1,)
            and start[-1] == len(index) == len(distance)
        )
        if not fits or (len(index) and not 0 <= index.min() <= index.max() < len(segments)):
            raise MapError("the wall tables do not belong to the walls", remedy="import the site anew")
        grid = np.array([*origin, 1 / CLEARANCE_CELL, CLEARANCE_UNIT, 1 / LIST_CELL, LONGEST_MOVE, nx])
        packed = np.column_stack([segments[index], (distance * CLEARANCE_UNIT) ** 2])
        return cls(WallArrays(grid, clearance, start, packed, segments), index, distance)

    @property
    def tables(self) -> tuple[NDArray[np.uint8], NDArray[np.int32], NDArray[np.int32], NDArray[np.uint8]]:
        """What `from_tables` takes after the walls."""
        return self.arrays.clearance, self.arrays.start, self.index, self.distance

    def crosses(self, x0: ArrayLike, y0: ArrayLike, x1: ArrayLike, y1: ArrayLike) -> BoolArray:
        """Whether moves (x0, y0) -> (x1, y1), (n,) m each, cross a wall; NaN crosses nothing."""
        from wayfuse.maps._kernels import crosses_many

        ends = [
            np.ascontiguousarray(a, dtype=np.float64)
            for a in np.broadcast_arrays(*map(np.atleast_1d, (x0, y0, x1, y1)))
        ]
        out = np.empty(len(ends[0]), np.bool_)
        ax, ay, bx, by = ends
        crosses_many(ax, ay, bx, by, *self.arrays, out)
        return out


def _in_order(walls: ArrayLike) -> Array:
    segments = np.array(walls, dtype=np.float64)
    if not segments.size:
        return np.empty((0, 4))
    if segments.ndim != 2 or segments.shape[1] != 4:
        raise MapError(f"walls have shape {segments.shape}", remedy="give (w, 4): x0, y0, x1, y1")
    if not np.all(np.isfinite(segments)):
        raise MapError("walls: coordinates must be finite numbers", remedy="mend the plan")
    swap = (segments[:, 0] > segments[:, 2]) | (
        (segments[:, 0] == segments[:, 2]) & (segments[:, 1] > segments[:, 3])
    )
    return np.ascontiguousarray(np.where(swap[:, None], segments[:, [2, 3, 0, 1]], segments))


def _extent(walls: Array) -> tuple[tuple[float, float], int, int]:
    """Origin (m) and size (cells) of the grid: beyond it no wall is within the longest move."""
    if not len(walls):
        return (0.0, 0.0), 1, 1
    margin = LONGEST_MOVE + LIST_CELL
    x0, y0 = (
        np.floor(walls[:, 0].min() - margin),
        np.floor(np.minimum(walls[:, 1], walls[:, 3]).min() - margin),
    )
    x1, y1 = walls[:, 2].max() + margin, np.maximum(walls[:, 1], walls[:, 3]).max() + margin
    if max(x1 - x0, y1 - y0) > LARGEST:
        raise MapError(
            f"walls span {max(x1 - x0, y1 - y0):.0f} m, more than {LARGEST:.0f} m", remedy="mend the plan"
        )
    return (float(x0), float(y0)), int(np.ceil((x1 - x0) / LIST_CELL)), int(np.ceil((y1 - y0) / LIST_CELL))
