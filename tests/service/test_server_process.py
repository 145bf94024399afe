"""The server as its users meet it: in a process of its own, over HTTP."""

from __future__ import annotations

import csv
import io
from dataclasses import replace
from pathlib import Path
from typing import Any

from service_running import Running, running

from wayfuse.presets.methods import build_method
from wayfuse.service.replay import envelopes
from wayfuse.service.wire import encode
from wayfuse.tracking.estimate import Estimate, State


def _post(server: Running, walk: Any, device: str = "phone", every: float = 1.0) -> tuple[str, int]:
    """Post a walk as a phone would; its track and the last entry of the log."""
    with server.client() as client:
        for envelope in envelopes(walk, device, walk.name, every):
            answer = client.post("/api/v1/in/own", content=encode(envelope))
            assert answer.status_code == 200, answer.text
            accepted = answer.json()["accepted"][0]
    return accepted["track"], accepted["seq"]


def _estimates(server: Running, track: str) -> list[tuple[float, ...]]:
    """Time, place and uncertainty of a track, to the bit."""
    with server.client() as client:
        answer = client.get(f"/api/v1/tracks/{track}/export?format=csv")
    assert answer.status_code == 200, answer.text
    rows = list(csv.DictReader(io.StringIO(answer.text)))
    names = ("t", "x", "y", "floor", "cov_xx", "cov_xy", "cov_yy", "radius_68", "radius_95")
    return [
        (*(float(r[n]) for n in names), r["state"], int(r["steps"]), int(r["access_points"])) for r in rows
    ]


def _said(e: Estimate) -> tuple[float, ...]:
    return (*e[:9], e.state.value, e.n_steps, e.n_aps)


def test_a_walk_over_http_gives_the_replay_to_the_bit(world: Any, tmp_path: Path) -> None:
    tracker = build_method("fused", world.site, world.survey)
    with running(world.folder, tmp_path / "data", "--radio-map", world.folder / "map.npz") as server:
        posted = [_post(server, walk) for walk in world.walks[:1]]
        server.wait_applied(posted[-1][1])
        for walk, (track, _) in zip(world.walks, posted, strict=False):
            expected = tracker.run(replace(walk, name=track)).estimates
            assert _estimates(server, track) == [_said(e) for e in expected]
            with server.client() as client:
                last = client.get(f"/api/v1/tracks/{track}/position").json()
            p = last["properties"]
            assert (p["x"], p["y"], p["floor"]) == expected[-1][1:4]
            assert p["radius_m_95"] == expected[-1].r95
            assert p["state"] == State.TRACKING.value
            assert p["is_ended"]
