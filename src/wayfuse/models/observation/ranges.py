r"""Ranges to anchors with exponents 1/d, and a measured velocity: Eq. 7-12 of li2015 [1]_.

.. math:: p(d \mid x) = \prod_j \mathcal{N}(d_j; |x - x_j|, \sigma^2)^{m_j}, \quad m_j = (1/d_j) / \sum_n 1/d_n
   \quad (10-12)

The exponents lower the say of far anchors, whose errors tend to be greater. They sum to 1, so N ranges weigh as one:
the cloud is wider than its errors are, and where errors do not grow with range (as by time of flight) the exponents
only throw information away. ``Exponents.EQUAL`` (1/N) has the same sum and no preference, ``Exponents.ONE`` is Eq. 8.

Departures from the paper: sigma, called a variance there, is a standard deviation; the factor of Eq. 7 must be
1/(2 pi sigma_v²), a constant that cancels.

References
----------
.. [1] Li, Burbano, Zhao, Carrera, Braun, Fine-grained Indoor Tracking by Fusing Inertial Sensor and Physical Layer
   Information in WLANs, University of Bern, INF-15-004, 2015.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import Enum

import numpy as np

from wayfuse.core.errors import ConfigError
from wayfuse.core.types import Array
from wayfuse.models.motion.constant_velocity import MovingCloud

__all__ = ["Exponents", "RangeLikelihood", "VelocityLikelihood", "range_exponents"]

_NEAREST = 0.1  # m; a range estimate may come out as zero or less, which has no inverse


class Exponents(Enum):
    """How the likelihoods of N anchors are weighed against each other."""

    INVERSE_RANGE = "1/d"
    EQUAL = "1/N"
    ONE = "1"


def range_exponents(distances: Array, kind: Exponents = Exponents.INVERSE_RANGE) -> Array:
    """Exponents m_j (n,) of ranges (n,) m, Eq. 12; an anchor without a range (NaN) has 0, the others sum to 1.

    >>> range_exponents(np.array([1.0, 3.0])).tolist()
    [0.75, 0.25]
    """
    heard = np.isfinite(distances)
    if kind is Exponents.INVERSE_RANGE:
        m = np.where(heard, 1.0 / np.maximum(np.where(heard, distances, 1.0), _NEAREST), 0.0)  # Eq. 12
    else:
        m = heard.astype(np.float64)
    total = float(m.sum())
    return m if kind is Exponents.ONE or total == 0.0 else m / total


@dataclass(frozen=True, slots=True, eq=False)
class RangeLikelihood:
    """Likelihood of the ranges of one moment.

    Parameters
    ----------
    anchors : (n, 2) m, building frame. sigma : m, standard deviation of a range (Eq. 10). exponents : Eq. 12, or none.
    """

    anchors: Array
    sigma: float
    exponents: Exponents = field(default=Exponents.INVERSE_RANGE)

    def __post_init__(self) -> None:
        if self.anchors.ndim != 2 or self.anchors.shape[1] != 2:
            raise ConfigError(f"anchors must be (n, 2), got {self.anchors.shape}", where="RangeLikelihood")
        if not self.sigma > 0.0:
            raise ConfigError(f"sigma must be positive, got {self.sigma}", where="RangeLikelihood")

    def log_likelihood(self, cloud: MovingCloud, observation: Array, out: Array) -> None:
        """Add log p(d | x) up to a constant to ``out`` (N,); ranges (n,) m, NaN where an anchor heard nothing."""
        if observation.shape != (len(self.anchors),):
            raise ConfigError(
                f"{len(self.anchors)} anchors, ranges of shape {observation.shape}", where="RangeLikelihood"
            )
        m = range_exponents(observation, self.exponents)
        heard = m > 0.0
        ax, ay = self.anchors[heard, :1], self.anchors[heard, 1:]
        residual = observation[heard, None] - np.sqrt((cloud.x - ax) ** 2 + (cloud.y - ay) ** 2)  # Eq. 9
        out -= (m[heard] @ (residual * residual)) / (2.0 * self.sigma**2)  # Eq. 10, 11


@dataclass(frozen=True, slots=True)
class VelocityLikelihood:
    """Likelihood of a measured velocity, Eq. 7.

    Parameters
    ----------
    sigma : m/s, standard deviation of each component.
    """

    sigma: float

    def __post_init__(self) -> None:
        if not self.sigma > 0.0:
            raise ConfigError(f"sigma must be positive, got {self.sigma}", where="VelocityLikelihood")

    def log_likelihood(self, cloud: MovingCloud, observation: Array, out: Array) -> None:
        """Add log p(v | x) up to a constant to ``out`` (N,); velocity (2,) m/s, building frame."""
        vx, vy = observation
        out -= ((vx - cloud.vx) ** 2 + (vy - cloud.vy) ** 2) / (2.0 * self.sigma**2)
