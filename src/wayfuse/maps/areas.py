"""Areas of a floor as rings: how far a place lies from one."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from wayfuse.core.types import Array

__all__ = ["Area", "distance_to_area"]


class Area(NamedTuple):
    """The sides of a polygon's closed rings: begins, ends and vectors along them (n, 2) m, squared lengths (n,) m²."""

    begin: Array
    end: Array
    along: Array
    length2: Array

    @classmethod
    def of(cls, rings: Sequence[Array]) -> Area:
        """The area within rings (k, 2) m."""
        begin = np.concatenate([ring[:-1] for ring in rings])
        end = np.concatenate([ring[1:] for ring in rings])
        along = end - begin
        return cls(begin, end, along, np.maximum(np.einsum("ij,ij->i", along, along), 1e-12))

    def distance(self, x: float, y: float) -> float:
        """Distance (m) of a place; 0 inside by the even-odd rule, so that holes are outside."""
        crosses = (self.begin[:, 1] > y) != (self.end[:, 1] > y)
        if crosses.any():
            begin, up = self.begin[crosses], self.along[crosses]
            if np.count_nonzero(begin[:, 0] + up[:, 0] * (y - begin[:, 1]) / up[:, 1] > x) % 2:
                return 0.0
        away = np.array([x, y]) - self.begin
        share = np.clip(np.einsum("ij,ij->i", away, self.along) / self.length2, 0.0, 1.0)
        nearest = self.begin + share[:, None] * self.along - np.array([x, y])
        return float(np.hypot(*nearest.T).min())


def distance_to_area(rings: Sequence[Array], place: Array) -> float:
    """Distance (m) of a place (2,) to a polygon of closed rings (k, 2) m, 0 inside."""
    return Area.of(rings).distance(*place.tolist())
