from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from made_up_walks import House, recording

from wayfuse.core.errors import UsageError
from wayfuse.core.frames import GeoAnchor
from wayfuse.evaluation.truth import CommonFrame, Truth, first_radio, truth_of
from wayfuse.sensors.recording import Recording
from wayfuse.sensors.records import BleReading, Range, Waypoint


def truth(**changes: object) -> Truth:
    found = truth_of(recording(**changes))  # type: ignore[arg-type]
    assert found is not None
    return found


times = st.lists(st.integers(0, 10**6).map(lambda ms: ms / 1000), min_size=2, max_size=8, unique=True)


@given(times, st.integers(0, 2**31))
def test_places_are_linear_between_waypoints(at: list[float], seed: int) -> None:
    rng = np.random.default_rng(seed)
    points = [Waypoint(t, *rng.uniform(-50, 50, 2).tolist(), "F1") for t in sorted(at)]
    found = truth_of(recording(waypoints=points))
    assert found is not None
    t = rng.uniform(points[0].t, points[-1].t)
    k = max(i for i, w in enumerate(points[:-1]) if w.t <= t)
    a, b = points[k], points[k + 1]
    share = (t - a.t) / (b.t - a.t)
    expected = (a.x + share * (b.x - a.x), a.y + share * (b.y - a.y))
    np.testing.assert_allclose(found.at(np.array([t]))[0][0], expected, atol=1e-6)


def test_grid_begins_at_the_first_waypoint_and_ends_with_the_last() -> None:
    points = (Waypoint(100.25, 0, 0, "F1"), Waypoint(103.5, 3, 0, "F1"))
    found = truth(waypoints=points, scans=(101.0,))
    np.testing.assert_allclose(found.times("1hz"), [100.25, 101.25, 102.25, 103.25])
    np.testing.assert_allclose(found.times("waypoints"), [100.25, 103.5])
    assert found.start == 101.0


def test_grid_holds_the_last_waypoint_at_epoch_times() -> None:
    start = 1_574_661_471.585  # float spacing here is 0.24 µs
    found = truth(waypoints=(Waypoint(start, 0, 0, "F1"), Waypoint(start + 7.0, 1, 0, "F1")))
    assert len(found.times("1hz")) == 8


def test_unknown_evaluation_times_are_refused() -> None:
    with pytest.raises(UsageError, match="1hz"):
        truth().times("10hz")


def test_floor_is_that_of_the_waypoint_nearer_in_time() -> None:
    points = (Waypoint(0, 0, 0, "F1"), Waypoint(10, 0, 0, "F1"), Waypoint(20, 0, 0, "F2"))
    found = truth(waypoints=points, scans=())
    t = np.array([0.0, 10.0, 14.9, 15.1, 20.0])
    assert found.at(t)[1].tolist() == ["F1", "F1", "F1", "F2", "F2"]
    assert found.in_transit(t).tolist() == [False, False, True, True, False]


def test_floor_of_the_recording_stands_in_for_waypoints_that_name_none() -> None:
    points = (Waypoint(0, 0, 0, ""), Waypoint(10, 0, 0, ""))
    assert truth(waypoints=points, floor="F3").floor.tolist() == ["F3", "F3"]
    assert truth(waypoints=points).floor.tolist() == ["", ""]


def test_a_recording_without_usable_waypoints_has_no_truth() -> None:
    assert truth_of(Recording("a")) is None
    assert truth_of(recording(waypoints=(Waypoint(0, float("nan"), 0, "F1"),))) is None


def test_waypoints_of_one_moment_count_once_and_order_does_not_matter() -> None:
    points = (Waypoint(10, 1, 0, "F1"), Waypoint(0, 0, 0, "F1"), Waypoint(10, 9, 9, "F1"))
    found = truth(waypoints=points)
    assert found.t.tolist() == [0, 10]
    assert found.xy[1].tolist() == [1, 0]


def test_first_radio_prefers_wifi_and_falls_back() -> None:
    assert first_radio(recording(scans=(3.0, 4.0))) == 3.0
    assert first_radio(Recording("a", ranges=(Range(7.0, 1, 2.0),), ble=(BleReading(5.0, 1, -60),))) == 5.0
    assert first_radio(Recording("a")) is None
    assert (
        truth(scans=(30.0, 104.0)).start == 30.0
    )  # scans before the first waypoint count for the age of a track
    lonely = truth(scans=())
    assert not lonely.has_radio
    assert lonely.start == 100.0


def test_waypoints_in_degrees_are_metres_on_a_plane() -> None:
    anchor = GeoAnchor.from_origin(11.11, 49.46)
    places = np.array([(0.0, 0.0), (30.0, 0.0), (30.0, 40.0)])
    nan = float("nan")
    points = [
        Waypoint(10.0 * i, nan, nan, "0", lat, lon) for i, (lon, lat) in enumerate(anchor.to_lonlat(places))
    ]
    plane = truth(waypoints=points)
    assert plane.plane is not None
    np.testing.assert_allclose(np.hypot(*np.diff(plane.xy, axis=0).T), [30.0, 40.0], atol=1e-3)
    turned = GeoAnchor.from_origin(11.1095, 49.4598, rotation=0.3)
    anchored = truth_of(recording(waypoints=points), CommonFrame(House(anchor=turned)))
    assert anchored is not None
    assert anchored.plane is None
    np.testing.assert_allclose(turned.to_lonlat(anchored.xy), anchor.to_lonlat(places), atol=1e-10)


def test_floors_with_their_own_frames_are_shifted_into_one() -> None:
    house = House(offsets=((5.0, -1.0), (0.0, 0.0), (-2.0, 3.0)))
    frame = CommonFrame(house)
    np.testing.assert_allclose(frame.shift(np.array(["B1", "F2", "attic"])), [(5, -1), (-2, 3), (0, 0)])
    found = truth_of(recording(waypoints=(Waypoint(0, 1, 1, "B1"), Waypoint(9, 1, 1, "F2"))), frame)
    assert found is not None
    np.testing.assert_allclose(found.xy, [(6, 0), (-1, 4)])


def test_steps_between_floors() -> None:
    estimate, true = np.array(["B1", "f2", "F1", "F1", "F2"]), np.array(["F2", "F2", "B1", "", "roof"])
    with_site = CommonFrame(House()).steps(estimate, true)
    np.testing.assert_array_equal(with_site, [2, 0, 1, np.nan, 1])
    np.testing.assert_array_equal(CommonFrame().steps(estimate, true), [1, 0, 1, np.nan, 1])


@pytest.mark.real_data
def test_truth_of_a_real_walk(ms_indoor: Path) -> None:
    from wayfuse.formats.reading import read

    paths = sorted(ms_indoor.rglob("*.txt"))[:3]
    for path in paths:
        walk = read(path)
        found = truth_of(walk)
        assert found is not None
        assert set(found.floor.tolist()) == {walk.floor}
        assert found.start <= found.t[-1]
        speed = np.hypot(*np.diff(found.xy, axis=0).T) / np.diff(found.t)
        assert np.all(speed < 4.0)  # m/s: a walker
