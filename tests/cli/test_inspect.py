"""``wayfuse inspect``: what a recording holds and every fault with its place."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from click.testing import CliRunner, Result

from wayfuse.cli.inspect import inspect
from wayfuse.core.errors import DataMissingError


def run(*arguments: object) -> Result:
    return CliRunner().invoke(inspect, [str(a) for a in arguments])


@pytest.fixture
def walk(tmp_path: Path) -> Path:
    t = 1574661471000
    lines = [
        "#\tstartTime:1",
        "#\tSiteName:Mall\tFloorName:F4",
        "#\tBrand:OPPO\tModel:PBCM10\tAndroidName:8.1.0",
    ]
    lines += [f"{t + 20 * k}\tTYPE_ACCELEROMETER\t0.5\t0.25\t9.75\t3" for k in range(101)]
    lines += [f"{t + 2000 * k}\tTYPE_WIFI\ts\t0a:74:9c:2e:af:f7\t-72\t5765\t{t}" for k in range(2)]
    lines += [f"{t}\tTYPE_WAYPOINT\t1.5\t2.5", "rubbish"]
    path = tmp_path / "walk.txt"
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def test_records_rates_and_faults(walk: Path) -> None:
    result = run(walk)
    assert result.exit_code == 0
    for part in (
        "ms-indoor, 108 lines, clock: Unix time",
        "OPPO PBCM10 Android 8.1.0, Mall F4",
        "2.0 s long",
        "101    50.00 Hz",
        "2 readings of 1 access points",
        "waypoints   1",
        "none of     rotation_rate, magnetic_field, pressure, orientation, ble",
        "1 x not a record (line 108)",
    ):
        assert part in result.output


def test_json_for_machines(walk: Path) -> None:
    (answer,) = json.loads(run("--json", walk).output)
    assert answer["format"] == "ms-indoor"
    assert answer["records"]["acceleration"]["count"] == 101
    assert answer["records"]["acceleration"]["rate"] == pytest.approx(50.0)
    assert answer["records"]["wifi_scans"] == {"count": 2, "rate": 0.5, "longest_gap": 2.0}
    assert answer["waypoints"] == [{"t": 1574661471.0, "x": 1.5, "y": 2.5, "floor": "F4"}]
    assert answer["issues"] == {"not a record": {"count": 1, "lines": [108]}}
    assert answer["kinds_in_file"] == {"ACCELEROMETER": 101, "WIFI": 2, "WAYPOINT": 1}


def test_a_file_that_cannot_be_read_does_not_stop_the_others(walk: Path, tmp_path: Path) -> None:
    (tmp_path / "foreign.txt").write_text("hello\n", encoding="utf-8")
    result = run(tmp_path / "foreign.txt", walk)
    assert result.exit_code == 1
    assert "foreign.txt: not a recording of a known format" in result.stderr
    assert "101    50.00 Hz" in result.stdout
    answers = json.loads(run("--json", tmp_path / "foreign.txt", walk).stdout)
    assert "not a recording" in answers[0]["error"]
    assert answers[1]["name"] == "walk"


def test_the_platform_reaches_the_reader(tmp_path: Path) -> None:
    (tmp_path / "phone").mkdir()
    for name in ("Gyroscope", "Magnetometer"):
        text = "time,x,y,z\n1679068247375690000,1,2,3\n"
        (tmp_path / "phone" / f"{name}.csv").write_text(text, encoding="utf-8")
    result = run(tmp_path / "phone")
    assert result.exit_code == 1
    assert "--platform" in result.stderr
    assert run("--platform", "ios", tmp_path / "phone").exit_code == 0


def test_an_absent_argument_is_an_error(tmp_path: Path) -> None:
    assert isinstance(run(tmp_path / "absent").exception, DataMissingError)


@pytest.mark.real_data
def test_a_real_walk_is_without_fault(ms_indoor: Path) -> None:
    path = sorted(ms_indoor.glob("F1/path_data_files/*.txt"))[0]
    (answer,) = json.loads(run("--json", path).output)
    assert answer["issues"] == {}
    assert answer["records"]["acceleration"]["rate"] == pytest.approx(50, abs=1)
    assert len(answer["waypoints"]) > 1


def test_ranges_and_their_anchors(tmp_path: Path) -> None:
    sensors = "AccX,AccY,AccZ,GyroX,GyroY,GyroZ,MagX,MagY,MagZ,Azimuth,Pitch,Roll,M1 Ground Truth"
    columns = "".join(
        f"AP{k} True Distance (m),AP{k} RTT Distance (m),AP{k} RTT std (m),AP{k} RSS (dBm)," for k in (1, 2)
    )
    rows = [
        f'{500 * k},5,{6 + k},0.1,-60,7,{8 + k},0.1,-70,0,0,9.8,0,0,0,20,5,-40,0,0,0,"[1, 2]"'
        for k in range(5)
    ]
    path = tmp_path / "113.csv"
    path.write_text(
        "\n".join([f"M1 Time Stamp (ms),{columns}{sensors}", *rows, "5000,1"]) + "\n", encoding="utf-8"
    )
    said = run(path).output
    for part in ("wifi-rtt, 7 lines", "ranges               10", "anchors     2", "too few columns (line 7)"):
        assert part in said
    (answer,) = json.loads(run("--json", path).output)
    assert (answer["anchors"], answer["records"]["ranges"]["count"], answer["access_points"]) == (2, 10, 0)
