"""he2014 as a tracker of real recordings: Gaussian-process radio map, k-NN start, steps, a disc for who stands."""

from __future__ import annotations

from dataclasses import dataclass

from wayfuse.maps.site import Site
from wayfuse.models.initial import KnownStart
from wayfuse.models.motion.adaptive import AdaptiveMotion, StandingDisc
from wayfuse.models.motion.random_walk import RandomWalk
from wayfuse.models.observation.mapped import MapLikelihood
from wayfuse.models.placed_start import ToldStart
from wayfuse.models.scan_start import NearestPlaces
from wayfuse.presets.fused import prior_estimate
from wayfuse.presets.given import needed_survey
from wayfuse.radio import gaussian_process, knn
from wayfuse.radio.ap_places import ApPlaces
from wayfuse.radio.ap_selection import most_heard
from wayfuse.radio.survey import Survey
from wayfuse.tracking.plain_engine import PlainEngine, PlainState
from wayfuse.tracking.tracker import Tracker

__all__ = ["Config", "build"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Config:
    """Parameters; those the paper does not print are marked."""

    n_particles: int = 1000  # not printed
    k: int = 3  # neighbours of the start, Sec. II; number not printed
    radius: float = 1.0  # m, disc of a standing user, Sec. II-B
    length_sigma: float = 0.1  # m, Eq. 4; not printed
    heading_sigma: float = 0.1  # rad, Eq. 5; not printed
    n_aps: int = 4000  # access points that may have a field, those heard at most places; the paper has 4
    aps: float = 4.0  # a scan counts for no more access points than the paper's had
    max_points: int = 500  # places of a floor that the process is fitted to
    step: float = 1.0  # m, grid of the field; wider where a floor would need more nodes
    max_nodes: int = 4000  # of a floor
    start_sigma: float = 1.0  # m, of a start that is told
    diffusion: float = 0.5  # m per root second and axis, without motion sensors: the disc once a second


def build(
    site: Site,
    survey: Survey | None,
    *,
    places: ApPlaces | None = None,  # noqa: ARG001
    config: Config | None = None,
    lag: float = 0.0,
) -> Tracker[PlainState]:
    """The tracker of a site and a survey of it; places of access points are of no use to it.

    It knows one floor: the track stays on that of its start.

    Raises
    ------
    UsageError : there is no survey. RadioMapError : the survey is of another site.
    """
    survey = needed_survey("he2014", site, survey)
    c = config or Config()
    survey = most_heard(survey, c.n_aps)
    field = gaussian_process.fit(survey, step=c.step, max_points=c.max_points, max_nodes=c.max_nodes)
    engine = PlainEngine(
        n_floors=len(site.floors),
        prior=prior_estimate(site),
        first=NearestPlaces(radio_map=knn.fit(survey, k=c.k)),
        told=ToldStart(about=KnownStart(sigma=c.start_sigma)),
        motion=AdaptiveMotion(radius=c.radius, length_sigma=c.length_sigma, heading_sigma=c.heading_sigma),
        standing=StandingDisc(radius=c.radius),
        quiet=RandomWalk(c.diffusion),
        observation=MapLikelihood(radio_map=field, most=c.aps),
        n_particles=c.n_particles,
        rotation=site.anchor.rotation if site.anchor is not None else 0.0,
    )
    return Tracker(engine=engine, lag=lag)
