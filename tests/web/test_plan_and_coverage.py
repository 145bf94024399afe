"""Plans as GeoJSON and pictures of a survey, by arithmetic."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from wayfuse.maps.site import Site
from wayfuse.radio.survey import Survey
from wayfuse.service.web.coverage import coverage, heard_at, level_of, next_places
from wayfuse.service.web.plan import floor_features, floor_frame
from wayfuse.service.web.survey_build import held_out_by_room, tapped_walk
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


def test_coverage_is_the_distance_to_the_nearest_fingerprint(site: Site) -> None:
    floor = site.floors[0]
    places = floor.walkable.centres()[[0, 500, 900]]
    grid = coverage(floor, places)
    ny, nx = grid.values.shape
    n = 0
    for j in range(0, ny, 3):
        for i in range(0, nx, 3):
            x, y = (i + 0.5) * grid.cell, (j + 0.5) * grid.cell
            if floor.walkable.contains(x, y):
                assert grid.values[j, i] == pytest.approx(np.hypot(*(places - (x, y)).T).min())
                n += 1
            else:
                assert np.isnan(grid.values[j, i])
    assert n > 100
    assert np.isinf(coverage(floor, np.empty((0, 2))).values[~np.isnan(grid.values)]).all()


def test_the_next_places_are_far_from_fingerprints_and_from_each_other(site: Site) -> None:
    floor = site.floors[0]
    places = floor.walkable.centres()[:1]
    found = next_places(floor, places)
    xy = np.array([p[:2] for p in found])
    assert len(found) == 5
    assert all(floor.walkable.contains(xy[:, 0], xy[:, 1]))
    assert found[0][2] == pytest.approx(np.nanmax(coverage(floor, places).values))
    between = np.hypot(*(xy[:, None] - np.concatenate([places, xy])).transpose(2, 0, 1))
    assert between[between > 0].min() >= 5.0
    assert next_places(floor, floor.walkable.centres()) == []
    assert np.isinf(next_places(floor, np.empty((0, 2)))[0][2])


def test_the_level_of_an_access_point_is_that_of_the_fingerprints(site: Site) -> None:
    floor = site.floors[0]
    places = floor.walkable.centres()[::40]
    levels = -40.0 - places[:, 0]
    levels[-1] = np.nan
    survey = Survey.from_dense(
        np.column_stack([np.full(len(places), -50.0), levels]),
        places,
        np.zeros(len(places), np.int32),
        site.floor_names,
    )
    xy, heard = heard_at(survey, 1, 0)
    np.testing.assert_allclose(heard, levels, rtol=1e-6)
    grid = level_of(floor, xy, heard)
    spots = [
        (int(y // grid.cell), int(x // grid.cell), level)
        for (x, y), level in zip(places, levels, strict=True)
    ]
    inner = [(grid.values[j, i], level) for j, i, level in spots[10:-10] if np.isfinite(grid.values[j, i])]
    assert len(inner) > 10
    assert np.median([abs(a - b) for a, b in inner]) < 2.0
    far = coverage(floor, xy).values > 5.0
    assert np.isnan(grid.values[far]).all()
    assert np.isnan(level_of(floor, xy, np.full(len(xy), np.nan)).values).all()


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


def test_held_out_errors_are_told_by_room(site: Site, house: Any) -> None:
    from wayfuse.radio.survey_accuracy import held_out
    from wayfuse.radio.walk_survey import load

    survey = load(house.folder / "map.npz").survey
    rooms = held_out_by_room(site, survey)
    assert sum(room.n for room in rooms) == len(held_out(survey, 1000).rows) > 100
    assert rooms == sorted(rooms, key=lambda room: -room.n)
    for room in rooms:
        assert 0.0 <= room.right_floor <= 1.0
        assert room.median is None or room.p90 is None or room.median <= room.p90
    names = {(site.floors[i].name, u.name) for i in range(3) for u in site.floors[i].units}
    assert {(r.level, r.name) for r in rooms if r.name} <= names


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
