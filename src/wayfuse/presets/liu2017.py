r"""liu2017: sequences of access points and dead reckoning in a particle filter, without a survey.

A particle is a place and a heading. Dead reckoning moves it (Eq. 5-7), a scan weighs it by the k cells whose order of
access points is most like the order of the strengths (Eq. 2-4, `radio.ap_sequence`), and it is resampled after every
scan. Against it stand dead reckoning alone, Wi-Fi alone on a random walk, and surveyed fingerprints compared by the
cosine in the same filter.

References
----------
.. [1] R. Liu, C. Yuen, T.-N. Do, Y. Jiang, X. Liu, U-X. Tan, Indoor positioning using similarity-based sequence and
   dead reckoning without training, 2017.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple, TypeAlias

import numpy as np

from wayfuse.core.angles import wrap
from wayfuse.core.philox import Noise
from wayfuse.core.types import Array
from wayfuse.filters.resampling import systematic
from wayfuse.models.motion.proportional_noise import Poses, ProportionalNoise, Report
from wayfuse.radio.ap_sequence import Neighbours, from_positions, kernel_log_likelihood, nearest
from wayfuse.radio.knn import distances
from wayfuse.radio.representation import Representation

__all__ = [
    "Config",
    "Motion",
    "Pose",
    "dead_reckoning",
    "fingerprint_neighbours",
    "fused",
    "sequence_neighbours",
    "wifi_alone",
]


@dataclass(frozen=True, slots=True, kw_only=True)
class Config:
    """The numbers of the paper, and those it leaves out."""

    n_particles: int = 1000  # N, Sec. IV-B
    step_length: float = 0.7  # m, s of Eq. 5-6, Sec. IV-D
    distance_sigma: float = 0.4  # sigma_d of Eq. 5-6, Sec. IV-B
    turn_sigma: float = 0.01  # sigma_theta of Eq. 7, Sec. IV-B
    cell: float = 2.0  # m, grid size, Sec. IV-B
    k: int = 4  # Sec. IV-B
    bandwidth: float = 0.01  # lambda of Eq. 3, Sec. IV-B
    bandwidth_divides: bool = False  # True: Eq. 3 as printed, a kernel of 0.1 m instead of 10 m
    walk_sigma: float = 1.75  # m per axis and scan, Wi-Fi alone; not in the paper
    scan_every: int = 1  # of the scans, one in so many is used; Fig. 7 has 1, 2, 4, 8
    missing: float = -100.0  # dBm that is the zero of the cosine; not in the paper
    # of `liu2017_tracker` alone, for real buildings:
    most: int = 20  # loudest access points of a floor that make a sequence; 20 give 190 pairs
    levelled: bool = True  # take off how much louder each access point is, where a survey tells
    start_sigma: float = 1.0  # m, of a start that is told
    heading_sigma: float = 0.25  # rad, of the phone's heading at the start

    @property
    def precision(self) -> float:
        """1/m², of the Gaussian of Eq. 2 with Eq. 3."""
        return 1.0 / self.bandwidth if self.bandwidth_divides else self.bandwidth


class Motion(NamedTuple):
    """What the phone sends (Sec. III-C): step count c_t (T,) and orientation alpha_t (T,) rad."""

    step_count: Array
    orientation: Array


class Pose(NamedTuple):
    """Where a walk starts: m, m, rad."""

    x: float
    y: float
    heading: float


def sequence_neighbours(
    ap_xy: Array, extent: tuple[float, float, float, float], rssi: Array, config: Config
) -> list[Neighbours]:
    """The k most similar cells of each scan (T, n) dBm, from the positions (n, 2) m of the access points alone."""
    sequences = from_positions(ap_xy, extent, config.cell)
    return [sequences.neighbours(scan, config.k) for scan in rssi]


def fingerprint_neighbours(xy: Array, surveyed: Array, rssi: Array, config: Config) -> list[Neighbours]:
    """The k most similar of the surveyed places (m, 2) m, by the cosine of RSS - ``missing`` (Sec. IV-E)."""
    positive = Representation("positive", config.missing)
    similarity = 1.0 - distances(positive(rssi), positive(surveyed), "cosine")
    return [nearest(xy, row, config.k) for row in similarity]


def fused(motion: Motion, start: Pose, scans: Sequence[Neighbours], seed: int, config: Config) -> Array:
    """Estimates (T, 2) m of the filter of Sec. III: dead reckoning moves, scans weigh."""
    steps, turns = _increments(motion)
    model = ProportionalNoise(
        step_length=config.step_length, distance_sigma=config.distance_sigma, turn_sigma=config.turn_sigma
    )

    def predict(particles: Poses, t: int, noise: Noise) -> Poses:
        return model.move(noise, particles, Report(steps[t], turns[t]))

    return _filtered(start, predict, scans, seed, config)


def wifi_alone(start: Pose, scans: Sequence[Neighbours], seed: int, config: Config) -> Array:
    """Estimates (T, 2) m without motion sensors: the same filter on a random walk."""

    def predict(particles: Poses, _: int, noise: Noise) -> Poses:
        x, y, heading = particles
        drawn = config.walk_sigma * noise.normals(len(x))
        return Poses(x + drawn[0], y + drawn[1], heading)

    return _filtered(start, predict, scans, seed, config)


def dead_reckoning(motion: Motion, start: Pose, config: Config) -> Array:
    """Estimates (T, 2) m of Eq. 5-7 alone, without noise."""
    steps, turns = _increments(motion)
    heading = start.heading + np.concatenate(
        [[0.0], np.cumsum(turns[1:])[:-1]]
    )  # theta_(t-1): before the turn
    move = config.step_length * steps[1:, None] * np.column_stack([np.cos(heading), np.sin(heading)])
    return np.asarray(np.concatenate([np.zeros((1, 2)), np.cumsum(move, axis=0)]) + start[:2])


_Predict: TypeAlias = Callable[[Poses, int, Noise], Poses]


def _increments(motion: Motion) -> tuple[Array, Array]:
    """Steps (T,) and turns (T,) rad since the report before; 0 first."""
    turns = np.diff(motion.orientation, prepend=motion.orientation[:1])
    return np.diff(motion.step_count, prepend=motion.step_count[:1]), wrap(turns)


def _filtered(
    start: Pose, predict: _Predict, scans: Sequence[Neighbours], seed: int, config: Config
) -> Array:
    """Predict, correct, resample (Sec. III-A); the estimate is the weighted mean before resampling."""
    noise = Noise.of(seed, "liu2017")
    particles = Poses(*(np.full(config.n_particles, value) for value in start))
    out = np.empty((len(scans), 2))
    for t, scan in enumerate(scans):
        if t > 0:
            particles = predict(particles, t, noise)
        xy = np.column_stack(particles[:2])
        if t % config.scan_every:
            out[t] = xy.mean(axis=0)
            continue
        log_likelihood = kernel_log_likelihood(scan, xy, config.precision)
        weights = np.exp(log_likelihood - log_likelihood.max())
        out[t] = weights @ xy / weights.sum()
        ancestors = systematic(noise, weights, len(weights))
        particles = Poses(*(column[ancestors] for column in particles))
    return out
