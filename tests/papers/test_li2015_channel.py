"""The whole chain of li2015 on the simulated room of four anchors: channel state, packets, ranges, steps, places."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from csi_room import Room, make_room
from wayfuse.core.errors import RadioMapError
from wayfuse.core.types import Array
from wayfuse.presets.li2015 import Config
from wayfuse.presets.li2015_tracker import build
from wayfuse.radio.csi_survey import channel_ranges, fit_anchors
from wayfuse.radio.packet_groups import PacketGrouper
from wayfuse.sensors.recording import Recording
from wayfuse.simulator.experiment import SimulatedWalk
from wayfuse.tracking.estimate import State


@pytest.fixture(scope="module")
def room() -> Room:
    return make_room()


GROUPER = {"wait": 0.2, "window": 0.125}  # four packets a second


def track_errors(room: Room, made: SimulatedWalk, recording: Recording) -> Array:
    tracker = build(room.site, None, places=room.places, config=Config(n_particles=500))
    said = [e for e in tracker.run(recording, 0).estimates if e.state is not State.INITIALISING and e.t > 3.0]
    truth = made.truth.at(np.array([e.t for e in said]))
    return np.hypot(*(np.array([(e.x, e.y) for e in said]) - truth[:, :2]).T)


def test_channel_state_and_steps_are_tracked(room: Room) -> None:
    models = fit_anchors(*room.surveyed())
    assert len(models) == 4
    assert {len(m) for m in models.values()} == {3}  # antennas
    both, alone, sensors_off = [], [], []
    for made in room.walks:
        frames = made.recording.csi
        grouper = PacketGrouper(anchors=tuple(models), **GROUPER)
        ranges, counts = channel_ranges(frames, models, grouper)
        assert len(ranges) == len(frames)
        assert counts.late + counts.repeated + counts.foreign == 0
        assert counts.groups == pytest.approx(len(frames) / 4, abs=3)
        recording = replace(made.recording, ranges=ranges, csi=(), wifi=())
        both.append(track_errors(room, made, recording).mean())
        alone.append(track_errors(room, made, Recording(recording.name, ranges=ranges)).mean())
        middle = made.truth.at(recording.acceleration.t)[:, :2]
        sensors_off.append(np.hypot(*(middle - room.places.xy.mean(axis=0)).T).mean())
    assert np.mean(both) < 2.5
    assert np.mean(both) < np.mean(alone)
    assert np.mean(both) < 0.5 * np.mean(sensors_off)  # than to say the middle of the room


def test_ranges_are_not_drawn_to_the_mean_distance(room: Room) -> None:
    frames, distances = room.surveyed()
    models = fit_anchors(frames, distances)
    ranges, _ = channel_ranges(frames, models, PacketGrouper(anchors=tuple(models), wait=0.002, window=0.001))
    row = {(f.anchor, f.t): d for f, d in zip(frames, distances, strict=True)}
    pairs = np.array([(r.distance, row[r.anchor, r.t]) for r in ranges])
    near, far = pairs[:, 1] < 4.0, pairs[:, 1] > 18.0
    assert abs(np.median(pairs[near, 0] - pairs[near, 1])) < 1.0
    assert abs(np.median(pairs[far, 0] - pairs[far, 1])) < 3.0


def test_an_anchor_that_was_not_surveyed_far_and_near_is_named(room: Room) -> None:
    frames, _ = room.surveyed()
    with pytest.raises(RadioMapError, match="survey it near and far"):
        fit_anchors(frames, np.full(len(frames), 5.5))
    with pytest.raises(RadioMapError, match="0 surveyed distances"):
        fit_anchors(frames[:3], np.array([1.0, 2.0, 3.0]))
