"""The particle cloud: columns, one per component of the state; float32 where they are quantities."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayfuse.core.types import Array32

__all__ = ["NO_CONNECTOR", "Cloud"]

NO_CONNECTOR = -1


class Cloud(NamedTuple):
    """N particles. Nobody writes into a cloud they did not make.

    x, y : (N,) m, frame of the particle's floor. heading_bias : (N,) rad, added to the measured heading. step_scale :
    (N,), multiplies the measured step length. floor : (N,) index into the site's floors; on a connector the floor it
    is nearest. connector : (N,) index into the site's connectors for those on stairs or in a lift, `NO_CONNECTOR` for
    those who walk a floor. base : (N,) m, elevation on the connector when its present movement began, or at which the
    particle rests on it; of no meaning on a floor.
    """

    x: Array32
    y: Array32
    heading_bias: Array32
    step_scale: Array32
    floor: NDArray[np.int32]
    connector: NDArray[np.int32]
    base: Array32

    @classmethod
    def on_floors(
        cls, x: Array32, y: Array32, heading_bias: Array32, step_scale: Array32, floor: NDArray[np.int32]
    ) -> Cloud:
        """Particles that all walk a floor."""
        nowhere = np.full_like(floor, NO_CONNECTOR)
        return cls(x, y, heading_bias, step_scale, floor, nowhere, np.zeros(len(floor), np.float32))

    def take(self, ancestors: NDArray[np.integer]) -> Cloud:
        """The particles at some indices, copied."""
        return Cloud(*(column[ancestors] for column in self))

    @property
    def n(self) -> int:
        """Number of particles."""
        return int(self.x.shape[0])
