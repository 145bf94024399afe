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
drift is taken for a bias, taken off, and the lag it has caused is taken back. Smaller biases are left to the
pull.

Measured on near-straight segments between waypoints (``python -m benchmarks.inertial``), degrees:

=================== ======== ============= =========== ==================
ms-indoor survey    median   between walks within walk turn error, median
------------------- -------- ------------- ----------- ------------------
rotation vector     7.9      9.4           11.8        9.0
pulled, 20 s        8.1      9.9           10.9        6.6
own 9-axis, pulled  8.6      10.7          10.8        6.6
magnetometer alone  9.0      9.9           13.3        9.7
=================== ======== ============= =========== ==================
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
