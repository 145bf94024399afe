"""The field of one floor on a grid, and the likelihood of readings on it.

Only access points that the floor heard at enough places have columns here; their spread is shared, for they
share the kernel and the places. Silence is kept as a table and as its sum over the columns: the silence of all
access points that a query did not hear is the sum less the few that it did.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayfuse.core.types import Array, Array32, BoolArray
from wayfuse.radio.censoring import log_silence
from wayfuse.radio.gp_fit import FloorField
from wayfuse.radio.radio_map import parts_error

__all__ = ["FloorGrid", "GridSize", "grid_of", "log_student"]

_MARGIN = 5.0  # m that the grid reaches beyond the survey
_BLOCK = 4096  # nodes predicted at a time
_TABLES = ("origin", "columns", "mean", "sigma", "silence", "near")


class GridSize(NamedTuple):
    """Spacing (m), how far from a surveyed place a node counts as near (m), most nodes of a floor."""

    step: float
    reach: float
    max_nodes: int


def log_student(
    z: NDArray[np.floating], mean: NDArray[np.floating], sigma: NDArray[np.floating], dof: float
) -> Array:
    """(N,) log density of independent Student-t readings z (h,) around mean (N, h), constants dropped.

    ``sigma`` (N, 1) or (N, h) dB.
    """
    r = (z - mean) / sigma
    terms = -0.5 * (dof + 1.0) * np.log1p(r * r / dof) - np.log(sigma)
    return np.asarray(terms.sum(axis=1, dtype=np.float64))


@dataclass(frozen=True, slots=True, eq=False)
class FloorGrid:
    """Field of one floor on grid nodes (r rows along y, c columns along x, node = row * c + column).

    origin (2,) m of node 0; step m; shape (r, c); columns (a,): access points with a field, ascending columns
    of the map; mean (r * c, a) dBm; sigma (r * c,) dB of a query reading; silence (r * c, a) log probability
    of not hearing; near (r * c,): close to a surveyed place.
    """

    origin: Array
    step: float
    shape: tuple[int, int]
    columns: NDArray[np.int64]
    mean: Array32
    sigma: Array32
    silence: Array32
    near: BoolArray
    total_silence: Array = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "total_silence", self.silence.sum(axis=1, dtype=np.float64))

    def nodes(self) -> Array:
        """(r * c, 2) m: the places of the nodes."""
        row, column = np.divmod(np.arange(self.shape[0] * self.shape[1]), self.shape[1])
        return self.origin + self.step * np.column_stack([column, row])

    def corners(self, xy: NDArray[np.floating]) -> tuple[NDArray[np.int64], Array]:
        """Nodes (N, 4) around places (N, 2), bilinear weights (N, 4); places outside move to the edge."""
        rows, columns = self.shape
        at = np.clip((np.asarray(xy, np.float64) - self.origin) / self.step, 0.0, [columns - 1, rows - 1])
        low = np.minimum(at.astype(np.int64), [max(columns - 2, 0), max(rows - 2, 0)])
        u, v = (at - low).T
        right, up = np.minimum(low[:, 0] + 1, columns - 1), np.minimum(low[:, 1] + 1, rows - 1)
        x, y = (low[:, 0], right, low[:, 0], right), (low[:, 1], low[:, 1], up, up)
        node = np.stack([j * columns + i for i, j in zip(x, y, strict=True)], axis=1)
        return node, np.stack([(1 - u) * (1 - v), u * (1 - v), (1 - u) * v, u * v], axis=1)

    def split(self, heard: NDArray[np.int64]) -> tuple[NDArray[np.int64], BoolArray]:
        """Which of the map's columns ``heard`` (h,) have a field: their place in the tables, and the mask."""
        place = np.minimum(np.searchsorted(self.columns, heard), len(self.columns) - 1)
        known = self.columns[place] == heard
        return place[known], known

    def at_places(self, z: Array, own: NDArray[np.int64], xy: NDArray[np.floating], dof: float) -> Array:
        """(N,) log-likelihood of readings z (h,) of own columns (h,), and of silence, at places (N, 2)."""
        from wayfuse.radio._grid_kernels import field_log_likelihood

        node, weight = self.corners(xy)
        out = np.empty(len(node))
        tables = (self.mean, self.sigma, self.silence, self.total_silence)
        field_log_likelihood(node, weight, *tables, own, z, dof, out)
        return out

    def at_near_nodes(self, z: Array, own: NDArray[np.int64], dof: float) -> Array:
        """As `at_places`, at the nodes near a surveyed place."""
        nodes = np.flatnonzero(self.near)
        at = np.ix_(nodes, own)
        silent = self.total_silence[nodes] - self.silence[at].sum(axis=1, dtype=np.float64)
        if not len(own):
            return np.asarray(silent)
        return np.asarray(log_student(z, self.mean[at], self.sigma[nodes, None], dof) + silent)

    def parts(self, level: int) -> dict[str, NDArray[Any]]:
        """Arrays to store, their names ending in the level."""
        size = np.array([*self.shape, self.step])
        return {f"size_{level}": size} | {f"{name}_{level}": getattr(self, name) for name in _TABLES}

    @classmethod
    def from_parts(cls, arrays: Mapping[str, NDArray[Any]], level: int, n_columns: int) -> FloorGrid:
        """The grid of what `parts` gave; `ValueError` where it does not fit a map of so many columns."""
        rows, columns, step = arrays[f"size_{level}"].tolist()
        tables = {name: arrays[f"{name}_{level}"] for name in _TABLES}
        nodes, own = int(rows) * int(columns), len(tables["columns"])
        shapes = ((2,), (own,), (nodes, own), (nodes,), (nodes, own), (nodes,))
        if fault := parts_error(tables, dict(zip(_TABLES, shapes, strict=True)), "fifffb"):
            raise ValueError(fault)
        index = tables["columns"]
        if not own or index[0] < 0 or index[-1] >= n_columns or np.any(np.diff(index) <= 0) or step <= 0:
            raise ValueError("columns or step of a grid")
        return cls(step=step, shape=(int(rows), int(columns)), **tables)


def grid_of(floor: FloorField, noise: float, limit: float, dropout: float, size: GridSize) -> FloorGrid:
    """Mean, spread and silence of the access points of a floor on its grid.

    ``noise`` dB of a query reading around the field; ``limit`` dBm and ``dropout`` of hearing.
    """
    low, high = floor.xy.min(axis=0) - _MARGIN, floor.xy.max(axis=0) + _MARGIN
    spacing = max(size.step, float(np.sqrt(np.prod(high - low) / size.max_nodes)))
    columns, rows = (np.ceil((high - low) / spacing).astype(int) + 1).tolist()
    row, column = np.divmod(np.arange(rows * columns), columns)
    nodes = low + spacing * np.column_stack([column, row])
    mean = np.empty((len(nodes), len(floor.columns)), np.float32)
    silence = np.empty_like(mean)
    sigma, near = np.empty(len(nodes), np.float32), np.empty(len(nodes), np.bool_)
    for start in range(0, len(nodes), _BLOCK):
        part = slice(start, start + _BLOCK)
        value, spread = floor.predict(nodes[part])
        whole = np.hypot(spread, noise)
        mean[part], sigma[part] = value, whole
        silence[part] = log_silence(value, whole[:, None], limit, dropout)
        squared = ((nodes[part, None] - floor.xy[None]) ** 2).sum(axis=-1)
        near[part] = squared.min(axis=1) <= max(size.reach, spacing) ** 2
    return FloorGrid(low, spacing, (rows, columns), floor.columns, mean, sigma, silence, near)
