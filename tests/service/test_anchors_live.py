"""Anchors that measure: targets are tracked by what anchors overhear, without a radio map (li2015, Section 6)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from service_running import App, started

from csi_room import Room, make_room
from wayfuse.core.errors import RadioMapError, UsageError
from wayfuse.radio.ap_places import write_ap_places
from wayfuse.sensors.recording import Recording
from wayfuse.sensors.records import CsiFrame, bssid_text
from wayfuse.service.server import SiteFiles
from wayfuse.service.site_anchors import read_site_anchors
from wayfuse.service.wire import encode
from wayfuse.service.world import NO_MAP
from wayfuse.tracking.estimate import State


@pytest.fixture(scope="module")
def room() -> Room:
    return make_room()


@pytest.fixture(scope="module")
def anchored(room: Room, tmp_path_factory: pytest.TempPathFactory) -> Iterator[App]:
    folder = tmp_path_factory.mktemp("anchored")
    files = SiteFiles(room.save(folder / "SITE"))
    with started(None, folder / "data", sites=[files], particles=300) as app:
        yield app


def bodies(recording: Recording, every: float = 0.5) -> Iterator[bytes]:
    """Envelopes of the anchors, one each per stretch of time, the first with the target's own samples."""
    first, last = recording.span
    for start in np.arange(first, last, every).tolist():
        frames = [f for f in recording.csi if start <= f.t < start + every]
        for k, anchor in enumerate(sorted({f.anchor for f in frames})):
            mine = [_frame(f) for f in frames if f.anchor == anchor]
            if k == 0:
                mine[0]["imu"] = _imu(recording, start, start + every)
            yield encode({"v": 1, "anchor": bssid_text(anchor), "t": int(start * 1e9), "frames": mine})


def _frame(f: CsiFrame) -> dict[str, Any]:
    iq = np.stack([f.csi[:, 0].real, f.csi[:, 0].imag], axis=-1).astype(np.float64).tolist()
    csi = {"iq": iq, "agc": float(f.agc), "noise": float(f.noise)}
    return {"target": "tag 7", "rssi": float(f.rss), "seq": None, "t": round(f.t * 1e9), "csi": csi}


def _imu(recording: Recording, start: float, stop: float) -> list[list[float]]:
    a, w = recording.acceleration, recording.rotation_rate
    rows = np.flatnonzero((a.t >= start) & (a.t < stop))
    turn = np.column_stack([np.interp(a.t[rows], w.t, w.values[:, k]) for k in range(3)])
    table = np.column_stack([np.round(a.t[rows] * 1e9), a.values[rows], turn])
    return [list(map(float, row)) for row in table]


def test_a_tag_is_tracked_by_the_frames_that_anchors_overhear(anchored: App, room: Room) -> None:
    made = room.walks[0]
    track = ""
    for body in bodies(made.recording):
        answer = anchored.post("/api/v1/in/anchors", body)
        assert answer.status_code == 200, answer.text
        track = answer.json()["accepted"][0]["track"]
    anchored.settle()
    features = anchored.get(f"/api/v1/tracks/{track}/estimates").json()["features"]
    said = [f["properties"] for f in features]
    known = [p for p in said if p["state"] != State.INITIALISING.value and p["t"] > said[0]["t"] + 5.0]
    assert len(known) > 20
    t = np.array([p["t"] for p in known])
    off = np.hypot(*(np.array([(p["x"], p["y"]) for p in known]) - made.truth.at(t)[:, :2]).T)
    assert off.mean() < 3.0
    assert np.mean(off < 6.0) > 0.9
    assert sum(p["why"]["steps"] for p in said) > 20


def test_a_phone_that_measures_ranges_itself_needs_no_radio_map_either(anchored: App, room: Room) -> None:
    x, y = 9.0, 6.0
    for n in range(12):
        ranges = [
            [float(n), bssid_text(int(a)), float(np.hypot(ax - x, ay - y))]
            for a, ax, ay in zip(room.places.bssid, room.places.x, room.places.y, strict=True)
        ]
        answer = anchored.post("/api/v1/in/own", {"v": 1, "device": "p", "id": n, "ranges": ranges})
        assert answer.status_code == 200, answer.text
    anchored.settle()
    track = answer.json()["accepted"][0]["track"]
    last = anchored.get(f"/api/v1/tracks/{track}/estimates").json()["features"][-1]["properties"]
    assert np.hypot(last["x"] - x, last["y"] - y) < 1.5


def test_the_tracker_without_a_map_is_the_one_by_ranges(anchored: App) -> None:
    (world,) = anchored.server.worlds.values()
    tracker = world.tracker(NO_MAP)
    assert tracker.engine.uses_ranges
    assert not tracker.engine.uses_scans
    assert tracker.channel is not None


def test_files_of_anchors_are_checked_when_the_server_starts(room: Room, tmp_path: Path) -> None:
    site = room.site
    assert read_site_anchors(tmp_path, site) is None
    room.model.save(tmp_path / "channel.npz")
    with pytest.raises(UsageError, match="without the places"):
        read_site_anchors(tmp_path, site)
    write_ap_places(tmp_path / "access_points.csv", room.places, site.floor_names)
    found = read_site_anchors(tmp_path, site)
    assert found is not None
    assert found.channel is not None
    replace(room.model, site="elsewhere").save(tmp_path / "channel.npz")
    with pytest.raises(RadioMapError, match="channel model of site elsewhere"):
        read_site_anchors(tmp_path, site)
    (tmp_path / "channel.npz").unlink()
    without = read_site_anchors(tmp_path, site)
    assert without is not None
    assert without.channel is None
    guessed = replace(room.places, is_estimated=True, sigma=np.ones(len(room.places)))
    write_ap_places(tmp_path / "access_points.csv", guessed, site.floor_names)
    with pytest.raises(UsageError, match="measured"):
        read_site_anchors(tmp_path, site)
