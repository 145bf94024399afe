r"""How likely a scan is at a particle: a mixture of kernels at the nearest fingerprints of the survey.

.. math:: \log p(z \mid x) = \gamma \log\Big(\sum_j w_j \exp\frac{-|x - p_j|^2}{2 \sigma^2} + \epsilon\Big)

over the neighbours j on the particle's floor. The kernel widens with the signal distance of the best neighbour: a
query unlike any fingerprint was made away from the survey. For the same reason particles away from the survey then
get a bonus (`coverage_gain`). The exponent tempers the product over scans, whose errors are not independent.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wayfuse.core.errors import ConfigError
from wayfuse.core.philox import Noise
from wayfuse.core.types import Array, Array32
from wayfuse.filters.cloud import Cloud
from wayfuse.models._kernels import mixture_log_likelihood
from wayfuse.models.observation.coverage import SurveyDistance
from wayfuse.models.observation.neighbouring import NeighbouringFloors
from wayfuse.radio.sparse_knn import Neighbours

__all__ = ["FingerprintLikelihood"]


@dataclass(frozen=True, slots=True, kw_only=True)
class FingerprintLikelihood:
    """Parameters of the mixture (signal distances are those of `radio.sparse_knn`, 0 to 1).

    sigma : m, kernel width at a signal distance up to ``near``; it grows by ``sigma_slope`` m per unit beyond, up to
    ``sigma_most``. background : epsilon. exponent : gamma. coverage : distance to the survey, None = no coverage term.
    coverage_gain : nats for particles farther than ``coverage_reach`` m from the survey, reached when the signal
    distance has grown from ``coverage_from`` by ``coverage_width``. neighbouring : lends fingerprints to floors
    without a survey, None = nobody is found there.
    """

    sigma: float = 4.0
    sigma_slope: float = 15.0
    sigma_most: float = 20.0
    near: float = 0.2
    background: float = 0.05
    exponent: float = 0.9
    coverage: SurveyDistance | None = None
    coverage_gain: float = 1.0
    coverage_from: float = 0.25
    coverage_width: float = 0.25
    coverage_reach: float = 5.0
    neighbouring: NeighbouringFloors | None = None

    def __post_init__(self) -> None:
        for name in ("sigma", "sigma_most", "background", "exponent", "coverage_width"):
            if not getattr(self, name) > 0.0:
                raise ConfigError(
                    f"{name} must be positive, got {getattr(self, name)}", where="FingerprintLikelihood"
                )

    def kernel_width(self, distance: float) -> float:
        """Width (m) of the kernels for a signal distance of the best neighbour."""
        return min(self.sigma + self.sigma_slope * max(distance - self.near, 0.0), self.sigma_most)

    def log_likelihood(self, cloud: Cloud, observation: Neighbours, out: Array) -> None:
        """Add the log-likelihood of the neighbours found for a scan."""
        self._mixture(cloud.x, cloud.y, cloud.floor, observation, out)
        novelty = (observation.distance - self.coverage_from) / self.coverage_width
        if self.coverage is not None and novelty > 0.0:
            away = self.coverage.at(cloud.x, cloud.y, cloud.floor) > self.coverage_reach
            out += self.coverage_gain * min(novelty, 1.0) * away

    def agreement(self, weights: Array, log_likelihood: Array, observation: Neighbours) -> float:
        """Mean likelihood over the cloud as a share of that over the neighbours themselves.

        About 1 where the cloud is where the scan says, near 0 where the two contradict each other.
        """
        own = np.zeros(len(observation.x))
        self._mixture(observation.x, observation.y, observation.floor, observation, own)
        reference = float(observation.weight @ np.exp(own / self.exponent))
        mean = float(weights @ np.exp(np.minimum(log_likelihood / self.exponent, 0.0)))
        return max(mean - self.background, 0.0) / max(reference - self.background, 1e-9)

    def draw_places(
        self, noise: Noise, observation: Neighbours, n: int
    ) -> tuple[Array32, Array32, NDArray[np.int32]]:
        """Places x, y (n,) m and floor (n,) drawn from the mixture."""
        width = self.kernel_width(observation.distance)
        u = noise.uniforms(n)[0]
        total = np.cumsum(observation.weight, dtype=np.float64)
        j = np.minimum(np.searchsorted(total, u * total[-1]), len(total) - 1)
        z = noise.normals(n)
        x = (observation.x[j] + np.float32(width) * z[0]).astype(np.float32)
        y = (observation.y[j] + np.float32(width) * z[1]).astype(np.float32)
        return x, y, observation.floor[j].astype(np.int32)

    def _mixture(
        self, x: Array32, y: Array32, floor: NDArray[np.int32], near: Neighbours, out: Array
    ) -> None:
        if self.neighbouring is not None:
            near = self.neighbouring.lend(near)
        mixture_log_likelihood(
            x,
            y,
            floor,
            near.x,
            near.y,
            near.floor,
            near.weight,
            self.kernel_width(near.distance),
            self.background,
            self.exponent,
            out,
        )
