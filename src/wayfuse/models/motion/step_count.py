r"""Motion by counted steps and gyroscope turns, the heading unknown (karlsson2015, Eq. 2).

.. math::
   x_{k+1} = x_k + N (l + r_k) \cos\theta_k, \quad y_{k+1} = y_k + N (l + r_k) \sin\theta_k, \quad
   \theta_{k+1} = \theta_k + \Delta\theta_k + v_k

A particle moves with the heading it had *before* the turn, and one r_k serves all N steps of an event, so
the noise of a distance grows with N, not with its root: give events of one step where that matters.

References
----------
.. [1] F. Karlsson, M. Karlsson, B. Bernhardsson, F. Tufvesson and M. Persson, Sensor fused indoor positioning using
   dual band WiFi signal measurements, European Control Conference 2015, 10.1109/ECC.2015.7330777.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from wayfuse.core.errors import ConfigError
from wayfuse.core.philox import Noise
from wayfuse.filters.cloud import Cloud
from wayfuse.models.motion.pdr import StepInput

__all__ = ["CountedSteps", "StepByStep", "StepCountMotion"]


class CountedSteps(NamedTuple):
    """N steps, and the measured heading (rad) during them: the turns summed from any start."""

    n: int
    heading: float


@dataclass(frozen=True, slots=True, kw_only=True)
class StepCountMotion:
    """Eq. 2 with the heading as measured heading + the particle's heading bias, which carries start and v_k.

    step_length : l, m. length_sigma : sigma_r, m per step. heading_sigma : sigma_v, rad per event.
    """

    step_length: float
    length_sigma: float
    heading_sigma: float

    def __post_init__(self) -> None:
        if not (self.step_length > 0.0 and self.length_sigma >= 0.0 and self.heading_sigma >= 0.0):
            raise ConfigError(f"lengths and sigmas must not be negative, got {self}", where="StepCountMotion")

    def propagate(self, noise: Noise, cloud: Cloud, event: CountedSteps) -> Cloud:
        """One event; floors and step scales stay."""
        z = noise.normals(cloud.n)
        length = np.float32(event.n) * (np.float32(self.step_length) + np.float32(self.length_sigma) * z[0])
        theta = np.float32(event.heading) + cloud.heading_bias
        return cloud._replace(
            x=cloud.x + length * np.cos(theta),  # Eq. (2)
            y=cloud.y + length * np.sin(theta),
            heading_bias=cloud.heading_bias + np.float32(self.heading_sigma) * z[1],
        )


@dataclass(frozen=True, slots=True)
class StepByStep:
    """The same for the steps of a tracker: an event each, with the measured heading; the length is the motion's own."""

    motion: StepCountMotion

    def propagate(self, noise: Noise, cloud: Cloud, event: StepInput) -> Cloud:
        """One step."""
        return self.motion.propagate(noise, cloud, CountedSteps(1, event.heading))
