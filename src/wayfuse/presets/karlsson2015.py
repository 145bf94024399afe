"""karlsson2015: both Wi-Fi bands by path loss, counted steps, gyroscope turns; the start and its heading unknown.

What it needs: places and powers of the access points, and the rectangle the walk is in. It estimates with the weighted
mean of the particles after each scan, and after each step between scans.

References
----------
.. [1] F. Karlsson, M. Karlsson, B. Bernhardsson, F. Tufvesson and M. Persson, Sensor fused indoor positioning using
   dual band WiFi signal measurements, European Control Conference 2015, 10.1109/ECC.2015.7330777.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from wayfuse.core.philox import Noise, track_key
from wayfuse.core.types import Array, IntArray
from wayfuse.filters.cloud import Cloud
from wayfuse.filters.particle_filter import FilterState, ParticleFilter
from wayfuse.models.motion.random_walk import RandomWalk
from wayfuse.models.motion.step_count import CountedSteps, StepCountMotion
from wayfuse.radio.path_loss import PathLoss, log_likelihood
from wayfuse.radio.path_loss_trilateration import gauss_newton_fix, linearised_fix, ranges

__all__ = ["Config", "RadioPlan", "dead_reckoning", "fused", "least_squares", "wifi_only"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Config:
    """Numbers of the paper, and those it leaves open, which were fitted to rows of its tables (F in docs/papers)."""

    bands: tuple[PathLoss, ...] = (
        # 2.4 GHz, 5 GHz; Eq. 1. sigma F: Table II, each band alone; power and alpha not printed
        PathLoss(power=-35.0, attenuation=0.15, sigma=3.5),
        PathLoss(power=-40.0, attenuation=0.25, sigma=4.5),
    )
    walk_sigma: float = 0.84  # m per root second and axis, section IV; F: Table III, PF Wi-Fi only
    step_length: float = 0.83  # m, l of Eq. 2; caption of Figure 2
    length_sigma: float = 0.1  # m, sigma_r of Eq. 2; not printed
    heading_sigma: float = 0.1  # rad, sigma_v of Eq. 2, per step; not printed
    n_particles: int = 2000  # not printed
    # of `karlsson2015_tracker` alone, for real buildings:
    most: float = 10.0  # readings that a scan may count for; the walks of the paper heard about as many
    offset_sigma: float = 6.0  # dB, between phones
    start_sigma: float = 1.0  # m, of a start that is told
    filter: ParticleFilter = field(
        default_factory=ParticleFilter
    )  # systematic, at half the effective sample size


@dataclass(frozen=True, slots=True)
class RadioPlan:
    """What is known beforehand: access points (m, 2) m, and the rectangle (low, high corner) of the first particles."""

    ap_xy: Array
    low: tuple[float, float]
    high: tuple[float, float]


def wifi_only(config: Config, plan: RadioPlan, scans: Array, interval: float, seed: int) -> Array:
    """PF, Wi-Fi only: a random walk between scans (n, b, m) dBm that come every ``interval`` s.

    Returns
    -------
    (n, 2) m, an estimate after each scan.
    """
    key = track_key(seed, "wifi only")
    motion, state = RandomWalk(config.walk_sigma), _first(config, plan, key)
    out = np.empty((len(scans), 2))
    for k, scan in enumerate(scans):
        if k:
            state, _ = config.filter.predict(key, state, motion, interval, None)
        state, out[k] = _weigh(config, plan, key, state, scan)
    return out


def fused(config: Config, plan: RadioPlan, scans: Array, due: IntArray, turn: Array, seed: int) -> Array:
    """PF, Wi-Fi and PDR (Eq. 2), an event per step.

    Parameters
    ----------
    scans : (n, b, m) dBm. due : (n,) steps made before each scan, ascending. turn : (k,) rad, measured change of
    heading from a step to the next.

    Returns
    -------
    (k + 1, 2) m, an estimate before the first step and after each.
    """
    key = track_key(seed, "fused")
    motion = StepCountMotion(
        step_length=config.step_length, length_sigma=config.length_sigma, heading_sigma=config.heading_sigma
    )
    state = _first(config, plan, key)
    heading = np.concatenate([[0.0], np.cumsum(turn)])
    out = np.empty((len(turn) + 1, 2))
    for k in range(len(out)):
        if k:
            state, _ = config.filter.predict(key, state, motion, CountedSteps(1, heading[k - 1]), None)
        out[k] = _mean(state)
        for scan in scans[due == k]:
            state, out[k] = _weigh(config, plan, key, state, scan)
    return out


def dead_reckoning(config: Config, start: Array, heading: float, turn: Array) -> Array:
    """PDR only: Eq. 2 without noise from a start (2,) m and heading (rad) that are told; (k + 1, 2) m."""
    theta = heading + np.concatenate([[0.0], np.cumsum(turn)[:-1]])
    legs = config.step_length * np.column_stack([np.cos(theta), np.sin(theta)])
    return np.concatenate([start[None], start + np.cumsum(legs, axis=0)])


def least_squares(config: Config, plan: RadioPlan, scans: Array, *, gauss_newton: bool = False) -> Array:
    """LS, Wi-Fi only: each scan (n, b, m) dBm by itself; (n, 2) m, the last fix kept where a scan gives none."""
    fix = np.mean([plan.low, plan.high], axis=0)
    out = np.empty((len(scans), 2))
    for k, scan in enumerate(scans):
        place, r, r_sigma = ranges(config.bands, plan.ap_xy, scan)
        found = linearised_fix(place, r)
        if found is not None:
            fix = gauss_newton_fix(place, r, r_sigma, found) if gauss_newton else found
        out[k] = fix
    return out


def _first(config: Config, plan: RadioPlan, key: tuple[int, int]) -> FilterState:
    """Places uniform over the rectangle, headings over the circle: "the initial states were treated as unknown"."""
    n = config.n_particles
    noise = Noise(key)
    u = noise.uniforms(n)
    xy = np.array(plan.low)[:, None] + np.subtract(plan.high, plan.low)[:, None] * u[:2]
    bias = (2.0 * u[2] - 1.0) * np.pi
    one, ground = np.ones(n, np.float32), np.zeros(n, np.int32)
    x, y, bias32 = (column.astype(np.float32) for column in (*xy, bias))
    return FilterState(Cloud.on_floors(x, y, bias32, one, ground), np.zeros(n), noise.draw)


def _weigh(
    config: Config, plan: RadioPlan, key: tuple[int, int], state: FilterState, scan: Array
) -> tuple[FilterState, Array]:
    """The state after a scan (b, m), and the weighted mean (2,) m before resampling."""
    xy = np.column_stack([state.cloud.x, state.cloud.y]).astype(np.float64)
    gain = log_likelihood(config.bands, plan.ap_xy, scan, xy)
    estimate = _mean(state._replace(log_weights=state.log_weights + gain))
    return config.filter.update(key, state, gain)[0], estimate


def _mean(state: FilterState) -> Array:
    w = state.weights
    return np.array([w @ state.cloud.x, w @ state.cloud.y])
