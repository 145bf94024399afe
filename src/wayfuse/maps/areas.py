"""Areas of a floor as rings: how far a place lies from one."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from wayfuse.core.types import Array

__all__ = ["distance_to_area"]


def distance_to_area(rings: Sequence[Array], place: Array) -> float:
    """Distance (m) of a place (2,) to a polygon of closed rings (k, 2) m.

    0 inside by the even-odd rule, so that holes are outside.
    """
    a = np.concatenate([ring[:-1] for ring in rings])
    b = np.concatenate([ring[1:] for ring in rings])
    crosses = (a[:, 1] > place[1]) != (b[:, 1] > place[1])
    up = b[crosses] - a[crosses]
    x = a[crosses, 0] + up[:, 0] * (place[1] - a[crosses, 1]) / up[:, 1]
    if np.count_nonzero(x > place[0]) % 2:
        return 0.0
    along = b - a
    length2 = np.maximum(np.einsum("ij,ij->i", along, along), 1e-12)
    share = np.clip(np.einsum("ij,ij->i", place - a, along) / length2, 0.0, 1.0)
    return float(np.hypot(*(a + share[:, None] * along - place).T).min())
