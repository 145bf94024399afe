"""``fused``: Wi-Fi fingerprints, steps, stairs, lifts and floor plans in one particle filter; and it without parts.

One set of numbers for all buildings, chosen on two together: three development folds of ms-indoor site1 (h == 1, 2, 3;
survey = all other walks; a mall) and ipin2023-track3 (leave one repetition out; a museum). `wayfuse results` prints
what each part is worth there. Source papers: he2014 (steps and radio map in a particle filter), chu2009 (floor plan,
stairs and lifts), li2015 (step length per particle).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from wayfuse.core.errors import ConfigError, UsageError
from wayfuse.filters.particle_filter import Constraint, ParticleFilter
from wayfuse.filters.resampling import resampler
from wayfuse.inertial.vertical_front_end import VerticalConfig, VerticalFrontEnd
from wayfuse.maps.site import Site
from wayfuse.maps.walkable import Walkable
from wayfuse.models.constraint.barriers import Barriers
from wayfuse.models.constraint.walkable_mask import WalkableMask
from wayfuse.models.initial import Anywhere, FirstCloud, KnownStart
from wayfuse.models.motion.connectors import ConnectorMotion
from wayfuse.models.motion.pdr import PdrMotion
from wayfuse.models.motion.random_walk import RandomWalk
from wayfuse.models.observation.anchored_ranges import AnchoredRanges
from wayfuse.models.observation.coverage import SurveyDistance
from wayfuse.models.observation.fingerprint import FingerprintLikelihood
from wayfuse.models.observation.neighbouring import NeighbouringFloors
from wayfuse.presets.given import check_floors
from wayfuse.radio.ap_places import ApPlaces
from wayfuse.radio.device_offset import DeviceOffset
from wayfuse.radio.novelty import Novelty
from wayfuse.radio.range_line import LineGrid
from wayfuse.radio.sparse_knn import SparseKnn
from wayfuse.radio.survey import Survey
from wayfuse.tracking.dead_reckoning import Start
from wayfuse.tracking.elsewhere import Elsewhere
from wayfuse.tracking.estimate import Estimate, State
from wayfuse.tracking.floor_change import FloorChange
from wayfuse.tracking.particle_engine import ParticleEngine, ParticleState, Recovery
from wayfuse.tracking.radio_parts import Radio
from wayfuse.tracking.range_parts import Ranging
from wayfuse.tracking.summary import Summary
from wayfuse.tracking.tracker import Tracker

__all__ = [
    "BAND_2_4",
    "BAND_5",
    "CALIBRATED",
    "Config",
    "build",
    "build_from_ranges",
    "build_from_start",
    "prior_estimate",
]

BAND_2_4 = ((2400, 2500),)  # MHz
BAND_5 = ((4900, 5925),)


# radius = offset + scale * quantile of the cloud, by quantile regression of the error at 1 Hz on the three folds
# (ms-indoor); the offsets go in proportion to the accuracy of the survey, which was 2.5 m there
CALIBRATED_AT = 2.5
CALIBRATED = Summary(offset_68=0.84, scale_68=0.89, offset_95=1.73, scale_95=1.06)


@dataclass(frozen=True, slots=True, kw_only=True)
class Config:
    """Parameters of ``fused``."""

    n_particles: int = 1000
    resampling: str = "systematic"
    k: int = 40  # neighbours of a scan
    temperature: float = 0.02  # of the neighbours' weights, in signal distance
    bands: tuple[tuple[int, int], ...] = ()  # MHz; empty = both
    # kernel at a neighbour: this many times the survey's own accuracy, within limits (m); `radio.survey_accuracy`
    kernel_width: float = 1.5
    kernel_limits: tuple[float, float] = (1.2, 6.0)
    kernel_unknown: float = 4.0  # m, of a survey that does not know its accuracy
    background: float = 0.03
    exponent: float = 0.41  # tempering: errors of successive scans are much alike
    coverage_gain: float = 1.5  # nats
    length_sigma: float = 0.15  # relative, per step
    heading_sigma: float = 0.06  # rad, per step
    bias_sigma: float = 0.03  # rad, per step
    scale_sigma: float = 0.006  # per step
    first_bias_sigma: float = 0.3  # rad; rotation vector against truth: 0.17 between walks
    first_scale_sigma: float = 0.08  # per-walk mean step against the model
    injection: float = 0.04  # share of particles per scan that the cloud does not agree with
    injection_least: float = 0.002  # per scan that it does
    penalty: float = 1.2  # nats per blocked move
    diffusion: float = 4.0  # m per root second and axis, where motion sensors are silent
    quiet_exponent: float = 2.0  # tempering there; both as the random walk tuned for itself
    moving_gain: float = 0.3  # of a scan's log-likelihood on stairs and in lifts
    # ranges: chosen on loop 1 of wifi-rtt and on simulated warehouses with little and with much bias
    range_sigma: float = 1.0  # m, about the phone's line; what records state is the scatter of a burst
    range_late: float = 0.5  # share of ranges that walls and bodies delay beyond it
    range_lateness: float = 3.0  # m
    range_gain: float = 0.3  # tempering: errors of successive ranges of an anchor are much alike
    range_spacing: float = 0.5  # s between ranges of an anchor; closer ones say less
    range_near: float = 4.0  # m; ranges beyond say less, in proportion
    range_slab: float = 0.3  # how often anchors a floor away are heard, of those on the same floor
    range_floor_rate: float = 0.002  # 1/s, how often somebody changes floors unnoticed
    range_jump_rate: float = 0.001  # 1/s, how often somebody is anywhere else, unnoticed
    range_creep: float = 0.5  # m per root second and axis, between moments without a step
    range_lines: LineGrid = field(default_factory=LineGrid)  # how the phone measures; estimated
    map_constraint: Literal["walkable", "barriers", "none"] = "walkable"
    use_steps: bool = True
    device_offset: bool = True  # estimate how the phone's levels differ from the survey's
    novelty: Novelty | None = field(default_factory=Novelty)  # scans away from the survey count less
    use_vertical: bool = True  # stairs, lifts and escalators change floors
    use_pressure: bool = True
    summary: Summary = field(default_factory=lambda: CALIBRATED)


def build(
    site: Site,
    survey: Survey,
    config: Config | None = None,
    *,
    start: Start | None = None,
    places: ApPlaces | None = None,
    lag: float = 0.0,
) -> Tracker[ParticleState]:
    """The tracker of a site and a survey of it; a start that is known helps until the scans do.

    places : of anchors that ranges are measured to; None, or estimated ones, = ranges are not used.

    Raises
    ------
    RadioMapError : the survey is of another site.
    """
    c = config or Config()
    check_floors(site, survey)
    observation = FingerprintLikelihood(
        sigma=_kernel(survey, c),
        background=c.background,
        exponent=c.exponent,
        coverage=SurveyDistance.build(survey) if c.coverage_gain > 0.0 else None,
        coverage_gain=c.coverage_gain,
        neighbouring=NeighbouringFloors.build(site, survey),
    )
    first = FirstCloud(
        observation=observation,
        walkable=_walkable(site, c),
        bias_sigma=c.first_bias_sigma,
        scale_sigma=c.first_scale_sigma,
    )
    radio = Radio(
        radio_map=SparseKnn(survey, k=c.k, temperature=c.temperature, bands=c.bands),
        observation=observation,
        first=first,
        device=DeviceOffset() if c.device_offset else None,
        novelty=c.novelty,
        quiet_gain=c.quiet_exponent / c.exponent,
        moving_gain=c.moving_gain,
    )
    config = replace(c, summary=_scaled(c.summary, survey))
    return _tracker(site, config, radio, start, lag, None if places is None else _ranging(site, places, c))


def build_from_start(
    site: Site, start: Start, config: Config | None = None, *, lag: float = 0.0
) -> Tracker[ParticleState]:
    """The tracker without Wi-Fi: steps, stairs and lifts from a start that is told, held to the floor plan."""
    return _tracker(site, config or Config(), None, start, lag)


def build_from_ranges(
    site: Site, places: ApPlaces, config: Config | None = None, *, lag: float = 0.0
) -> Tracker[ParticleState]:
    """The tracker without a radio map: steps and ranges to anchors, from anywhere in the building.

    Raises
    ------
    UsageError : the places were estimated from a survey.
    """
    c = config or Config()
    ranging = _ranging(site, places, c)
    if ranging is None:
        raise UsageError(
            "ranges need measured places", where="--access-points", remedy="measure where the anchors hang"
        )
    return _tracker(site, c, None, None, lag, ranging)


def _ranging(site: Site, places: ApPlaces, c: Config) -> Ranging | None:
    if places.is_estimated:  # to some metres: worse than the ranges
        return None
    ranges = AnchoredRanges.build(
        site,
        places,
        sigma=c.range_sigma,
        late=c.range_late,
        lateness=c.range_lateness,
        gain=c.range_gain,
        near=c.range_near,
        slab=c.range_slab,
    )
    return Ranging(
        ranges=ranges,
        lines=c.range_lines,
        creep=RandomWalk(c.range_creep) if c.range_creep > 0.0 else None,
        usual_spacing=c.range_spacing,
    )


def _tracker(
    site: Site,
    c: Config,
    radio: Radio | None,
    start: Start | None,
    lag: float,
    ranging: Ranging | None = None,
) -> Tracker[ParticleState]:
    motion = PdrMotion(
        length_sigma=c.length_sigma,
        heading_sigma=c.heading_sigma,
        bias_sigma=c.bias_sigma,
        scale_sigma=c.scale_sigma,
    )
    constraint, particle_filter = _constraint(site, c), ParticleFilter(resampler(c.resampling))
    floor_change = None
    if c.use_vertical and len(site.floors) > 1:
        floor_change = FloorChange(
            connectors=ConnectorMotion(site=site), steps=motion, filter=particle_filter, constraint=constraint
        )
    known = (
        KnownStart(
            x=start.x,
            y=start.y,
            floor=start.floor,
            bias_sigma=c.first_bias_sigma,
            scale_sigma=c.first_scale_sigma,
        )
        if start is not None
        else None
    )
    engine = ParticleEngine(
        n_floors=len(site.floors),
        radio=radio,
        ranging=ranging,
        elsewhere=_elsewhere(site, c) if ranging is not None and radio is None else None,
        start=known,
        prior=prior_estimate(site),
        motion=motion,
        diffusion=RandomWalk(c.diffusion),
        constraint=constraint,
        filter=particle_filter,
        recovery=Recovery(injection=c.injection, injection_least=c.injection_least),
        summary=c.summary,
        floor_change=floor_change,
        walkable=_walkable(site, c),
        n_particles=c.n_particles,
        uses_steps=c.use_steps,
        rotation=site.anchor.rotation if site.anchor is not None else 0.0,
    )
    vertical = VerticalFrontEnd(VerticalConfig(use_pressure=c.use_pressure))
    return Tracker(engine=engine, vertical=vertical, lag=lag)


def _elsewhere(site: Site, c: Config) -> Elsewhere:
    walkable = tuple(floor.walkable for floor in site.floors)
    anywhere = Anywhere(walkable=walkable, bias_sigma=c.first_bias_sigma, scale_sigma=c.first_scale_sigma)
    return Elsewhere(anywhere=anywhere, floor_rate=c.range_floor_rate, jump_rate=c.range_jump_rate)


def _walkable(site: Site, c: Config) -> tuple[Walkable, ...]:
    return tuple(floor.walkable for floor in site.floors) if c.map_constraint != "none" else ()


def _scaled(summary: Summary, survey: Survey) -> Summary:
    if not math.isfinite(survey.accuracy):
        return summary
    share = float(np.clip(survey.accuracy / CALIBRATED_AT, 0.3, 2.0))
    return replace(summary, offset_68=share * summary.offset_68, offset_95=share * summary.offset_95)


def _kernel(survey: Survey, c: Config) -> float:
    if not c.kernel_width > 0.0:
        raise ConfigError(f"kernel_width must be positive, got {c.kernel_width}", where="Config")
    if not math.isfinite(survey.accuracy):
        return c.kernel_unknown
    return float(np.clip(c.kernel_width * survey.accuracy, *c.kernel_limits))


def _constraint(site: Site, c: Config) -> Constraint | None:
    if c.map_constraint == "walkable":
        return WalkableMask(tuple(f.walkable for f in site.floors), c.penalty)
    if c.map_constraint == "barriers":
        return Barriers(tuple(f.barrier_index for f in site.floors), c.penalty)
    return None


def prior_estimate(site: Site) -> Estimate:
    """What is known before the first scan: somewhere on a floor, most likely the one with most walkable space.

    The radii hold 68 and 95 % of the walkable places of that floor.
    """
    floor = int(np.argmax([f.walkable.area for f in site.floors]))
    places = site.floors[floor].walkable.centres()
    if not len(places):
        places = np.array([[site.floors[floor].width / 2, site.floors[floor].height / 2]])
    x, y = places.mean(axis=0)
    cov = np.cov(places.T) if len(places) > 1 else np.zeros((2, 2))
    r68, r95 = np.quantile(np.hypot(places[:, 0] - x, places[:, 1] - y), (0.68, 0.95))
    return Estimate(
        0.0,
        float(x),
        float(y),
        floor,
        float(cov[0, 0]),
        float(cov[0, 1]),
        float(cov[1, 1]),
        float(r68),
        float(r95),
        State.INITIALISING,
    )
