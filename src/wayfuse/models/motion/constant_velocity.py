r"""Constant velocity with random acceleration, Eq. 3-4 of li2015 [1]_.

.. math:: x_k = F x_{k-1} + \eta w, \quad x = [x, y, v_x, v_y]^T \quad (3, 4)

with a 2-vector w, independent in time, the same acceleration for place and velocity. For targets whose steps are not
known; where they are, moving particles by the steps (`models.motion.pdr`) follows turns at once.

References
----------
.. [1] Li, Burbano, Zhao, Carrera, Braun, Fine-grained Indoor Tracking by Fusing Inertial Sensor and Physical Layer
   Information in WLANs, University of Bern, INF-15-004, 2015.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayfuse.core.errors import ConfigError
from wayfuse.core.philox import Noise
from wayfuse.core.types import Array

__all__ = ["ConstantVelocity", "MovingCloud"]


class MovingCloud(NamedTuple):
    """N particles with a velocity (Eq. 3): x, y (N,) m, vx, vy (N,) m/s, building frame."""

    x: Array
    y: Array
    vx: Array
    vy: Array

    @classmethod
    def around(
        cls, noise: Noise, n: int, start: tuple[float, float], place_sigma: float, velocity_sigma: float
    ) -> MovingCloud:
        """Normal about a start (m) with sigma (m), and about rest with sigma (m/s), per axis."""
        z = noise.normals(n).astype(np.float64)
        return cls(
            start[0] + place_sigma * z[0],
            start[1] + place_sigma * z[1],
            velocity_sigma * z[2],
            velocity_sigma * z[3],
        )

    @property
    def n(self) -> int:
        """Number of particles."""
        return len(self.x)

    def take(self, ancestors: NDArray[np.integer]) -> MovingCloud:
        """The particles at some indices, copied."""
        return MovingCloud(*(column[ancestors] for column in self))

    def mean(self, weights: Array) -> tuple[float, float, float, float]:
        """Weighted mean state (step 11 of Algorithm 1) with weights (N,) that sum to 1: x, y (m), vx, vy (m/s)."""
        x, y, vx, vy = (float(column @ weights) for column in self)
        return x, y, vx, vy


@dataclass(frozen=True, slots=True)
class ConstantVelocity:
    """Motion model of Eq. 4; the event is the interval since the last prediction (s).

    Parameters
    ----------
    acceleration_sigma : m/s², standard deviation of each component of w.
    """

    acceleration_sigma: float

    def __post_init__(self) -> None:
        if not self.acceleration_sigma >= 0.0:
            raise ConfigError(f"acceleration_sigma must not be negative, got {self.acceleration_sigma}")

    def propagate(self, noise: Noise, cloud: MovingCloud, event: float) -> MovingCloud:
        """A new cloud, each particle moved on for ``event`` seconds with its own acceleration."""
        wx, wy = self.acceleration_sigma * noise.normals(cloud.n)[:2].astype(np.float64)
        half = 0.5 * event * event  # Eq. 4: Delta T^2 / 2
        return MovingCloud(
            cloud.x + event * cloud.vx + half * wx,
            cloud.y + event * cloud.vy + half * wy,
            cloud.vx + event * wx,
            cloud.vy + event * wy,
        )
