"""Plans as GeoJSON, and what a survey collects."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from wayfuse.maps.site import Site
from wayfuse.service.web.plan import floor_features, floor_frame
from wayfuse.service.web.survey_build import tapped_walk
from wayfuse.service.web.survey_store import Push, SurveyStore, TappedWalk, Waypoint
from wayfuse.service.wire import Ap, Scan


@pytest.fixture(scope="module")
def site(house: Any) -> Site:
    return Site.load(house.folder / "SITE")


def _place(frame: dict[str, Any], x: float, y: float) -> Any:
    """As the browser does it."""
    return np.asarray(frame["origin"]) + np.asarray(frame["matrix"]) @ (x, y)


def test_every_wall_outline_and_unit_is_in_the_plan_where_it_is(site: Site) -> None:
    for index, floor in enumerate(site.floors):
        found = floor_features(site, index)["features"]
        of = {
            k: [f for f in found if f["properties"]["kind"] == k]
            for k in ("outline", "unit", "wall", "landing")
        }
        frame = floor_frame(site, index)
        assert len(of["outline"]) == len(floor.outline)
        assert [f["properties"]["id"] for f in of["unit"]] == [u.id for u in floor.units]
        for feature, unit in zip(of["unit"], floor.units, strict=True):
            drawn = np.array(feature["geometry"]["coordinates"][0])
            expected = np.array([_place(frame, *xy) for xy in unit.polygon.exterior])
            np.testing.assert_allclose(drawn, expected, atol=1e-8)
        lines = of["wall"][0]["geometry"]["coordinates"]
        assert len(lines) == len(floor.walls)
        np.testing.assert_allclose(lines[3][1], _place(frame, *floor.walls[3, 2:]), atol=1e-8)
        landings = [c for c in site.connectors if c.landing(index) is not None]
        assert [f["properties"]["id"] for f in of["landing"]] == [c.id for c in landings]


def test_a_floor_without_a_place_on_earth_is_drawn_in_its_own_shape(site: Site) -> None:
    floors = tuple(replace(floor, anchor=None) for floor in site.floors)
    frame = floor_frame(Site(site.name, floors), 0)
    assert not frame["is_on_earth"]
    east, north = _place(frame, 10.0, 0.0), _place(frame, 0.0, 10.0)
    assert east[0] == pytest.approx(10.0 / 111_320.0, rel=1e-3)
    assert north[1] == pytest.approx(10.0 / 110_574.0, rel=1e-3)


def test_a_tapped_walk_is_put_on_the_phones_clock() -> None:
    ahead = 3600.25  # the phone's clock before the server's
    scans = [Scan(1000.0 + ahead + k, [Ap("02:00:00:00:00:01", -50.0 - k, 2412.0)]) for k in range(8)]
    delays = (0.9, 0.05, 0.4)  # s on the way
    pushes = [
        Push(s.t - ahead + delay, s.t, [s])
        for s, delay in zip(scans, (*delays, *delays, *delays[:2]), strict=True)
    ]
    waypoints = [Waypoint(1001.0, 1, 2.0, 3.0), Waypoint(1005.0, 1, 8.0, 3.0), Waypoint(1005.0, 1, 8.0, 3.0)]
    walk = tapped_walk("w", TappedWalk("0" * 16, waypoints), pushes)
    np.testing.assert_allclose(walk.t, [1001.0 + ahead, 1005.0 + ahead], atol=0.051)
    assert walk.xy.tolist() == [[2.0, 3.0], [8.0, 3.0]]
    assert [s.t for s in walk.scans] == [s.t for s in scans]
    assert walk.scans[3].rssi.tolist() == [-53.0]
    assert tapped_walk("w", TappedWalk("0" * 16, waypoints), []).scans == ()


def test_a_survey_store_keeps_what_it_is_given(tmp_path: Any) -> None:
    store = SurveyStore(tmp_path / "s")
    push = Push(10.0, 9.5, [Scan(9.0, [Ap("02:00:00:00:00:01", -50.0)])])
    store.add_push("ab" * 8, push)
    walk = TappedWalk("ab" * 8, [Waypoint(1.0, 0, 2.0, 3.0), Waypoint(2.0, 0, 2.0, 3.0)])
    identifier = store.add_walk(walk)
    recording, path = store.add_recording("../../etc/pass wd.txt", b"content")
    assert path.parent == tmp_path / "s" / "recordings"
    with (tmp_path / "s" / "scans" / f"{'ab' * 8}.jsonl").open("ab") as out:
        out.write(b'{"arrived": 11, "new')  # cut off by a crash
    again = SurveyStore(tmp_path / "s")
    assert list(again.pushes("ab" * 8)) == [push]
    assert [(p.device, p.heard, p.scans) for p in again.phones()] == [("ab" * 8, 10.0, 1)]
    assert again.walks() == {identifier: walk}
    assert again.recordings() == {recording: path}
    assert again.remove(identifier)
    assert again.remove(recording)
    assert not again.remove(recording)
    assert not again.remove("../scans")
    assert (again.walks(), again.recordings()) == ({}, {})
