r"""Displacement and a disc of disturbance: chu2009 Eq. 3.3, :math:`P(t_b) = P(t_a) + d + r (\cos\theta, \sin\theta)`.

r is uniform in [0, r_max] (so places are denser in the middle of the disc), the angle uniform. Without a displacement
this is the motion of a particle filter that knows nothing of the walker.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from wayfuse.core.errors import ConfigError
from wayfuse.core.philox import Noise
from wayfuse.filters.cloud import Cloud
from wayfuse.models.motion.pdr import StepInput

__all__ = ["DisplacedDisc", "StepDisc"]


@dataclass(frozen=True, slots=True, kw_only=True)
class DisplacedDisc:
    """Parameters: r_max (m). extent : m, side of the square field particles stay in ("the point when it first moves
    out" of the paper, here its projection); infinite = no field."""

    r_max: float = 3.0
    extent: float = float("inf")

    def __post_init__(self) -> None:
        if not (self.r_max > 0.0 and self.extent > 0.0):
            raise ConfigError(
                f"r_max and extent must be positive, got {self.r_max}, {self.extent}", where="DisplacedDisc"
            )

    def propagate(self, noise: Noise, cloud: Cloud, event: tuple[float, float]) -> Cloud:
        """Every particle moved by the displacement (m) and its own disturbance."""
        u = noise.uniforms(cloud.n)
        r, theta = self.r_max * u[0], 2.0 * np.pi * u[1]
        x = np.clip(
            cloud.x + event[0] + r * np.cos(theta), 0.0 if np.isfinite(self.extent) else -np.inf, self.extent
        )
        y = np.clip(
            cloud.y + event[1] + r * np.sin(theta), 0.0 if np.isfinite(self.extent) else -np.inf, self.extent
        )
        return cloud._replace(x=x.astype(np.float32), y=y.astype(np.float32))


@dataclass(frozen=True, slots=True, kw_only=True)
class StepDisc:
    """The same for steps, each a displacement of its own. r_max : m."""

    r_max: float = 3.0

    def __post_init__(self) -> None:
        if not self.r_max > 0.0:
            raise ConfigError(f"r_max must be positive, got {self.r_max}", where="StepDisc")

    def propagate(self, noise: Noise, cloud: Cloud, event: StepInput) -> Cloud:
        """Every particle moved by the step and its own disturbance."""
        moved = (event.length * math.cos(event.heading), event.length * math.sin(event.heading))
        return DisplacedDisc(r_max=self.r_max).propagate(noise, cloud, moved)
