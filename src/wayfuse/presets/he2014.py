"""``he2014``: Gaussian-process radio map, k-NN start and an adaptive motion model in a particle filter.

The composition of Figure 1 and Section II on one screen; the parts are in `radio.gp_field`, `models.motion.adaptive`,
`inertial.stage_transition` and `filters.particle_filter`.

References
----------
.. [1] X. He, J. Li, D. Aloi, WiFi based indoor localization with adaptive motion model using smartphone motion
   sensors, ICCVE 2014.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from wayfuse.core.angles import wrap
from wayfuse.core.errors import ConfigError
from wayfuse.core.philox import Noise
from wayfuse.core.types import Array
from wayfuse.filters.cloud import Cloud
from wayfuse.filters.particle_filter import FilterState, ParticleFilter
from wayfuse.models.motion.adaptive import AdaptiveMotion, Walked
from wayfuse.radio.gp_field import GpField

__all__ = ["Config", "headings", "nearest_start", "track"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Config:
    """Parameters of ``he2014``; those the paper does not print are marked."""

    n_particles: int = 1000  # not printed
    k: int = 3  # neighbours of the start, Sec. II; number not printed
    radius: float = 1.0  # m, disc of a standing user, Sec. II-B
    length_sigma: float = 0.1  # m per epoch, Eq. 4; not printed
    heading_sigma: float = 0.1  # rad, Eq. 5; not printed
    least_noise: float = 1.0  # dB, of the Gaussian process; not printed, docs/papers/he2014.md

    def __post_init__(self) -> None:
        if self.n_particles < 1 or self.k < 1 or not self.least_noise > 0.0:
            raise ConfigError(
                "n_particles and k must be 1 or more, least_noise above 0 dB", where="he2014.Config"
            )


def nearest_start(config: Config, places: Array, fingerprints: Array, z: Array) -> Array:
    """Start (2,) m: the mean of the k surveyed places (n, 2) whose fingerprints (n, a) are nearest to z (a,) dBm."""
    distance = ((fingerprints - z) ** 2).sum(axis=1)
    return np.asarray(places[np.argsort(distance, kind="stable")[: config.k]].mean(axis=0))


def headings(compass: float, yaw: Array) -> Array:
    """Headings (T,) rad: the compass' at the start (rad, CCW from building +x), then changed as the gyro's yaw (T,) is.

    Sec. II-A (3): the compass is easily disturbed indoors and only gives the first heading.
    """
    return np.asarray(wrap(compass + yaw - yaw[0]))


def track(
    config: Config,
    field: GpField,
    readings: Array,
    start: Array,
    moves: Sequence[Walked | None],
    noise: Noise,
) -> Array:
    """Estimates (T + 1, 2) m of a walk, the start first.

    Parameters
    ----------
    readings : (T + 1, a) dBm; the first belongs to the start and weighs nothing any more.
    start : (2,) m, where all particles begin. moves : one per epoch; None: standing, or no motion model.
    noise : random numbers of this run.
    """
    motion = AdaptiveMotion(
        radius=config.radius, length_sigma=config.length_sigma, heading_sigma=config.heading_sigma
    )
    n, particle_filter = config.n_particles, ParticleFilter()
    x, y = (np.full(n, c, np.float32) for c in start)
    cloud = Cloud.on_floors(x, y, np.zeros(n, np.float32), np.ones(n, np.float32), np.zeros(n, np.int32))
    state = FilterState(cloud, np.zeros(n), noise.draw)
    estimates = [np.asarray(start, np.float64)]
    for z, move in zip(readings[1:], moves, strict=True):
        state, _ = particle_filter.predict(noise.key, state, motion, move, None)
        xy = np.column_stack([state.cloud.x, state.cloud.y])
        weighed = field.log_likelihood(z, xy)  # Eq. 3
        state, _ = particle_filter.update(noise.key, state, weighed, always_resample=True)
        # "the mean of all the resampled particles' location", Sec. II-B
        estimates.append(np.array([state.cloud.x.mean(dtype=float), state.cloud.y.mean(dtype=float)]))
    return np.array(estimates)
