"""Many tracks advanced by one call: what a server does with all phones that have spoken since the last tick.

A batch is a block of float32 (track, field, particle) with log-weights and a counter of random draws per track. The
numbers of a track are those of `ParticleFilter` with `PdrMotion`, `Barriers` and systematic resampling: same key, same
draws, and the same results but for rounding (float32 weights). They do not depend on who else is in the batch.

Limits: one floor and one wall index per call, steps on floors only. Tracks on stairs, in lifts, or with particles on
several floors go through `ParticleFilter`, one at a time.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wayfuse.core.errors import ConfigError, UsageError
from wayfuse.core.types import Array, Array32
from wayfuse.filters.cloud import Cloud
from wayfuse.maps.walls import WallIndex
from wayfuse.models._batch_kernels import SCRATCH, tick
from wayfuse.models.motion.pdr import PdrMotion
from wayfuse.radio.level_table import LANES, LevelTable

__all__ = ["BatchModel", "Seen", "TrackBatch"]

# for a single track, making a type of a name takes as long as looking at an array
_INT, _SINGLE = np.dtype(np.int64), np.dtype(np.float32)
_NO_ANCHORS = np.zeros((0, 2), np.float32)
_NO_LEVELS = LevelTable(np.zeros((0, 4, 3, LANES), np.float32), np.array([0, 0, 1, 2, 2], np.float32), 0)
_NO_RANGES, _NO_SCANS, _NO_PLACES = (
    np.zeros(shape, np.float32) for shape in ((1, 0), (1, 0, 2, LANES), (1, 0, 4))
)


class Seen(NamedTuple):
    """Observations of K tracks in a tick; None = of this kind nobody saw anything.

    ranges : (K, A) m to the anchors of the model, NaN where none. scans : (K, a) dBm of the access points of its
    levels, NaN where unheard. places : (K, k, 4) x, y m, log-weight, precision 1/m² of a mixture of kernels about k
    places (the neighbours of a fingerprint, the cells most alike in rank); log-weight -1e9 where a track has fewer.
    """

    ranges: Array | None = None
    scans: NDArray[np.floating] | None = None
    places: Array | None = None


_NOTHING = Seen()


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class BatchModel:
    """What the tracks of a batch have in common.

    Parameters
    ----------
    motion : of steps. walls : None = moves are not tested. penalty : nats lost per blocked move. anchors : (A, 2) m.
    range_sigma : m. levels : of access points. ess_ratio : resample below this share of N. tables : of a model, as
    `_batch_kernels.tick` takes them.
    """

    motion: PdrMotion = field(default_factory=PdrMotion)
    walls: WallIndex | None = None
    penalty: float = 1.2
    anchors: NDArray[np.floating] = field(default_factory=lambda: _NO_ANCHORS)
    range_sigma: float = 1.0
    levels: LevelTable = _NO_LEVELS
    ess_ratio: float = 0.5
    tables: tuple[NDArray[Any], ...] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        if not (self.penalty >= 0.0 and self.range_sigma > 0.0 and 0.0 <= self.ess_ratio <= 1.0):
            raise ConfigError(
                "penalty must not be negative, range_sigma positive, ess_ratio a share", where="BatchModel"
            )
        if self.anchors.ndim != 2 or self.anchors.shape[1] != 2 or not np.isfinite(self.anchors).all():
            raise ConfigError(f"anchors of shape {self.anchors.shape}", where="BatchModel", remedy="(A, 2) m")
        m, precision = self.motion, 0.5 / self.range_sigma**2
        sigmas = (m.length_sigma, m.heading_sigma, m.bias_sigma, m.scale_sigma)
        numbers = np.array([*sigmas, self.penalty, self.ess_ratio, precision], np.float32)
        walls = self.walls if self.walls is not None else WallIndex.build(np.empty((0, 4)))
        anchors = np.ascontiguousarray(self.anchors, dtype=np.float32)
        tables = (numbers, *walls.arrays, anchors, self.levels.levels, self.levels.frame)
        object.__setattr__(self, "tables", tables)

    def tick(self, batch: TrackBatch, tracks: ArrayLike, steps: ArrayLike, seen: Seen | None = None) -> Array:
        """Advance some tracks by a step and an observation each, in place.

        Parameters
        ----------
        batch : changed in place; `TrackBatch.copy` keeps one. tracks : (K,) rows of the batch, each once. steps :
        (K, 2) length m and heading rad; length 0 = no step. seen : what they observed.

        Returns
        -------
        (K, 8): mean x, y m, covariance xx, xy, yy m², effective sample size, log of the mean weight, resampled (0, 1);
        mean and covariance before resampling.

        Raises
        ------
        UsageError : shapes that do not fit, a track twice or outside the batch, numbers that are not finite.
        """
        rows, moves = np.ascontiguousarray(tracks, _INT), np.ascontiguousarray(steps, _SINGLE)
        n = len(rows)
        if moves.shape != (n, 2):
            raise UsageError(f"steps of shape {moves.shape}", remedy=f"({n}, 2): m, rad")
        ranges, scans, places = seen or _NOTHING
        scratch, out = np.empty(SCRATCH * batch.particles.shape[2], _SINGLE), np.empty((n, 8))
        wrong = tick(
            batch.particles, batch.log_weights, batch.counters, scratch, rows, moves,
            _NO_RANGES if ranges is None else _of_tracks(ranges, (n, len(self.anchors)), "ranges"),
            _NO_SCANS if scans is None else self.levels.scans(_of_tracks(scans, (n, None), "scans")),
            _NO_PLACES if places is None else _finite(_of_tracks(places, (n, None, 4), "places")),
            out, *self.tables,
        )  # fmt: skip
        if wrong >= 0:
            raise UsageError(
                f"track {rows[wrong]} with step {moves[wrong].tolist()}",
                where=f"tracks[{wrong}]",
                remedy=f"rows below {len(batch.counters)}, each once, and finite steps",
            )
        return out


@dataclass(frozen=True, slots=True, eq=False)
class TrackBatch:
    """Particles of U tracks; `BatchModel.tick` writes into the arrays, so a batch has one owner.

    particles (U, 4, N): x, y m, heading bias rad, step scale. log_weights (U, N), greatest 0. counters (U, 3): the two
    keys of the track (`core.philox.track_key`) and the count of its draws.
    """

    particles: Array32
    log_weights: Array32
    counters: NDArray[np.uint64]

    @classmethod
    def of(
        cls, clouds: Sequence[Cloud], keys: Sequence[tuple[int, int]], draws: Sequence[int] | None = None
    ) -> TrackBatch:
        """Batch of clouds of equally many particles, all of weight one.

        Raises
        ------
        UsageError : no cloud, clouds of different sizes, another number of keys.
        """
        if not clouds or len({c.n for c in clouds}) != 1 or len(keys) != len(clouds):
            raise UsageError("clouds", remedy="one or more of equal size, a key for each")
        particles = np.array([[c.x, c.y, c.heading_bias, c.step_scale] for c in clouds], np.float32)
        counts = draws if draws is not None else [0] * len(clouds)
        counters = np.array([[*key, draw] for key, draw in zip(keys, counts, strict=True)], np.uint64)
        return cls(particles, np.zeros((len(clouds), clouds[0].n), np.float32), counters)

    def copy(self) -> TrackBatch:
        """A checkpoint: going on from it gives the same bits."""
        return TrackBatch(self.particles.copy(), self.log_weights.copy(), self.counters.copy())

    def cloud(self, track: int, floor: int) -> Cloud:
        """Particles of a track, copied, on a floor."""
        x, y, bias, scale = self.particles[track].copy()
        return Cloud.on_floors(x, y, bias, scale, np.full(len(x), floor, np.int32))


def _of_tracks(values: NDArray[np.floating], shape: tuple[int | None, ...], name: str) -> Array32:
    got = values.shape
    if got != shape:  # or it has places for any number
        wanted = tuple(g if w is None else w for g, w in zip(got, shape, strict=False))
        if len(got) != len(shape) or got != wanted:
            raise UsageError(f"{name} of shape {got}", remedy=f"{shape}, None = any")
    return np.ascontiguousarray(values, _SINGLE)


def _finite(values: Array32) -> Array32:
    if not np.isfinite(values).all():
        raise UsageError("places", remedy="finite numbers; a log-weight of -1e9 where there is none")
    return values
