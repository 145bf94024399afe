"""chu2009 as a tracker of real recordings: interpolated fingerprints, steps with a disc, walls, stairs and lifts."""

from __future__ import annotations

from dataclasses import dataclass

from wayfuse.filters.particle_filter import ParticleFilter
from wayfuse.filters.widening import WideningFilter, scaling
from wayfuse.maps.site import Site
from wayfuse.models.constraint.barriers import Barriers
from wayfuse.models.constraint.step_speed import StepSpeedFilter
from wayfuse.models.initial import KnownStart
from wayfuse.models.motion.connectors import ConnectorMotion
from wayfuse.models.motion.displaced_disc import StepDisc
from wayfuse.models.motion.random_walk import RandomWalk
from wayfuse.models.observation.mapped import MapLikelihood
from wayfuse.models.placed_start import ToldStart
from wayfuse.models.scan_start import LikelyPlaces
from wayfuse.presets.fused import prior_estimate
from wayfuse.presets.given import needed_survey
from wayfuse.radio import interpolated_map
from wayfuse.radio.ap_places import ApPlaces
from wayfuse.radio.survey import Survey
from wayfuse.tracking.floor_change import FloorChange
from wayfuse.tracking.plain_engine import PlainEngine, PlainState
from wayfuse.tracking.tracker import Tracker

__all__ = ["Config", "build"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Config:
    """Parameters; those the thesis does not give, or gives per second and not per step, are marked."""

    n_particles: int = 500  # Section 4.1, chapter 5
    r_max: float = 1.5  # m per step, Eq. 3.3; not given
    kernel_sigma: float = 6.0  # dB, Eq. 3.7; not given
    missing: float = -95.0  # dBm that stands for "not heard"; not given
    cell: float = 2.0  # m; the scans of a walked survey in one cell are samples of one training place
    aps: float = 11.0  # a scan counts for no more access points than those of chapter 5 had
    wall_penalty: float = 30.0  # nats: filtered, Section 3.3.2
    rounds: int = 6  # of widening; the thesis widens without end
    least_radius: float | None = None  # m, of the speed filter (Eq. 3.4), as 10.0; None = off
    start_radius: float = 3.0  # m about a likely training place or a start that is told; not given
    diffusion: float = 1.2  # m per root second and axis, without motion sensors: Eq. 3.3 with 3 m each second


def build(
    site: Site,
    survey: Survey | None,
    *,
    places: ApPlaces | None = None,  # noqa: ARG001
    config: Config | None = None,
    lag: float = 0.0,
) -> Tracker[PlainState]:
    """The tracker of a site and a survey of it; places of access points are of no use to it.

    Raises
    ------
    UsageError : there is no survey. RadioMapError : the survey is of another site.
    """
    survey = needed_survey("chu2009", site, survey)
    c = config or Config()
    radio_map = interpolated_map.fit(survey, sigma=c.kernel_sigma, missing=c.missing, cell=c.cell)
    walls = Barriers(tuple(floor.barrier_index for floor in site.floors), c.wall_penalty)
    motion, plain = StepDisc(r_max=c.r_max), ParticleFilter(ess_ratio=1.0)
    steps = WideningFilter(wider=scaling("r_max"), rounds=c.rounds, filter=plain)
    floors = FloorChange(connectors=ConnectorMotion(site=site), steps=motion, filter=plain, constraint=walls)
    engine = PlainEngine(
        n_floors=len(site.floors),
        prior=prior_estimate(site),
        first=LikelyPlaces(radio_map=radio_map, radius=c.start_radius, most=c.aps, walls=walls),
        told=ToldStart(about=KnownStart(sigma=0.5 * c.start_radius)),
        motion=motion,
        quiet=RandomWalk(c.diffusion),
        observation=MapLikelihood(radio_map=radio_map, most=c.aps),
        constraint=walls,
        filter=plain,
        steps=steps if c.least_radius is None else StepSpeedFilter(filter=steps, least=c.least_radius),
        floor_change=floors if len(site.floors) > 1 else None,
        n_particles=c.n_particles,
        rotation=site.anchor.rotation if site.anchor is not None else 0.0,
    )
    return Tracker(engine=engine, lag=lag)
