"""FW-PF of li2015: a constant-velocity particle filter that fuses CSI ranges, with exponents 1/d, and a velocity.

Algorithm 1 of Li, Burbano, Zhao, Carrera, Braun, University of Bern, INF-15-004, 2015. The paper prints none of its
sigmas, nor w, N_s, the interval or the start: docs/papers/li2015.md says what each was chosen by.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wayfuse.core.philox import Noise
from wayfuse.core.types import Array
from wayfuse.filters._kernels import normalise
from wayfuse.filters.resampling import systematic
from wayfuse.models.motion.constant_velocity import ConstantVelocity, MovingCloud
from wayfuse.models.observation.ranges import Exponents, RangeLikelihood, VelocityLikelihood
from wayfuse.radio.range_correction import AS_MEASURED, RangeLine

__all__ = ["R_PF", "Config", "dead_reckon", "track"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Config:
    """FW-PF."""

    n_particles: int = 1000  # not printed; the result is flat from 500 on
    range_sigma: float = 2.0  # m, Eq. 10; not printed; about the error behind walls
    velocity_sigma: float | None = (
        1.8  # m/s, Eq. 7; not printed; fitted to row FW-PF (5 ANs); None: no velocity, R-PF
    )
    acceleration_sigma: float = 0.5  # m/s², w of Eq. 4; not printed; people turn at about this
    exponents: Exponents = Exponents.INVERSE_RANGE  # Eq. 12
    ess_ratio: float = 0.5  # Algorithm 1, step 9
    start_sigma: float = 0.5  # m; not printed; the start is known
    start_velocity_sigma: float = 0.5  # m/s; not printed; at rest, or walking
    # of the tracker of recordings alone (presets/li2015_tracker.py)
    step_sigma: float = (
        0.5  # m per axis, of a step: between sigma_v of 0.3 m/s and the fitted 1.8 over half a second
    )
    centroid_sigma: float = 3.0  # m, about the weighted centroid, where no start is told
    range_line: RangeLine = AS_MEASURED  # from ranges to distances: what Section 5.1 is to powers


R_PF = Config(velocity_sigma=None)  # Section 7.1: ranging only


def track(
    anchors: Array, ranges: Array, velocity: Array, start: tuple[float, float], dt: float | Array, noise: Noise,
    config: Config = Config(),
) -> Array:  # fmt: skip
    """Places (k, 2) m that Algorithm 1 gives, row by row.

    Parameters
    ----------
    anchors : (n, 2) m. ranges : (k, n) m, NaN where missing. velocity : (k, 2) m/s. start : m, place at row 0.
    dt : s between rows, or (k,) s from the row before each. noise : the random numbers.
    """
    motion = ConstantVelocity(config.acceleration_sigma)
    from_ranges = RangeLikelihood(anchors, config.range_sigma, config.exponents)
    from_velocity = VelocityLikelihood(config.velocity_sigma) if config.velocity_sigma is not None else None
    n = config.n_particles
    cloud = MovingCloud.around(noise, n, start, config.start_sigma, config.start_velocity_sigma)  # step 1
    log_weights, weights = np.zeros(n), np.full(n, 1.0 / n)
    intervals = np.broadcast_to(np.asarray(dt, dtype=np.float64), len(ranges))
    places = np.empty((len(ranges), 2))
    places[0] = cloud.mean(weights)[:2]
    for k in range(1, len(ranges)):
        cloud = motion.propagate(noise, cloud, float(intervals[k]))  # step 2
        from_ranges.log_likelihood(cloud, ranges[k], log_weights)  # steps 3, 4
        if from_velocity is not None:
            from_velocity.log_likelihood(cloud, velocity[k], log_weights)  # step 5
        top, _, effective = normalise(
            log_weights, weights
        )  # steps 6 to 8, with the weights of before (Eq. 2)
        log_weights -= top
        places[k] = cloud.mean(weights)[:2]  # step 11
        if effective < config.ess_ratio * n:  # steps 9, 10
            cloud = cloud.take(systematic(noise, weights, n))
            log_weights = np.zeros(n)
    return places


def dead_reckon(velocity: Array, start: tuple[float, float], dt: float) -> Array:
    """Places (k, 2) m by summing the velocity (k, 2) m/s from a start: PDR of Table 1."""
    return np.asarray(np.asarray(start) + dt * np.cumsum(np.vstack([np.zeros(2), velocity[1:]]), axis=0))
