"""Barriers stop particles: exactly, by the segment test of the floor's wall index."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wayfuse.core.errors import ConfigError
from wayfuse.core.types import Array
from wayfuse.filters.cloud import Cloud
from wayfuse.maps._kernels import crosses_many
from wayfuse.maps.walls import WallArrays, WallIndex

__all__ = ["Barriers"]


@dataclass(frozen=True, slots=True)
class Barriers:
    """One wall index per floor; a particle whose move crosses a wall stays where it was and loses log-weight.

    Parameters
    ----------
    indices : wall index of each floor, bottom up.
    penalty : nats lost per blocked move. Soft, because plans lack doors.
    """

    indices: tuple[WallIndex, ...]
    penalty: float = 1.2

    def __post_init__(self) -> None:
        if not self.penalty >= 0.0:
            raise ConfigError(f"penalty must not be negative, got {self.penalty}", where="Barriers")

    def restrict(self, before: Cloud, after: Cloud, log_weights: Array) -> tuple[Cloud, int]:
        """Undo the moves that cross a barrier of the particle's floor."""
        blocked = np.empty(after.n, np.bool_)
        lowest, highest = int(before.floor.min()), int(before.floor.max())
        if lowest == highest:
            self._test(self.indices[lowest].arrays, before, after, blocked)
        else:
            for floor in range(lowest, highest + 1):
                rows = np.flatnonzero(before.floor == floor)
                if len(rows):
                    part = np.empty(len(rows), np.bool_)
                    self._test(self.indices[floor].arrays, before.take(rows), after.take(rows), part)
                    blocked[rows] = part
        n = int(np.count_nonzero(blocked))
        if not n:
            return after, 0
        log_weights[blocked] -= self.penalty
        x, y = np.where(blocked, before.x, after.x), np.where(blocked, before.y, after.y)
        return after._replace(x=x, y=y), n

    @staticmethod
    def _test(
        arrays: WallArrays, before: Cloud, after: Cloud, out: np.ndarray[tuple[int], np.dtype[np.bool_]]
    ) -> None:
        crosses_many(before.x, before.y, after.x, after.y, *arrays, out)
