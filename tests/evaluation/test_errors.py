from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from made_up_walks import House, recording, track

from wayfuse.core.errors import UsageError
from wayfuse.core.frames import GeoAnchor
from wayfuse.evaluation.errors import Scores, last_at_or_before, score, summarise
from wayfuse.evaluation.estimates_file import EstimatesFile
from wayfuse.radio.survey import Survey
from wayfuse.sensors.records import Waypoint

NAN = float("nan")


def only(scores: Scores, at: str = "1hz") -> np.ndarray:
    return scores.methods[0].points[at].used().error


def test_errors_by_hand() -> None:
    # Truth walks along x at 1 m/s from t = 100; the first scan is at 101.5, so 102 counts first.
    found = score([track([101.5, 104.0], [(1.0, 0.0), (4.0, 3.0)])], [recording()])
    points = found.methods[0].points["1hz"].used()
    assert points.t.tolist() == [102, 103, 104, 105, 106, 107, 108, 109, 110]
    expected = [1.0, 2.0, 3.0, *(float(np.hypot(k, 3.0)) for k in range(1, 7))]
    np.testing.assert_allclose(points.error, expected)
    waypoints = found.methods[0].points["waypoints"]
    assert waypoints.used().t.tolist() == [110]  # the other one is before the first scan
    assert waypoints.used("all").t.tolist() == [100, 110]
    assert waypoints.used("all").error[0] == 1.0  # filled back with the first estimate
    assert points.since_start[0] == 0.5


tracks = st.integers(0, 2**32 - 1)


@settings(max_examples=60)
@given(tracks)
def test_errors_equal_brute_force(seed: int) -> None:
    rng = np.random.default_rng(seed)
    t_way = np.sort(rng.choice(np.arange(100, 160), size=rng.integers(2, 6), replace=False)).astype(float)
    xy_way = rng.uniform(-20, 20, (len(t_way), 2))
    t_est = np.unique(np.round(rng.uniform(95, 165, rng.integers(1, 30)), 3))
    xy_est = rng.uniform(-20, 20, (len(t_est), 2))
    names = rng.choice(["B1", "F1", "F2"], len(t_est)).tolist()
    scan = float(rng.uniform(95, 130))
    points = [Waypoint(t, x, y, "F1") for t, (x, y) in zip(t_way.tolist(), xy_way.tolist(), strict=True)]
    if scan > t_way[-1]:
        return
    found = score([track(t_est, xy_est, names)], [recording(waypoints=points, scans=(scan,))], House())
    got = found.methods[0].points["1hz"]
    online = []
    t = t_way[0]
    while t <= t_way[-1]:
        earlier = [i for i in range(len(t_est)) if t_est[i] <= t]
        if t >= scan and earlier:
            i = earlier[-1]
            true = [float(np.interp(t, t_way, xy_way[:, k])) for k in (0, 1)]
            error = float(np.hypot(xy_est[i, 0] - true[0], xy_est[i, 1] - true[1]))
            online.append((t, error, error + 15.0 * (names[i] != "F1")))
        t += 1.0
    used = got.used()
    table = np.array(online).reshape(-1, 3)
    np.testing.assert_allclose(np.stack([used.t, used.error, used.combined], axis=1), table, atol=1e-9)
    if len(table):
        summary = summarise(used)
        assert summary.mean == pytest.approx(table[:, 1].mean())
        assert summary.p90 == pytest.approx(np.percentile(table[:, 1], 90))
        assert summary.ipin == pytest.approx(np.percentile(table[:, 2], 75))
        assert summary.floor_accuracy == pytest.approx(np.mean(table[:, 1] == table[:, 2]))


@settings(max_examples=40)
@given(tracks)
def test_a_later_row_never_counts(seed: int) -> None:
    rng = np.random.default_rng(seed)
    t = np.unique(np.round(rng.uniform(100, 110, 20), 3))
    xy = rng.normal(size=(len(t), 2))
    cut = float(rng.uniform(102, 109))
    other = np.where((t > cut)[:, None], xy + 100.0, xy)
    a, b = (score([track(t, p)], [recording()]).methods[0].points["1hz"] for p in (xy, other))
    before = a.t <= cut
    np.testing.assert_array_equal(a.error[before & ~a.missing], b.error[before & ~b.missing])


@given(st.lists(st.floats(0, 100), max_size=12), st.lists(st.floats(0, 100), min_size=1, max_size=6))
def test_last_at_or_before_equals_a_search(t: list[float], at: list[float]) -> None:
    ascending = sorted(set(np.round(t, 3).tolist()))
    ask = np.round(at, 3)
    expected = [max((i for i, s in enumerate(ascending) if s <= a), default=-1) for a in ask.tolist()]
    assert last_at_or_before(np.array(ascending), ask).tolist() == expected


@settings(max_examples=80)
@given(st.floats(1.5e9, 1.6e9))
def test_a_row_at_the_very_time_counts_despite_rounding(start: float) -> None:
    row = start + 5.0
    points = (Waypoint(start, 0, 0, "F1"), Waypoint(start + 10, 10, 0, "F1"))
    rounded = float(f"{row * 1000:.3f}") / 1000  # through EST.csv
    found = score([track([rounded], [(5.0, 0.0)])], [recording(waypoints=points, scans=(row,))])
    times = found.methods[0].points["1hz"].used()
    assert times.error[0] == pytest.approx(0.0, abs=1e-6)
    assert len(times) == 6


def test_a_scan_at_the_very_time_counts_despite_rounding() -> None:
    assert 1.14 + 1.0 < 2.14  # the grid's time falls short of the scan's by a rounding
    points = (Waypoint(1.14, 0, 0, "F1"), Waypoint(5.14, 4, 0, "F1"))
    found = score([track([1.2], [(0.0, 0.0)])], [recording(waypoints=points, scans=(2.14,))])
    assert only(found).tolist() == pytest.approx([1, 2, 3, 4])


def test_missing_times_are_counted_not_dropped() -> None:
    found = score([track([105.0], [(5.0, 0.0)])], [recording()])
    points = found.methods[0].points["1hz"]
    assert points.availability == pytest.approx(6 / 9)
    assert [len(points.used(m)) for m in ("skip", "backfill", "all")] == [6, 9, 11]
    assert points.used("backfill").error.tolist() == [3, 2, 1, 0, 1, 2, 3, 4, 5]
    with pytest.raises(UsageError, match="backfill"):
        points.used("guess")


def test_floor_and_combined_errors() -> None:
    estimate = track([101.0, 104.0, 107.0], [(0, 0), (0, 0), (0, 0)], ["F1", "B1", "F2"])
    points = (Waypoint(100.0, 0, 0, "B1"), Waypoint(110.0, 0, 0, "B1"))
    walk = recording(waypoints=points, scans=(101.0,))
    with_site = summarise(score([estimate], [walk], House()).methods[0].points["1hz"].used())
    assert (with_site.n, with_site.floor_accuracy) == (10, pytest.approx(0.3))
    assert with_site.combined_mean == pytest.approx((3 * 15 + 3 * 0 + 4 * 30) / 10)
    assert with_site.ipin == 30.0
    without = summarise(score([estimate], [walk]).methods[0].points["1hz"].used())
    assert without.combined_mean == pytest.approx((3 * 15 + 4 * 15) / 10)


def test_a_truth_without_floor_gives_no_floor_figures() -> None:
    points = (Waypoint(100.0, 0, 0, ""), Waypoint(110.0, 0, 0, ""))
    found = summarise(
        score([track([101.0], [(3, 4)])], [recording(waypoints=points)]).methods[0].points["1hz"].used()
    )
    assert found.mean == 5.0
    assert all(np.isnan(v) for v in (found.floor_accuracy, found.combined_mean, found.ipin))


def test_a_wrong_floor_is_compared_in_the_common_frame() -> None:
    house = House(offsets=((0, 0), (0, 0), (100.0, 0.0)))  # the frame of F2 begins 100 m east
    points = (Waypoint(100.0, 7.0, 0, "F1"), Waypoint(110.0, 7.0, 0, "F1"))
    walk = recording(waypoints=points, scans=(100.0,))
    above = score([track([100.0], [(-93.0, 0.0)], "F2")], [walk], house).methods[0].points["1hz"].used()
    np.testing.assert_allclose(above.error, 0.0)
    np.testing.assert_allclose(above.combined, 15.0)


def test_degrees_are_compared_in_metres_with_and_without_a_site() -> None:
    anchor = GeoAnchor.from_origin(11.11, 49.46, rotation=0.4)
    places = np.array([(0.0, 0.0), (20.0, 0.0)])
    (lon0, lat0), (lon1, lat1) = anchor.to_lonlat(places).tolist()
    points = (Waypoint(100.0, NAN, NAN, "F1", lat0, lon0), Waypoint(110.0, NAN, NAN, "F1", lat1, lon1))
    walk = recording(waypoints=points, scans=(100.0,))
    xy = np.array([(0.0, 3.0), (10.0, 4.0)])
    bare = track([100.0, 105.0], xy)
    lettered = replace(bare, lonlat=anchor.to_lonlat(xy))
    expected = [np.hypot(2.0 * k, 3.0) for k in range(5)] + [np.hypot(2.0 * k, 4.0) for k in range(6)]
    np.testing.assert_allclose(only(score([lettered], [walk])), expected, atol=1e-3)
    np.testing.assert_allclose(only(score([bare], [walk], House(anchor=anchor))), expected, atol=1e-6)
    with pytest.raises(UsageError, match="give --site"):
        score([bare], [walk])


def test_distance_to_the_survey_is_on_the_floor_of_the_truth() -> None:
    rssi = np.full((3, 1), -50.0)
    places = np.array([(2.0, 0.0), (2.0, 1.0), (9.0, 0.0)])
    survey = Survey.from_dense(rssi, places, np.array([0, 0, 1]), ("f1", "F2"))
    found = score([track([101.0], [(0, 0)])], [recording()], survey=survey).methods[0].points["1hz"]
    np.testing.assert_allclose(found.survey_distance, np.abs(found.truth_xy[:, 0] - 2.0))
    empty = Survey.from_dense(rssi, places, np.array([1, 1, 1]), ("F1", "F2"))
    far = score([track([101.0], [(0, 0)])], [recording()], survey=empty).methods[0].points["1hz"]
    assert np.all(np.isinf(far.survey_distance))
    without = score([track([101.0], [(0, 0)])], [recording()]).methods[0].points["1hz"]
    assert np.all(np.isnan(without.survey_distance))


def test_what_cannot_be_scored_is_named() -> None:
    estimates = [track([101.0], [(0, 0)], walk=w) for w in ("a", "b", "lone")]
    estimates.append(track([101.0], [(0, 0)], walk="a", method="other"))
    walks = [recording("a"), recording("b", ()), recording("c"), recording("a2", scans=())]
    found = score(estimates, walks)
    assert found.walks == ("a",)
    assert dict(found.unscored) == {
        "b": "recording without waypoints",
        "c": "recording without estimates",
        "a2": "recording without estimates",
        "lone": "estimates without a recording",
    }
    assert [m.name for m in found.methods] == ["m", "other"]
    with pytest.raises(UsageError, match=r"no walk can be scored .*recording without waypoints"):
        score([track([101.0], [(0, 0)], walk="b")], [recording("b", ())])
    with pytest.raises(UsageError, match="no walk can be scored"):
        score([], [])


def test_a_walk_that_one_method_lacks_is_missing_there() -> None:
    estimates = [track([101.0], [(0, 0)], walk=w, method=m) for w, m in (("a", "x"), ("b", "x"), ("a", "y"))]
    found = score(estimates, [recording("a"), recording("b")])
    assert found.method("x").missing_walks == ()
    assert found.method("y").missing_walks == ("b",)
    with pytest.raises(UsageError, match="there are: x, y"):
        found.method("z")


def test_misuse_is_refused() -> None:
    good = track([101.0], [(0, 0)])
    with pytest.raises(UsageError, match="two tracks of walk 'a'"):
        score([good, good], [recording()])
    with pytest.raises(UsageError, match="two recordings are named 'a'"):
        score([good], [recording(), recording()])
    with pytest.raises(UsageError, match=r"no floor 'F9'.*B1, F1, F2"):
        score([track([101.0], [(0, 0)], "F9")], [recording()], House())


def test_a_truth_on_a_floor_the_site_lacks_is_a_floor_away_and_noted() -> None:
    points = (Waypoint(100.0, 0, 0, "roof"), Waypoint(110.0, 0, 0, "roof"))
    found = score([track([101.0], [(0, 0)])], [recording(waypoints=points)], House())
    assert np.all(found.methods[0].points["1hz"].floor_steps == 1)
    assert "lacks the floor" in found.notes[0]


def test_a_walk_without_radio_counts_from_its_first_waypoint() -> None:
    found = score([track([100.0], [(0, 0)])], [recording(scans=())])
    assert only(found).tolist() == list(range(11))
    assert "no Wi-Fi scan" in found.notes[0]


def test_files_and_tracks_score_alike_and_inputs_stay() -> None:
    one = track([101.0, 103.0], [(0, 0), (1, 1)], r95=[1.0, 2.0])
    before = one.xy.copy()
    a = score([EstimatesFile("est.csv", (one,))], iter([recording()]))
    b = score([one], [recording()])
    np.testing.assert_array_equal(only(a), only(b))
    np.testing.assert_array_equal(one.xy, before)
    assert a.methods[0].points["1hz"].used().r95.tolist() == [1.0] + [2.0] * 8


def test_no_points_give_no_figures() -> None:
    nothing = score([track([120.0], [(0, 0)])], [recording()]).methods[0].points["1hz"].used()
    found = summarise(nothing)
    assert found.n == 0
    assert np.isnan(found.mean)
    assert np.isnan(found.p95)
