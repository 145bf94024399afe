r"""Constant velocity for a `Cloud`: Eq. 3-4 of li2015 [1]_ with the velocity kept as course and speed.

The state [x, y, v_x, v_y] of the paper in the columns of a cloud: ``heading_bias`` holds the course (rad, building
frame) and ``step_scale`` the speed (m/s) of each particle. `CourseAndSpeed` moves and turns them as
`models.motion.constant_velocity` does.

`StepsOrVelocity` is for steps: a step says how far its owner went in its time, so it moves every particle itself, and
what is left of the velocity is that which steps do not tell: none. Without steps (a trolley, a phone in which none is
seen) the velocity is learnt from the observations alone.

References
----------
.. [1] Li, Burbano, Zhao, Carrera, Braun, Fine-grained Indoor Tracking by Fusing Inertial Sensor and Physical Layer
   Information in WLANs, University of Bern, INF-15-004, 2015.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from wayfuse.core.errors import ConfigError
from wayfuse.core.philox import Noise
from wayfuse.filters.cloud import Cloud
from wayfuse.models.motion.constant_velocity import ConstantVelocity, MovingCloud
from wayfuse.models.motion.pdr import StepInput

__all__ = ["CourseAndSpeed", "Held", "StepsOrVelocity"]


@dataclass(frozen=True, slots=True, kw_only=True)
class CourseAndSpeed:
    """Constant velocity with random acceleration; the event is the time (s) since the last move.

    Parameters
    ----------
    acceleration_sigma : m/s², w of Eq. 4. longest : s; of a longer silence only so much is moved, for w over the
    whole of it would spread particles without end.
    """

    acceleration_sigma: float
    longest: float = 5.0

    def __post_init__(self) -> None:
        if not (self.acceleration_sigma >= 0.0 and self.longest > 0.0):
            raise ConfigError(
                f"acceleration_sigma must not be negative, longest positive, got {self}",
                where="CourseAndSpeed",
            )

    def propagate(self, noise: Noise, cloud: Cloud, event: float) -> Cloud:
        """Move on for ``event`` seconds (Eq. 4)."""
        x, y, course, speed = (
            column.astype(np.float64) for column in (cloud.x, cloud.y, cloud.heading_bias, cloud.step_scale)
        )
        vx, vy = speed * np.cos(course), speed * np.sin(course)
        dt = min(max(event, 0.0), self.longest)
        moved = ConstantVelocity(self.acceleration_sigma).propagate(noise, MovingCloud(x, y, vx, vy), dt)
        return cloud._replace(
            x=moved.x.astype(np.float32),
            y=moved.y.astype(np.float32),
            heading_bias=np.arctan2(moved.vy, moved.vx).astype(np.float32),
            step_scale=np.hypot(moved.vx, moved.vy).astype(np.float32),
        )


@dataclass(frozen=True, slots=True)
class StepsOrVelocity:
    """A step moves every particle by its length and heading, and takes the rest of its velocity away.

    Parameters
    ----------
    sigma : m per axis, of a step.
    """

    sigma: float

    def __post_init__(self) -> None:
        if not self.sigma >= 0.0:
            raise ConfigError(f"sigma must not be negative, got {self.sigma}", where="StepsOrVelocity")

    def propagate(self, noise: Noise, cloud: Cloud, event: StepInput) -> Cloud:
        """Move by a step."""
        z = np.float32(self.sigma) * noise.normals(cloud.n)[:2]
        return cloud._replace(
            x=cloud.x + np.float32(event.length * math.cos(event.heading)) + z[0],
            y=cloud.y + np.float32(event.length * math.sin(event.heading)) + z[1],
            step_scale=np.zeros_like(cloud.step_scale),
        )


@dataclass(frozen=True, slots=True)
class Held:
    """No motion: for engines whose motion over time is applied when something is seen."""

    def propagate(self, noise: Noise, cloud: Cloud, event: float) -> Cloud:  # noqa: ARG002
        """The cloud as it is."""
        return cloud
