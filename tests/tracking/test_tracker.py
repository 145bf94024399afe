"""One engine: record by record or a recording at once, from any checkpoint, nothing of the future."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from wayfuse.core.errors import ConfigError, UsageError
from wayfuse.presets import baselines, fused
from wayfuse.sensors.quality import Verdict
from wayfuse.sensors.recording import Recording, Series
from wayfuse.sensors.records import Record, Waypoint, WifiScan
from wayfuse.simulator import faults
from wayfuse.tracking.dead_reckoning import Start
from wayfuse.tracking.estimate import Estimate, State
from wayfuse.tracking.tracker import Tracker, TrackState

FEW = fused.Config(n_particles=60)


def make(world: Any, method: str, lag: float = 0.0) -> Tracker[Any]:
    if method == "pdr":
        return baselines.dead_reckoning(world.site, Start(20.0, 11.0, 0))
    if method in {"nnss", "wknn"}:
        return getattr(baselines, method)(world.site, world.survey)
    config = {
        "fused": FEW,
        "barriers": replace(FEW, map_constraint="barriers"),
        "random-walk": replace(baselines.RANDOM_WALK, n_particles=60),
    }[method]
    return fused.build(world.site, world.survey, config, lag=lag)


def feed(
    tracker: Tracker[Any], records: Iterable[Record], name: str, until: float, seed: int = 0
) -> tuple[list[Estimate], Counter[Verdict], TrackState[Any]]:
    state, out, verdicts = tracker.init(name, seed), [], Counter()
    for record in records:
        state, more, verdict = tracker.step(state, record)
        out += more
        if isinstance(record, WifiScan):
            verdicts[verdict] += 1
    state, more = tracker.flush(state, until)
    return out + more, verdicts, state


def end_of(recording: Recording) -> float:
    """Time of the last record that is not truth."""
    return replace(recording, waypoints=()).span[1]


def paused(recording: Recording, at: float, seconds: float) -> Recording:
    """The phone says nothing for ``seconds`` from ``at`` on (walk time since the first record)."""
    cut = recording.span[0] + at

    def shift(series: Series) -> Series:
        return Series(series.t + np.where(series.t >= cut, seconds, 0.0), series.values)

    def late(scan: WifiScan) -> WifiScan:
        if scan.t < cut:
            return scan
        return replace(scan, t=scan.t + seconds, last_seen=scan.last_seen + seconds)

    names = ("acceleration", "rotation_rate", "magnetic_field", "orientation")
    columns = {name: shift(getattr(recording, name)) for name in names}
    return replace(recording, **columns, wifi=tuple(map(late, recording.wifi)))


def _without_acceleration(recording: Recording) -> Recording:
    return replace(recording, acceleration=Series.empty(3))


def _lone_scans(recording: Recording) -> Recording:
    """Three scans, the last after a break, and a magnetometer that goes on during it."""
    t = recording.wifi[0].t + np.arange(0.0, 700.0, 10.0)
    field = Series(t, np.tile([20.0, 0.0, -40.0], (len(t), 1)))
    scans = [
        replace(recording.wifi[0], t=s, last_seen=recording.wifi[0].last_seen * np.nan) for s in t[[0, 1, 50]]
    ]
    return Recording(recording.name, magnetic_field=field, wifi=tuple(scans))


VARIANTS: dict[str, Callable[[Recording], Recording]] = {
    "as it is": lambda r: r,
    "no IMU": faults.without_imu,
    "no accelerometer": _without_acceleration,
    "IMU stops": lambda r: faults.without_imu(r, after=r.span[0] + 10.0, until=r.span[0] + 17.3),
    "no Wi-Fi": faults.without_wifi,
    "Wi-Fi stops": lambda r: faults.without_wifi(r, after=r.span[0] + 8.0, until=r.span[0] + 20.0),
    "pause of 5 minutes": lambda r: paused(r, 12.0, 299.0),
    "pause of an hour": lambda r: paused(r, 12.345, 3600.0),
    "two pauses": lambda r: paused(paused(r, 7.0, 400.0), 420.0, 301.0),
    "pause without IMU": lambda r: faults.without_imu(paused(r, 12.0, 400.0)),
    "pause without Wi-Fi": lambda r: faults.without_wifi(paused(r, 12.0, 400.0)),
    "scans far apart": _lone_scans,
    "not finite": lambda r: faults.with_not_finite(r, 50),
    "unknown networks": lambda r: faults.unknown_access_points(r, np.random.default_rng(1)),
    "only waypoints": lambda r: Recording(r.name, waypoints=r.waypoints),
    "nothing": lambda r: Recording(r.name),
}
LAGGED = ("as it is", "pause of an hour", "no IMU", "IMU stops", "unknown networks", "no Wi-Fi")


@pytest.mark.parametrize("variant", VARIANTS)
def test_replay_has_the_bits_of_record_by_record(world: Any, variant: str) -> None:
    recording = VARIANTS[variant](world.walks[0])
    methods = ["fused", "random-walk", "wknn", "pdr"] if variant in LAGGED[:3] else ["fused"]
    for method in methods:
        tracker = make(world, method)
        done = tracker.run(recording, 5)
        rows, verdicts, _ = feed(tracker, recording.records(), recording.name, end_of(recording), 5)
        assert done.estimates == rows
        assert done.verdicts == verdicts
        assert sum(verdicts.values()) == len(recording.wifi)


@pytest.mark.parametrize("variant", LAGGED)
@pytest.mark.parametrize("lag", [0.7, 5.0, 60.0])
def test_replay_has_the_same_bits_with_a_lag(world: Any, variant: str, lag: float) -> None:
    recording = VARIANTS[variant](world.walks[1])
    tracker = make(world, "fused", lag)
    rows, verdicts, state = feed(tracker, recording.records(), recording.name, end_of(recording))
    done = tracker.run(recording)
    assert done.estimates == rows
    assert done.verdicts == verdicts
    assert not state.pending
    times = [e.t for e in make(world, "fused").run(recording).estimates]
    assert [e.t for e in rows] == times


def _until(recording: Recording, t: float) -> Recording:
    def cut(series: Series) -> Series:
        keep = series.t <= t
        return Series(series.t[keep], series.values[keep])

    names = ("acceleration", "rotation_rate", "magnetic_field", "orientation")
    columns = {name: cut(getattr(recording, name)) for name in names}
    return replace(
        recording,
        **columns,
        wifi=tuple(s for s in recording.wifi if s.t <= t),
        waypoints=tuple(w for w in recording.waypoints if w.t <= t),
    )


@settings(max_examples=15, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    variant=st.sampled_from(["as it is", "IMU stops", "pause of an hour", "no IMU", "Wi-Fi stops"]),
    lag=st.sampled_from([0.0, 0.0, 2.0, 5.0]),
    share=st.floats(0.0, 1.0),
    after=st.one_of(st.just(0.0), st.floats(-1.0, 1.0)),
)
def test_nothing_of_the_future_is_used(
    world: Any, variant: str, lag: float, share: float, after: float
) -> None:
    recording = VARIANTS[variant](world.walks[2])
    tracker = make(world, "fused", lag)
    whole = tracker.run(recording).estimates
    t = whole[int(share * (len(whole) - 1))].t + lag + after
    past = _until(recording, t)
    short = tracker.run(past).estimates
    said = [e for e in whole if e.t + lag <= end_of(past)]
    assert short[: len(said)] == said


def test_rows_are_in_order_one_per_scan_and_at_least_one_a_second(world: Any) -> None:
    for recording in world.walks:
        for method in ("fused", "nnss", "pdr"):
            t = np.array([e.t for e in make(world, method).run(recording).estimates])
            assert np.all(np.diff(t) >= 0.0)
            assert np.all(np.diff(t) <= 1.0 + 1e-6)
            assert {scan.t for scan in recording.wifi} <= set(t.tolist())
            first = min(recording.acceleration.t[0], recording.wifi[0].t)
            assert t[0] <= first + 1e-9
            assert recording.acceleration.t[-1] - t[-1] < 1.0


def test_truth_in_the_recording_is_not_used(world: Any) -> None:
    recording = world.walks[0]
    tracker = make(world, "fused")
    want = tracker.run(recording).estimates
    nowhere = tuple(Waypoint(w.t, 0.0, 0.0, "F2") for w in recording.waypoints)
    early = (Waypoint(recording.span[0] - 100.0, 1.0, 1.0, "F1"), *nowhere)
    for other in (
        replace(recording, waypoints=()),
        replace(recording, waypoints=nowhere, floor="F2"),
        replace(recording, waypoints=early, floor="", path="elsewhere", site="another"),
    ):
        assert tracker.run(other).estimates == want
        rows, _, _ = feed(tracker, other.records(), other.name, end_of(other))
        assert rows == want


def test_seed_and_name_decide_the_bits_and_nothing_else(world: Any) -> None:
    recording = world.walks[0]
    tracker = make(world, "fused")
    want = tracker.run(recording, 1).estimates
    tracker.run(world.walks[1], 1)  # another walk in between leaves no trace
    assert tracker.run(recording, 1).estimates == want
    assert make(world, "fused").run(recording, 1).estimates == want
    assert tracker.run(recording, 2).estimates != want
    assert tracker.run(replace(recording, name="another"), 1).estimates != want


@pytest.mark.parametrize("lag", [0.0, 3.0])
def test_a_state_kept_is_a_checkpoint(world: Any, lag: float) -> None:
    recording = world.walks[3]
    tracker = make(world, "fused", lag)
    records = list(recording.records())
    kept: list[tuple[int, TrackState[Any], int]] = []
    state, out = tracker.init(recording.name, 4), []
    for i, record in enumerate(records):
        if i % 2000 == 1500:
            kept.append((i, state, len(out)))
        state, more, _ = tracker.step(state, record)
        out += more
    assert len(kept) >= 2
    for i, checkpoint, n in kept:
        state, again = checkpoint, []
        for record in records[i:]:
            state, more, _ = tracker.step(state, record)
            again += more
        assert again == out[n:]


def test_bad_records_get_a_verdict_and_change_nothing(world: Any) -> None:
    recording = world.walks[0]
    tracker = make(world, "fused")
    state = tracker.init("x")
    records = list(recording.records())
    for record in records[:3000]:
        state, _, _ = tracker.step(state, record)
    scan = recording.wifi[0]
    late = replace(scan, t=state.now - 0.5)
    for record, verdict in [
        (replace(scan, t=np.nan), Verdict.NOT_FINITE),
        (replace(scan, t=np.inf), Verdict.NOT_FINITE),
        (late, Verdict.LATE),
        (Waypoint(state.now + 1.0, 0.0, 0.0, "F1"), Verdict.IGNORED),
    ]:
        after, out, said = tracker.step(state, record)
        assert said is verdict
        assert after is state
        assert not out


def test_verdicts_on_scans(world: Any) -> None:
    recording = faults.without_imu(world.walks[0])
    tracker = make(world, "fused")
    first = recording.wifi[0]
    silent = np.full(len(first.bssid), np.nan)
    stale = np.full(len(first.bssid), first.t - 100.0)
    scans = (
        replace(first, last_seen=silent),
        replace(first, t=first.t + 2.0, last_seen=silent),  # a throttled phone repeats itself
        replace(first, t=first.t + 3.0, bssid=first.bssid ^ np.uint64(1 << 46), last_seen=silent),
        replace(first, t=first.t + 30.0, last_seen=stale),
        replace(first, t=first.t + 60.0, bssid=first.bssid ^ np.uint64(1 << 46), last_seen=silent),
    )
    verdicts = tracker.run(replace(recording, wifi=scans)).verdicts
    assert verdicts == {
        Verdict.USED: 2,  # the third still holds the first one's readings
        Verdict.DUPLICATE: 1,
        Verdict.OUT_OF_RANGE: 1,
        Verdict.UNKNOWN_ACCESS_POINTS: 1,
    }


def test_a_scan_delivered_twice_counts_once(world: Any) -> None:
    recording = world.walks[0]
    twice = replace(recording, wifi=tuple(s for scan in recording.wifi for s in (scan, scan)))
    tracker = make(world, "fused")
    done = tracker.run(twice)
    assert done.verdicts[Verdict.DUPLICATE] == len(recording.wifi)
    want = tracker.run(recording).estimates
    got = list({e.t: (e.x, e.y, e.floor) for e in done.estimates}.items())
    assert got == list({e.t: (e.x, e.y, e.floor) for e in want}.items())


def test_a_method_that_ignores_scans_says_so(world: Any) -> None:
    verdicts = make(world, "pdr").run(world.walks[0]).verdicts
    assert verdicts == {Verdict.IGNORED: len(world.walks[0].wifi)}


def test_after_a_long_silence_the_track_starts_anew(world: Any) -> None:
    recording = paused(world.walks[0], 12.0, 3600.0)
    estimates = make(world, "fused").run(recording).estimates
    t = np.array([e.t for e in estimates])
    gap = int(np.argmax(np.diff(t)))
    assert t[gap + 1] - t[gap] > 3590.0
    assert estimates[gap].state is not State.INITIALISING
    assert estimates[gap + 1].state is State.INITIALISING
    assert estimates[-1].state is State.TRACKING


def test_parameters_out_of_range_are_refused(world: Any) -> None:
    engine = make(world, "fused").engine
    with pytest.raises(ConfigError, match="interval must be positive"):
        Tracker(engine=engine, interval=0.0)
    with pytest.raises(ConfigError, match="lag not negative"):
        Tracker(engine=engine, lag=-1.0)
    with pytest.raises(UsageError, match="leave --lag out"):
        baselines.nnss(world.site, world.survey, lag=5.0)


@pytest.mark.real_data
@pytest.mark.parametrize("floor", ["B1", "F2"])
def test_real_recordings_replay_bit_for_bit(world: Any, ms_indoor: Any, floor: str) -> None:
    from wayfuse.formats.reading import read

    path = sorted((ms_indoor / floor).rglob("*.txt"))[0]
    recording = read(path)
    survey = _survey_of(recording)
    site = world.site
    for lag in (0.0, 5.0):
        tracker = fused.build(site, replace(survey, floors=site.floor_names), FEW, lag=lag)
        rows, verdicts, _ = feed(tracker, recording.records(), recording.name, end_of(recording))
        done = tracker.run(recording)
        assert done.estimates == rows
        assert done.verdicts == verdicts
        assert verdicts[Verdict.USED] > 3


def _survey_of(recording: Recording) -> Any:
    from wayfuse.radio.walk_survey import SurveyWalk, survey_from_walks

    t = np.array([w.t for w in recording.waypoints])
    xy = np.array([(w.x, w.y) for w in recording.waypoints])
    keep = np.concatenate([[True], np.diff(t) > 0])
    walk = SurveyWalk(recording.name, t[keep], xy[keep], np.zeros(keep.sum(), np.int32), recording.wifi)
    return survey_from_walks([walk], ("F1", "F2"))
