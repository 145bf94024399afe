"""The particle cloud: float32 columns, one per component of the state."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayfuse.core.types import Array32

__all__ = ["Cloud"]


class Cloud(NamedTuple):
    """N particles. Nobody writes into a cloud they did not make.

    x, y : (N,) m, building frame. heading_bias : (N,) rad, added to the measured heading. step_scale : (N,),
    multiplies the measured step length. floor : (N,) index into the site's floors.
    """

    x: Array32
    y: Array32
    heading_bias: Array32
    step_scale: Array32
    floor: NDArray[np.int32]

    def take(self, ancestors: NDArray[np.integer]) -> Cloud:
        """The particles at some indices, copied."""
        return Cloud(*(column[ancestors] for column in self))

    @property
    def n(self) -> int:
        """Number of particles."""
        return int(self.x.shape[0])
