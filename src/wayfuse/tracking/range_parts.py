"""What a particle filter knows of ranges: where anchors hang, the line of the phone, and how much a range may say."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from wayfuse.core.errors import ConfigError
from wayfuse.core.philox import Noise
from wayfuse.core.types import Array
from wayfuse.filters.cloud import Cloud
from wayfuse.filters.particle_filter import FilterState
from wayfuse.filters.resampling import systematic
from wayfuse.models.initial import Anywhere
from wayfuse.models.motion.random_walk import RandomWalk
from wayfuse.models.observation.anchored_ranges import AnchoredRanges
from wayfuse.radio.range_line import LineGrid, mixed
from wayfuse.sensors.records import Range
from wayfuse.tracking.engine import Known

__all__ = ["Ranging", "RangingState"]

_TRIED = 16  # places per particle where ranges begin a track
_LEAST = 1e-300  # of a likelihood, against log(0)


class RangingState(NamedTuple):
    """Of one track: log-probability of each line (n,); time each anchor (m,) and any was last heard (s). A value."""

    lines: Array
    heard: Array
    t: float = -math.inf


@dataclass(frozen=True, slots=True, kw_only=True)
class Ranging:
    """The parts that make ranges an observation.

    Parameters
    ----------
    ranges : how likely a range is at a particle. lines : how the phone's ranges differ from distances. creep : motion
    from moment to moment while no step is made, None = none: people shift, push a cart, or walk with a phone whose
    sensors are too slow to show steps. usual_spacing : s between ranges of one anchor that ``ranges.gain`` was chosen
    for; the errors of closer ones are more alike, so each says less, in proportion and by no more than a factor of
    ``spacing_range``. slab : how often an anchor one floor away is heard, of how often one on the same floor is; counts
    where ranges begin a track, for ranges of some metres and more hardly differ from floor to floor.
    """

    ranges: AnchoredRanges
    lines: LineGrid = field(default_factory=LineGrid)
    creep: RandomWalk | None = None
    usual_spacing: float = 0.5
    spacing_range: float = 10.0
    slab: float = 0.3

    def __post_init__(self) -> None:
        if not (self.usual_spacing > 0.0 and self.spacing_range >= 1.0):
            raise ConfigError("usual_spacing must be positive, spacing_range at least 1", where="Ranging")
        if not 0.0 < self.slab <= 1.0:
            raise ConfigError("slab must be a share above 0", where="Ranging")

    def init(self) -> RangingState:
        """Before the first range."""
        return RangingState(self.lines.prior, np.full(len(self.ranges.places), -np.inf))

    def look(
        self, state: RangingState, cloud: Cloud, weights: Array, ranges: Sequence[Range], t: float
    ) -> tuple[RangingState, Array | None]:
        """The ranges of a moment at particles of weights (N,): what they teach, and their log-likelihood (N,).

        None, and nothing learned, where no anchor is known.
        """
        at = self.ranges.places.rows(np.array([r.anchor for r in ranges], np.uint64))
        known = np.flatnonzero(at >= 0)
        if not len(known):
            return state, None
        at = at[known]
        measured = np.array([ranges[k].distance for k in known.tolist()])
        gains = np.clip((t - state.heard[at]) / self.usual_spacing, 1.0 / self.spacing_range, 1.0)
        rows = self.lines.live(state.lines)
        table = self.ranges.table(
            cloud, at, measured, gains, self.lines.offsets[rows], self.lines.slopes[rows]
        )
        top = float(table.max())
        evidence = top + np.log(np.maximum(np.exp(table - top) @ weights, _LEAST))
        spacing = t - state.t if math.isfinite(state.t) else 0.0
        learned = self.lines.learned(state.lines, rows, evidence, spacing)
        heard = state.heard.copy()
        heard[at] = t
        return RangingState(learned, heard, t), mixed(state.lines[rows], table)

    def begin(
        self,
        anywhere: Anywhere,
        key: tuple[int, int],
        n: int,
        ranges: Sequence[Range],
        t: float,
        known: Known,
    ) -> tuple[RangingState, FilterState | None]:
        """The first n particles: the best of many that are anywhere, rather on the floors of the anchors; None where no
        anchor is known."""
        noise, many = Noise(key), _TRIED * n
        cloud = anywhere.draw(noise, many, heading_known=known.heading)
        even = FilterState(cloud, np.zeros(many), noise.draw)
        state, log_weights = self.look(self.init(), cloud, even.weights, ranges, t)
        if log_weights is None:
            return state, None
        slabs = self._slabs(cloud, ranges)
        weights = even._replace(log_weights=log_weights + slabs * math.log(self.slab)).weights
        chosen = cloud.take(systematic(noise, weights, n))
        return state, FilterState(chosen, np.zeros(n), noise.draw)

    def _slabs(self, cloud: Cloud, ranges: Sequence[Range]) -> Array:
        """Floor slabs (N,) between particles and the known anchors, all together."""
        at = self.ranges.places.rows(np.array([r.anchor for r in ranges], np.uint64))
        floors = self.ranges.places.floor[at[at >= 0]]
        return np.asarray(np.abs(cloud.floor[:, None] - floors).sum(axis=1, dtype=np.float64))
