"""A particle filter as the papers have it: motion, observation, resampling, mean; nothing is learnt, nothing is lost.

What `ParticleEngine` adds for real buildings (phone offset, fresh particles, tempering by the spacing of scans, held
floors, calibrated radii) is left out: this is the engine of the published systems, composed of their own parts.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple, Protocol, TypeAlias

import numpy as np

from wayfuse.core.errors import ConfigError
from wayfuse.core.philox import Noise, track_key
from wayfuse.core.types import Array
from wayfuse.filters.cloud import Cloud
from wayfuse.filters.particle_filter import (
    Constraint,
    FilterInfo,
    FilterState,
    MotionModel,
    ParticleFilter,
    Snapshot,
)
from wayfuse.inertial.front_end import StepEvent
from wayfuse.inertial.vertical import VerticalEvent
from wayfuse.models.motion.pdr import StepInput
from wayfuse.radio.survey import Fingerprint
from wayfuse.sensors.records import Range
from wayfuse.tracking.dead_reckoning import Start
from wayfuse.tracking.engine import Known, RangeObservation, Why, unknown
from wayfuse.tracking.estimate import Estimate
from wayfuse.tracking.fixed_lag import recalled, remembered
from wayfuse.tracking.floor_change import FloorChange, Movement
from wayfuse.tracking.summary import Summary, summarise

__all__ = ["First", "PlainEngine", "PlainState", "ScanObservation", "Seen", "Told"]

Seen: TypeAlias = Fingerprint | Sequence[Range]
_MEAN = Summary(median_iterations=0)


class ScanObservation(Protocol):
    """How likely a scan is at each particle."""

    def log_likelihood(self, cloud: Cloud, fingerprint: Fingerprint, out: Array, /) -> bool:
        """Add to ``out`` (N,); False, and nothing added, where the scan says nothing."""
        ...


class First(Protocol):
    """Where a track begins."""

    def draw(self, noise: Noise, seen: Seen | None, n: int, *, heading_known: bool) -> Cloud | None:
        """n particles for what was seen first (None: before anything was); None where that does not do for a start."""
        ...


class Told(First, Protocol):
    """Where a track begins that is told its place."""

    def at(self, x: float, y: float, floor: int, /) -> First:
        """The same about x, y (m) on a floor (index)."""
        ...


class Steps(Protocol):
    """What of a particle filter a paper may replace, such as `filters.widening.WideningFilter`."""

    def predict(
        self,
        key: tuple[int, int],
        state: FilterState,
        motion: MotionModel[StepInput],
        event: StepInput,
        constraint: Constraint | None,
    ) -> tuple[FilterState, int]:
        """Move the cloud; how many moves were undone."""
        ...


class PlainState(NamedTuple):
    """State of one track: the filter (None before the start) and what went on since the last scan and estimate."""

    key: tuple[int, int]
    filter: FilterState | None = None
    why: Why = Why()
    scanned: float = np.nan
    is_walking: bool = False
    ess: float = 1.0
    movement: Movement = Movement()
    marks: tuple[float, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class PlainEngine:
    """Particle filter of a published system.

    Parameters
    ----------
    n_floors : of the site. prior : the estimate before the start. first : where the track starts, told : where it
    starts if it is told. motion : of steps.
    observation : of scans, ranging : of ranges, None = not looked at; one of the two is needed. standing : motion of
    the seconds since the last scan, at a scan before which no step was made, None = none. quiet : motion while
    motion sensors are silent, the event is seconds. constraint : of steps. steps : predicts by steps, ``filter`` does
    all else. always_resample : after every observation. floor_change : takes the cloud over stairs and lifts.
    rotation : rad, heading of building +x from east. starts_unseen : the start is drawn before anything was seen.
    """

    n_floors: int
    prior: Estimate
    first: First
    told: Told
    motion: MotionModel[StepInput]
    quiet: MotionModel[float]
    observation: ScanObservation | None = None
    ranging: RangeObservation | None = None
    standing: MotionModel[float] | None = None
    constraint: Constraint | None = None
    filter: ParticleFilter = field(default_factory=ParticleFilter)
    steps: Steps | None = None
    always_resample: bool = True
    floor_change: FloorChange | None = None
    n_particles: int = 1000
    rotation: float = 0.0
    starts_unseen: bool = False
    uses_steps: bool = True
    supports_lag: bool = True

    def __post_init__(self) -> None:
        if self.n_particles < 10:
            raise ConfigError(f"n_particles must be at least 10, got {self.n_particles}", where="PlainEngine")
        if self.observation is None and self.ranging is None:
            raise ConfigError("neither scans nor ranges are observed", where="PlainEngine")

    @property
    def uses_scans(self) -> bool:
        """Whether scans change it."""
        return self.observation is not None

    @property
    def uses_ranges(self) -> bool:
        """Whether ranges change it."""
        return self.ranging is not None

    @property
    def uses_vertical(self) -> bool:
        """Whether movements between floors change it."""
        return self.floor_change is not None

    def begun_at(self, start: Start) -> PlainEngine:
        """The engine of tracks that begin at a place that is told."""
        return replace(self, first=self.told.at(*start), starts_unseen=True)

    def init(self, track: str, seed: int) -> PlainState:
        """State before the first record."""
        state = PlainState(track_key(seed, track))
        return self._begun(state, None, heading_known=True) if self.starts_unseen else state

    def resume(self, state: PlainState, track: str, seed: int, silence: float) -> PlainState:
        """State after a long silence: a start that was seen is looked for again; told, the cloud goes on, wider."""
        if not self.starts_unseen or state.filter is None:
            return self.init(track, seed)
        on = PlainState(track_key(seed, track), state.filter)
        return self.on_quiet(on, silence)

    def on_step(self, state: PlainState, event: StepEvent) -> PlainState:
        """Move by a step; before the start there is nothing to move."""
        if not self.uses_steps or state.filter is None:
            return state
        step = StepInput(event.length, event.heading - self.rotation)
        mover = self.steps or self.filter
        after, n_blocked = mover.predict(state.key, state.filter, self.motion, step, self.constraint)
        movement = state.movement
        if self.floor_change is not None:
            after, movement = self.floor_change.step(state.key, state.filter, after, movement, event.t, step)
        if n_blocked:
            after, _ = self._updated(state.key, after, np.zeros(self.n_particles))
        why = state.why._replace(
            n_steps=state.why.n_steps + 1,
            share_blocked=state.why.share_blocked + n_blocked / self.n_particles,
        )
        return state._replace(filter=after, why=why, is_walking=True, movement=movement)

    def on_vertical(self, state: PlainState, event: VerticalEvent) -> PlainState:
        """Take the cloud over stairs or by lift."""
        if self.floor_change is None or state.filter is None:
            return state
        after, movement = self.floor_change.report(state.key, state.filter, state.movement, event)
        return state._replace(filter=after, movement=movement)

    def on_quiet(self, state: PlainState, dt: float) -> PlainState:
        """Diffuse while no motion sensor speaks."""
        if state.filter is None or dt <= 0.0:
            return state
        after, _ = self.filter.predict(state.key, state.filter, self.quiet, dt, None)
        return state._replace(filter=after)

    def on_fingerprint(
        self, state: PlainState, t: float, fingerprint: Fingerprint, known: Known
    ) -> PlainState:
        """Weigh by a scan; the first one that does for a start makes the cloud."""
        model = self.observation
        if model is None:
            return state
        n_seen = len(fingerprint.bssid)
        return self._see(
            state, t, fingerprint, n_seen, known, lambda c, out: model.log_likelihood(c, fingerprint, out)
        )

    def on_ranges(self, state: PlainState, t: float, ranges: Sequence[Range], known: Known) -> PlainState:
        """Weigh by the ranges of one moment; the first that do for a start make the cloud."""
        model = self.ranging
        if model is None:
            return state
        return self._see(
            state, t, ranges, len(ranges), known, lambda c, out: model.log_likelihood(c, ranges, out)
        )

    def estimate(self, state: PlainState, t: float) -> tuple[PlainState, Estimate]:
        """Weighted mean on the heaviest floor, with radii that hold shares of the weight."""
        if state.filter is None:
            return self._say(state, t, None)
        cloud = state.filter.cloud
        return self._say(state, t, Snapshot(t, cloud.x, cloud.y, cloud.floor))

    def mark(self, state: PlainState, t: float) -> PlainState:
        """Keep where the particles are, so that their descendants can say where they came from."""
        return state._replace(filter=remembered(state.filter, t), marks=(*state.marks, t))

    def recall(self, state: PlainState) -> tuple[PlainState, Estimate]:
        """Where the ancestors of today's particles were at the oldest mark, weighted by what is known today."""
        t = state.marks[0]
        now, past = recalled(state.filter, len(state.marks))
        return self._say(state._replace(filter=now, marks=state.marks[1:]), t, past)

    def _say(self, state: PlainState, t: float, where: Snapshot | None) -> tuple[PlainState, Estimate]:
        e = unknown(t, self.prior)
        if where is not None and state.filter is not None:
            e = summarise(where, state.filter.weights, self.n_floors, t, _MEAN)
        n_steps, n_aps, share = state.why
        e = e._replace(n_steps=n_steps, n_aps=n_aps, ess=state.ess, share_blocked=share / max(n_steps, 1))
        return state._replace(why=Why()), e

    def _see(
        self,
        state: PlainState,
        t: float,
        seen: Seen,
        n_seen: int,
        known: Known,
        add_log_likelihood: Callable[[Cloud, Array], bool],
    ) -> PlainState:
        begun = self._begun(state, seen, heading_known=known.heading) if state.filter is None else state
        moved = self._stood(begun, t)
        if moved.filter is None:
            return state
        log_likelihood = np.zeros(self.n_particles)
        if not add_log_likelihood(moved.filter.cloud, log_likelihood):
            return state
        after, info = self._updated(state.key, moved.filter, log_likelihood)
        why = moved.why._replace(n_aps=max(moved.why.n_aps, n_seen))
        ess = info.ess / self.n_particles
        return moved._replace(filter=after, why=why, ess=ess, scanned=t, is_walking=False)

    def _begun(self, state: PlainState, seen: Seen | None, *, heading_known: bool) -> PlainState:
        noise = Noise(state.key)
        cloud = self.first.draw(noise, seen, self.n_particles, heading_known=heading_known)
        if cloud is None:
            return state
        return state._replace(filter=FilterState(cloud, np.zeros(self.n_particles), noise.draw))

    def _stood(self, state: PlainState, t: float) -> PlainState:
        """Somebody who made no step since the last scan may still have moved a little."""
        dt = t - state.scanned
        if state.filter is None or self.standing is None or state.is_walking or not dt > 0.0:
            return state
        after, _ = self.filter.predict(state.key, state.filter, self.standing, dt, self.constraint)
        return state._replace(filter=after)

    def _updated(
        self, key: tuple[int, int], state: FilterState, log_likelihood: Array
    ) -> tuple[FilterState, FilterInfo]:
        return self.filter.update(key, state, log_likelihood, always_resample=self.always_resample)
