"""The Sensor Logger reader: folder, ZIP and JSON alike; Android and iOS conventions; hostile archives."""

from __future__ import annotations

import csv
import io
import json
import math
import zipfile
from pathlib import Path

import numpy as np
import pytest

from wayfuse.core.errors import FormatError, UsageError
from wayfuse.formats import read, sniff
from wayfuse.formats import sensor_logger_tables as tables
from wayfuse.sensors.recording import Recording

T0 = 1679068247375690000  # ns
G = 9.80665


def rows_of(
    name: str, columns: list[str], values: list[list[object]], step_ms: int = 20
) -> tuple[str, list[list[str]]]:
    """A sensor's rows with the header first, time and seconds_elapsed added in front."""
    out = [["time", "seconds_elapsed", *columns]]
    for k, row in enumerate(values):
        out.append([str(T0 + k * step_ms * 1_000_000), f"{k * step_ms / 1000}", *map(str, row)])
    return name, out


def metadata(**fields: str) -> tuple[str, list[list[str]]]:
    return "Metadata", [list(fields), list(fields.values())]


def android() -> dict[str, list[list[str]]]:
    """Flat on a table, screen up, then a scan of two and one advertisement."""
    n = 40
    return dict(
        [
            metadata(
                **{"version": "3", "device name": "SM-A520F", "platform": "android", "appVersion": "1.12.0"}
            ),
            rows_of("TotalAcceleration", ["z", "y", "x"], [[G, 0.2, 0.1]] * n),
            rows_of("Accelerometer", ["z", "y", "x"], [[0.0, 0.2, 0.1]] * n),
            rows_of("Gravity", ["z", "y", "x"], [[G, 0, 0]] * n),
            rows_of("Gyroscope", ["z", "y", "x"], [[0.03, 0.02, 0.01]] * n),
            rows_of("Magnetometer", ["z", "y", "x"], [[-40, 20, 0]] * n),
            rows_of("Barometer", ["relativeAltitude", "pressure"], [[0, 947.77]] * 5),
            rows_of(
                "Orientation", ["yaw", "qx", "qz", "roll", "qw", "qy", "pitch"], [[0, 0, 0, 0, 1, 0, 0]] * n
            ),
            rows_of(
                "WiFi",
                ["ssid", "bssid", "frequency", "level", "capabilities"],
                [
                    ['a,"b"', "aa:bb:cc:dd:ee:01", 5180, -57, "[WPA2]"],
                    ["", "aa:bb:cc:dd:ee:02", 2412, -71, ""],
                ],
                step_ms=3,
            ),
            rows_of("Bluetooth", ["id", "rssi", "txPowerLevel"], [["AA:BB:CC:DD:EE:03", -80, ""]]),
            rows_of("Annotation", ["text", "millisecond_press_duration"], [["door", 12]]),
        ]
    )


def ios(*, standardised: bool | None = None) -> dict[str, list[list[str]]]:
    """Flat on a table, screen up, x to the north and y to the west, as iOS or as the app writes it."""
    n = 40
    sign = 1 if standardised else -1
    fields = {"version": "3", "device name": "iPhone 12 Pro", "platform": "ios"}
    if standardised is not None:
        fields["standardisation"] = str(standardised).lower()
    c = math.sqrt(0.5)
    q = [c, 0, 0, c] if standardised else [1, 0, 0, 0]
    return dict(
        [
            metadata(**fields),
            rows_of("Accelerometer", ["z", "y", "x"], [[0.0, 0.2 * sign, 0.1 * sign]] * n),
            rows_of("Gravity", ["z", "y", "x"], [[G * sign, 0, 0]] * n),
            rows_of("Magnetometer", ["z", "y", "x"], [[-40, 0, 20]] * n),
            rows_of("Orientation", ["qw", "qx", "qy", "qz"], [q] * n),
        ]
    )


def as_folder(root: Path, data: dict[str, list[list[str]]]) -> Path:
    folder = root / "2023-03-17_15-50-47"
    folder.mkdir()
    for name, rows in data.items():
        with (folder / f"{name}.csv").open("w", newline="", encoding="utf-8") as file:
            csv.writer(file, lineterminator="\n").writerows(rows)
    return folder


def as_zip(root: Path, data: dict[str, list[list[str]]], inside: str = "") -> Path:
    path = root / "2023-03-17_15-50-47.zip"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, rows in data.items():
            text = io.StringIO()
            csv.writer(text, lineterminator="\n").writerows(rows)
            archive.writestr(f"{inside}{name}.csv", text.getvalue())
    return path


def as_json(root: Path, data: dict[str, list[list[str]]], indent: int | None = None) -> Path:
    path = root / "2023-03-17_15-50-47.json"
    flat = [
        {"sensor": name, **dict(zip(rows[0], row, strict=True))}
        for name, rows in data.items()
        for row in rows[1:]
    ]
    path.write_text(json.dumps(flat, indent=indent), encoding="utf-8")
    return path


FORMS = [as_folder, as_zip, as_json, lambda root, data: as_zip(root, data, "export/")]


@pytest.mark.parametrize("form", FORMS)
def test_android_in_every_form(tmp_path: Path, form) -> None:
    r = read(form(tmp_path, android()))
    assert r.name == "2023-03-17_15-50-47"
    assert (r.device.model, r.device.system, r.clock) == ("SM-A520F", "android", "Unix time")
    assert r.acceleration.values[0].tolist() == [0.1, 0.2, G]
    assert r.acceleration.t[:2].tolist() == [1679068247.37569, 1679068247.39569]
    assert r.rotation_rate.values[0].tolist() == [0.01, 0.02, 0.03]
    assert r.magnetic_field.values[0].tolist() == [0, 20, -40]
    assert r.pressure.values[0].tolist() == [947.77]
    assert r.orientation.values[0].tolist() == [1, 0, 0, 0]
    (scan,) = r.wifi
    assert scan.t == (T0 + 3_000_000) / 1e9
    assert scan.bssid.tolist() == [0xAABBCCDDEE01, 0xAABBCCDDEE02]
    assert scan.rssi.tolist() == [-57, -71]
    assert scan.frequency.tolist() == [5180, 2412]
    assert np.isnan(scan.last_seen).all()
    assert (r.ble[0].id, r.ble[0].rssi) == (0xAABBCCDDEE03, -80)
    assert r.report.n_bad == 0
    assert r.report.n_records["Annotation"] == 1


@pytest.mark.parametrize("standardised", [None, False, True])
def test_ios_signs_and_reference_frame(tmp_path: Path, standardised: bool | None) -> None:
    r = read(as_folder(tmp_path, ios(standardised=standardised)))
    np.testing.assert_allclose(r.acceleration.values[0], [0.1, 0.2, G])
    w, _, _, z = r.orientation.values[0]
    assert 2 * math.atan2(z, w) == pytest.approx(math.pi / 2)  # x to the north is a quarter turn from east
    assert r.report.n_bad == 0


def test_the_platform_is_never_guessed(tmp_path: Path) -> None:
    data = android()
    del data["Metadata"]
    path = as_folder(tmp_path, data)
    with pytest.raises(FormatError, match="--platform android or --platform ios"):
        read(path)
    assert read(path, platform="android").acceleration.values[0, 2] == G
    assert len(read(path, platform="Android").acceleration) == 40
    with pytest.raises(UsageError, match="unknown platform 'symbian'"):
        read(path, platform="symbian")


def test_a_platform_that_contradicts_the_recording_is_refused(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="says android, the option ios"):
        read(as_json(tmp_path, android()), platform="ios")


@pytest.mark.parametrize("fault", ["conjugated frame", "wrong sign of gravity"])
def test_an_orientation_that_contradicts_the_sensors_is_left_out(tmp_path: Path, fault: str) -> None:
    data = android()
    if fault == "wrong sign of gravity":
        data["Orientation"] = rows_of("Orientation", ["qw", "qx", "qy", "qz"], [[0, 1, 0, 0]] * 40)[1]
    else:
        data["Orientation"] = rows_of("Orientation", ["qw", "qx", "qy", "qz"], [[0.6, 0, 0, 0.8]] * 40)[1]
    r = read(as_folder(tmp_path, data))
    assert len(r.orientation) == 0
    (what,) = r.report.issues
    assert what.startswith("Orientation: its ")
    assert r.report.issues[what].count == 40


def test_acceleration_without_gravity_is_not_taken_for_specific_force(tmp_path: Path) -> None:
    data = ios()
    del data["Gravity"], data["Orientation"]
    r = read(as_folder(tmp_path, data))
    assert len(r.acceleration) == 0
    assert r.report.issues["Accelerometer: no Gravity to go with it, not used"].count == 40


def test_bad_rows_cost_themselves(tmp_path: Path) -> None:
    path = as_folder(tmp_path, android())
    file = path / "Gyroscope.csv"
    lines = file.read_text().splitlines()
    lines[3] = lines[3].replace("0.02", "oops")
    lines[5] = lines[5].replace("0.02", "NaN")
    lines[7] = ",".join(lines[7].split(",")[:3])
    lines[40] = lines[40][:30]
    file.write_text("\n".join(lines))
    r = read(path)
    assert len(r.rotation_rate) == 36
    assert {k: (i.count, i.lines) for k, i in r.report.issues.items()} == {
        "Gyroscope: not a number where one is due": (1, [4]),
        "rotation rate: not finite": (1, [6]),
        "Gyroscope: 3 fields of 5": (1, [8]),
        "truncated last line": (1, [41]),
    }


def test_a_missing_column_is_named(tmp_path: Path) -> None:
    data = android()
    data["Gyroscope"] = rows_of("Gyroscope", ["z", "y"], [[0.03, 0.02]] * 3)[1]
    r = read(as_folder(tmp_path, data))
    assert r.report.issues["Gyroscope: no column x"].count == 3
    assert len(r.acceleration) == 40


def test_json_faults_and_a_cut_export(tmp_path: Path) -> None:
    path = as_json(tmp_path, android())
    text = path.read_text()
    records = text[1:-1].split("}, {")
    records[5] = records[5][:20]
    path.write_text("[" + "}, {".join(records)[:-60], encoding="utf-8")
    r = read(path)
    assert len(r.acceleration) == 39
    assert {k: i.count for k, i in r.report.issues.items()} == {
        "not a JSON object": 1,
        "truncated last record": 1,
    }


def test_json_is_read_in_pieces(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = as_json(tmp_path, android(), indent=1)
    whole = read(path)
    monkeypatch.setattr(tables, "_CHUNK", 333)
    pieces = read(path)
    np.testing.assert_array_equal(pieces.acceleration.values, whole.acceleration.values)
    assert pieces.report.n_records == whole.report.n_records


def test_scans_are_apart_by_half_a_second(tmp_path: Path) -> None:
    data = android()
    wifi = [["s", f"aa:bb:cc:dd:ee:0{k}", 2412, -60] for k in range(4)]
    data["WiFi"] = rows_of("WiFi", ["ssid", "bssid", "frequency", "level"], wifi, step_ms=600)[1]
    assert len(read(as_folder(tmp_path, data)).wifi) == 4


def bomb(root: Path) -> Path:
    path = root / "bomb.zip"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        with archive.open("Accelerometer.csv", "w") as member:
            for _ in range(300):
                member.write(b"0" * (1 << 20))
        archive.writestr("Metadata.csv", "platform\nandroid\n")
    return path


def test_a_zip_bomb_is_refused_before_it_is_read(tmp_path: Path) -> None:
    with pytest.raises(FormatError, match=r"would unpack to 315 MB in 2 files from 0.3 MB"):
        read(bomb(tmp_path))


def test_a_zip_writes_nothing_and_reads_nothing_outside(tmp_path: Path) -> None:
    path = as_zip(tmp_path, android())
    with zipfile.ZipFile(path, "a") as archive:
        archive.writestr("../evil.csv", "time\n1\n")
        archive.writestr("/etc/evil.csv", "time\n1\n")
    before = {p.name for p in tmp_path.parent.iterdir()}
    r = read(path)
    assert r.report.issues["ZIP: member name that leads outside, not read"].count == 2
    assert {p.name for p in tmp_path.parent.iterdir()} == before
    assert [p.name for p in tmp_path.iterdir()] == [path.name]


def test_a_zip_of_two_recordings_and_a_broken_zip(tmp_path: Path) -> None:
    path = as_zip(tmp_path, android(), "a/")
    with zipfile.ZipFile(path, "a") as archive:
        archive.writestr("b/Gyroscope.csv", "time,x,y,z\n")
    with pytest.raises(FormatError, match="holds 2 recordings"):
        read(path)
    whole = as_zip(tmp_path, android()).read_bytes()
    (tmp_path / "cut.zip").write_bytes(whole[: len(whole) // 2])
    with pytest.raises(FormatError, match=r"cut\.zip"):
        read(tmp_path / "cut.zip", format="sensor-logger")


def test_a_damaged_member_keeps_the_others(tmp_path: Path) -> None:
    data = android()
    path = as_zip(tmp_path, data)
    raw = bytearray(path.read_bytes())
    with zipfile.ZipFile(path) as archive:
        info = archive.getinfo("Gyroscope.csv")
    at = info.header_offset + 30 + len(info.filename)
    raw[at + 10 : at + 30] = bytes(20)
    path.write_bytes(raw)
    r = read(path)
    assert len(r.acceleration) == 40
    assert any("unreadable from here on" in what for what in r.report.issues)


def real(root: Path) -> Path:
    path = root / "sensorlogger" / "sensorlogger_ethz" / "data" / "2023-03-17_15-50-47"
    if not path.is_dir():
        pytest.skip(f"REAL DATA ABSENT: no folder {path}; fetch with `wayfuse datasets fetch sensorlogger`")
    return path


@pytest.mark.real_data
def test_a_real_export(data_root: Path) -> None:
    path = real(data_root)
    assert sniff(path) == "sensor-logger"
    r: Recording = read(path)
    assert len(r.acceleration) == 34667
    assert (len(r.rotation_rate), len(r.magnetic_field), len(r.pressure)) == (34648, 34650, 3853)
    assert 9.5 < np.linalg.norm(r.acceleration.values, axis=1).mean() < 10.2
    assert r.acceleration.values[0].tolist() == [0.12689268589019775, -0.002394201699644327, 9.66539192199707]
    assert 45 < len(r.acceleration) / (r.span[1] - r.span[0]) < 55
    assert r.device.model == "SM-A520F"
    assert r.report.n_bad == 0


@pytest.mark.real_data
def test_linear_acceleration_plus_gravity_is_the_total_on_a_real_phone(
    data_root: Path, tmp_path: Path
) -> None:
    path = real(data_root)
    for name in ("Accelerometer", "Gravity", "Metadata"):
        lines = (path / f"{name}.csv").read_text(encoding="utf-8").splitlines(keepends=True)
        (tmp_path / f"{name}.csv").write_text("".join(lines[:3000]), encoding="utf-8")
    joined, total = read(tmp_path).acceleration, read(path).acceleration
    assert len(joined) == 2999
    at = np.column_stack([np.interp(joined.t, total.t, total.values[:, k]) for k in range(3)])
    assert np.median(np.abs(joined.values - at)) < 0.05
