"""The GetSensorData reader on the real IPIN logs and on the traps of the format."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from wayfuse.core.errors import FormatError
from wayfuse.formats import getsensordata, read
from wayfuse.sensors.recording import Recording
from wayfuse.sensors.records import bssid_id

HEADER = """% LogFile created by the 'GetSensorData' App for Android.
% Manufacturer:            \tsamsung
% Model:                   \tSM-A520F
% Android version Release: \t8.0.0
"""
ADDRESS = "20:23:00:00:00:01"


def load(tmp_path: Path, text: str, encoding: str = "utf-8") -> Recording:
    path = tmp_path / "log.txt"
    path.write_bytes((HEADER + text).encode(encoding))
    return getsensordata.read(path)


@pytest.fixture(scope="module")
def logs(data_root: Path) -> Path:
    folder = data_root / "ipin2023-track3" / "logs"
    if not folder.is_dir():
        pytest.skip(
            f"REAL DATA ABSENT: no folder {folder}; fetch with `wayfuse datasets fetch ipin2023-track3`"
        )
    return folder


@pytest.fixture(scope="module")
def stairs(logs: Path) -> Recording:
    return read(logs / "IPIN2023_T3_TrainingTrial52_repetition01.txt")


@pytest.mark.real_data
def test_a_real_log_arrives_whole(logs: Path, stairs: Recording) -> None:
    text = (logs / f"{stairs.name}.txt").read_text(encoding="latin-1")
    n = {k: text.count(f"\n{k};") for k in ("ACCE", "GYRO", "MAGN", "PRES", "AHRS", "WIFI", "BLE4", "POSI")}
    assert len(stairs.acceleration) == n["ACCE"] > 5000
    assert len(stairs.rotation_rate) == n["GYRO"]
    assert len(stairs.magnetic_field) == n["MAGN"]
    assert len(stairs.pressure) == n["PRES"] > 500
    assert len(stairs.orientation) == n["AHRS"]
    assert sum(len(s.bssid) for s in stairs.wifi) == n["WIFI"] > 500
    assert len(stairs.ble) == n["BLE4"]
    assert len(stairs.waypoints) == n["POSI"] > 5
    assert stairs.report.n_bad == 0
    assert stairs.report.n_records["GNSS"] > 0
    assert (stairs.clock, stairs.device.brand, stairs.device.system) == (
        "AppTimestamp",
        "samsung",
        "Android 8.0.0",
    )
    assert {w.floor for w in stairs.waypoints} == {"0", "-2"}
    assert all(49 < w.lat < 50 and 11 < w.lon < 12 and math.isnan(w.x) for w in stairs.waypoints)
    assert all(950 < p < 1050 for p in stairs.pressure.values[:, 0])


@pytest.mark.real_data
def test_orientation_is_device_to_east_north_up(stairs: Recording) -> None:
    """Gravity lies along up, the magnetic field along north (declination at the site: 4 degrees)."""
    w, x, y, z = stairs.orientation.values.T
    up = np.column_stack([2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)])
    north = np.column_stack([2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)])
    t = stairs.orientation.t
    force, field = (
        np.column_stack([np.interp(t, s.t, s.values[:, k]) for k in range(3)])
        for s in (stairs.acceleration, stairs.magnetic_field)
    )
    assert 9.2 < np.einsum("ij,ij->i", up, force).mean() < 10.2  # phones are off by some per cent
    n, e = (np.einsum("ij,ij->i", axis, field).mean() for axis in (north, np.cross(north, up)))
    assert abs(math.degrees(math.atan2(e, n))) < 15


@pytest.mark.real_data
def test_last_seen_is_on_the_recording_clock(stairs: Recording) -> None:
    age = np.concatenate([s.t - s.last_seen for s in stairs.wifi])
    assert age.min() >= 0.0
    assert age.min() < 1e-3
    assert np.median(age) < 0.2


@pytest.mark.real_data
def test_a_rebuilt_log_does_not_invent_last_seen(logs: Path) -> None:
    r = read(logs / "IPIN2023_T3_TrainingTrial53_repetition01.txt")
    assert all(np.isnan(s.last_seen).all() for s in r.wifi)
    assert len(r.wifi) > 50
    assert all(math.isnan(b.tx_power) for b in r.ble)
    assert r.report.n_bad == 0


@pytest.mark.real_data
@pytest.mark.slow
def test_all_real_logs_are_without_fault(logs: Path, read_log: Callable[[Path], Recording]) -> None:
    paths = sorted(logs.glob("*.txt"))
    assert len(paths) == 39
    for path in paths:
        r = read_log(path)
        assert r.report.n_bad == 0
        assert 48 < len(r.acceleration) / np.ptp(r.acceleration.t) < 52 or len(r.acceleration) > 1000


def test_wifi_with_five_and_six_fields_and_any_ssid(tmp_path: Path) -> None:
    r = load(
        tmp_path,
        f"WIFI;1.0;101.0;plain;{ADDRESS};2437;-60\n"
        f"WIFI;1.0;101.0;plain;20:23:00:00:00:02;-61\n"
        f"WIFI;1.0;101.0;a;b;;c;20:23:00:00:00:03;5180;-62\n"
        f"WIFI;1.0;101.0;x;1;2;20:23:00:00:00:04;-63\n"
        f"WIFI;1.0;101.0;;20:23:00:00:00:05;2412;-64;\n",
    )
    (scan,) = r.wifi
    assert scan.rssi.tolist() == [-60, -61, -62, -63, -64]
    assert scan.frequency.tolist() == [2437, 0, 5180, 0, 2412]
    assert scan.bssid.tolist() == [bssid_id(f"20:23:00:00:00:0{k}") for k in range(1, 6)]
    assert r.report.n_bad == 0


def test_repeats_of_a_stale_reading_keep_one_time(tmp_path: Path) -> None:
    lines = []
    for k in range(5):
        t = 4.0 * k + 1
        lines.append(f"WIFI;{t};{1000 + t - 0.05 - 0.01 * k};s;20:23:00:00:00:0{k};2437;-60")
        lines.append(f"WIFI;{t};{1000.5};s;20:23:00:00:00:0a;2437;-70")
    r = load(tmp_path, "\n".join(lines) + "\n")
    stale = [s.last_seen[s.bssid == bssid_id("20:23:00:00:00:0a")][0] for s in r.wifi]
    assert len(set(stale)) == 1
    ages = [s.t - s.last_seen[0] for s in r.wifi]
    np.testing.assert_allclose(ages, [0.0, 0.01, 0.02, 0.03, 0.04], atol=1e-9)


def test_a_last_seen_from_the_future_is_unknown(tmp_path: Path) -> None:
    lines = [f"WIFI;{k}.0;{100 + k}.0;s;{ADDRESS};2437;-60" for k in range(1, 9)]
    lines[4] = lines[4].replace("105.0", "99999.0")
    r = load(tmp_path, "\n".join(lines) + "\n")
    assert [bool(np.isnan(s.last_seen[0])) for s in r.wifi] == [k == 4 for k in range(8)]
    assert r.report.issues["wifi: last seen after delivery, taken as unknown"].lines == [9]


def test_bluetooth_in_its_three_forms(tmp_path: Path) -> None:
    r = load(
        tmp_path,
        "BLUE;1.0;a;name;BE:AC:20:23:00:01;-80\n"
        "BLE4;2.0;iBeacon;BE:AC:20:23:00:02;-81;-59;1;2;UUID\n"
        "BLE4;3.0;iBeacon;BE:AC:20:23:00:03;-82;;;;\n"
        "BLE4;4.0;Eddystone;BE:AC:20:23:00:04;-83;0011\n",
    )
    assert [(b.t, b.rssi) for b in r.ble] == [(1.0, -80), (2.0, -81), (3.0, -82), (4.0, -83)]
    assert r.ble[1].tx_power == -59
    assert math.isnan(r.ble[2].tx_power)
    assert r.report.n_bad == 0


def test_places_and_the_unedited_log(tmp_path: Path) -> None:
    r = load(tmp_path, "POSI;1.5;1;49.461316433032;11.110964442580;-1;100\nPOSI;2.5;2;0;0;0;0\n")
    assert r.waypoints[0].floor == "-1"
    assert (r.waypoints[0].lat, r.waypoints[0].lon) == (49.461316433032, 11.110964442580)
    assert r.report.issues["POSI: no place given (0;0)"].lines == [6]


def test_joined_records_and_faults(tmp_path: Path) -> None:
    r = load(
        tmp_path,
        "ACCE;0.1;5.1;1;2;9;3GYRO;0.2;5.2;0.1;0.2;0.3;3\n"
        f"WIFI;0.3;5.3;s;{ADDRESS};2437;-60ACCE;0.4;5.4;1;2;9;3\n"
        "ACCE;0.5;5.5;1;2\n"
        "ACCE;x;5.5;1;2;9;3\n"
        "ACCE;0.6;5.6;1;two;9;3\n"
        "WIFI;0.7;5.7;s;nonsense;2437;-60\n"
        "what is this\n"
        "GNSS;0.8;1;2;3;4;5;6;7;8;9\n"
        "ACCE;0.9;5.9;1;2",
    )
    assert r.acceleration.t.tolist() == [0.1, 0.4]
    assert r.rotation_rate.values.tolist() == [[0.1, 0.2, 0.3]]
    assert r.wifi[0].rssi.tolist() == [-60]
    assert {k: i.count for k, i in r.report.issues.items()} == {
        "two records on a line, both read": 2,
        "ACCE: 5 fields of 7": 1,
        "ACCE: no time": 1,
        "ACCE: not a number where one is due": 1,
        "WIFI: no BSSID": 1,
        "not a record": 1,
        "truncated last line": 1,
    }
    assert r.report.n_records["GNSS"] == 1


def test_latin_1_and_utf_8_headers(tmp_path: Path) -> None:
    line = "% Model: \tTéléphone\nACCE;0.1;5.1;1;2;9;3\n"
    for encoding in ("utf-8", "latin-1"):
        assert load(tmp_path, line, encoding).device.model == "Téléphone"


def test_a_header_alone_and_a_foreign_file(tmp_path: Path) -> None:
    r = load(tmp_path, "")
    assert r.is_empty
    assert r.report.issues["no record in the recording"].count == 1
    (tmp_path / "foreign.txt").write_text("a;b;c\n1;2;3\n", encoding="utf-8")
    with pytest.raises(FormatError, match="neither a header nor a record of GetSensorData"):
        getsensordata.read(tmp_path / "foreign.txt")


def test_blocks_stream_the_file_in_order(tmp_path: Path) -> None:
    text = "".join(f"ACCE;{k / 50};{k / 50};{k};2;9;3\n" for k in range(500))
    whole = load(tmp_path, text)
    pieces = list(getsensordata.blocks(tmp_path / "log.txt", 2000))
    assert len(pieces) > 4
    x = np.concatenate([p.columns["acceleration"].values[:, 0] for p in pieces if p.columns])
    np.testing.assert_array_equal(x, whole.acceleration.values[:, 0])
