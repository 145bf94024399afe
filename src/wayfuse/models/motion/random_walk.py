"""Motion without motion sensors: a random walk in the plane."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from wayfuse.core.errors import ConfigError
from wayfuse.core.philox import Noise
from wayfuse.filters.cloud import Cloud

__all__ = ["RandomWalk"]


@dataclass(frozen=True, slots=True)
class RandomWalk:
    """Independent displacement of ``sigma`` * sqrt(dt) per axis; the event is dt (s).

    sigma : m per root second and axis.
    """

    sigma: float

    def __post_init__(self) -> None:
        if not self.sigma > 0.0:
            raise ConfigError(f"sigma must be positive, got {self.sigma}", where="RandomWalk")

    def propagate(self, noise: Noise, cloud: Cloud, event: float) -> Cloud:
        """Diffuse for ``event`` seconds."""
        z = noise.normals(cloud.n)
        spread = np.float32(self.sigma * math.sqrt(max(event, 0.0)))
        return cloud._replace(x=cloud.x + spread * z[0], y=cloud.y + spread * z[1])
