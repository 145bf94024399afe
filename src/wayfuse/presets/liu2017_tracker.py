"""liu2017 as a tracker of real recordings: sequences of access points and steps; no survey where places are given."""

from __future__ import annotations

import math

from wayfuse.maps.site import Site
from wayfuse.models.initial import KnownStart
from wayfuse.models.motion.proportional_noise import ProportionalNoise
from wayfuse.models.motion.random_walk import RandomWalk
from wayfuse.models.observation.placed_aps import SequenceLikelihood
from wayfuse.models.placed_start import SequenceStart, ToldStart
from wayfuse.presets.fused import prior_estimate
from wayfuse.presets.given import known_places
from wayfuse.presets.liu2017 import Config
from wayfuse.radio.ap_hearing import DEFAULT_BANDS, known_levels
from wayfuse.radio.ap_places import ApPlaces
from wayfuse.radio.survey import Survey
from wayfuse.tracking.plain_engine import PlainEngine, PlainState
from wayfuse.tracking.tracker import Tracker

__all__ = ["build"]

_PERIOD = 2.0  # s, between the scans of the paper, for which `walk_sigma` is


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

    Without steps it is Wi-Fi alone: the same filter on a random walk.

    Raises
    ------
    UsageError : neither places nor a survey.
    """
    c = config or Config()
    places = known_places(site, survey, places)
    levels = known_levels(survey, places, DEFAULT_BANDS)
    observation = SequenceLikelihood(
        places=places,
        extents=tuple((0.0, 0.0, floor.width, floor.height) for floor in site.floors),
        cell=c.cell,
        k=c.k,
        precision=c.precision,
        most=c.most,
        power=levels.power if levels is not None and c.levelled else None,
    )
    about = KnownStart(sigma=c.start_sigma, bias_sigma=c.heading_sigma, scale_sigma=0.0)
    engine = PlainEngine(
        n_floors=len(site.floors),
        prior=prior_estimate(site),
        first=SequenceStart(observation=observation, bias_sigma=c.heading_sigma),
        told=ToldStart(about=about),
        motion=ProportionalNoise(
            step_length=c.step_length, distance_sigma=c.distance_sigma, turn_sigma=c.turn_sigma
        ),
        quiet=RandomWalk(c.walk_sigma / math.sqrt(_PERIOD)),
        observation=observation,
        always_resample=True,  # Sec. III-A
        n_particles=c.n_particles,
        rotation=site.anchor.rotation if site.anchor is not None else 0.0,
        uses_steps=use_steps,
    )
    return Tracker(engine=engine, lag=lag)
