"""What a particle filter knows of ranges: where anchors hang, the line of the phone, and how much a range may say."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayfuse.core.errors import ConfigError
from wayfuse.core.types import Array
from wayfuse.filters.cloud import Cloud
from wayfuse.filters.particle_filter import Constraint, FilterState, ParticleFilter
from wayfuse.models.motion.random_walk import RandomWalk
from wayfuse.models.observation.anchored_ranges import AnchoredRanges
from wayfuse.radio.range_line import LineGrid, mixed
from wayfuse.sensors.records import Range

__all__ = ["Moment", "Ranging", "RangingState"]

_LEAST = 1e-300  # of a likelihood, against log(0)


class RangingState(NamedTuple):
    """Of one track: log-probability of each line (n,); time each anchor (m,) and any was last heard (s); when the track
    was last looked for elsewhere (s), and how many random draws that took. A value.
    """

    lines: Array
    heard: Array
    t: float = -math.inf
    looked: float = -math.inf
    looks: int = 0


class Moment(NamedTuple):
    """Ranges of known anchors at one time t (s): rows (n,) of their places, measured (n,) m, tempering (n,)."""

    t: float
    rows: NDArray[np.int64]
    measured: Array
    gains: Array


@dataclass(frozen=True, slots=True, kw_only=True)
class Ranging:
    """The parts that make ranges an observation.

    Parameters
    ----------
    ranges : how likely a range is at a particle. lines : how the phone's ranges differ from distances. creep : motion
    from moment to moment while no step is made, None = none: people shift, push a cart, or walk with a phone whose
    sensors are too slow to show steps. usual_spacing : s between ranges of one anchor that ``ranges.gain`` was chosen
    for; the errors of closer ones are more alike, so each says less, in proportion and by no more than a factor of
    ``spacing_range``.
    """

    ranges: AnchoredRanges
    lines: LineGrid = field(default_factory=LineGrid)
    creep: RandomWalk | None = None
    usual_spacing: float = 0.5
    spacing_range: float = 10.0

    def __post_init__(self) -> None:
        if not (self.usual_spacing > 0.0 and self.spacing_range >= 1.0):
            raise ConfigError("usual_spacing must be positive, spacing_range at least 1", where="Ranging")

    def init(self) -> RangingState:
        """Before the first range."""
        return RangingState(self.lines.prior, np.full(len(self.ranges.places), -np.inf))

    def moment(self, state: RangingState, ranges: Sequence[Range], t: float) -> Moment | None:
        """What the ranges of a moment say, and how much; None where no anchor is known."""
        at = self.ranges.places.rows(np.array([r.anchor for r in ranges], np.uint64))
        known = np.flatnonzero(at >= 0)
        if not len(known):
            return None
        at = at[known]
        measured = np.array([ranges[k].distance for k in known.tolist()])
        gains = np.clip((t - state.heard[at]) / self.usual_spacing, 1.0 / self.spacing_range, 1.0)
        return Moment(t, at, measured, gains)

    def look(
        self, state: RangingState, cloud: Cloud, weights: Array, moment: Moment
    ) -> tuple[RangingState, Array]:
        """A moment at particles of weights (N,): what it teaches of the phone, and its log-likelihood (N,)."""
        rows = self.lines.live(state.lines)
        table = self._table(cloud, moment, rows)
        top = float(table.max())
        evidence = top + np.log(np.maximum(np.exp(table - top) @ weights, _LEAST))
        spacing = moment.t - state.t if math.isfinite(state.t) else 0.0
        learned = self.lines.learned(state.lines, rows, evidence, spacing)
        heard = state.heard.copy()
        heard[moment.rows] = moment.t
        after = state._replace(lines=learned, heard=heard, t=moment.t)
        return after, mixed(state.lines[rows], table)

    def at_best_line(self, state: RangingState, cloud: Cloud, moment: Moment) -> Array:
        """Log-likelihood (N,) of a moment by the likeliest line alone: enough to compare places, and faster."""
        best = np.argmax(state.lines, keepdims=True)
        return np.asarray(self._table(cloud, moment, best)[0])

    def _table(self, cloud: Cloud, moment: Moment, lines: NDArray[np.int64]) -> Array:
        offsets, slopes = self.lines.offsets[lines], self.lines.slopes[lines]
        return self.ranges.table(cloud, moment.rows, moment.measured, moment.gains, offsets, slopes)

    def crept(
        self,
        particle_filter: ParticleFilter,
        key: tuple[int, int],
        now: FilterState,
        dt: float,
        constraint: Constraint | None,
    ) -> FilterState:
        """The particles ``dt`` seconds after they last moved: who makes no steps may still move."""
        if self.creep is None or not 0.0 < dt < np.inf:
            return now
        return particle_filter.predict(key, now, self.creep, dt, constraint)[0]
