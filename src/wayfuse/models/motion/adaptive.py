r"""The adaptive motion model of he2014: a disc while standing, the measured move while walking.

.. math:: x' = x + (l + \delta l) \cos(\theta + \delta\theta), \quad
          y' = y + (l + \delta l) \sin(\theta + \delta\theta) \qquad (Eq. 4, 5)

with zero-mean Gaussian noises in metres and radians, drawn anew for each particle and epoch. While the user stands
(and throughout, where there are no motion sensors) a particle moves to a place drawn uniformly from the disc of
1 m about it, which lets the filter correct itself.

References
----------
.. [1] X. He, J. Li, D. Aloi, WiFi based indoor localization with adaptive motion model using smartphone motion
   sensors, ICCVE 2014, Sec. II.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from wayfuse.core.errors import ConfigError
from wayfuse.core.philox import Noise
from wayfuse.filters.cloud import Cloud
from wayfuse.models.motion.pdr import StepInput

__all__ = ["AdaptiveMotion", "StandingDisc", "Walked"]

Walked: TypeAlias = StepInput  # a move of one epoch: length m, heading rad, building frame


@dataclass(frozen=True, slots=True, kw_only=True)
class AdaptiveMotion:
    """The event is `Walked`, or None: the user stands, or nothing is known of the motion.

    radius : m, of the disc. length_sigma : m. heading_sigma : rad.
    """

    radius: float = 1.0
    length_sigma: float = 0.1
    heading_sigma: float = 0.1

    def __post_init__(self) -> None:
        if not self.radius > 0.0 or self.length_sigma < 0.0 or self.heading_sigma < 0.0:
            raise ConfigError("radius must be positive and both sigmas not negative", where="AdaptiveMotion")

    def propagate(self, noise: Noise, cloud: Cloud, event: Walked | None) -> Cloud:
        """Move every particle by the event, each with its own noise."""
        if event is None:
            u = noise.uniforms(cloud.n)
            length, heading = self.radius * np.sqrt(u[0]), 2.0 * np.pi * u[1]
        else:
            z = noise.normals(cloud.n).astype(np.float64)
            length = event.length + self.length_sigma * z[0]  # Eq. 4
            heading = event.heading + self.heading_sigma * z[1]  # Eq. 5
        x, y = cloud.x + length * np.cos(heading), cloud.y + length * np.sin(heading)
        return cloud._replace(x=x.astype(np.float32), y=y.astype(np.float32))


@dataclass(frozen=True, slots=True, kw_only=True)
class StandingDisc:
    """The disc alone, for the time in which no step was made. radius : m, however long the time is."""

    radius: float = 1.0

    def propagate(self, noise: Noise, cloud: Cloud, event: float) -> Cloud:  # noqa: ARG002
        """Every particle to a place of its disc; ``event`` is seconds."""
        return AdaptiveMotion(radius=self.radius).propagate(noise, cloud, None)
