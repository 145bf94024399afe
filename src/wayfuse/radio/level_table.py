r"""Expected levels on a grid, laid out for kernels: Gaussian readings whose mean and spread are read bilinearly.

.. math:: \log p(z \mid x) = \sum_{a\,\text{heard}} \log s_a(x) - \tfrac12 s_a(x)^2 (z_a - m_a(x))^2, \quad s = 1/\sigma

Between nodes m, s and log s are interpolated. What is stored is 1/sigma and its logarithm, not sigma: the query then
needs no division and no logarithm. Access points come in groups of 16, the last one padded: a group is a whole vector.

>>> table = LevelTable.of((0.0, 0.0), 1.0, np.full((2, 2, 1), -60.0), np.full((2, 2, 1), 4.0))
>>> table.scans(np.array([[np.nan]]))[0, 0, 1].sum()
np.float32(0.0)
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wayfuse.core.errors import ConfigError, UsageError
from wayfuse.core.types import Array32

__all__ = ["LANES", "LevelTable"]

LANES = 16  # float32 numbers of the widest vectors in use


@dataclass(frozen=True, slots=True, eq=False)
class LevelTable:
    """Levels (groups, nodes, 3, 16): mean dBm, 1 / sigma 1/dB, log(1 / sigma) of the access points of each group.

    frame (5,): x, y m of the first node, 1 / step 1/m, nodes per row, rows. n_aps : access points; the rest is padding.
    """

    levels: Array32
    frame: Array32
    n_aps: int

    @classmethod
    def of(
        cls,
        origin: tuple[float, float],
        step: float,
        mean: NDArray[np.floating],
        sigma: NDArray[np.floating],
    ) -> LevelTable:
        """Table of mean dBm and sigma dB (rows, columns, a) on nodes ``step`` m apart, the first at ``origin`` m.

        Raises
        ------
        ConfigError : fewer than two rows or columns, a mean that is not finite, a sigma that is not positive.
        """
        if mean.ndim != 3 or mean.shape != sigma.shape or min(mean.shape[:2]) < 2:
            raise ConfigError(
                f"mean {mean.shape} and sigma {sigma.shape}",
                where="LevelTable",
                remedy="(rows, columns, a), 2 by 2",
            )
        if not (
            step > 0.0 and np.all(np.isfinite(mean)) and np.all(np.isfinite(sigma)) and np.all(sigma > 0.0)
        ):
            raise ConfigError("step and sigma must be positive, all levels finite", where="LevelTable")
        rows, columns, n = mean.shape
        groups = -(-n // LANES)
        levels = np.zeros((rows * columns, 3, groups * LANES), np.float32)
        levels[:, 0, :n] = mean.reshape(-1, n)
        levels[:, 1, :n] = 1.0 / sigma.reshape(-1, n)
        levels[:, 2, :n] = -np.log(sigma.reshape(-1, n))
        grouped = levels.reshape(rows * columns, 3, groups, LANES).transpose(2, 0, 1, 3)
        return cls(
            np.ascontiguousarray(grouped), np.array([*origin, 1.0 / step, columns, rows], np.float32), n
        )

    def scans(self, rssi: NDArray[np.floating]) -> Array32:
        """(K, groups, 2, 16) readings and 1 where heard, of scans (K, a) dBm with NaN where unheard.

        Raises
        ------
        UsageError : another number of access points.
        """
        if rssi.ndim != 2 or rssi.shape[1] != self.n_aps:
            raise UsageError(f"scans of shape {rssi.shape}", remedy=f"(K, {self.n_aps}) dBm")
        heard = np.isfinite(rssi)
        groups = len(self.levels)
        out = np.zeros((len(rssi), 2, groups * LANES), np.float32)
        out[:, 0, : self.n_aps] = np.where(heard, rssi, 0.0)
        out[:, 1, : self.n_aps] = heard
        return np.ascontiguousarray(out.reshape(-1, 2, groups, LANES).transpose(0, 2, 1, 3))
