"""Levels of access points on a square grid, read between its places: the radio map of chu2009, chapter 4.

>>> grid = LevelGrid(np.array([[[-40.0], [-50.0]], [[-60.0], [-70.0]]]), 2.0)
>>> float(grid.at(np.array([1.0]), np.array([1.0]))[0, 0])
-55.0
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from wayfuse.core.types import Array

__all__ = ["LevelGrid"]


@dataclass(frozen=True, slots=True, eq=False)
class LevelGrid:
    """Training places on a square grid from 0: levels (ny, nx, a) dBm every ``grain`` m."""

    levels: Array
    grain: float
    _flat: Array = field(init=False, repr=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "_flat", self.levels.reshape(-1, self.levels.shape[-1]))

    def at(self, x: NDArray[np.floating], y: NDArray[np.floating]) -> Array:
        """Levels (n, a) dBm by bilinear interpolation of the training places; outside, those of the edge."""
        ny, nx, _ = self.levels.shape
        gx = np.clip(np.asarray(x, dtype=np.float64) / self.grain, 0.0, nx - 1.0)
        gy = np.clip(np.asarray(y, dtype=np.float64) / self.grain, 0.0, ny - 1.0)
        i = np.minimum(gx.astype(int), nx - 2)
        j = np.minimum(gy.astype(int), ny - 2)
        fx, fy = (gx - i)[:, None], (gy - j)[:, None]
        low = (1.0 - fx) * self.levels[j, i] + fx * self.levels[j, i + 1]
        high = (1.0 - fx) * self.levels[j + 1, i] + fx * self.levels[j + 1, i + 1]
        return np.asarray((1.0 - fy) * low + fy * high)

    def log_likelihood(
        self, levels: Array, x: NDArray[np.floating], y: NDArray[np.floating], sigma: float
    ) -> Array:
        """(n,) log-likelihood of levels (a,) dBm by a Gaussian kernel of sigma dB (Eq. 3.6-3.7), constant dropped."""
        off = (self.at(x, y) - levels) / sigma
        return np.asarray(-0.5 * np.sum(off * off, axis=1))

    def nearest(self, levels: Array) -> Array:
        """Training place (2,) m nearest in signal space to levels (a,)."""
        best = int(np.argmin(np.sum((self._flat - levels) ** 2, axis=1)))
        j, i = divmod(best, self.levels.shape[1])
        return np.array([i * self.grain, j * self.grain])
