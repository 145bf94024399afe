r"""Stairs and lifts without a barometer: the curve fit on the vertical acceleration, as a bank of Kalman filters.

A lift shows in the vertical acceleration as two opposite pulses (chu2009, Fig. 2.6, fitted in Section 3.1.3). So do
stairs: who climbs has a mean vertical speed of about 0.26 m/s between the first and the last tread, under the much
larger swing of each step. The integral of the vertical acceleration, averaged over 1.2 s and 0.6 s (whole steps and
double steps), then is

.. math:: y(t) = o(t) + s \, [\text{moving}] + r, \qquad \dot o = b,

with an offset :math:`o` and its drift :math:`b` (error of the accelerometer and of the tilt), a speed :math:`s`
while there is a movement, and noise. A branch is one history of movements: which began and ended when. Each carries
a Kalman filter of (o, b, s) and is weighed by how well it foretold y and by how usual such movements are. Every
0.6 s branches split where a movement may begin (stairs while walking, lift while standing) or end; those alike are
joined, the 24 best stay. What the best branch says is reported once enough of the weight agrees.

Noise, measured as second differences of y over 1.2 to 14 s on level walks of ms-indoor (survey) and on the
single-floor walks of ipin2023-track3, is a random walk whose strength follows the mean vigour a (r.m.s. of \|a\| - g
over about 2 s, m/s²) alike on both sets and all phones:

.. math:: q = \max(0.005, \min(0.04 a, 0.024 + 0.005 a)) \; \mathrm{m/s/\sqrt{s}}

(standing 0.006, walking 0.026 to 0.05): after 4 s of standing 0.01 m/s, of walking 0.06 m/s, against 0.26 m/s of
stairs and 0.4 m/s and more of lifts. The vertical is the own one: rotation rate, drawn to the specific force in
1 s (2, 3 and 5 s are worse with gyros that have a bias). Without a gyroscope only lifts are found, from a phone
that stands: while walking the tilt is not known well enough.

How many movements are found and how many are false: docs/results.md (`wayfuse results --only behaviours`).

What it cannot do: tell a ramp from level ground (0.1 m/s), know the height of stairs well (the count of steps gives
it, `VerticalConfig.riser`), see through shaking, or always tell a phone that is raised by 0.3 m within a second
while walking from a first tread. A missed beginning can make the end look like a movement the other way; most such
doubts show as a belief below the one asked for.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from wayfuse.core.types import Array

__all__ = ["speed_noise"]


def speed_noise(vigour: ArrayLike) -> Array:
    """Random walk of the integrated vertical acceleration (m/s/√s) by the r.m.s. of \\|a\\| - g (m/s²).

    >>> speed_noise([0.0, 0.3, 1.0, 3.0]).round(3)
    array([0.005, 0.012, 0.029, 0.039])
    """
    a = np.asarray(vigour, dtype=np.float64)
    return np.asarray(np.maximum(np.minimum(0.04 * a, 0.024 + 0.005 * a), 0.005))
