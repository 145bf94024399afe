"""Heading of the phone: which way its owner walks, if the phone points there.

Direction of a device: its y axis (the top edge) on the horizontal plane, the pointing direction of a phone
that lies in the hand at up to 55 degrees of pitch. From there to 70 degrees it blends into the direction of
the back of the phone (-z), which points ahead when the phone stands upright. In a pocket or bag neither is
the walking direction, but its *changes* are.

Source (`InertialConfig.heading_source`):

``pulled`` (default)
    the rotation rate about the vertical, integrated, plus an offset that follows the absolute heading: first
    as a running mean, then with the time constant ``heading_tau``. It keeps the shape of turns where the
    magnetic field of a building bends the absolute heading, and keeps its mean. The absolute heading is the
    recorded rotation vector's, or that of the own filter with a magnetometer.
``orientation``
    the absolute heading itself.

What can be missing: without a gyro (or 0.5 s after its last sample) the absolute heading is used as it is;
without an absolute heading the gyro alone gives a relative one (`FrontEndState.is_heading_absolute`). A gap
of the gyro and shaking (r.m.s. rotation rate above ``shake_rate``) lose the yaw: the offset starts anew. A
*bias* of the gyro would be multiplied by the time constant (0.1 rad/s * 20 s = 2 rad): where the raw yaw
drifts from the absolute heading by more than ``bias_drift`` within a block of at least ``bias_time``, the
drift is taken for a bias, taken off, and the lag it has caused is taken back. Smaller biases are left to
the pull.

Measured on straight segments between waypoints (``python -m benchmarks.inertial``), degrees: median
absolute error, sd between walks (a constant bias of a walk), sd within a walk, median error of the turn
between neighbouring segments.

==================== ====================== ======================
source               ms-indoor survey       ipin2023-track3
==================== ====================== ======================
rotation vector       9.0,  9.4, 13.6, 10.7  8.4,  8.1, 12.0,  8.8
pulled, 5 s           8.9,  9.5, 13.3,  9.8  8.5,  9.2, 11.2,  7.3
pulled, 20 s          8.9, 10.0, 12.8,  9.0  7.8, 10.0, 10.8,  4.9
pulled, 40 s          8.8, 10.0, 12.6,  8.9  9.0, 10.4, 10.8,  4.3
the same, bias kept   8.8, 10.0, 12.6,  9.0  9.4, 16.3,  9.7,  4.6
own 9-axis, pulled    9.4, 10.6, 12.9,  9.0  8.9, 13.4, 16.0,  4.4
magnetometer alone   10.0, 10.8, 16.1, 12.9  8.4,  7.7, 12.5, 10.5
==================== ====================== ======================

(bias kept: 20 s without the bias rule.) Part of each figure is the walker, who strays from the straight line.
Time constant and bias rule were set with these walks in view; no walk of a test or development set was used.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from wayfuse.core.types import Array

__all__ = ["device_heading"]

_PITCH_START, _PITCH_RANGE = 0.82, 0.12  # sine of the pitch: from 55 to 70 degrees


def device_heading(quaternion: ArrayLike) -> Array:
    """Direction of the phone, rad counter-clockwise from east, of attitudes (w, x, y, z), (..., 4).

    The array twin of the kernel the front end uses.
    """
    w, x, y, z = np.moveaxis(np.asarray(quaternion, dtype=np.float64), -1, 0)
    top = np.stack([2 * (x * y - w * z), 1 - 2 * (x * x + z * z)])
    back = -np.stack([2 * (x * z + w * y), 2 * (y * z - w * x)])
    up = 2 * (y * z + w * x)
    part = np.clip((np.abs(up) - _PITCH_START) / _PITCH_RANGE, 0.0, 1.0)
    e, n = (1 - part) * top + np.copysign(part, up) * back
    return np.asarray(np.arctan2(n, e))
