"""The ms-indoor reader: the compiled scanner equals a plain line loop, on real walks and on mangled lines."""

from __future__ import annotations

import importlib.util
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from wayfuse.core.errors import FormatError
from wayfuse.formats import ms_indoor
from wayfuse.sensors.quality import ReadReport
from wayfuse.sensors.recording import Recording
from wayfuse.sensors.records import bssid_id

HEADER = (
    "#\tstartTime:1574661471572\n"
    "#\tSiteID:1\tSiteName:Mall\tFloorId:2\tFloorName:F4\n"
    "#\tBrand:OPPO\tModel:PBCM10\tAndroidName:8.1.0\tAPILevel:27\t\n"
)
LINES = [
    "1574661471585\tTYPE_WAYPOINT\t212.72197\t151.0766",
    "1574661471701\tTYPE_ACCELEROMETER\t-1.1614838\t-0.35914612\t19.2034\t2",
    "1574661471701\tTYPE_MAGNETIC_FIELD\t-17.251587\t18.0542\t-26.313782\t3",
    "1574661471701\tTYPE_GYROSCOPE\t-0.46195984\t3.3750916E-4\t-0.33773804\t3",
    "1574661471701\tTYPE_ROTATION_VECTOR\t0.008286571\t0.032158267\t-0.3905575\t3",
    "1574661471701\tTYPE_MAGNETIC_FIELD_UNCALIBRATED\t-66.6\t-18.7\t-295.6\t-49.3\t-36.7\t-269.2\t3",
    "1574661471701\tTYPE_GYROSCOPE_UNCALIBRATED\t-0.4\t0.3\t-0.3\t-7.9345703E-4\t3.2E-4\t4.1E-4\t3",
    "1574661471701\tTYPE_ACCELEROMETER_UNCALIBRATED\t-1.1\t-0.3\t19.2\t0.0\t0.0\t0.0\t3",
    "1574661471822\tTYPE_BLUE\t\t08:D7:D1:D8:C4:C4\t-88",
    "1574661471822\tTYPE_BLU4\t54304\t11842\t-88",
    "1574661471900\tTYPE_BEACON\tFDA50693-A4E2\t10073\t61418\t-65\t-75\t2.8\t67:FA:40:46:5F:36\t1574661471900",
    "1574661473481\tTYPE_WIFI\tintime_office\t0a:74:9c:2e:af:f7\t-72\t5765\t1574661472768",
    "1574661473481\tTYPE_WIFI\t\t12:74:9c:2e:af:f7\t-74\t2412\t1574661472769",
]


def write(tmp_path: Path, lines: list[str], end: str = "\n", header: str = HEADER) -> Path:
    path = tmp_path / "walk.txt"
    path.write_bytes((header + "\n".join(lines) + end).encode())
    return path


def assert_same(a: Recording, b: Recording) -> None:
    """Every record of two recordings is the same, bit for bit."""
    for x, y in zip(a._series(), b._series(), strict=True):
        np.testing.assert_array_equal(x.t, y.t)
        np.testing.assert_array_equal(x.values, y.values)
    assert len(a.wifi) == len(b.wifi)
    for s, r in zip(a.wifi, b.wifi, strict=True):
        assert s.t == r.t
        np.testing.assert_array_equal(s.bssid, r.bssid)
        np.testing.assert_array_equal(s.rssi, r.rssi)
        np.testing.assert_array_equal(s.frequency, r.frequency)
        np.testing.assert_array_equal(s.last_seen, r.last_seen)
    assert repr(a.ble) == repr(b.ble)
    assert repr(a.waypoints) == repr(b.waypoints)
    assert (a.site, a.floor, a.device) == (b.site, b.floor, b.device)


@pytest.fixture(scope="module")
def plain_read() -> Callable[[Path], Recording]:
    """The plain line loop of the benchmark: an independent reader."""
    place = Path(__file__).parents[2] / "benchmarks" / "reading.py"
    spec = importlib.util.spec_from_file_location("benchmark_reading", place)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules["benchmark_reading"] = module
    spec.loader.exec_module(module)
    return module.plain_read


def test_every_kind_of_record_arrives_in_its_units(tmp_path: Path) -> None:
    r = ms_indoor.read(write(tmp_path, LINES))
    assert r.acceleration.t.tolist() == [1574661471.701]
    assert r.acceleration.values.tolist() == [[-1.1614838, -0.35914612, 19.2034]]
    assert r.rotation_rate.values.tolist() == [[-0.46195984, 3.3750916e-4, -0.33773804]]
    assert r.magnetic_field.values.tolist() == [[-17.251587, 18.0542, -26.313782]]
    q = r.orientation.values[0]
    assert q[1:].tolist() == [0.008286571, 0.032158267, -0.3905575]
    assert q @ q == pytest.approx(1.0, abs=1e-12)
    assert q[0] > 0
    (scan,) = r.wifi
    assert scan.t == 1574661473.481
    assert scan.bssid.tolist() == [bssid_id("0a:74:9c:2e:af:f7"), bssid_id("12:74:9c:2e:af:f7")]
    assert scan.rssi.tolist() == [-72, -74]
    assert scan.frequency.tolist() == [5765, 2412]
    assert scan.last_seen.tolist() == [1574661472.768, 1574661472.769]
    assert [(b.id, b.rssi) for b in r.ble] == [
        (bssid_id("08:d7:d1:d8:c4:c4"), -88),
        (bssid_id("67:FA:40:46:5F:36"), -75),
    ]
    assert r.ble[1].tx_power == -65
    assert r.waypoints == (
        (1574661471.585, 212.72197, 151.0766, "F4", r.waypoints[0].lat, r.waypoints[0].lon),
    )
    assert (r.site, r.floor, r.device.brand, r.device.model) == ("Mall", "F4", "OPPO", "PBCM10")
    assert r.report.n_lines == 16
    assert r.report.n_bad == 0
    assert r.report.n_records["ACCELEROMETER_UNCALIBRATED"] == 1


@pytest.mark.real_data
def test_scanner_equals_the_plain_loop_on_real_walks(
    ms_indoor_paths: list[Path], plain_read: Callable[[Path], Recording]
) -> None:
    assert len(ms_indoor_paths) >= 10
    for path in ms_indoor_paths:
        r = ms_indoor.read(path)
        assert_same(r, plain_read(path))
        assert r.report.n_bad == 0
        assert 45 < (len(r.acceleration) - 1) / np.ptp(r.acceleration.t) < 55


@pytest.mark.real_data
@pytest.mark.slow
def test_scanner_equals_the_plain_loop_on_a_whole_floor(
    ms_indoor: Path, plain_read: Callable[[Path], Recording]
) -> None:
    from wayfuse.formats.ms_indoor import read

    paths = sorted((ms_indoor / "F1" / "path_data_files").glob("*.txt"))
    assert len(paths) > 40
    for path in paths:
        assert_same(read(path), plain_read(path))


@pytest.fixture(scope="module")
def ms_indoor_paths(request: pytest.FixtureRequest) -> list[Path]:
    """About twenty walks of all floors."""
    site: Path = request.getfixturevalue("ms_indoor")
    return sorted(site.glob("*/path_data_files/*.txt"))[::26]


@pytest.mark.real_data
def test_orientation_of_a_real_walk_is_device_to_east_north_up(ms_indoor_paths: list[Path]) -> None:
    r = ms_indoor.read(ms_indoor_paths[0])
    w, x, y, z = r.orientation.values.T
    up = np.column_stack([2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)])
    along = np.einsum("ij,ij->i", up, r.acceleration.values[: len(up)]).mean()
    assert 9.4 < along < 10.2


@pytest.mark.real_data
def test_small_blocks_give_the_same_recording(ms_indoor_paths: list[Path]) -> None:
    path = min(ms_indoor_paths, key=lambda p: p.stat().st_size)
    whole = list(ms_indoor.blocks(path))
    report = ReadReport()
    parts = list(ms_indoor.blocks(path, 4001, report=report))
    assert len(whole) == 1
    assert len(parts) > 50
    for kind, column in whole[0].columns.items():
        for k in range(4):
            joined = np.concatenate([p.columns[kind][k] for p in parts if kind in p.columns])
            np.testing.assert_array_equal(joined, column[k])
    assert report.n_lines == path.read_bytes().count(b"\n") + (not path.read_bytes().endswith(b"\n"))


def careful_only(path: Path, monkeypatch: pytest.MonkeyPatch) -> Recording:
    """Read with a scanner that hands every line to the careful path."""

    def hand_over(buf, word, n, line, t, values, ids, token, care, counts):
        data = bytes(buf[:n])
        start = k = number = 0
        while start < n:
            stop = data.index(b"\n", start)
            number += 1
            if stop > start:
                care[k] = number, start, stop
                k += 1
            start = stop + 1
        counts[12] = k
        return number

    with monkeypatch.context() as patch:
        patch.setattr(ms_indoor, "scan_ms_indoor", hand_over)
        return ms_indoor.read(path)


CHARACTERS = st.sampled_from([*"0123456789.-+eE\t\t:#aFnNTYPE_W \r\x00é\n", "1574661471701\tTYPE_"])
EDIT = st.tuples(st.integers(0, 2000), st.integers(0, 3), st.lists(CHARACTERS, max_size=4).map("".join))


@given(st.lists(st.sampled_from(LINES), min_size=1, max_size=12), st.lists(EDIT, max_size=6))
@settings(max_examples=200, deadline=None)
def test_both_paths_agree_on_mangled_lines(
    tmp_path_factory: pytest.TempPathFactory, lines: list[str], edits: list[tuple[int, int, str]]
) -> None:
    text = "\n".join(lines) + "\n"
    for at, removed, added in edits:
        i = at % (len(text) + 1)
        text = text[:i] + added + text[i + removed :]
    path = tmp_path_factory.mktemp("fuzz") / "walk.txt"
    path.write_text(HEADER + text, encoding="utf-8", newline="")
    fast = ms_indoor.read(path)
    with pytest.MonkeyPatch.context() as patch:
        slow = careful_only(path, patch)
    assert_same(fast, slow)
    assert fast.report.n_records == slow.report.n_records
    assert fast.report.n_lines == slow.report.n_lines
    issues = [{k: i.count for k, i in r.report.issues.items()} for r in (fast, slow)]
    assert issues[0] == issues[1]


NUMBERS = st.one_of(
    st.floats(-1e3, 1e3, allow_nan=False).map(repr),
    st.decimals(-999, 999, places=7).map(str),
    st.from_regex(r"-?[0-9]{1,22}(\.[0-9]{1,22})?(E-?[0-9]{1,3})?", fullmatch=True),
)


@given(st.tuples(NUMBERS, NUMBERS, NUMBERS))
@settings(max_examples=200, deadline=None)
def test_numbers_are_those_of_python_to_the_last_bit(
    tmp_path_factory: pytest.TempPathFactory, numbers: tuple[str, str, str]
) -> None:
    line = "\t".join(["1574661471701", "TYPE_ACCELEROMETER", *numbers, "3"])
    path = write(tmp_path_factory.mktemp("numbers"), [line])
    values = [float(n) for n in numbers]
    read = ms_indoor.read(path).acceleration.values.tolist()
    assert read == ([values] if max(map(abs, values)) <= 1e3 else [])


def test_two_records_on_a_line_are_both_read(tmp_path: Path) -> None:
    joined = LINES[1] + LINES[3] + LINES[11] + LINES[12] + LINES[8] + LINES[4]
    r = ms_indoor.read(write(tmp_path, [LINES[0], joined]))
    assert (len(r.acceleration), len(r.rotation_rate), len(r.orientation)) == (1, 1, 1)
    assert r.wifi[0].rssi.tolist() == [-72, -74]
    assert r.ble[0].rssi == -88
    assert r.report.issues["two records on a line, both read"].lines == [5]


@pytest.mark.parametrize("ssid", ["a\tb", "\t", "x\t-1\t2412", "TYPE_WIFI", "#", "net:work", "Ünï"])
def test_an_ssid_may_hold_anything(tmp_path: Path, ssid: str) -> None:
    line = f"1574661473481\tTYPE_WIFI\t{ssid}\t0a:74:9c:2e:af:f7\t-72\t5765\t1574661472768"
    r = ms_indoor.read(write(tmp_path, [line]))
    assert r.wifi[0].bssid.tolist() == [0x0A749C2EAFF7]
    assert r.wifi[0].rssi.tolist() == [-72]
    assert r.report.n_bad == 0


def test_hashed_identifiers_of_the_larger_edition(tmp_path: Path) -> None:
    token = "4a93b1fd3bf4cd98ee25d08bfcb31b1ba0d4ba2d"  # noqa: S105 (a digest)
    wifi = f"1574661473481\tTYPE_WIFI\t7182afc4e5c212133d5d7d76eb3d\t{token}\t-40\t5825\t1574661473400"
    beacon = f"1574661473482\tTYPE_BEACON\tu\tm\tn\t-62\t-79\t4.66\t{token}"
    r = ms_indoor.read(write(tmp_path, [wifi, wifi.replace("-40", "-41"), beacon]))
    assert r.wifi[0].bssid.tolist() == [bssid_id(token)] * 2
    assert r.wifi[0].bssid[0] >> np.uint64(63) == 1
    assert r.ble[0].id == bssid_id(token)
    assert r.report.n_bad == 0


def test_a_beacon_heard_twice_is_one_advertisement(tmp_path: Path) -> None:
    blue = "1574661471800\tTYPE_BLUE\tx\tE0:78:A3:3E:97:BD\t-78"
    beacon = (
        "1574661471900\tTYPE_BEACON\tU\t0\t0\t-56\t-78\t11.687424064721569\tE0:78:A3:3E:97:BD\t1574661471900"
    )
    r = ms_indoor.read(write(tmp_path, [blue, beacon]))
    assert [(b.t, b.rssi, b.tx_power) for b in r.ble] == [(1574661471.8, -78, -56)]


def test_bad_lines_cost_themselves_and_are_counted_with_their_place(tmp_path: Path) -> None:
    lines = [
        LINES[1],
        "1574661471721\tTYPE_ACCELEROMETER\t1.0\t2.0",
        "1574661471741\tTYPE_ACCELEROMETER\t1.0\tx\t3.0\t3",
        "garbage",
        "1574661471761\tTYPE_MYSTERY\t1",
        "1574661471761\tTYPE_WIFI\tssid\t0a:74:9c:2e:af:f7\t-72\t5765\t15746614727",
        LINES[3],
    ]
    r = ms_indoor.read(write(tmp_path, lines))
    assert {k: (i.count, i.lines) for k, i in r.report.issues.items()} == {
        "ACCELEROMETER: 4 fields of 6": (1, [5]),
        "ACCELEROMETER: not a number where one is due": (1, [6]),
        "not a record": (1, [7]),
        "unknown kind TYPE_MYSTERY": (1, [8]),
        "WIFI: not a number where one is due": (1, [9]),
    }
    assert (len(r.acceleration), len(r.rotation_rate)) == (1, 1)
    assert any("ACCELEROMETER: 4 fields of 6 (line 5)" in line for line in r.report.describe())


def test_windows_line_ends_and_blank_lines(tmp_path: Path) -> None:
    path = tmp_path / "walk.txt"
    path.write_bytes((HEADER + "\n\n".join(LINES) + "\n").replace("\n", "\r\n").encode())
    r = ms_indoor.read(path)
    (tmp_path / "unix").mkdir()
    assert_same(r, ms_indoor.read(write(tmp_path / "unix", LINES)))
    assert r.report.n_bad == 0


@pytest.mark.parametrize("content", [b"", b"{}", b"hello\nworld\n", bytes(range(256)) * 40])
def test_a_foreign_file_is_an_error(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "walk.txt"
    path.write_bytes(content)
    with pytest.raises(FormatError, match=r"walk\.txt"):
        ms_indoor.read(path)
