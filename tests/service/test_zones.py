"""Rooms and geofences: entered and left once, not at every step over a threshold."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from service_running import App, started

from wayfuse.core.errors import ConfigError
from wayfuse.service.checkpoint import pack, unpack
from wayfuse.service.replay import envelopes
from wayfuse.service.wire import encode
from wayfuse.service.zones import Zone, ZoneConfig, Zones, ZoneState, read_geofences, rooms_of
from wayfuse.tracking.estimate import Estimate, State

SQUARE = np.array([[0.0, 0.0], [10.0, 0.0], [10.0, 10.0], [0.0, 10.0], [0.0, 0.0]])
HOLE = 4.0 + 0.2 * SQUARE[::-1]
EAST = np.array([10.0, 0.0])
ZONES = Zones(
    [Zone("a", "A", 0, (SQUARE,)), Zone("b", "B", 0, (SQUARE + EAST, HOLE + EAST), True)],
    ZoneConfig(enter_s=2.0, leave_s=3.0, margin_m=1.5),
)


def _at(t: float, x: float, y: float = 2.0, floor: int = 0, state: State = State.TRACKING) -> Estimate:
    return Estimate(t, x, y, floor, 1.0, 0.0, 1.0, 1.0, 2.0, state)


def _told(estimates: list[Estimate], zones: Zones = ZONES) -> list[tuple[float, str, bool]]:
    _, crossings = zones.step(ZoneState(), estimates)
    return [(c.t, c.zone, c.is_enter) for c in crossings]


def test_a_walk_through_two_rooms() -> None:
    walk = [_at(float(t), t - 0.5) for t in range(-5, 30)]
    assert _told(walk) == [(3.0, "a", True), (13.0, "b", True), (16.0, "a", False), (26.0, "b", False)]


def test_who_stands_on_a_threshold_enters_once_and_does_not_flicker() -> None:
    draw = np.random.default_rng(5)
    walk = [_at(float(t), x) for t, x in enumerate(draw.normal(9.5, 0.6, 200).tolist())]
    told = _told(walk)
    assert told.count((told[0][0], "a", True)) == 1
    assert [event for event in told if event[1] == "a"] == told[:1]
    assert np.count_nonzero(np.diff([p.x > 10.0 for p in walk])) > 20


def test_a_short_visit_is_none_and_another_floor_is_outside() -> None:
    assert _told([_at(0.0, -3.0), _at(1.0, 1.0), _at(2.0, -3.0), _at(3.0, 1.0), _at(4.0, -3.0)]) == []
    up = [_at(float(t), 5.0, floor=int(t > 5)) for t in range(12)]
    assert _told(up) == [(2.0, "a", True), (9.0, "a", False)]


def test_a_hole_is_outside() -> None:
    assert _told([_at(float(t), 15.0, 5.0) for t in range(5)]) == []


@pytest.mark.parametrize("bad", [{"state": State.LOST}, {"state": State.INITIALISING}, {"x": float("nan")}])
def test_who_is_lost_enters_and_leaves_nothing(bad: dict[str, Any]) -> None:
    inside = [_at(float(t), 5.0) for t in range(4)]
    gone = [_at(**({"t": 4.0 + t, "x": 99.0} | bad)) for t in range(9)]
    assert _told(inside + gone) == [(2.0, "a", True)]


def test_a_state_goes_on_after_it_was_written_and_estimates_again_are_no_news() -> None:
    walk = [_at(float(t), t - 0.5) for t in range(-5, 30)]
    state, told = ZoneState(), []
    for n in range(len(walk)):
        state, some = ZONES.step(unpack(pack(state)), walk[max(0, n - 3) : n + 1])
        told += some
    assert told == ZONES.step(ZoneState(), walk)[1]
    assert ZONES.names(state) == ()
    assert ZONES.names(ZoneState(inside=("b", "gone"))) == ("B",)


def test_a_zone_that_is_no_longer_there_is_left_without_a_word() -> None:
    state, _ = ZONES.step(ZoneState(), [_at(float(t), 5.0) for t in range(4)])
    assert Zones([]).step(state, [_at(9.0, 5.0)]) == (ZoneState(9.0), [])


def test_of_rooms_of_one_name_the_nearest_on_the_floor_is_meant() -> None:
    same = [Zone(f"{floor}/{n}", "Toilet", floor, (SQUARE + n * EAST,)) for floor in (0, 1) for n in (0, 5)]
    zones = Zones([*same, Zone("b", "Bar", 0, (SQUARE,))])
    assert zones.called(("Toilet", "Bar", "gone"), _at(0.0, 2.0)) == ["0/0", "b"]
    assert zones.called(("Toilet",), _at(0.0, 49.0)) == ["0/5"]
    assert zones.called(("Toilet",), _at(0.0, 2.0, floor=1)) == ["1/0"]
    assert zones.called(("Bar",), _at(0.0, 2.0, floor=1)) == ["b"]  # just gone upstairs


# --- geofences ----------------------------------------------------------------------------------------------


def _fence(world: Any, xy: np.ndarray, **properties: Any) -> dict[str, Any]:
    floor = world.site.floors[0]
    ring = floor.anchor.to_lonlat(xy).tolist()
    said = {"name": "West", "level": floor.name, "site": world.site.name} | properties
    return {"type": "Feature", "properties": said, "geometry": {"type": "Polygon", "coordinates": [ring]}}


def _file(path: Path, *features: Any) -> Path:
    path.write_text(json.dumps({"type": "FeatureCollection", "features": list(features)}), encoding="utf-8")
    return path


def test_geofences_are_read_in_metres(world: Any, tmp_path: Path) -> None:
    sites = {world.site.name: world.site}
    found = read_geofences(_file(tmp_path / "f.json", _fence(world, SQUARE)), sites)[world.site.name]
    np.testing.assert_allclose(found[0].rings[0], SQUARE, atol=1e-6)
    assert found[0].is_fence
    assert len(Zones(rooms_of(world.site))) == sum(bool(u.name) for f in world.site.floors for u in f.units)


@pytest.mark.parametrize("bad", [{"level": "none"}, {"site": "elsewhere"}, {"name": None, "level": None}])
def test_geofences_of_nowhere_are_refused(world: Any, tmp_path: Path, bad: dict[str, Any]) -> None:
    path = _file(tmp_path / "f.json", _fence(world, SQUARE, **bad))
    with pytest.raises(ConfigError, match="feature 0 is no geofence"):
        read_geofences(path, {world.site.name: world.site})


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"features": 3}', '{"features": [3]}'])
def test_files_that_are_no_geofences(world: Any, tmp_path: Path, text: str) -> None:
    (tmp_path / "f.json").write_text(text, encoding="utf-8")
    with pytest.raises(ConfigError):
        read_geofences(tmp_path / "f.json", {world.site.name: world.site})


def _zone_events(app: App) -> list[dict[str, Any]]:
    headers = app.headers("read") | {"Last-Event-ID": "0"}
    text = app.client.get("/api/v1/events?once=true", headers=headers).text
    blocks = [block.splitlines() for block in text.strip().split("\n\n")]
    return [json.loads(b[-1].removeprefix("data: ")) for b in blocks if b[0] == "event: zone"]


def test_a_phone_enters_a_geofence_and_a_crash_changes_nothing_of_it(world: Any, tmp_path: Path) -> None:
    floor = world.site.floors[0]
    whole = SQUARE * (floor.width / 10.0, floor.height / 10.0)
    fences = [_fence(world, whole, level=f.name, name=f"all of {f.name}") for f in world.site.floors]
    settings = {"geofences": str(_file(tmp_path / "f.json", *fences)), "checkpoint_s": 3600.0}
    with started(world, tmp_path / "a", **settings) as app:
        for envelope in list(envelopes(world.walks[0], "p", "w", 2.0))[:12]:
            assert app.post("/api/v1/in/own", encode(envelope)).status_code == 200
        app.settle()
        events = _zone_events(app)
        fence = [e for e in events if e["kind"] == "geofence"]
        assert [e["event"] for e in fence][:1] == ["enter"]
        feature = app.get("/api/v1/positions").json()["features"][0]["properties"]
        drawn = app.get("/api/v1/zones").json()["features"]
        fenced = {f["properties"]["id"]: f for f in drawn if f["properties"]["kind"] == "geofence"}
        assert len(drawn) - len(fenced) == len(rooms_of(world.site))
        told = json.loads((tmp_path / "f.json").read_text())["features"]
        np.testing.assert_allclose(
            fenced["fence/0"]["geometry"]["coordinates"], told[0]["geometry"]["coordinates"], atol=2e-8
        )
        inside = app.get("/api/v1/zones/inside").json()["inside"]
        named = {f["properties"]["id"]: f["properties"]["name"] for f in drawn}
        assert {named[zone] for zone in inside} == set(feature["zones"])
        assert {track for tracks in inside.values() for track in tracks} <= {feature["track"]}
        assert fence[0]["name"] in feature["zones"] or len(fence) > 1
        shutil.copytree(tmp_path / "a", tmp_path / "b")  # what a crash leaves
    with started(world, tmp_path / "b", **settings) as again:
        assert _zone_events(again) == events
