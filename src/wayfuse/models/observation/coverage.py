"""How far a place is from the survey: the measure of what a radio map can know."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wayfuse.core.types import Array, Array32
from wayfuse.radio.survey import Survey

__all__ = ["SurveyDistance"]

_MOST = 60.0  # m; beyond this the distance no longer matters


@dataclass(frozen=True, slots=True, eq=False)
class SurveyDistance:
    """Distance to the nearest fingerprint as a raster per floor.

    cell : m. rasters : (ny, nx) float32 m per floor, cell (j, i) around ((i + 0.5) cell, (j + 0.5) cell) from
    ``origins``; a floor without fingerprints has the largest distance everywhere.
    """

    cell: float
    origins: tuple[tuple[float, float], ...]
    rasters: tuple[Array32, ...]

    @classmethod
    def build(cls, survey: Survey, cell: float = 1.0) -> SurveyDistance:
        """Rasters that reach ``_MOST`` metres beyond the survey (a two-pass exact distance transform)."""
        origins, rasters = [], []
        for floor in range(len(survey.floors)):
            xy = survey.xy[survey.floor == floor]
            if not len(xy):
                origins.append((0.0, 0.0))
                rasters.append(np.full((1, 1), _MOST, np.float32))
                continue
            low = np.floor(xy.min(axis=0)) - _MOST
            size = np.ceil((xy.max(axis=0) + _MOST - low) / cell).astype(int) + 1
            origins.append((float(low[0]), float(low[1])))
            rasters.append(_distance_raster(xy, low, size, cell))
        return cls(cell, tuple(origins), tuple(rasters))

    def at(self, x: NDArray[np.floating], y: NDArray[np.floating], floor: NDArray[np.integer]) -> Array:
        """(N,) m at places (N,) m; the largest known distance off the raster."""
        out = np.full(len(x), _MOST)
        for f in np.unique(floor):
            rows = np.flatnonzero(floor == f)
            raster, (x0, y0) = self.rasters[f], self.origins[f]
            i = np.floor((x[rows] - x0) / self.cell).astype(np.int64)
            j = np.floor((y[rows] - y0) / self.cell).astype(np.int64)
            on = (i >= 0) & (j >= 0) & (i < raster.shape[1]) & (j < raster.shape[0])
            out[rows[on]] = raster[j[on], i[on]]
        return out


def _distance_raster(xy: Array, low: Array, size: NDArray[np.int_], cell: float) -> Array32:
    # Exact for the cell centres to within the spacing of the fingerprints: fingerprints are binned to cells, then
    # the squared distance is separable: first along rows, then the lower envelope down the columns by brute force.
    nx, ny = int(size[0]), int(size[1])
    seed = np.zeros((ny, nx), dtype=bool)
    cells = np.floor((xy - low) / cell).astype(int)
    seed[cells[:, 1], cells[:, 0]] = True
    columns = np.arange(nx)
    along = np.full((ny, nx), np.inf)
    for j in np.flatnonzero(seed.any(axis=1)):
        hits = np.flatnonzero(seed[j])
        k = np.clip(np.searchsorted(hits, columns), 1, len(hits) - 1) if len(hits) > 1 else np.zeros(nx, int)
        nearest = np.abs(columns - hits[k])
        if len(hits) > 1:
            nearest = np.minimum(nearest, np.abs(columns - hits[k - 1]))
        along[j] = nearest
    best = np.full((ny, nx), np.inf)
    rows = np.arange(ny)
    for j in np.flatnonzero(np.isfinite(along[:, 0])):
        best = np.minimum(best, along[j][None, :] ** 2 + ((rows - j) ** 2)[:, None])
    raster: Array32 = np.minimum(np.sqrt(best) * cell, _MOST).astype(np.float32)
    return raster
