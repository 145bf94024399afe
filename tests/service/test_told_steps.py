"""Steps that a phone worked out itself, over the wire: the same estimates as of a recording that has them."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from wayfuse.sensors.recording import Recording
from wayfuse.sensors.records import Step
from wayfuse.service.adapters import ADAPTERS
from wayfuse.service.message import Profile
from wayfuse.service.replay import envelopes
from wayfuse.service.wire import encode
from wayfuse.tracking.tracker import Tracker


def _told(walk: Recording, tracker: Tracker) -> Recording:
    """A walk whose phone kept its motion samples to itself; every fifth step without a length."""
    events = tracker.front_end.run(tracker.front_end.init(), walk, -np.inf, walk.span[1])[1]
    steps = tuple(
        Step(t, math.nan if n % 5 == 0 else length, heading)
        for n, (t, length, heading) in enumerate(
            zip(events.t.tolist(), events.length.tolist(), events.heading.tolist(), strict=True)
        )
    )
    return Recording(name=walk.name, wifi=walk.wifi, steps=steps)


def test_steps_come_back_as_they_were(world: Any, tracker: Tracker) -> None:
    walk = _told(world.walks[0], tracker)
    assert len(walk.steps) > 10
    bodies = [encode(e) for e in envelopes(walk, "phone", "walk", 1.0)]
    messages = [ADAPTERS["own"].read(body, Profile(), 0.0)[0] for body in bodies]
    got = [r for m in messages for part in m.parts for r in part.records if isinstance(r, Step)]
    np.testing.assert_array_equal(np.array(got), np.array(walk.steps))


@pytest.mark.parametrize("heading", ["null", '"north"', "[]"])
def test_a_step_without_a_heading_is_refused(app: Any, heading: str) -> None:
    body = b'{"v": 1, "device": "d", "steps": [[1.0, %s]]}' % heading.encode()
    answer = app.post("/api/v1/in/own", body)
    assert answer.status_code == 400
    assert "steps" in answer.json()["error"]


def test_told_steps_are_tracked_as_in_a_replay(app: Any, world: Any) -> None:
    tracker = next(iter(app.server.worlds.values())).tracker(1)
    walk = _told(world.walks[0], tracker)
    for envelope in envelopes(walk, "stepping phone", "walk", 1.0):
        answer = app.post("/api/v1/in/own", encode(envelope))
        assert answer.status_code == 200, answer.text
    track = answer.json()["accepted"][0]["track"]
    app.settle()
    expected = tracker.run(replace(walk, name=track)).estimates
    features = app.get(f"/api/v1/tracks/{track}/estimates").json()["features"]
    said = [(p["t"], p["x"], p["y"], p["floor"]) for p in (f["properties"] for f in features)]
    assert said == [e[:4] for e in expected]
    assert sum(e.n_steps for e in expected) > 10
