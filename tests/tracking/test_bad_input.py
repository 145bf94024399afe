"""Bad recordings through the real command line: a message for each, the good ones tracked all the same."""

from __future__ import annotations

import csv
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from wayfuse.simulator import faults

Run = Callable[..., Any]


@pytest.fixture
def text(world: Any) -> str:
    """A good recording."""
    return sorted((world.folder / "walks").rglob("*.txt"))[0].read_text()


@pytest.fixture
def tracked(world: Any, run_cli: Run, tmp_path: Path) -> Callable[..., tuple[Any, Counter[str]]]:
    """Track texts by name; what was said, and rows by walk."""

    def run(**texts: str | bytes) -> tuple[Any, Counter[str]]:
        paths = []
        for name, content in texts.items():
            path = tmp_path / f"{name}.txt"
            path.write_bytes(content if isinstance(content, bytes) else content.encode())
            paths.append(path)
        est = tmp_path / "EST.csv"
        said = run_cli(
            "track",
            world.folder / "SITE",
            *paths,
            "--radio-map",
            world.folder / "map.npz",
            "--particles",
            50,
            "--out",
            est,
        )
        assert "Traceback" not in said.err
        if not est.exists():
            return said, Counter()
        with est.open(newline="") as stream:
            found = list(csv.DictReader(stream))
        for row in found:
            assert np.all(
                np.isfinite([float(row[k]) for k in ("t_ms", "x", "y", "lat", "lon", "r68", "r95")])
            )
        return said, Counter(row["walk"] for row in found)

    return run


def without(text: str, *kinds: str) -> str:
    return "\n".join(line for line in text.splitlines() if not any(k in line for k in kinds)) + "\n"


IMU = ("TYPE_ACCELEROMETER", "TYPE_GYROSCOPE", "TYPE_MAGNETIC_FIELD", "TYPE_ROTATION_VECTOR")


def test_a_bad_file_among_good_ones(tracked: Any, text: str, tmp_path: Path) -> None:
    said, rows = tracked(one=text, empty=b"", noise=b"\x00\xff" * 500, two=text)
    assert said.code == 1
    assert set(rows) == {"one", "two"}
    assert rows["one"] > 20
    assert "2 of 4 recordings tracked" in said.out
    for name in ("empty", "noise"):
        assert f"note: {tmp_path / name}.txt: not a recording of a known format" in said.err


def test_many_recordings_in_two_processes_and_one_bad(
    world: Any, text: str, run_cli: Run, tmp_path: Path
) -> None:
    for name in "abcd":
        (tmp_path / f"{name}.txt").write_text(text)
    (tmp_path / "bad.txt").write_bytes(b"")
    listed = tmp_path / "list"
    listed.write_text("\n".join(str(tmp_path / f"{name}.txt") for name in ("a", "b", "bad", "c", "d")))
    said = run_cli(
        "track", world.folder / "SITE", f"@{listed}", "--radio-map", world.folder / "map.npz", "--particles", 50,
        "--jobs", 2, "--out", tmp_path / "EST.csv",
    )  # fmt: skip
    assert said.code == 1
    assert "4 of 5 recordings tracked" in said.out
    assert "bad.txt: not a recording" in said.err


def test_a_recording_with_a_header_alone(tracked: Any, text: str) -> None:
    header = "\n".join(line for line in text.splitlines() if line.startswith("#")) + "\n"
    said, rows = tracked(hollow=header, good=text)
    assert said.code == 0
    assert set(rows) == {"good"}
    assert "hollow.txt: empty: no estimate" in said.err


@pytest.mark.parametrize("share", [0.2, 0.5, 0.83])
def test_a_truncated_recording_is_tracked_to_its_end(tracked: Any, text: str, share: float) -> None:
    said, rows = tracked(cut=faults.truncated_text(text, share), good=text)
    assert said.code == 0
    assert 0 < rows["cut"] < rows["good"]


def test_without_wifi_the_position_stays_unknown(tracked: Any, text: str, tmp_path: Path) -> None:
    said, rows = tracked(deaf=without(text, "TYPE_WIFI"))
    assert said.code == 0
    assert rows["deaf"] > 20
    assert "deaf.txt: no Wi-Fi scan: the position stays unknown (state initialising)" in said.err
    with (tmp_path / "EST.csv").open(newline="") as stream:
        assert {row["state"] for row in csv.DictReader(stream)} == {"initialising"}


def test_without_motion_sensors_scans_are_left(tracked: Any, text: str) -> None:
    said, rows = tracked(still=without(text, *IMU))
    assert said.code == 0
    assert rows["still"] > 20
    assert "still.txt: no accelerometer: no steps" in said.err


def test_nothing_but_waypoints(tracked: Any, text: str) -> None:
    said, rows = tracked(truth=without(text, *IMU, "TYPE_WIFI"))
    assert said.code == 0
    assert not rows
    assert "truth.txt: empty: no estimate" in said.err


def test_only_unknown_access_points(tracked: Any, text: str) -> None:
    lines = [line.replace("\t0", "\tf", 1) if "TYPE_WIFI" in line else line for line in text.splitlines()]
    out = []
    for line in lines:
        fields = line.split("\t")
        if len(fields) > 4 and fields[1] == "TYPE_WIFI":
            fields[3] = "fe:ed:" + fields[3][-11:]
        out.append("\t".join(fields))
    said, rows = tracked(foreign="\n".join(out) + "\n")
    assert said.code == 0
    assert rows["foreign"] > 20
    assert "no access point of the survey" in said.out
    assert "used" not in said.out.split("scans:")[1]


def test_values_that_are_no_numbers_are_counted(tracked: Any, text: str) -> None:
    lines = text.splitlines()
    for i in range(100, len(lines), 97):
        fields = lines[i].split("\t")
        if len(fields) > 4 and fields[1] in IMU:
            fields[2] = ("nan", "inf", "1e400", "oops")[i % 4]
            lines[i] = "\t".join(fields)
    said, rows = tracked(odd="\n".join(lines) + "\n", good=text)
    assert said.code == 0
    assert abs(rows["odd"] - rows["good"]) <= 5
    assert "odd.txt: " in said.err


@pytest.mark.parametrize("ms", [-3_600_000, -5_000, 400_000])
def test_a_clock_that_jumps(tracked: Any, text: str, ms: int) -> None:
    said, rows = tracked(jumped=faults.text_clock_jump(text, 0.5, ms), good=text)
    assert said.code == 0
    assert rows["jumped"] > 0.8 * rows["good"]
    if ms < 0:
        assert "jumped.txt: " in said.err


def test_joined_and_garbled_lines(tracked: Any, text: str) -> None:
    garbled = faults.garbled_text(text, np.random.default_rng(0), 0.02)
    said, rows = tracked(joined=faults.joined_lines(text, 50), garbled=garbled, good=text)
    assert said.code == 0
    assert min(rows.values()) > 0.8 * rows["good"]
    assert "garbled.txt: " in said.err


def test_scans_that_come_twice_change_nothing(tracked: Any, text: str, tmp_path: Path) -> None:
    doubled = []
    for line in text.splitlines():
        doubled += [line] * (2 if "TYPE_WIFI" in line else 1)
    tracked(walk=text)
    want = (tmp_path / "EST.csv").read_text()
    said, _ = tracked(walk="\n".join(doubled) + "\n")
    assert said.code == 0
    assert (tmp_path / "EST.csv").read_text() == want


def test_absent_paths_and_lists(world: Any, run_cli: Run, tmp_path: Path) -> None:
    (tmp_path / "hollow").mkdir()
    (tmp_path / "list").write_text("# nothing\n")
    (tmp_path / "broken").write_text(f"{tmp_path / 'gone.txt'}\n")
    (tmp_path / "binary").write_bytes(b"\xff\xfe\x00")
    for argument, message in (
        (tmp_path / "gone.txt", "no such file or folder"),
        (tmp_path / "hollow", "no recording in this folder"),
        (f"@{tmp_path / 'missing'}", "no such list of recordings"),
        (f"@{tmp_path}", "no such list of recordings"),
        (f"@{tmp_path / 'list'}", "no path in this list"),
        (f"@{tmp_path / 'broken'}", "no such file or folder"),
        (f"@{tmp_path / 'binary'}", "binary"),
    ):
        said = run_cli(
            "track",
            world.folder / "SITE",
            argument,
            "--radio-map",
            world.folder / "map.npz",
            "--out",
            tmp_path / "E.csv",
        )
        assert said.code == 2
        assert message in said.err
        assert len(said.err.strip().splitlines()) == 1
