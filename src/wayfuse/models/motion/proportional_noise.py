r"""Counted steps and turns with noise in proportion to them: Eq. 5 to 7 of liu2017.

.. math::
   x' = x + s\,c\cos\theta\,(1 + n_x), \quad y' = y + s\,c\sin\theta\,(1 + n_y), \quad
   \theta' = \theta + \Delta\alpha\,(1 + n_\theta)

c steps of length s since the report before, :math:`\Delta\alpha` the turn meanwhile; n_x and n_y of deviation sigma_d,
one for each axis, n_theta of sigma_theta. A particle moves with the heading it had before the turn, and on a straight
way nothing changes a heading.

References
----------
.. [1] R. Liu, C. Yuen, T.-N. Do, Y. Jiang, X. Liu, U-X. Tan, Indoor positioning using similarity-based sequence and
   dead reckoning without training, 2017.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from wayfuse.core.errors import ConfigError
from wayfuse.core.philox import Noise
from wayfuse.filters.cloud import Cloud
from wayfuse.models.motion.pdr import StepInput

__all__ = ["Poses", "ProportionalNoise", "Report"]

F = TypeVar("F", bound=np.floating)


class Report(NamedTuple):
    """What a phone reports: steps and turn (rad) since the report before."""

    n_steps: float
    turn: float


class Poses(NamedTuple):
    """Places x, y (N,) m and headings (N,) rad."""

    x: NDArray[np.floating]
    y: NDArray[np.floating]
    heading: NDArray[np.floating]


@dataclass(frozen=True, slots=True, kw_only=True)
class ProportionalNoise:
    """step_length : s, m. distance_sigma : sigma_d of a distance. turn_sigma : sigma_theta of a turn."""

    step_length: float
    distance_sigma: float
    turn_sigma: float

    def __post_init__(self) -> None:
        if not (self.step_length > 0.0 and self.distance_sigma >= 0.0 and self.turn_sigma >= 0.0):
            raise ConfigError(
                f"lengths and sigmas must not be negative, got {self}", where="ProportionalNoise"
            )

    def move(self, noise: Noise, before: Poses, report: Report) -> Poses:
        """Eq. 5 to 7, in the precision of the poses."""
        drawn = noise.normals(len(before.x))
        reach = self.step_length * report.n_steps
        return Poses(
            before.x + reach * np.cos(before.heading) * (1.0 + self.distance_sigma * drawn[0]),  # Eq. 5
            before.y + reach * np.sin(before.heading) * (1.0 + self.distance_sigma * drawn[1]),  # Eq. 6
            before.heading + report.turn * (1.0 + self.turn_sigma * drawn[2]),  # Eq. 7
        )

    def propagate(self, noise: Noise, cloud: Cloud, event: StepInput) -> Cloud:
        """One step of a tracker, its heading measured: Eq. 5 and 6, the length that of the model.

        A step tells its heading and no turn, so the noise of Eq. 7 is that of a turn of 1 rad at every step.
        """
        heading = cloud.heading_bias + np.float32(event.heading)
        moved = self.move(noise, Poses(cloud.x, cloud.y, heading), Report(1.0, 1.0))
        drift = moved.heading - heading - np.float32(1.0)
        return cloud._replace(x=moved.x, y=moved.y, heading_bias=cloud.heading_bias + drift)
