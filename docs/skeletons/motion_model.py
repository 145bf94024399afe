"""Skeleton of a motion model: a walked distance in an unknown direction (a step counter without a compass).

Copy this file to ``src/wayfuse/models/motion/<model>.py``, rename the class and its event, and replace the motion.
What the contract asks (``tests/docs/test_docs.py`` runs it on this file):

* the cloud that comes in stays as it is; a new one goes out, float32, of the same size;
* all randomness comes from ``noise``, and how often it is drawn from does not depend on the particles: a replay
  from a checkpoint then gives the same bits;
* floors change only in a model that is about floors; walls are no business of a motion model (a `Constraint` undoes
  the moves that the building forbids);
* parameters are checked when the model is made, with a `ConfigError` that names the field.

Loops over particles that NumPy does not express go into ``wayfuse/models/_kernels.py`` with a plain twin in the test.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wayfuse.core.errors import ConfigError
from wayfuse.core.philox import Noise
from wayfuse.filters.cloud import Cloud

__all__ = ["UndirectedWalk"]


@dataclass(frozen=True, slots=True, kw_only=True)
class UndirectedWalk:
    """Every particle walks the distance in a direction of its own; the event is the distance (m).

    length_sigma : relative noise of the distance.
    """

    length_sigma: float = 0.1

    def __post_init__(self) -> None:
        if not self.length_sigma >= 0.0:
            raise ConfigError(
                f"length_sigma must not be negative, got {self.length_sigma}", where="UndirectedWalk"
            )

    def propagate(self, noise: Noise, cloud: Cloud, event: float) -> Cloud:
        """Walk ``event`` metres; ``step_scale`` multiplies them, as it does measured steps."""
        direction = np.float32(2.0 * np.pi) * noise.uniforms(cloud.n)[0].astype(np.float32)
        error = np.float32(1.0) + np.float32(self.length_sigma) * noise.normals(cloud.n)[0]
        distance = np.float32(event) * cloud.step_scale * error
        return cloud._replace(
            x=cloud.x + distance * np.cos(direction), y=cloud.y + distance * np.sin(direction)
        )
