"""Walkable space of a floor as a mask of small cells.

The free space (outline minus units) of a plan is as inexact as its drawing, so it is widened by `WIDENING`:
a place at most that deep in a shop still counts as walkable. The mask is computed once when a site is built
(`build_floor`) and saved with it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.random import Generator
from numpy.typing import ArrayLike, NDArray

from wayfuse.core.errors import MapError
from wayfuse.core.types import Array, BoolArray

__all__ = ["CELL", "WIDENING", "Walkable"]

CELL = 0.5  # m, edge of a mask cell
WIDENING = 0.3  # m, free space is widened by this: plans are drawn to about 0.1 m, waypoints to a few


@dataclass(frozen=True, slots=True, eq=False)
class Walkable:
    """Mask of walkable cells: cell (j, i) covers x in origin_x + [i, i + 1) cell, y likewise with j.

    origin : (x, y) m. cell : m. mask : (ny, nx) uint8, 1 walkable.
    """

    origin: tuple[float, float]
    cell: float
    mask: NDArray[np.uint8]

    @property
    def area(self) -> float:
        """Walkable area (m2)."""
        return float(np.count_nonzero(self.mask)) * self.cell**2

    def contains(self, x: ArrayLike, y: ArrayLike) -> BoolArray:
        """Whether places (m, any shape) lie in walkable cells; places off the mask and NaN do not."""
        u = (np.asarray(x, dtype=np.float64) - self.origin[0]) / self.cell
        v = (np.asarray(y, dtype=np.float64) - self.origin[1]) / self.cell
        ny, nx = self.mask.shape
        on = (u >= 0) & (u < nx) & (v >= 0) & (v < ny)
        i = np.where(on, u, 0).astype(np.intp)
        j = np.where(on, v, 0).astype(np.intp)
        return np.asarray(on & (self.mask[j, i] != 0))

    def holds(self, x: float, y: float) -> bool:
        """`contains` of one place, without the arrays that take most of its time."""
        u, v = (x - self.origin[0]) / self.cell, (y - self.origin[1]) / self.cell
        ny, nx = self.mask.shape
        return 0.0 <= u < nx and 0.0 <= v < ny and bool(self.mask[int(v), int(u)])

    def centres(self) -> Array:
        """(n, 2) m, the centres of the walkable cells, row by row."""
        j, i = np.nonzero(self.mask)
        return np.asarray(np.asarray(self.origin) + (np.column_stack([i, j]) + 0.5) * self.cell)

    def random_points(self, rng: Generator, n: int) -> Array:
        """(n, 2) m, uniform over the walkable cells.

        Raises
        ------
        MapError : nothing is walkable.
        """
        centres = self.centres()
        if not len(centres):
            raise MapError(
                "the floor has no walkable space", remedy="check the outline and the units of the plan"
            )
        offset = rng.uniform(-0.5, 0.5, (n, 2)) * self.cell
        return np.asarray(centres[rng.integers(len(centres), size=n)] + offset)
