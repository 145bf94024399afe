"""``chu2009``: the systems of the thesis' chapter 4 on one screen: NNSS, PF_MCL and PFMM.

Chu, Wireless location tracking by a sensor-enhanced particle filter in 2.5D buildings, National Chiao Tung University,
2009. The vertical part of its chapter 3 is in `fused` (`models.motion.connectors`).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from wayfuse.core.philox import Noise, track_key
from wayfuse.core.types import Array
from wayfuse.filters.cloud import Cloud
from wayfuse.filters.particle_filter import FilterState, ParticleFilter
from wayfuse.filters.widening import WideningFilter, scaling
from wayfuse.maps.walls import WallIndex
from wayfuse.models.constraint.barriers import Barriers
from wayfuse.models.motion.displaced_disc import DisplacedDisc
from wayfuse.radio.level_grid import LevelGrid

__all__ = ["Config", "nnss", "pf_mcl", "pfmm"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Config:
    """Parameters of PF_MCL and PFMM; where the thesis gives none, those that reproduce it."""

    n_particles: int = 500  # Section 4.1
    r_max: float = 3.0  # m, Eq. 3.3; not given
    kernel_sigma: float = 3.0  # dB, Eq. 3.7; not given: the noise of the scans, at least 1
    estimate: Literal["mean", "best"] = "mean"  # Section 3.3 says "the particle with maximum weight"
    wall_penalty: float = 30.0  # nats: a particle that passes a wall is filtered (Section 3.3.2)
    rounds: int = 6  # of widening where all are filtered; the thesis widens without end


def nnss(grid: LevelGrid, levels: Array) -> Array:
    """Nearest neighbour in signal space, scan by scan: places (t, 2) m."""
    return np.array([grid.nearest(scan) for scan in levels])


def pf_mcl(grid: LevelGrid, levels: Array, config: Config, seed: int) -> Array:
    """Monte Carlo localisation without any information on the walker: places (t, 2) m."""
    return _track(grid, levels, np.zeros((len(levels), 2)), None, config, track_key(seed, "pf_mcl"))


def pfmm(grid: LevelGrid, levels: Array, moved: Array, walls: WallIndex, config: Config, seed: int) -> Array:
    """The thesis' filter: displacements moved (t, 2) m from the phone's sensors, walls that filter: places (t, 2) m."""
    return _track(grid, levels, moved, walls, config, track_key(seed, "pfmm"))


def _track(
    grid: LevelGrid, levels: Array, moved: Array, walls: WallIndex | None, c: Config, key: tuple[int, int]
) -> Array:
    side = (grid.levels.shape[1] - 1) * grid.grain
    motion = DisplacedDisc(r_max=c.r_max, extent=side)
    constraint = None if walls is None else Barriers((walls,), c.wall_penalty)
    # resampled in every round (Section 3.5)
    filter_ = WideningFilter(wider=scaling("r_max"), rounds=c.rounds, filter=ParticleFilter(ess_ratio=1.0))
    noise = Noise(key)
    u = (side * noise.uniforms(c.n_particles)).astype(np.float32)
    zero = np.zeros(c.n_particles, np.float32)
    cloud = Cloud.on_floors(u[0], u[1], zero, zero + 1, np.zeros(c.n_particles, np.int32))
    state = FilterState(cloud, np.zeros(c.n_particles), noise.draw)
    out = np.empty((len(levels), 2))
    for t, scan in enumerate(levels):
        if t:
            state, _ = filter_.predict(
                key, state, motion, (float(moved[t, 0]), float(moved[t, 1])), constraint
            )
        log_likelihood = grid.log_likelihood(scan, state.cloud.x, state.cloud.y, c.kernel_sigma)
        weighed = state._replace(log_weights=state.log_weights + log_likelihood)
        w = weighed.weights
        if c.estimate == "best":
            k = int(np.argmax(w))
            out[t] = weighed.cloud.x[k], weighed.cloud.y[k]
        else:
            out[t] = w @ weighed.cloud.x, w @ weighed.cloud.y
        state, _ = filter_.update(key, weighed, np.zeros(c.n_particles), always_resample=True)
    return out
