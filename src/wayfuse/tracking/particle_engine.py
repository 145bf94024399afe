"""The particle filter as a positioning method: fused, without map, without steps, by its parts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from wayfuse.core.errors import ConfigError
from wayfuse.core.philox import Noise, track_key
from wayfuse.filters.particle_filter import (
    Constraint,
    FilterState,
    ParticleFilter,
    Snapshot,
    replace_particles,
    spread_slots,
)
from wayfuse.inertial.front_end import StepEvent
from wayfuse.inertial.vertical import VerticalEvent
from wayfuse.maps.walkable import Walkable
from wayfuse.models.initial import KnownStart
from wayfuse.models.motion.pdr import PdrMotion, StepInput
from wayfuse.models.motion.random_walk import RandomWalk
from wayfuse.radio.device_offset import OffsetState
from wayfuse.radio.sparse_knn import Neighbours
from wayfuse.radio.standing import Standing
from wayfuse.radio.survey import Fingerprint
from wayfuse.sensors.records import Range
from wayfuse.tracking.elsewhere import Elsewhere
from wayfuse.tracking.engine import Known, Why, unknown
from wayfuse.tracking.estimate import Estimate, State
from wayfuse.tracking.fixed_lag import recalled, remembered
from wayfuse.tracking.floor_change import FloorChange, Movement
from wayfuse.tracking.radio_parts import Radio
from wayfuse.tracking.range_parts import Ranging, RangingState
from wayfuse.tracking.summary import Held, Summary, on_walkable, summarise

__all__ = ["ParticleEngine", "ParticleState", "Recovery"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Recovery:
    """When a track is settled, lost, and what is done about it.

    injection : share of particles drawn afresh at a scan with which the cloud does not agree at all; it falls with the
    square of the disagreement to ``injection_least`` (as the sensor resetting of Monte Carlo localisation).
    agreement : a scan contradicts the cloud when the cloud's mean likelihood is below this share of what the scan's
    own neighbours have. patience : scans in a row until the track is lost and ``reset_share`` of the particles are
    drawn afresh. hold, hold_start, hold_height, hold_moving : share of the weight that keeps the floor said before: on
    a floor; before the first few steps; where a barometer would have told of a change; on stairs or in a lift.
    settled : m, r95 below which a track is no longer initialising. lost : m, r95 above which a settled track is lost.
    """

    injection: float = 0.04
    injection_least: float = 0.002
    agreement: float = 0.02
    patience: int = 3
    reset_share: float = 0.5
    hold: float = 0.15
    hold_start: float = 0.3
    hold_height: float = 0.05
    hold_moving: float = 0.4
    settled: float = 25.0
    lost: float = 60.0

    def __post_init__(self) -> None:
        shares = (self.reset_share, self.hold, self.hold_start, self.hold_height, self.hold_moving)
        is_share = (
            all(0.0 <= share <= 1.0 for share in shares) and min(self.injection, self.injection_least) >= 0.0
        )
        if not (is_share and self.injection + self.injection_least < 1.0 and self.patience >= 1):
            raise ConfigError(
                "injection, reset_share and hold are shares, patience at least 1", where="Recovery"
            )

    @property
    def injects(self) -> bool:
        """Whether particles are drawn afresh at every scan."""
        return self.injection + self.injection_least > 0.0

    def injection_share(self, agreement: float) -> float:
        """Share of particles to draw afresh at a scan the cloud agrees with so much (about 0 to 1)."""
        return self.injection_least + self.injection * (1.0 - min(agreement, 1.0)) ** 2


_UNCORROBORATED = 10  # steps before which no walk has told the floors apart


class ParticleState(NamedTuple):
    """State of one track: the filter (None before the first usable scan), key of its random numbers, bookkeeping."""

    key: tuple[int, int]
    filter: FilterState | None = None
    why: Why = Why()
    n_moves: int = 0
    contradictions: int = 0
    is_settled: bool = False
    ess: float = 1.0
    marks: tuple[float, ...] = ()
    is_quiet: bool = False
    offset: OffsetState | None = None
    movement: Movement = Movement()
    said: int = -1
    height_known: bool = False
    scanned: float = -np.inf
    n_walked: int = 0
    standing: Standing | None = None
    ranged: RangingState | None = None
    moved: float = -np.inf  # s, of the last step or the last ranges
    novelty: float = np.nan


@dataclass(frozen=True, slots=True, kw_only=True)
class ParticleEngine:
    """Particle filter over steps and scans.

    Parameters
    ----------
    n_floors : of the site. radio : what answers scans, None = Wi-Fi is not used. ranging : what answers ranges of known
    anchors, None = they are not used. elsewhere : where a track that only ranges speak of is looked for, None = it
    waits for a scan or a start. start : where the track starts, None = at the first scan; one of the two is needed.
    prior : the estimate before. motion, constraint : of steps; constraint None = no map. diffusion : motion while no
    motion sensor speaks. floor_change : takes the cloud over stairs and lifts, None = floors change by scans only.
    walkable : mask per floor that estimates are kept on, empty = none. uses_steps : False = diffusion always.
    rotation : rad, heading of building +x from east (headings arrive counter-clockwise from east).
    """

    n_floors: int
    prior: Estimate
    motion: PdrMotion
    diffusion: RandomWalk
    radio: Radio | None = None
    ranging: Ranging | None = None
    elsewhere: Elsewhere | None = None
    start: KnownStart | None = None
    constraint: Constraint | None = None
    filter: ParticleFilter = field(default_factory=ParticleFilter)
    recovery: Recovery = field(default_factory=Recovery)
    summary: Summary = field(default_factory=Summary)
    floor_change: FloorChange | None = None
    walkable: tuple[Walkable, ...] = ()
    n_particles: int = 1000
    uses_steps: bool = True
    rotation: float = 0.0
    supports_lag: bool = True

    def __post_init__(self) -> None:
        if self.n_particles < 10:
            raise ConfigError(
                f"n_particles must be at least 10, got {self.n_particles}", where="ParticleEngine"
            )
        if self.radio is None and self.start is None and (self.ranging is None or self.elsewhere is None):
            raise ConfigError(
                "neither a radio map nor a start nor ranges",
                where="ParticleEngine",
                remedy="give radio, start, or ranging with elsewhere: nobody can be found by steps alone",
            )

    def init(self, track: str, seed: int) -> ParticleState:
        """State before the first record."""
        state = self._unplaced(track, seed)
        if self.start is None:
            return state
        noise = Noise(state.key)
        cloud = self.start.draw(noise, self.n_particles)
        return state._replace(filter=FilterState(cloud, np.zeros(self.n_particles), noise.draw))

    def resume(self, state: ParticleState, track: str, seed: int, silence: float) -> ParticleState:
        """State after a long silence: somewhere in the building until a scan; without Wi-Fi lost from here on.

        The floor plan alone could gather the particles again, but at any of the places that look alike.
        """
        return self._unplaced(track, seed)

    @property
    def uses_scans(self) -> bool:
        """Whether scans change it."""
        return self.radio is not None

    @property
    def uses_ranges(self) -> bool:
        """Whether ranges change it."""
        return self.ranging is not None

    @property
    def uses_vertical(self) -> bool:
        """Whether movements between floors change it."""
        return self.floor_change is not None

    def on_step(self, state: ParticleState, event: StepEvent) -> ParticleState:
        """Move by a step; before the first scan there is nothing to move."""
        if not self.uses_steps or state.filter is None:
            return state
        why = state.why._replace(n_steps=state.why.n_steps + 1)
        step = StepInput(event.length, event.heading - self.rotation)
        after, n_blocked = self.filter.predict(state.key, state.filter, self.motion, step, self.constraint)
        if self.floor_change is not None:
            after, movement = self.floor_change.step(
                state.key, state.filter, after, state.movement, event.t, step
            )
            state = state._replace(movement=movement)
        return self._moved(state, after, n_blocked, why)._replace(
            is_quiet=False, n_walked=state.n_walked + 1, standing=None, moved=event.t
        )

    def on_vertical(self, state: ParticleState, event: VerticalEvent) -> ParticleState:
        """Take the cloud over stairs or by lift; before the first scan there is nothing to take."""
        if self.floor_change is None or state.filter is None:
            return state
        after, movement = self.floor_change.report(state.key, state.filter, state.movement, event)
        return state._replace(filter=after, movement=movement)

    def on_quiet(self, state: ParticleState, dt: float) -> ParticleState:
        """Diffuse, unconstrained: a second's displacement is no step, and walls would only trap it."""
        if state.filter is None or dt <= 0.0:
            return state
        after, _ = self.filter.predict(state.key, state.filter, self.diffusion, dt, None)
        return self._moved(state, after, 0, state.why)._replace(is_quiet=True)

    def on_fingerprint(
        self, state: ParticleState, t: float, fingerprint: Fingerprint, known: Known
    ) -> ParticleState:
        """Weigh by a scan; the first one makes the cloud. A scan of unknown access points changes nothing."""
        if self.radio is None:
            return state
        standing = Standing.of(fingerprint)
        if state.standing is not None and self.uses_steps and not state.is_quiet:
            standing = state.standing.add(fingerprint)
        fingerprint = standing.fingerprint
        offset, near = self.radio.neighbours(state.offset, fingerprint)
        if near is None:
            return state
        why = state.why._replace(n_aps=max(state.why.n_aps, near.n_aps))
        state = state._replace(standing=standing, offset=offset, height_known=known.height, why=why)
        if state.filter is None:
            noise = Noise(state.key)
            cloud = self.radio.first.draw(noise, near, self.n_particles, heading_known=known.heading)
            return state._replace(filter=FilterState(cloud, np.zeros(self.n_particles), noise.draw))
        spacing = t - state.scanned
        state = self._weigh(state, state.filter, self.radio, near, known, spacing)
        return state._replace(scanned=t)

    def on_ranges(
        self, state: ParticleState, t: float, ranges: Sequence[Range], known: Known
    ) -> ParticleState:
        """Weigh by the ranges of one moment; those of unknown anchors change nothing."""
        if self.ranging is None:
            return state
        if state.filter is None:
            if self.elsewhere is None:
                return state
            ranged, first = self.elsewhere.begin(self.ranging, state.key, self.n_particles, ranges, t, known)
            return state._replace(ranged=ranged, filter=first, moved=t)
        before = state.ranged or self.ranging.init()
        moment = self.ranging.moment(before, ranges, t)
        if moment is None:
            return state
        now, fresh, is_moving = state.filter, None, state.movement.event is not None
        if not is_moving:  # on stairs and in lifts nobody creeps, nor is drawn afresh
            now = self.ranging.crept(self.filter, state.key, now, t - state.moved, self.constraint)
        if self.elsewhere is None or is_moving:
            ranged, log_likelihood = self.ranging.look(before, now.cloud, now.weights, moment)
        else:
            watched = self._is_watched(state, known)
            ranged, log_likelihood, fresh = self.elsewhere.look(
                self.ranging, state.key, before, now, moment, known, is_watched=watched
            )
        after, info = self.filter.update(state.key, now, log_likelihood, always_resample=fresh is not None)
        if fresh is not None:
            after = replace_particles(after, *fresh)
        why, ess = state.why._replace(n_aps=max(state.why.n_aps, len(ranges))), info.ess / self.n_particles
        return state._replace(filter=after, why=why, ess=ess, ranged=ranged, moved=t)

    def _weigh(
        self,
        state: ParticleState,
        now: FilterState,
        radio: Radio,
        near: Neighbours,
        known: Known,
        spacing: float,
    ) -> ParticleState:
        is_moving = state.movement.event is not None  # nobody is drawn afresh onto stairs or into a lift
        walks = state.n_walked >= _UNCORROBORATED and not (is_moving or state.is_quiet)
        novelty, trust, observation = radio.observed(state.novelty, near, walks=walks)
        log_likelihood = np.zeros(self.n_particles)
        observation.log_likelihood(now.cloud, near, log_likelihood)
        agreement = observation.agreement(now.weights, log_likelihood, near)
        log_likelihood *= radio.gain(spacing, is_quiet=state.is_quiet, is_moving=is_moving)
        inject = self.recovery.injects and not is_moving
        after, info = self.filter.update(state.key, now, log_likelihood, always_resample=inject)
        contradicts = agreement < self.recovery.agreement and not is_moving
        contradictions = state.contradictions + 1 if contradicts else 0
        if not is_moving:
            share, keeps_floor = self._renewal(contradictions, agreement, trust)
            keeps_floor = keeps_floor and self._is_watched(state, known)
            after = self._renewed(state.key, after, radio, near, share, known, keeps_floor=keeps_floor)
        ess = info.ess / self.n_particles
        return state._replace(filter=after, contradictions=contradictions, ess=ess, novelty=novelty)

    def _is_watched(self, state: ParticleState, known: Known) -> bool:
        """Whether a change of floors would not go unnoticed."""
        return self.floor_change is not None and known.height and state.n_walked >= _UNCORROBORATED

    def estimate(self, state: ParticleState, t: float) -> tuple[ParticleState, Estimate]:
        """Geometric median on the heaviest floor, with radii."""
        if state.filter is None:
            return self._explained(state, self._nowhere(t))
        cloud = state.filter.cloud
        return self._say(state, t, Snapshot(t, cloud.x, cloud.y, cloud.floor))

    def mark(self, state: ParticleState, t: float) -> ParticleState:
        """Keep where the particles are, so that their descendants can say where they came from."""
        return state._replace(filter=remembered(state.filter, t), marks=(*state.marks, t))

    def recall(self, state: ParticleState) -> tuple[ParticleState, Estimate]:
        """Where the ancestors of today's particles were at the oldest mark, weighted by what is known today."""
        t = state.marks[0]
        now, past = recalled(state.filter, len(state.marks))
        state = state._replace(filter=now, marks=state.marks[1:])
        if past is None:  # of the time before the first usable scan
            return self._explained(state, self._nowhere(t))
        return self._say(state, t, past)

    def _unplaced(self, track: str, seed: int) -> ParticleState:
        device = None if self.radio is None else self.radio.device
        return ParticleState(track_key(seed, track), offset=None if device is None else device.init())

    def _nowhere(self, t: float) -> Estimate:
        """Without particles: nothing but the building is known; who is not found by scans had a start, and lost it."""
        said = unknown(t, self.prior)
        return said if self.radio is not None else said._replace(state=State.LOST)

    def _moved(self, state: ParticleState, after: FilterState, n_blocked: int, why: Why) -> ParticleState:
        if n_blocked:  # penalties add up: without a scan for long all weight would end on a few particles
            after, _ = self.filter.update(state.key, after, np.zeros(self.n_particles))
        blocked = why._replace(share_blocked=why.share_blocked + n_blocked / self.n_particles)
        return state._replace(filter=after, why=blocked, n_moves=state.n_moves + 1)

    def _renewal(self, contradictions: int, agreement: float, trust: float) -> tuple[float, bool]:
        """Share of particles to draw afresh, and whether they keep to the floor of those they replace."""
        rounds, rest = divmod(contradictions, self.recovery.patience)
        is_reset = rounds > 0 and rest == 0
        # the first time a track is lost, its floor may still be right where a barometer saw no change
        keeps_floor = not (is_reset and rounds > 1)
        if is_reset:
            return self.recovery.reset_share, keeps_floor
        return trust * self.recovery.injection_share(agreement), keeps_floor

    def _renewed(
        self,
        key: tuple[int, int],
        state: FilterState,
        radio: Radio,
        near: Neighbours,
        share: float,
        known: Known,
        *,
        keeps_floor: bool,
    ) -> FilterState:
        """Some particles drawn afresh: a few always, many where the scans have long contradicted the cloud."""
        n = round(share * self.n_particles)
        if n == 0:
            return state
        noise = Noise(key, state.draw)
        fresh = radio.first.draw(noise, near, n, heading_known=known.heading)
        slots = spread_slots(noise, self.n_particles, n)  # of resampled particles
        if keeps_floor:  # the place is the scan's, the floor stays
            fresh = fresh._replace(floor=state.cloud.floor[slots])
        return replace_particles(state._replace(draw=noise.draw), slots, fresh)

    def _say(self, state: ParticleState, t: float, where: Snapshot) -> tuple[ParticleState, Estimate]:
        assert state.filter is not None  # noqa: S101 (callers checked)
        held = None
        if self.floor_change is not None and state.said >= 0:
            held = Held(state.said, self._hold(state))
        e = summarise(where, state.filter.weights, self.n_floors, t, self.summary, held)
        e = on_walkable(e, where, self.walkable)
        is_settled = state.is_settled or e.r95 <= self.recovery.settled
        lost = state.contradictions >= self.recovery.patience or (is_settled and e.r95 > self.recovery.lost)
        label = State.LOST if lost else State.TRACKING if is_settled else State.INITIALISING
        return self._explained(state._replace(is_settled=is_settled, said=e.floor), e._replace(state=label))

    def _hold(self, state: ParticleState) -> float:
        if state.movement.event is not None:
            return self.recovery.hold_moving
        if state.n_walked < _UNCORROBORATED:
            return self.recovery.hold_start
        return self.recovery.hold_height if state.height_known else self.recovery.hold

    @staticmethod
    def _explained(state: ParticleState, e: Estimate) -> tuple[ParticleState, Estimate]:
        why = state.why
        blocked = why.share_blocked / state.n_moves if state.n_moves else 0.0
        said = e._replace(n_steps=why.n_steps, n_aps=why.n_aps, share_blocked=blocked, ess=state.ess)
        return state._replace(why=Why(), n_moves=0), said
