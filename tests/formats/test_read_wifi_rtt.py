"""The reader of the walks of wifi-rtt: against tables written here, and the published ones."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from wayfuse.core.errors import DataMissingError, FormatError
from wayfuse.formats import wifi_rtt
from wayfuse.formats.reading import read, sniff
from wayfuse.sensors.records import bssid_id

AP1, AP2 = bssid_id("AP1"), bssid_id("AP2")
SENSORS = "AccX,AccY,AccZ,GyroX,GyroY,GyroZ,MagX,MagY,MagZ,Azimuth,Pitch,Roll"
HEADER = "M1 Time Stamp (ms)," + "".join(
    f"AP{k} True Distance (m),AP{k} RTT Distance (m),AP{k} RTT std (m),AP{k} RSS (dBm)," for k in (1, 2)
)
MOTION = "0.1,0.2,9.8,0.01,0.02,0.03,20,5,-40,1.5,0,0"
ONE, TWO = (
    f"{HEADER}{SENSORS},M1 Ground Truth",
    f"{HEADER}{SENSORS},M2 Ground Truth_x,M2 Ground Truth_y,user,circle",
)


def row(
    ms: object, first: str = "5,6.5,0.15,-60", second: str = "0,0,0,0", truth: str = '"[1.5, 2.5]"'
) -> str:
    return f"{ms},{first},{second},{MOTION},{truth}"


def written(tmp_path: Path, *lines: str) -> Path:
    path = tmp_path / "Room" / "1" / "113.csv"
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


@pytest.mark.parametrize(
    ("header", "truth"), [(ONE, '"[1.5, 2.5]"'), (TWO, "1.5,2.5,1,1"), ("\ufeff" + TWO, "1.5,2.5")]
)
def test_both_layouts_are_read(header: str, truth: str, tmp_path: Path) -> None:
    path = written(tmp_path, header, row(0, truth=truth), row(250.5, "5,6.25,0,-61", "9,11,0.3,-70", truth))
    recording = wifi_rtt.read(path)
    assert [r[:3] for r in recording.ranges] == [(0.0, AP1, 6.5), (0.2505, AP1, 6.25), (0.2505, AP2, 11.0)]
    assert [r.rssi for r in recording.ranges] == [-60.0, -61.0, -70.0]
    assert [r.sigma for r in recording.ranges] == pytest.approx([0.15, np.nan, 0.3], nan_ok=True)
    assert [w[:3] for w in recording.waypoints] == [(0.0, 1.5, 2.5), (0.2505, 1.5, 2.5)]
    assert recording.acceleration.values.tolist() == [[0.1, 0.2, 9.8]] * 2
    assert recording.rotation_rate.values.tolist() == [[0.01, 0.02, 0.03]] * 2
    assert recording.magnetic_field.values.tolist() == [[20.0, 5.0, -40.0]] * 2
    assert recording.report.n_bad == 0
    assert sniff(path) == "wifi-rtt"
    assert len(read(path).ranges) == 3


def test_what_is_wrong_costs_itself_and_is_counted(tmp_path: Path) -> None:
    path = written(
        tmp_path,
        ONE,
        row(0),
        row(100),  # filled up
        row(200, "5,8417.9,0.1,-60"),
        row("soon"),
        row(150),
        "300,1,2",
        row(400, "5,7,0.1,-60", truth="nowhere").replace(MOTION, "x" + MOTION),
    )
    recording = wifi_rtt.read(path)
    assert [r[:3] for r in recording.ranges] == [(0.0, AP1, 6.5), (0.4, AP1, 7.0)]
    assert [w.t for w in recording.waypoints] == [0.0, 0.1, 0.2]
    assert {kind: issue.lines for kind, issue in recording.report.issues.items()} == {
        "a reading repeated": [3],
        "a range or RSS out of range": [4],
        "a row without a time": [5],
        "a time that steps back": [6],
        "a row with too few columns": [7],
        "acceleration that is no number or out of range": [8],
        "a true place that is none": [8],
    }


def test_places_of_the_access_points(tmp_path: Path) -> None:
    path = written(tmp_path, ONE, row(0))
    room = path.parent.parent
    with pytest.raises(DataMissingError):
        wifi_rtt.read_places(room)
    assert wifi_rtt.read(path).site == ""
    (room / "AP_idx_Room.csv").write_text("\ufeff,x,y\nAP1,1.5,20.25\nAP2,0,0\n", encoding="utf-8")
    assert wifi_rtt.read_places(room) == ((AP1, 1.5, 20.25),)
    assert wifi_rtt.read(path).site == "Room"
    (room / "AP_idx_Room.csv").write_text(",x,y\nAP1,1.5,far\n", encoding="utf-8")
    with pytest.raises(FormatError, match="line 2"):
        wifi_rtt.read_places(room)


@pytest.mark.parametrize("content", ["", "a,b\n1,2\n", HEADER + "\n", "M1 Time Stamp (ms),M1 Ground Truth\n"])
def test_other_tables_are_refused(content: str, tmp_path: Path) -> None:
    with pytest.raises(FormatError, match="no table"):
        wifi_rtt.read(written(tmp_path, content))


def test_a_file_too_large_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(wifi_rtt, "_MOST_BYTES", 10)
    with pytest.raises(FormatError, match="larger than"):
        wifi_rtt.read(written(tmp_path, ONE, row(0)))


@settings(max_examples=80)
@given(data=st.binary(max_size=200), at=st.integers(0, 120))
def test_no_bytes_break_the_reader(data: bytes, at: int, tmp_path_factory: pytest.TempPathFactory) -> None:
    path = written(tmp_path_factory.mktemp("rtt"), ONE, row(0))
    line = row(100).encode()
    with path.open("ab") as file:
        file.write(line[:at] + data + line[at:] + b"\n" + data)
    recording = wifi_rtt.read(path)
    assert recording.ranges
    assert all(np.isfinite(r.distance) for r in recording.ranges)
    assert (np.diff([w.t for w in recording.waypoints]) > 0).all()


@pytest.mark.real_data
@pytest.mark.parametrize(("scene", "n_anchors"), [("Laboratory", 6), ("Conference Room", 8)])
def test_published_distances_are_those_to_the_places(scene: str, n_anchors: int, data_root: Path) -> None:
    folder = data_root / "wifi-rtt" / "rtt_imu_haiyaoyu" / "raw_data" / scene
    if not folder.is_dir():
        pytest.skip(f"REAL DATA ABSENT: no folder {folder}; fetch with `wayfuse datasets fetch wifi-rtt`")
    places = {p.anchor: np.array([p.x, p.y]) for p in wifi_rtt.read_places(folder)}
    assert len(places) == n_anchors
    walks = sorted(folder.glob("*/[0-9][0-9][0-9].csv"))
    assert len(walks) == 10
    for path in walks:
        recording = wifi_rtt.read(path)
        assert recording.site == scene
        assert {r.anchor for r in recording.ranges} <= set(places)
        truth = {w.t: np.array([w.x, w.y]) for w in recording.waypoints}
        true = np.array([np.hypot(*(truth[r.t] - places[r.anchor])) for r in recording.ranges])
        error = np.array([r.distance for r in recording.ranges]) - true
        assert abs(float(np.median(error))) < 4.0  # ranges are long by metres in these rooms
        assert recording.report.n_records["rows"] == len(recording.waypoints)
        line = path.read_text(encoding="utf-8-sig").splitlines()[1].split(",")
        stated = [float(line[1 + 4 * k]) for k in range(8)]  # true distances of the first row
        start = truth[0.0]
        for k, distance in enumerate(stated, 1):
            if distance:
                assert np.hypot(*(start - places[bssid_id(f"AP{k}")])) == pytest.approx(distance, abs=0.01)
