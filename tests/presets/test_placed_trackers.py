"""liu2017 and karlsson2015 as trackers: a simulated world is tracked, and what they lack is told."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from wayfuse.core.errors import UsageError
from wayfuse.models.survey_walk import place_of
from wayfuse.presets import karlsson2015, karlsson2015_tracker, liu2017, liu2017_tracker
from wayfuse.presets.methods import begun_at
from wayfuse.radio.ap_estimation import estimate_places
from wayfuse.radio.ap_places import ApPlaces
from wayfuse.tracking.dead_reckoning import Start
from wayfuse.tracking.tracker import Track

BUILDS: dict[str, Any] = {
    "liu2017": (liu2017_tracker.build, liu2017.Config(n_particles=400)),
    "karlsson2015": (karlsson2015_tracker.build, karlsson2015.Config(n_particles=400)),
}
both = pytest.mark.parametrize("name", list(BUILDS))


def errors(world: Any, track: Track) -> np.ndarray:
    truth = world.truth[track.name]
    t = np.array([e.t for e in track.estimates])
    inside = (t >= truth.t[0]) & (t <= truth.t[-1])
    found = np.array([(e.x, e.y) for e in track.estimates])[inside]
    true = np.column_stack([np.interp(t[inside], truth.t, truth.xy[:, k]) for k in (0, 1)])
    return np.hypot(*(found - true).T)


@both
def test_simulated_walks_are_followed_and_equal_seeds_give_equal_bits(world: Any, name: str) -> None:
    build, config = BUILDS[name]
    tracker = build(world.site, world.survey, config=config)
    found = [tracker.run(walk, 1) for walk in world.walks]
    every = np.concatenate([errors(world, track)[5:] for track in found])
    assert len(every) > 60
    assert np.median(every) < 12.0  # of 70 m x 45 m; somewhere in the building is 20 m and more
    assert tracker.run(world.walks[0], 1).estimates == found[0].estimates
    assert tracker.run(world.walks[0], 2).estimates != found[0].estimates


@both
def test_places_alone_do_without_a_survey(world: Any, name: str) -> None:
    build, config = BUILDS[name]
    places = estimate_places(world.survey)
    found = build(world.site, None, places=places, config=config).run(world.walks[0])
    assert len(found.estimates) > 10
    assert np.isfinite([(e.x, e.y, e.r95) for e in found.estimates]).all()


@both
def test_a_told_start_is_where_the_track_begins(world: Any, name: str) -> None:
    build, config = BUILDS[name]
    walk = world.walks[0]
    start = Start(*place_of(world.site, walk.waypoints[0]))
    tracker = build(world.site, world.survey, config=config)
    first = begun_at(tracker, start).run(walk).estimates[0]
    assert np.hypot(first.x - start.x, first.y - start.y) < 6.0
    assert first.floor == start.floor
    far = begun_at(tracker, Start(1.0, 1.0, 0)).run(walk).estimates[0]
    assert np.hypot(far.x - 1.0, far.y - 1.0) < np.hypot(first.x - 1.0, first.y - 1.0)


@both
def test_a_lag_and_a_filter_without_steps_work_too(world: Any, name: str) -> None:
    build, config = BUILDS[name]
    lagged = build(world.site, world.survey, config=config, lag=3.0).run(world.walks[0]).estimates
    assert np.all(np.diff([e.t for e in lagged]) >= 0.0)
    still = build(world.site, world.survey, config=config, use_steps=False).run(world.walks[0]).estimates
    assert all(e.n_steps == 0 for e in still)


@both
def test_what_is_missing_is_told(world: Any, name: str) -> None:
    build, _ = BUILDS[name]
    with pytest.raises(UsageError, match="--radio-map to estimate"):
        build(world.site, None)
    nan = np.full(1, np.nan)
    elsewhere = ApPlaces(np.ones(1, np.uint64), np.ones(1), np.ones(1), np.full(1, 9, np.int32), nan)
    with pytest.raises(UsageError, match="on floor 9"):
        build(world.site, None, places=elsewhere)
