"""li2015 as a tracker of real recordings: ranges to anchors with exponents 1/d, constant velocity or steps.

Where the paper weighs particles by a measured velocity (Eq. 7), a step of the project's front end moves them: the
engine has no duration of a step to divide by. Between steps, and for whom none is seen, constant velocity (Eq. 4).
"""

from __future__ import annotations

from wayfuse.core.errors import UsageError
from wayfuse.filters.particle_filter import ParticleFilter
from wayfuse.maps.site import Site
from wayfuse.models.motion.course_and_speed import CourseAndSpeed, Held, StepsOrVelocity
from wayfuse.models.observation.anchored_ranges import AnchoredRanges
from wayfuse.models.observation.corrected_ranges import CorrectedRanges
from wayfuse.models.range_start import RangeStart, RestingStart
from wayfuse.presets.fused import prior_estimate
from wayfuse.presets.li2015 import Config
from wayfuse.radio.ap_places import ApPlaces
from wayfuse.radio.survey import Survey
from wayfuse.tracking.plain_engine import PlainEngine, PlainState
from wayfuse.tracking.tracker import Tracker

__all__ = ["build"]


def build(
    site: Site,
    survey: Survey | None,  # noqa: ARG001
    *,
    places: ApPlaces | None = None,
    config: Config | None = None,
    lag: float = 0.0,
) -> Tracker[PlainState]:
    """The tracker of a site by the places of its anchors; a survey makes no difference.

    The track begins at the weighted centroid of the anchors first heard, unless a start is told. It stays on the
    floor it began on.

    Raises
    ------
    UsageError : no place of an anchor.
    """
    c = config or Config()
    if places is None or not len(places):
        raise UsageError(
            "li2015 needs the places of the anchors that ranges are to",
            where="--access-points",
            remedy="give a CSV of bssid,x,y,floor,height",
        )
    ranging = AnchoredRanges.build(site, places, sigma=c.range_sigma, exponents=c.exponents)  # Eq. 10-12
    engine = PlainEngine(
        n_floors=len(site.floors),
        prior=prior_estimate(site),
        first=RangeStart(
            places=places,
            line=c.range_line,
            sigma=c.centroid_sigma,
            speed_sigma=c.start_velocity_sigma,
        ),
        told=RestingStart(sigma=c.start_sigma, speed_sigma=c.start_velocity_sigma),
        motion=StepsOrVelocity(c.step_sigma),
        standing=CourseAndSpeed(acceleration_sigma=c.acceleration_sigma),  # Eq. 4
        quiet=Held(),
        ranging=CorrectedRanges(ranging, c.range_line),
        filter=ParticleFilter(ess_ratio=c.ess_ratio),
        always_resample=False,
        n_particles=c.n_particles,
        rotation=site.anchor.rotation if site.anchor is not None else 0.0,
    )
    return Tracker(engine=engine, lag=lag)
