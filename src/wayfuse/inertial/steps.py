r"""Step detection on the norm of the acceleration.

The norm does not depend on how the phone is held. A band-pass (second-order Butterworth high-pass and
low-pass in state-variable form, whose coefficients follow the measured sampling period, so that 20 to 400 Hz
and jittered clocks give the same filter) leaves one wave per step. A step is declared at the downward zero
crossing after a peak that exceeds a fixed threshold and a part of the usual peak of this walk, at least
``min_interval`` after the last step: the crossing is causal, needs no look-ahead and comes about 0.15 s
after the foot contact. Karlsson et al. [1]_ count upward crossings of a threshold by the low-passed
derivative; the zero crossing behind the peak times the step independently of its strength.

References
----------
.. [1] F. Karlsson, M. Karlsson, B. Bernhardsson, F. Tufvesson and M. Persson, Sensor fused indoor
   positioning using dual band WiFi signal measurements, European Control Conference 2015, Sec. IV.
"""

from __future__ import annotations

from wayfuse.core.types import Array
from wayfuse.inertial.config import InertialConfig
from wayfuse.inertial.front_end import InertialFrontEnd
from wayfuse.sensors.recording import Recording, Series

__all__ = ["detect_steps"]


def detect_steps(acceleration: Series, config: InertialConfig | None = None) -> Array:
    """Times (s) at which steps are declared in a column of accelerations, (n,)."""
    front_end = InertialFrontEnd(config or InertialConfig())
    _, events = front_end.run(front_end.init(), Recording("", acceleration=acceleration))
    return events.t
