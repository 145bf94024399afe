"""Channel state of anchors in the tracker: moments become ranges, live as in a replay."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from csi_room import Room, make_room
from wayfuse.core.errors import MapError
from wayfuse.core.types import Array
from wayfuse.models.channel_survey import anchor_distances
from wayfuse.presets import fused
from wayfuse.presets.li2015_tracker import build
from wayfuse.radio.channel_ranging import ChannelRanging
from wayfuse.sensors.quality import Verdict
from wayfuse.sensors.recording import Recording
from wayfuse.sensors.records import Waypoint
from wayfuse.simulator.experiment import SimulatedWalk
from wayfuse.tracking.dead_reckoning import Start
from wayfuse.tracking.estimate import State
from wayfuse.tracking.tracker import Tracker


@pytest.fixture(scope="module")
def room() -> Room:
    return make_room()


def trackers(room: Room) -> dict[str, Tracker[Any]]:
    made = {
        "li2015": build(room.site, None, places=room.places),
        "fused-ranges": fused.build_from_ranges(room.site, room.places, fused.Config(n_particles=500)),
    }
    channel = ChannelRanging(model=room.model)
    return {name: replace(tracker, channel=channel) for name, tracker in made.items()}


def errors(made: SimulatedWalk, estimates: list[Any]) -> Array:
    said = [e for e in estimates if e.state is not State.INITIALISING and e.t > estimates[0].t + 5.0]
    truth = made.truth.at(np.array([e.t for e in said]))
    return np.hypot(*(np.array([(e.x, e.y) for e in said]) - truth[:, :2]).T)


@pytest.mark.parametrize("name", ["li2015", "fused-ranges"])
def test_a_target_is_followed_by_channel_state_and_its_steps(room: Room, name: str) -> None:
    tracker = trackers(room)[name]
    for made in room.walks:
        heard = replace(made.recording, wifi=(), ranges=())
        middle = made.truth.at(heard.acceleration.t)[:, :2] - room.places.xy.mean(axis=0)
        off = errors(made, tracker.run(heard, 0).estimates)
        assert off.mean() < 2.5
        assert off.mean() < 0.5 * np.hypot(*middle.T).mean()  # of saying the middle of the room


@pytest.mark.parametrize("name", ["li2015", "fused-ranges"])
def test_one_record_after_the_other_gives_the_bits_of_the_whole(room: Room, name: str) -> None:
    tracker, heard = trackers(room)[name], replace(room.walks[0].recording, wifi=(), ranges=(), waypoints=())
    state, said, verdicts = tracker.init(heard.name, 0), [], Counter[Verdict]()
    for record in heard.records():
        state, out, verdict = tracker.step(state, record)
        said += out
        verdicts[verdict] += 1
    assert state.channel is not None  # the last moment is not over
    after, out = tracker.flush(state, state.now)
    assert after.channel is None
    assert said + out == tracker.run(heard, 0).estimates
    assert set(verdicts) == {Verdict.USED}
    middle = heard.acceleration.t[len(heard.acceleration) // 2]
    halves = [_part(heard, -np.inf, middle), _part(heard, middle, np.inf)]
    first = tracker.extend(tracker.init(heard.name, 0), halves[0])
    second = tracker.extend(first.state, halves[1])
    assert first.estimates + second.estimates == said


def _part(recording: Recording, start: float, stop: float) -> Recording:
    series = {
        name: getattr(recording, name).__class__(part.t, part.values)
        for name in ("acceleration", "rotation_rate", "magnetic_field", "pressure", "orientation")
        for part in [getattr(recording, name).between(start, stop)]
    }
    return replace(recording, **series, csi=tuple(f for f in recording.csi if start < f.t <= stop))


def test_without_a_model_channel_state_is_not_looked_at(room: Room) -> None:
    tracker = trackers(room)["li2015"]
    heard = replace(room.walks[0].recording, wifi=(), ranges=())
    blind = replace(tracker, channel=None)
    batch = blind.extend(blind.init("x", 0), heard)
    assert batch.others[Verdict.IGNORED] == len(heard.csi)
    assert all(e.state is State.INITIALISING for e in batch.estimates)
    no_ranges = fused.build_from_start(room.site, Start(5.0, 5.0, 0))
    steps_alone = replace(no_ranges, channel=ChannelRanging(model=room.model))
    assert steps_alone.run(heard, 0).estimates == no_ranges.run(heard, 0).estimates


def test_distances_of_a_survey_are_those_of_the_walk(room: Room) -> None:
    surveyed = room.survey[0]
    recording = surveyed.recording
    distances = anchor_distances(room.site, recording, room.places)
    t = np.array([frame.t for frame in recording.csi])
    rows = room.places.rows(np.array([frame.anchor for frame in recording.csi], np.uint64))
    true = np.hypot(*(surveyed.truth.at(t)[:, :2] - room.places.xy[rows]).T)
    known = np.isfinite(distances)
    assert known.mean() > 0.8
    assert np.median(np.abs(distances - true)[known]) < 0.5
    high = replace(room.places, height=np.full(4, 4.2))
    np.testing.assert_allclose(
        anchor_distances(room.site, recording, high)[known], np.hypot(distances[known], 3.0)
    )
    assert not np.isfinite(anchor_distances(room.site, replace(recording, waypoints=()), room.places)).any()
    elsewhere = replace(room.places, bssid=room.places.bssid + np.uint64(1000))
    assert not np.isfinite(anchor_distances(room.site, recording, elsewhere)).any()
    first = recording.waypoints[0]
    odd = (Waypoint(first.t, first.x, first.y, floor="attic"), *recording.waypoints[1:])
    with pytest.raises(MapError, match="attic"):
        anchor_distances(room.site, replace(recording, waypoints=odd), room.places)
