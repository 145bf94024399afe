r"""A way back for a cloud that is in a wrong place: at every scan some of its particles are drawn afresh.

chu2009 only ever moves its particles, so a cloud in a wrong room or on a wrong floor stays there. Here a share of the
particles is put on training places that are likely by the scan; where the cloud is right they soon die out, where it
is wrong they take over, for the weights of the scans that follow decide. The more the scan contradicts the cloud,

.. math:: g = \max_p \log p(z \mid p) - \log \sum_i w_i \, p(z \mid x_i),

the larger the share: from ``least`` at g = 0 to ``most`` as g grows past ``gap``. The idea is the sensor resetting of
Monte Carlo localisation.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wayfuse.core.errors import ConfigError
from wayfuse.core.philox import Noise
from wayfuse.core.types import Array
from wayfuse.filters.particle_filter import FilterState, replace_particles
from wayfuse.models.scan_start import LikelyPlaces
from wayfuse.radio.survey import Fingerprint

__all__ = ["Relocation"]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Relocation:
    """Parameters: first : draws fresh particles. least, most : shares of the particles per scan. gap : nats, g."""

    first: LikelyPlaces
    least: float = 0.01
    most: float = 0.1
    gap: float = 3.0

    def __post_init__(self) -> None:
        if not (0.0 <= self.least <= self.most <= 1.0 and self.gap > 0.0):
            raise ConfigError(
                f"0 <= least <= most <= 1 and a positive gap are needed, got {self.least}, {self.most}, {self.gap}",
                where="Relocation",
            )

    def share(self, state: FilterState, scan: Fingerprint, log_likelihood: Array) -> float:
        """Share of the particles to draw afresh for a scan; log_likelihood : (N,) of it at the particles."""
        at_places = self.first.radio_map.at_places(scan)
        if at_places is None:
            return 0.0
        top = float(log_likelihood.max())
        mean = top + float(np.log(state.weights @ np.exp(log_likelihood - top)))
        gap = max(float(at_places.max()) - mean, 0.0)
        return self.least + (self.most - self.least) * min((gap / self.gap) ** 2, 1.0)

    def renew(self, key: tuple[int, int], state: FilterState, scan: Fingerprint, share: float) -> FilterState:
        """The state with so many particles drawn afresh; to be called after resampling, when all weigh the same."""
        n = round(share * state.cloud.n)
        noise = Noise(key, state.draw)
        fresh = self.first.draw(noise, scan, n, heading_known=True) if n else None
        if fresh is None:
            return state
        start = float(noise.uniforms(1)[0, 0]) * state.cloud.n
        slots = np.floor(start + np.arange(n) * (state.cloud.n / n)).astype(np.int64) % state.cloud.n
        return replace_particles(state._replace(draw=noise.draw), slots, fresh)
