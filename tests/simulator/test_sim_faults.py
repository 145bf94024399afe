"""Each fault does what it says and nothing else."""

from __future__ import annotations

import numpy as np
import pytest

from wayfuse.formats.ms_indoor import read
from wayfuse.sensors.records import WifiScan
from wayfuse.simulator import faults
from wayfuse.simulator.recordings import recording_text


@pytest.fixture(scope="module")
def recording(sim_walks):
    return sim_walks[0][0]


@pytest.fixture(scope="module")
def middle(recording):
    start, stop = recording.span
    return 0.5 * (start + stop)


@pytest.fixture(scope="module")
def records(recording):
    return list(recording.records())


def read_text(tmp_path, text):
    path = tmp_path / "walk.txt"
    path.write_text(text, encoding="utf-8")
    return read(path)


def test_wifi_stops(recording, middle):
    cut = faults.without_wifi(recording, after=middle)
    assert 0 < len(cut.wifi) < len(recording.wifi)
    assert cut.wifi[-1].t <= middle
    assert cut.acceleration is recording.acceleration
    assert faults.without_wifi(recording).wifi == ()


def test_motion_sensors_stop(recording, middle):
    cut = faults.without_imu(recording, after=middle, until=middle + 5.0)
    t = cut.rotation_rate.t
    assert not np.any((t > middle) & (t <= middle + 5.0))
    assert len(t) == pytest.approx(len(recording.rotation_rate.t) - 250, abs=5)
    assert len(faults.without_imu(recording).acceleration) == 0
    assert cut.wifi == recording.wifi


def test_gyro_spike_is_short_and_leaves_the_original(recording, middle):
    before = recording.rotation_rate.values.copy()
    hit = faults.gyro_spike(recording, middle, duration=0.1, rate=30.0).rotation_rate
    assert np.count_nonzero((hit.values == 30.0).all(axis=1)) == pytest.approx(5, abs=1)
    np.testing.assert_array_equal(recording.rotation_rate.values, before)


def test_not_finite_samples(recording):
    spoilt = faults.with_not_finite(recording, every=10)
    bad = np.isnan(spoilt.acceleration.values).all(axis=1)
    assert bad.mean() == pytest.approx(0.1, abs=0.01)
    assert all(np.isnan(scan.rssi[0]) and np.isfinite(scan.rssi[1:]).all() for scan in spoilt.wifi)
    assert np.isinf(faults.with_not_finite(recording, 10, np.inf).rotation_rate.values[0]).all()


def test_unknown_access_points(recording):
    known = {int(b) for scan in recording.wifi for b in scan.bssid}
    rng = np.random.default_rng(0)
    replaced = faults.unknown_access_points(recording, rng)
    assert not known & {int(b) for scan in replaced.wifi for b in scan.bssid}
    half = faults.unknown_access_points(recording, rng, share=0.5)
    kept = known & {int(b) for scan in half.wifi for b in scan.bssid}
    assert 0.3 < len(kept) / len(known) < 0.7
    assert faults.unknown_access_points(faults.without_wifi(recording), rng).wifi == ()


def test_clock_jump_moves_all_that_follows(records, middle):
    jumped = list(faults.clock_jump(records, middle, -20.0))
    times = np.array([r.t for r in records])
    moved = np.array([r.t for r in jumped]) - times
    np.testing.assert_allclose(moved, np.where(times < middle, 0.0, -20.0), atol=1e-6)
    scan = next(r for r in jumped[::-1] if isinstance(r, WifiScan))
    assert (scan.last_seen <= scan.t).all()


def test_late_scans_arrive_after_newer_records(records):
    late = list(faults.late_records(records, 1.0))
    assert len(late) == len(records)
    assert {id(r) for r in late} == {id(r) for r in records}
    newest, lags = -np.inf, []
    for record in late:
        newest = max(newest, record.t)
        if isinstance(record, WifiScan):
            lags.append(newest - record.t)
        else:
            assert record.t == newest
    assert np.median(lags) == pytest.approx(1.0, abs=0.05)


def test_duplicates_arrive_twice(records):
    doubled = list(faults.duplicated(records, 10))
    assert len(doubled) == len(records) + int(np.ceil(len(records) / 10))
    assert doubled[0] is doubled[1] is records[0]


def test_a_truncated_file_loses_its_end_and_one_line(tmp_path, recording):
    text = recording_text(recording)
    back = read_text(tmp_path, faults.truncated_text(text, 0.5))
    assert back.report.n_bad <= 1
    assert 0.4 < len(back.acceleration) / len(recording.acceleration) < 0.6
    assert not faults.truncated_text("1\n2\n3\n4\n", 0.5).endswith("\n")


def test_garbled_lines_are_counted_by_the_reader(tmp_path, recording):
    text = faults.garbled_text(recording_text(recording), np.random.default_rng(0), 0.02)
    report = read_text(tmp_path, text).report
    assert report.n_bad == pytest.approx(0.02 * report.n_lines, rel=0.5)


def test_joined_lines_hold_every_record(tmp_path, recording):
    text = recording_text(recording)
    joined = faults.joined_lines(text, 50)
    assert len(joined.splitlines()) < len(text.splitlines())
    assert joined.replace("\n", "") == text.replace("\n", "")
    assert any(line.count("TYPE_") == 2 for line in joined.splitlines())


def test_text_clock_jump_moves_record_times(recording):
    text = recording_text(recording)
    jumped = faults.text_clock_jump(text, 0.5, -60_000)
    before = [int(line[:13]) for line in text.splitlines() if line[0] != "#"]
    after = [int(line[:13]) for line in jumped.splitlines() if line[0] != "#"]
    moved = np.subtract(after, before)
    assert set(moved.tolist()) == {0, -60_000}
    assert (np.diff(moved) <= 0).all()
