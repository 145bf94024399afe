"""chu2009 and he2014 on recordings: simulated walks, one real walk, and what they refuse."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from wayfuse.core.errors import UsageError
from wayfuse.presets import chu2009_tracker, he2014_tracker
from wayfuse.presets.methods import begun_at
from wayfuse.tracking.dead_reckoning import Start
from wayfuse.tracking.estimate import State

BUILDS = {"chu2009": chu2009_tracker.build, "he2014": he2014_tracker.build}


@pytest.fixture(scope="module", params=BUILDS)
def name(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.fixture(scope="module")
def tracker(name: str, world: Any) -> Any:
    return BUILDS[name](world.site, world.survey)


def errors(world: Any, tracker: Any, recording: Any) -> tuple[np.ndarray, list[Any]]:
    said = [e for e in tracker.run(recording, 0).estimates if e.state is State.TRACKING]
    at = world.truth[recording.name].at(np.array([e.t for e in said]))
    return np.hypot(*(np.array([(e.x, e.y) for e in said]) - at).T), said


def test_it_follows_simulated_walks(world: Any, tracker: Any) -> None:
    off = np.concatenate([errors(world, tracker, recording)[0] for recording in world.walks])
    assert len(off) > 50
    assert off.mean() < 9.0
    assert np.mean(off < 15.0) > 0.85


def test_one_step_after_the_other_gives_the_bits_of_the_whole(world: Any, tracker: Any) -> None:
    recording = world.walks[0]
    state, said = tracker.init(recording.name, 0), []
    for record in recording.records():
        state, estimates, _ = tracker.step(state, record)
        said += estimates
    assert said + tracker.flush(state, recording.span[1])[1] == tracker.run(recording, 0).estimates


def test_a_start_that_is_told_is_where_the_track_begins(world: Any, tracker: Any) -> None:
    recording = world.walks[1]
    x, y = world.truth[recording.name].at(np.array([recording.span[0]]))[0]
    said = begun_at(tracker, Start(float(x), float(y), 0)).run(recording, 0).estimates
    assert np.hypot(said[0].x - x, said[0].y - y) < 1.0
    assert said[0].floor == 0


def test_without_a_survey_it_says_what_is_missing(world: Any, name: str) -> None:
    with pytest.raises(UsageError, match=f"{name} goes by fingerprints.*--radio-map"):
        BUILDS[name](world.site, None)


def test_the_speed_filter_is_an_option(world: Any) -> None:
    config = chu2009_tracker.Config(least_radius=10.0)
    tracker = chu2009_tracker.build(world.site, world.survey, config=config)
    assert errors(world, tracker, world.walks[0])[0].mean() < 12.0


@pytest.mark.real_data
@pytest.mark.slow
def test_they_follow_a_real_walk(data_root: Path, read_log: Any) -> None:
    from wayfuse.evaluation.results_repetitions import gather, key_of
    from wayfuse.models.survey_walk import place_of

    logs = data_root / "ipin2023-track3" / "logs"
    if not logs.is_dir():
        pytest.skip(
            f"REAL DATA ABSENT: no folder {logs}; fetch with `wayfuse datasets fetch ipin2023-track3`"
        )
    repetitions = gather(logs, lambda _, paths, __: map(read_log, paths))
    number, site = repetitions.numbers[0], repetitions.site
    of_it = [r for r in repetitions.recordings if key_of(r.name).repetition == number]
    walk = next(r for r in of_it if not key_of(r.name).changes_floors)
    for build in BUILDS.values():
        said = build(site, repetitions.survey(number)).run(walk, 0).estimates
        t = np.array([e.t for e in said])
        off = []
        for waypoint in walk.waypoints[1:]:
            x, y, _ = place_of(site, waypoint)
            e = said[int(np.searchsorted(t, waypoint.t, side="right")) - 1]
            off.append(np.hypot(e.x - x, e.y - y))
        assert len(off) > 8
        assert np.mean(off) < 12.0
