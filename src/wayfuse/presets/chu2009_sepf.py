"""``chu2009`` in a building: the whole of its chapter 3, second by second, with what it is held against.

SEPF: displacements, stairs and lift rides move the particles (sampling cases 1 to 3), speed and walls filter them,
interpolated fingerprints weigh them. PF_MCL: the same radio map, no sensors; of the plan it knows where somebody can
be. Recovery is ours.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayfuse.core.philox import Noise, track_key
from wayfuse.core.types import Array
from wayfuse.filters.cloud import Cloud
from wayfuse.filters.particle_filter import FilterState, ParticleFilter, Snapshot
from wayfuse.filters.widening import WideningFilter, scaling
from wayfuse.inertial.vertical import VerticalEvent
from wayfuse.maps.site import Site
from wayfuse.models.constraint.barriers import Barriers
from wayfuse.models.constraint.speed_filter import SpeedFilter, SpeedState
from wayfuse.models.constraint.walkable_mask import WalkableMask
from wayfuse.models.motion.connectors import ConnectorMotion
from wayfuse.models.motion.displaced_disc import StepDisc
from wayfuse.models.motion.pdr import StepInput
from wayfuse.models.motion.random_connectors import RandomConnectors
from wayfuse.models.observation.mapped import MapLikelihood
from wayfuse.models.relocation import Relocation
from wayfuse.models.scan_start import AnywhereAtRest, LikelyPlaces
from wayfuse.radio.interpolated_map import InterpolatedMap
from wayfuse.radio.survey import Fingerprint
from wayfuse.tracking.floor_change import FloorChange, Movement
from wayfuse.tracking.summary import Summary, summarise

__all__ = ["Config", "Said", "Second", "nnss", "pf_mcl", "sepf"]

_MEAN = Summary(median_iterations=0)
_STILL = StepInput(0.0, 0.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Config:
    """Parameters of SEPF and PF_MCL; those the thesis does not give are marked."""

    n_particles: int = 500  # Chapter 5
    r_max: float = 3.0  # m, Eq. 3.3; not given: as chapter 4 here
    r_max_blind: float = 4.0  # m, of PF_MCL, which has to follow 1 m/s without displacements; not given
    wall_penalty: float = 30.0  # nats: filtered (Section 3.3.2)
    rounds: int = 6  # of widening; the thesis widens without end
    speed: SpeedFilter | None = field(default_factory=lambda: SpeedFilter(least=10.0))  # Eq. 3.4
    recovery: bool = False  # not in the thesis


class Second(NamedTuple):
    """What came in one second: displacement of the steps, reports of stairs and lifts, a scan; None where nothing."""

    step: StepInput | None
    vertical: tuple[VerticalEvent, ...]
    scan: Fingerprint | None


class Said(NamedTuple):
    """Estimates, second by second: xy (t, 2) m, floor (t,)."""

    xy: Array
    floor: NDArray[np.int32]


def nnss(radio_map: InterpolatedMap, seconds: Sequence[Second]) -> Said:
    """Nearest training place in signal space, scan by scan; the last one where a second has no scan."""
    best = 0
    rows = []
    for second in seconds:
        at_places = None if second.scan is None else radio_map.at_places(second.scan)
        best = best if at_places is None else int(np.argmax(at_places))
        rows.append(best)
    return Said(radio_map.xy[rows], radio_map.floor[rows])


def pf_mcl(
    site: Site,
    radio_map: InterpolatedMap,
    seconds: Sequence[Second],
    c: Config,
    seed: int,
    kidnapped: Mapping[int, tuple[float, float, int]] | None = None,
) -> Said:
    """Monte Carlo localisation without any information on the walker; kidnapped as for `sepf`."""
    key, filter_ = track_key(seed, "pf_mcl"), ParticleFilter(ess_ratio=1.0)
    plan = WalkableMask(tuple(floor.walkable for floor in site.floors), 0.0)  # nobody is in a closed room
    disc, connectors = StepDisc(r_max=c.r_max_blind), RandomConnectors(site=site)
    first, observation = _anywhere(site), MapLikelihood(radio_map=radio_map)
    state, said = None, []
    for t, second in enumerate(seconds):
        state = _begun(key, state, first, second, c.n_particles)
        if state is not None:
            if kidnapped and t in kidnapped:
                state = _put(state, kidnapped[t])
            state, _ = filter_.predict(key, state, disc, _STILL, plan)
            state, _ = filter_.predict(key, state, connectors, 1.0, None)
            if second.scan is not None:
                weights = np.zeros(c.n_particles)
                observation.log_likelihood(state.cloud, second.scan, weights)
                state = state._replace(log_weights=state.log_weights + weights)
        said.append(_estimate(state, len(site.floors)))
        if state is not None:
            state, _ = filter_.update(key, state, np.zeros(c.n_particles), always_resample=True)
    return _said(said)


def sepf(
    site: Site,
    radio_map: InterpolatedMap,
    seconds: Sequence[Second],
    c: Config,
    seed: int,
    kidnapped: Mapping[int, tuple[float, float, int]] | None = None,
) -> Said:
    """The thesis' filter. kidnapped : second to the place (x m, y m, floor) where all particles are put in it."""
    system, first = _Sepf(site, radio_map, c, track_key(seed, "sepf")), _anywhere(site)
    track, said = None, []
    for t, second in enumerate(seconds):
        state = _begun(system.key, None if track is None else track.state, first, second, c.n_particles)
        if state is None:
            said.append(_estimate(None, len(site.floors)))
            continue
        track = _Track(state) if track is None else track
        if kidnapped and t in kidnapped:
            track = track._replace(state=_put(state, kidnapped[t]), movement=Movement())
        track = system.move(track, float(t), second)
        track, share = system.weigh(track, second)
        said.append(_estimate(track.state, len(site.floors)))
        track = system.resample(track, float(t), second, said[-1], share)
    return _said(said)


class _Track(NamedTuple):
    """What SEPF knows of a track."""

    state: FilterState
    movement: Movement = Movement()
    speed: SpeedState = SpeedState()


class _Sepf:
    """The modules of Figure 3.1: particle sampling, filtering, weighting, resampling; and ours, relocation."""

    def __init__(self, site: Site, radio_map: InterpolatedMap, c: Config, key: tuple[int, int]) -> None:
        self.key, self.c, self.plain = key, c, ParticleFilter(ess_ratio=1.0)
        self.walls = Barriers(tuple(f.barrier_index for f in site.floors), c.wall_penalty)
        self.motion = StepDisc(r_max=c.r_max)
        self.filter = WideningFilter(wider=scaling("r_max"), rounds=c.rounds, filter=self.plain)
        self.floors = FloorChange(
            connectors=ConnectorMotion(site=site, leave_stairs=1.0, leave_lift=1.0),
            steps=self.motion,
            filter=self.plain,
            constraint=self.walls,
        )
        self.observation = MapLikelihood(radio_map=radio_map)
        likely = LikelyPlaces(radio_map=radio_map, walls=self.walls)
        self.relocation = Relocation(first=likely) if c.recovery else None

    def move(self, track: _Track, t: float, second: Second) -> _Track:
        """Sampling (3.2) and filtering (3.3)."""
        state, movement, speed = track
        for event in second.vertical:  # S(t), E(t)
            state, movement = self.floors.report(self.key, state, movement, event)
        if second.step is not None:  # H(t)
            after, _ = self.filter.predict(self.key, state, self.motion, second.step, self.walls)
            state, movement = self.floors.step(self.key, state, after, movement, t, second.step)
        if self.c.speed is not None:
            if second.step is not None:
                speed = self.c.speed.stepped(speed, *second.step)
            disc = self.c.speed.disc(speed, t)
            if disc is not None:
                log_weights = state.log_weights.copy()
                disc.restrict(state.cloud, state.cloud, log_weights)
                state = state._replace(log_weights=log_weights)
        return _Track(state, movement, speed)

    def weigh(self, track: _Track, second: Second) -> tuple[_Track, float]:
        """Weighting (3.4), and the share of particles to draw afresh after resampling."""
        state = track.state
        if second.scan is None:
            return track, 0.0
        weights, share = np.zeros(state.cloud.n), 0.0
        self.observation.log_likelihood(state.cloud, second.scan, weights)
        if self.relocation is not None and track.movement.event is None:
            share = self.relocation.share(state, second.scan, weights)
        return track._replace(state=state._replace(log_weights=state.log_weights + weights)), share

    def resample(
        self, track: _Track, t: float, second: Second, said: tuple[float, float, int], share: float
    ) -> _Track:
        """Resampling (3.5) in every round, and relocation."""
        speed = track.speed if self.c.speed is None else self.c.speed.estimated(track.speed, t, *said)
        state, _ = self.plain.update(
            self.key, track.state, np.zeros(track.state.cloud.n), always_resample=True
        )
        if self.relocation is not None and second.scan is not None and track.movement.event is None:
            state = self.relocation.renew(self.key, state, second.scan, share)
        return _Track(state, track.movement, speed)


def _anywhere(site: Site) -> AnywhereAtRest:
    return AnywhereAtRest(walkable=tuple(floor.walkable for floor in site.floors))


def _begun(
    key: tuple[int, int], state: FilterState | None, first: AnywhereAtRest, second: Second, n: int
) -> FilterState | None:
    if state is not None or second.scan is None:
        return state
    noise = Noise(key)
    return FilterState(first.draw(noise, second.scan, n, heading_known=True), np.zeros(n), noise.draw)


def _put(state: FilterState, where: tuple[float, float, int]) -> FilterState:
    n = state.cloud.n
    x, y = (np.full(n, value, np.float32) for value in where[:2])
    zero = np.zeros(n, np.float32)
    return state._replace(cloud=Cloud.on_floors(x, y, zero, zero + 1, np.full(n, where[2], np.int32)))


def _estimate(state: FilterState | None, n_floors: int) -> tuple[float, float, int]:
    """Weighted mean on the heaviest floor; nowhere before the first scan."""
    if state is None:
        return np.nan, np.nan, 0
    cloud = state.cloud
    e = summarise(Snapshot(0.0, cloud.x, cloud.y, cloud.floor), state.weights, n_floors, 0.0, _MEAN)
    return e.x, e.y, e.floor


def _said(rows: list[tuple[float, float, int]]) -> Said:
    table = np.array(rows)
    return Said(table[:, :2], table[:, 2].astype(np.int32))
