r"""Walking direction from the horizontal acceleration: forward and backward sums (chu2009, Section 3.1.1).

Horizontal accelerations of a walker tend to lie along the way. They fall into forward vectors, roughly along it, and
backward ones, roughly against it; the sum of the forward vectors and the reversed backward ones points along the
way. It needs no phone that points ahead, only a level and a north: the alternative to the heading of the phone.

The paper does not say which way is forward to begin with. Here a first guess splits the vectors, the sum replaces it
until it stays (the split is then that of the sum itself, a fixed point, which is the principal axis in all but
name). The axis has two ends: the guess chooses.

Measured on the 282 legs of 5 m and more between POSI of the single-floor trials of ipin2023-track3 (recorded attitude,
whole leg as one window, the phone's heading as guess): median error 10.0 degrees, 90 % 29; the heading of the phone
itself, which is held ahead there, 8.8 and 23.

>>> along = np.array([2.0, 1.0]) * np.array([[1.0], [-1.0], [0.8], [-0.6]])
>>> bool(np.isclose(walking_direction(along, guess=0.0), np.arctan2(1.0, 2.0)))
True

References
----------
.. [1] H.-T. Chu, master's thesis, National Chiao Tung University, 2009, Section 3.1.1.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from wayfuse.core.types import Array

__all__ = ["horizontal_acceleration", "walking_direction"]

_ROUNDS = 20  # the split settles in 2 to 4


def walking_direction(horizontal: ArrayLike, guess: float) -> float:
    """Direction in which one walks, rad counter-clockwise from the first axis, in (-pi, pi].

    Parameters
    ----------
    horizontal : (n, 2) horizontal accelerations in a fixed frame, m/s²; NaN rows are left out.
    guess : rad; chooses the end of the axis. It is returned where there is no acceleration at all.
    """
    a = np.asarray(horizontal, dtype=np.float64).reshape(-1, 2)
    a = a[np.all(np.isfinite(a), axis=1)]
    a = a - a.mean(axis=0) if len(a) > 2 else a
    way = np.array([np.cos(guess), np.sin(guess)])
    for _ in range(_ROUNDS):
        forward = np.where(a @ way >= 0.0, 1.0, -1.0)
        total = forward @ a
        size = float(np.hypot(*total))
        if size == 0.0:
            break
        before, way = way, total / size
        if np.array_equal(before, way):
            break
    if way @ (np.cos(guess), np.sin(guess)) < 0.0:
        way = -way
    return float(np.arctan2(way[1], way[0]))


def horizontal_acceleration(acceleration: ArrayLike, quaternion: ArrayLike) -> Array:
    """East and north parts (n, 2) of accelerations (n, 3) by attitudes (n, 4) (w, x, y, z), device to world."""
    v = np.asarray(acceleration, dtype=np.float64)
    w, x, y, z = np.moveaxis(np.asarray(quaternion, dtype=np.float64), -1, 0)
    east = (1 - 2 * (y * y + z * z)) * v[:, 0] + 2 * (x * y - w * z) * v[:, 1] + 2 * (x * z + w * y) * v[:, 2]
    north = (
        2 * (x * y + w * z) * v[:, 0] + (1 - 2 * (x * x + z * z)) * v[:, 1] + 2 * (y * z - w * x) * v[:, 2]
    )
    return np.column_stack([east, north])
