"""karlsson2015 as a tracker of real recordings: path loss of both bands, steps, start heading unknown."""

from __future__ import annotations

from wayfuse.maps.site import Site
from wayfuse.models.initial import KnownStart
from wayfuse.models.motion.random_walk import RandomWalk
from wayfuse.models.motion.step_count import StepByStep, StepCountMotion
from wayfuse.models.observation.placed_aps import PathLossLikelihood
from wayfuse.models.placed_start import AnywhereOnFloor, ToldStart
from wayfuse.presets.fused import prior_estimate
from wayfuse.presets.given import check_floors, known_places
from wayfuse.presets.karlsson2015 import Config
from wayfuse.radio.ap_hearing import known_levels
from wayfuse.radio.ap_places import ApPlaces
from wayfuse.radio.survey import Survey
from wayfuse.tracking.plain_engine import PlainEngine, PlainState
from wayfuse.tracking.tracker import Tracker

__all__ = ["build"]


def build(
    site: Site,
    survey: Survey | None,
    *,
    places: ApPlaces | None = None,
    config: Config | None = None,
    lag: float = 0.0,
    use_steps: bool = True,
) -> Tracker[PlainState]:
    """The tracker of a site by the places of its access points; estimated from the survey where none are given.

    Where there is a survey the path loss of each band and the power of each access point are fitted to it; else the
    path loss is that of the configuration, powers those that came with the places or else the configuration's. The
    heading at the start is always unknown; the start is, unless told, anywhere on the floor of the first scan.

    Raises
    ------
    UsageError : neither places nor a survey.
    """
    c = config or Config()
    if survey is not None:
        check_floors(site, survey)
    places = known_places(site, survey, places)
    levels = known_levels(survey, places, c.bands)
    walkable = tuple(floor.walkable for floor in site.floors)
    engine = PlainEngine(
        n_floors=len(site.floors),
        prior=prior_estimate(site),
        first=AnywhereOnFloor(places=places, walkable=walkable),
        told=ToldStart(about=KnownStart(sigma=c.start_sigma, scale_sigma=0.0), has_compass=False),
        motion=StepByStep(
            StepCountMotion(
                step_length=c.step_length, length_sigma=c.length_sigma, heading_sigma=c.heading_sigma
            )
        ),
        quiet=RandomWalk(c.walk_sigma),
        observation=PathLossLikelihood(
            places=places,
            bands=c.bands if levels is None else levels.bands,
            n_floors=len(site.floors),
            most=c.most,
            offset_sigma=c.offset_sigma,
            power=None if levels is None else levels.power,
        ),
        filter=c.filter,
        always_resample=False,
        n_particles=c.n_particles,
        rotation=site.anchor.rotation if site.anchor is not None else 0.0,
        uses_steps=use_steps,
    )
    return Tracker(engine=engine, lag=lag)
