"""A surveyor's recording on a site: which waypoints count, and what is said about the others."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from wayfuse.core.errors import MapError
from wayfuse.core.frames import GeoAnchor
from wayfuse.maps.build import build_floor
from wayfuse.maps.site import Polygon, Site
from wayfuse.models.survey_walk import place_of, survey_walk
from wayfuse.sensors.recording import Recording
from wayfuse.sensors.records import Waypoint, WifiScan

ANCHOR = GeoAnchor.from_origin(10.0, 50.0, 0.7)
HALL = Polygon(np.array([(0.0, 0.0), (30.0, 0.0), (30.0, 20.0), (0.0, 20.0), (0.0, 0.0)]))
NAN = float("nan")


@pytest.fixture(scope="module")
def site() -> Site:
    return Site("hall", (build_floor("0", 0, [HALL], anchor=ANCHOR), build_floor("1", 1, [HALL])))


def scan(t: float) -> WifiScan:
    return WifiScan(t, np.uint64([1, 2, 3]), np.float32([-50, -60, -70]), np.int32([0, 0, 0]), np.full(3, t))


def recording(*waypoints: Waypoint, wifi: bool = True) -> Recording:
    return Recording("walk", waypoints=waypoints, wifi=(scan(1.0),) if wifi else (), path="walk.txt")


def test_metres_are_taken_as_they_are_and_degrees_by_the_anchor(site: Site) -> None:
    assert place_of(site, Waypoint(0.0, 3.0, 4.0, "1")) == (3.0, 4.0, 1)
    lon, lat = ANCHOR.to_lonlat((7.0, 8.0))
    x, y, floor = place_of(site, Waypoint(0.0, NAN, NAN, "0", lat=lat, lon=lon))
    assert (x, y, floor) == (pytest.approx(7.0, abs=1e-6), pytest.approx(8.0, abs=1e-6), 0)


def test_degrees_on_a_floor_without_anchor_and_unknown_floors_are_refused(site: Site) -> None:
    with pytest.raises(MapError, match="floor 1 of site hall has no anchor"):
        place_of(site, Waypoint(0.0, NAN, NAN, "1", lat=50.0, lon=10.0))
    with pytest.raises(MapError, match="has no floor 'B7'"):
        place_of(site, Waypoint(0.0, 1.0, 1.0, "B7"))


def test_waypoints_outside_the_map_are_left_out_and_said(site: Site) -> None:
    inside = [Waypoint(0.0, 1.0, 1.0, "0"), Waypoint(9.0, 29.0, 19.0, "0")]
    walk, notes = survey_walk(
        site,
        recording(inside[0], Waypoint(3.0, 500.0, 1.0, "0"), Waypoint(4.0, NAN, NAN, "0"), inside[1]),
    )
    assert walk is not None
    np.testing.assert_array_equal(walk.t, [0.0, 9.0])
    np.testing.assert_array_equal(walk.xy, [[1.0, 1.0], [29.0, 19.0]])
    assert notes == ["walk.txt: 2 of 4 waypoints lie outside the map: left out"]
    walk, notes = survey_walk(site, recording(inside[0], Waypoint(3.0, -1e4, 1.0, "0")))
    assert walk is None
    assert notes[-1] == "walk.txt: fewer than two waypoints on the site: nothing surveyed"


def test_what_cannot_survey_says_why(site: Site) -> None:
    a, b = Waypoint(0.0, 1.0, 1.0, "0"), Waypoint(9.0, 2.0, 2.0, "0")
    for given, why in (
        (recording(a, b, wifi=False), "no Wi-Fi scan"),
        (recording(a, a._replace(x=2.0)), "all waypoints at one time"),
        (recording(), "fewer than two waypoints"),
        (recording(a, b._replace(floor="")), "no floor ''"),
    ):
        walk, notes = survey_walk(site, given)
        assert walk is None
        assert why in notes[-1]
        assert notes[-1].startswith("walk.txt: ")
    walk, notes = survey_walk(site, replace(recording(a, b), path=""))
    assert walk is not None
    assert notes == []
