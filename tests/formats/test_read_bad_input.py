"""Bad input, format by format: a clear message, every fault counted, nothing else lost."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from wayfuse.core.errors import FormatError, WayfuseError
from wayfuse.formats import getsensordata, ms_indoor, read
from wayfuse.formats._kernels import mark_repeats
from wayfuse.sensors.recording import Recording

START = 1574661471000  # ms

HEADER = "#\tstartTime:1574661471000\n#\tSiteName:Mall\tFloorName:F4\n"


def motion(k: int, kind: str = "ACCELEROMETER", shift: int = 0, x: str = "0.5") -> str:
    """The k-th sample of a 50 Hz sensor."""
    return f"{START + 20 * k + shift}\tTYPE_{kind}\t{x}\t0.25\t9.75\t3"


def scan(k: int, shift: int = 0) -> list[str]:
    """A scan of two readings at sample k."""
    t = START + 20 * k + shift
    return [f"{t}\tTYPE_WIFI\ts\t0a:74:9c:2e:af:f{i}\t-7{i}\t2412\t{t - 100}" for i in range(2)]


def load(tmp_path: Path, lines: list[str], end: str = "\n") -> Recording:
    path = tmp_path / "walk.txt"
    path.write_text(HEADER + "\n".join(lines) + end, encoding="utf-8")
    return read(path)


def counts(r: Recording) -> dict[str, int]:
    return {what: issue.count for what, issue in r.report.issues.items()}


def test_an_empty_file_says_so(tmp_path: Path) -> None:
    (tmp_path / "walk.txt").touch()
    for reader in (ms_indoor.read, getsensordata.read):
        with pytest.raises(FormatError, match="the file is empty"):
            reader(tmp_path / "walk.txt")
    with pytest.raises(FormatError, match=r"known formats: ms-indoor, getsensordata, sensor-logger"):
        read(tmp_path / "walk.txt")


def test_a_header_alone_is_an_empty_recording(tmp_path: Path) -> None:
    r = load(tmp_path, [])
    assert r.is_empty
    assert r.span == (0.0, 0.0)
    assert r.floor == "F4"
    assert counts(r) == {"no record in the recording": 1}


def test_a_truncated_last_line_costs_itself(tmp_path: Path) -> None:
    r = load(tmp_path, [motion(0), motion(1), motion(2)[:-8]], end="")
    assert len(r.acceleration) == 2
    assert r.report.issues["truncated last line"].lines == [5]


def test_a_whole_last_line_without_line_end_is_kept_and_counted(tmp_path: Path) -> None:
    r = load(tmp_path, [motion(0), f"{START}\tTYPE_WAYPOINT\t1.5\t2.5"], end="")
    assert r.waypoints[0][1:4] == (1.5, 2.5, "F4")
    assert counts(r) == {"last line has no line end, kept": 1}


@pytest.mark.real_data
@pytest.mark.parametrize("fraction", [0.1, 0.37, 0.5, 0.99])
def test_a_real_walk_cut_anywhere_keeps_what_is_before_the_cut(
    ms_indoor: Path, tmp_path: Path, fraction: float
) -> None:
    path = min(ms_indoor.glob("F2/path_data_files/*.txt"), key=lambda p: p.stat().st_size)
    data = path.read_bytes()
    cut = int(len(data) * fraction)
    (tmp_path / "cut.txt").write_bytes(data[:cut])
    r, whole = read(tmp_path / "cut.txt"), read(path)
    lines = data[:cut].count(b"\n")
    due = sum(b"\tTYPE_ACCELEROMETER\t" in line for line in data.split(b"\n")[:lines])
    assert len(r.acceleration) - due in {0, 1}
    n = len(r.acceleration)
    np.testing.assert_array_equal(r.acceleration.values, whole.acceleration.values[:n])
    assert r.report.n_bad <= 1


def test_no_wifi_and_no_motion_are_empty_columns(tmp_path: Path) -> None:
    r = load(tmp_path, [motion(k) for k in range(9)])
    assert r.wifi == ()
    assert len(r.acceleration) == 9
    r = load(tmp_path, scan(0) + scan(100))
    assert len(r.wifi) == 2
    assert len(r.acceleration) == 0
    assert r.report.n_bad == 0


@pytest.mark.parametrize("word", ["NaN", "nan", "Infinity", "-inf"])
def test_values_that_are_not_finite_are_dropped_and_counted(tmp_path: Path, word: str) -> None:
    r = load(tmp_path, [motion(0), motion(1, x=word), motion(2)])
    assert len(r.acceleration) == 2
    assert np.isfinite(r.acceleration.values).all()
    assert r.report.issues["acceleration: not finite"].lines == [4]


def test_absurd_values_are_dropped_and_counted(tmp_path: Path) -> None:
    wifi = scan(3)
    lines = [
        motion(0),
        motion(1, x="12345.0"),
        motion(2, "ROTATION_VECTOR", x="3.5").replace("9.75", "0.1"),
        motion(2, "ROTATION_VECTOR", x="0.9").replace("9.75", "0.9"),
        wifi[0].replace("-70", "-128"),
        wifi[1].replace("-71", "21"),
        wifi[0].replace("2412", "999999999"),
    ]
    r = load(tmp_path, lines)
    assert counts(r) == {
        "acceleration: out of range": 1,
        "orientation: out of range": 1,
        "orientation: no unit quaternion": 1,
        "wifi: out of range": 2,
        "wifi: frequency out of range, taken as unknown": 1,
    }
    assert len(r.acceleration) == 1
    assert r.wifi[0].frequency.tolist() == [0]


def test_exact_repeats_of_a_reading_are_dropped(tmp_path: Path) -> None:
    one = scan(0)
    r = load(tmp_path, [*one, *one, one[0].replace("-70", "-69"), *scan(100)])
    assert [s.rssi.tolist() for s in r.wifi] == [[-70, -71, -69], [-70, -71]]
    assert r.report.issues["wifi: exact repeat of a reading"].count == 2
    assert r.report.issues["wifi: exact repeat of a reading"].lines == [5, 6]


def test_repeats_kernel_equals_its_plain_twin() -> None:
    rng = np.random.default_rng(7)
    n = 400
    t, ids = rng.integers(0, 5, n) + 0.25, rng.integers(0, 9, n).astype(np.uint64)
    values = rng.integers(0, 3, (n, 3)).astype(float)
    values[rng.random((n, 3)) < 0.3] = math.nan
    seen: set[str] = set()
    due = []
    for i in range(n):
        key = repr((t[i], ids[i], values[i].tolist()))
        due.append(key in seen)
        seen.add(key)
    repeat = np.empty(n, np.bool_)
    with np.errstate(over="ignore"):
        mark_repeats(t, ids, values, np.full(1024, -1, np.int64), repeat)
    assert 0 < sum(due) < n
    assert repeat.tolist() == due


@pytest.mark.parametrize("shift", [-5_000, -86_400_000, 7_000, 86_400_000])
@pytest.mark.parametrize("place", [0, 1, 150, 299])
def test_a_lone_foreign_time_is_dropped(tmp_path: Path, shift: int, place: int) -> None:
    lines = [motion(k, shift=shift if k == place else 0) for k in range(300)]
    r = load(tmp_path, lines)
    if (place == 0 and shift == -5_000) or (place == 299 and shift == 7_000):
        assert r.report.n_bad == 0  # at the ends a few seconds may as well be a pause
        return
    assert counts(r) == {"acceleration: clock outlier": 1}
    assert r.report.issues["acceleration: clock outlier"].lines == [place + 3]
    assert len(r.acceleration) == 299
    assert np.diff(r.acceleration.t).max() < 0.05


def test_a_clock_set_back_goes_on_one_sample_later_for_all_sensors(tmp_path: Path) -> None:
    lines = []
    for k in range(400):
        shift = -30_000 if k >= 200 else 0
        lines += [motion(k, shift=shift), motion(k, "GYROSCOPE", shift=shift)]
        lines += scan(k, shift=shift) if k % 100 == 50 else []
        lines += [f"{START + 20 * k + shift}\tTYPE_WAYPOINT\t{k}\t0.0"] if k in {150, 250} else []
    r = load(tmp_path, lines)
    due = START / 1000 + 0.02 * np.arange(400)
    np.testing.assert_allclose(r.acceleration.t, due, atol=1e-6)
    np.testing.assert_allclose(r.rotation_rate.t, due, atol=1e-6)
    np.testing.assert_allclose([s.t for s in r.wifi], due[[50, 150, 250, 350]], atol=1e-6)
    np.testing.assert_allclose([s.t - s.last_seen[0] for s in r.wifi], 0.1, atol=1e-6)
    np.testing.assert_allclose([w.t for w in r.waypoints], due[[150, 250]], atol=1e-6)
    (issue,) = r.report.issues.items()
    assert issue[0] == "acceleration: clock set back, time continued"
    assert issue[1].lines == [3 + 400 + 4 + 1]


def test_two_jumps_back(tmp_path: Path) -> None:
    lines = [motion(k, shift=-(k // 100) * 9_000) for k in range(300)]
    r = load(tmp_path, lines)
    np.testing.assert_allclose(np.diff(r.acceleration.t), 0.02, atol=1e-6)
    assert counts(r) == {"acceleration: clock set back, time continued": 2}


def test_fewer_than_twenty_records_behind_are_outliers_not_a_jump(tmp_path: Path) -> None:
    lines = [motion(k, shift=-9_000 if 100 <= k < 119 else 0) for k in range(300)]
    r = load(tmp_path, lines)
    assert counts(r) == {"acceleration: clock outlier": 19}
    assert len(r.acceleration) == 281


def test_a_foreign_scan_is_one_outlier_however_many_readings_it_has(tmp_path: Path) -> None:
    lines = []
    for k in range(300):
        lines.append(motion(k))
        if k % 50 == 0:
            shift = -20_000 if k == 150 else 0
            lines += [s.replace("af:f", f"{j:02x}:f") for j in range(30) for s in scan(k, shift)]
    r = load(tmp_path, lines)
    assert len(r.wifi) == 5
    assert counts(r) == {"wifi: clock outlier": 60}


def test_small_disorder_is_sorted_and_counted(tmp_path: Path) -> None:
    order = list(range(50))
    order[20], order[21] = 21, 20
    r = load(tmp_path, [motion(k, x=f"{k}.5") for k in order])
    assert r.acceleration.values[:, 0].tolist() == [k + 0.5 for k in range(50)]
    assert r.report.issues["acceleration: out of time order, sorted"].lines == [24]


def test_a_late_waypoint_is_no_fault(tmp_path: Path) -> None:
    lines = [motion(k) for k in range(900)]
    lines.insert(880, f"{START + 4000}\tTYPE_WAYPOINT\t1.0\t2.0")
    r = load(tmp_path, lines)
    assert r.report.n_bad == 0
    assert len(r.waypoints) == 1


def test_a_waypoint_of_another_day_is_dropped(tmp_path: Path) -> None:
    r = load(tmp_path, [motion(0), motion(1), f"{START - 86_400_000}\tTYPE_WAYPOINT\t1.0\t2.0"])
    assert r.waypoints == ()
    assert counts(r) == {"waypoint: clock outlier": 1}


def test_binary_rubbish_in_the_middle_is_counted_and_passed_over(tmp_path: Path) -> None:
    path = tmp_path / "walk.txt"
    rubbish = bytes(b for b in range(256) if b != 10) * 3
    path.write_bytes((HEADER + motion(0) + "\n").encode() + rubbish + b"\n" + motion(1).encode() + b"\n")
    r = read(path, format="ms-indoor")
    assert len(r.acceleration) == 2
    assert counts(r) == {"not a record": 1}


def test_a_line_longer_than_the_block_is_read(tmp_path: Path) -> None:
    path = tmp_path / "walk.txt"
    ssid = "x" * 9000
    path.write_text(
        f"{HEADER}{scan(0)[0].replace('_WIFI	s', '_WIFI	' + ssid)}\n{motion(1)}\n", encoding="utf-8"
    )
    pieces = list(ms_indoor.blocks(path, 512))
    assert sum(len(p.columns["wifi"].t) for p in pieces if "wifi" in p.columns) == 1
    assert sum(len(p.columns["acceleration"].t) for p in pieces if "acceleration" in p.columns) == 1


@pytest.mark.parametrize("name", ["absent.txt", "absent"])
def test_an_absent_file_is_named(tmp_path: Path, name: str) -> None:
    with pytest.raises(WayfuseError, match=rf"{name}: no such file or folder"):
        read(tmp_path / name)
