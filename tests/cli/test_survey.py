"""``wayfuse survey build``: from recordings with waypoints to a radio map."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from wayfuse.core.frames import GeoAnchor
from wayfuse.maps.build import build_floor
from wayfuse.maps.site import Polygon, Site
from wayfuse.radio.walk_survey import load

Run = Callable[..., Any]


@pytest.fixture
def build(world: Any, run_cli: Run, tmp_path: Path) -> Run:
    def run(*arguments: object) -> Any:
        return run_cli("survey", "build", world.folder / "SITE", *arguments, "--out", tmp_path / "map.npz")

    return run


def test_the_radio_map_is_that_of_the_library(world: Any, build: Run, tmp_path: Path) -> None:
    said = build(world.folder / "survey")
    assert said.code == 0, said.err
    n = len(list((world.folder / "survey").rglob("*.txt")))
    assert f"{n} of {n} recordings surveyed: {len(world.survey)} fingerprints" in said.out
    made = load(tmp_path / "map.npz")
    assert made.site == world.site.name
    np.testing.assert_allclose(np.sort(made.survey.xy[:, 0]), np.sort(world.survey.xy[:, 0]))


def test_the_same_bytes_from_one_process_and_two(world: Any, build: Run, tmp_path: Path) -> None:
    files = []
    for jobs in (1, 2):
        assert build(world.folder / "survey", "--jobs", jobs).code == 0
        files.append((tmp_path / "map.npz").read_bytes())
    assert files[0] == files[1]


def test_json_names_every_floor(world: Any, build: Run) -> None:
    said = build(world.folder / "survey" / "F1", "--json")
    document = json.loads(said.out)
    assert document["fingerprints_by_floor"]["F2"] == 0
    assert document["fingerprints"] == document["fingerprints_by_floor"]["F1"] > 100
    said = build(world.folder / "survey" / "F1")
    assert "not surveyed: nobody can be found here" in said.out


def test_bad_recordings_are_named_and_the_others_surveyed(world: Any, build: Run, tmp_path: Path) -> None:
    good = sorted((world.folder / "survey").rglob("*.txt"))[0]
    text = good.read_text()
    bad, deaf, lost, far = (tmp_path / f"{name}.txt" for name in ("bad", "deaf", "lost", "far"))
    bad.write_bytes(b"")
    deaf.write_text("\n".join(line for line in text.splitlines() if "WIFI" not in line) + "\n")
    lost.write_text("\n".join(line for line in text.splitlines() if "WAYPOINT" not in line) + "\n")
    lines = [
        "\t".join([*line.split("\t")[:2], "5000.0", "1.0"]) if "WAYPOINT" in line else line
        for line in text.splitlines()
    ]
    far.write_text("\n".join(lines) + "\n")
    said = build(good, bad, deaf, lost, far)
    assert said.code == 1
    assert "1 of 5 recordings surveyed" in said.out
    assert "bad.txt: not a recording" in said.err
    assert "deaf.txt: no Wi-Fi scan: nothing surveyed" in said.err
    assert "lost.txt: fewer than two waypoints" in said.err
    assert "waypoints lie outside the map: left out" in said.err
    assert load(tmp_path / "map.npz").survey.walks == (good.stem,)


def test_when_nothing_can_be_surveyed_it_says_why(world: Any, build: Run, tmp_path: Path) -> None:
    good = sorted((world.folder / "survey").rglob("*.txt"))[0]
    deaf = tmp_path / "deaf.txt"
    deaf.write_text("\n".join(line for line in good.read_text().splitlines() if "WIFI" not in line) + "\n")
    said = build(deaf)
    assert said.code == 2
    assert "deaf.txt: no Wi-Fi scan: nothing surveyed" in said.err
    assert "no fingerprint" in said.err
    assert not (tmp_path / "map.npz").exists()


def test_one_recording_named_twice_counts_once(world: Any, build: Run, tmp_path: Path) -> None:
    good = sorted((world.folder / "survey").rglob("*.txt"))[0]
    assert build(good, good).code == 0
    assert load(tmp_path / "map.npz").survey.walks == (good.stem,)


def test_wrong_use_is_one_line_and_status_2(world: Any, run_cli: Run, build: Run, tmp_path: Path) -> None:
    walks = world.folder / "survey"
    for arguments, message in (
        ((world.folder / "SITE", tmp_path / "gone", "--out", tmp_path / "m.npz"), "no such file or folder"),
        ((tmp_path / "gone", walks, "--out", tmp_path / "m.npz"), "gone"),
        ((world.folder / "SITE", walks, "--out", tmp_path / "no" / "m.npz"), "create it first"),
        ((world.folder / "SITE", walks, "--out", tmp_path), "is a folder"),
    ):
        said = run_cli("survey", "build", *arguments)
        assert said.code == 2
        assert message in said.err
        assert "Traceback" not in said.err


@pytest.mark.real_data
def test_waypoints_in_degrees_survey_and_score(data_root: Path, run_cli: Run, tmp_path: Path) -> None:
    """IPIN 2023 logs from survey to scores; no importer makes that site, so a made-up hall stands in its place."""
    folder = data_root / "ipin2023-track3" / "logs"
    logs = sorted(folder.glob("*0[1-5]_*.txt"))[:3] if folder.is_dir() else []
    if len(logs) < 3:
        pytest.skip(f"REAL DATA ABSENT: no logs below {folder}")
    from wayfuse.formats.reading import read

    recordings = [read(path) for path in logs]
    points = np.array([(w.lon, w.lat) for r in recordings for w in r.waypoints])
    assert np.all(np.isfinite(points))
    anchor = GeoAnchor.from_origin(*points.min(axis=0))
    corner = anchor.to_xy(points).max(axis=0) + 10.0
    anchor = GeoAnchor.from_origin(*anchor.to_lonlat((-10.0, -10.0)))
    w, h = (corner + 10.0).tolist()
    hall = Polygon(np.array([(0.0, 0.0), (w, 0.0), (w, h), (0.0, h), (0.0, 0.0)]))
    names = sorted({w.floor for r in recordings for w in r.waypoints}, key=float)
    floors = tuple(build_floor(name, int(float(name)), [hall], anchor=anchor) for name in names)
    Site("hall", floors).save(tmp_path / "SITE")
    said = run_cli("survey", "build", tmp_path / "SITE", *logs[1:], "--out", tmp_path / "map.npz")
    assert said.code == 0, said.err
    est = tmp_path / "EST.csv"
    said = run_cli("track", tmp_path / "SITE", logs[0], "--radio-map", tmp_path / "map.npz", "--out", est)
    assert said.code == 0, said.err
    said = run_cli("evaluate", est, logs[0], "--json", "--replicates", 100)
    assert said.code == 0, said.err
    report = json.loads(said.out)["methods"]["fused"]
    assert report["n_walks"] == 1
    assert report["1hz"]["mean"] < 12.0
