"""``wayfuse track``: from recordings to EST.csv."""

from __future__ import annotations

import csv
import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from wayfuse.models.survey_walk import place_of
from wayfuse.presets.catalogue import METHODS
from wayfuse.radio.ap_places import ApPlaces, write_ap_places

Run = Callable[..., Any]


@pytest.fixture
def track(world: Any, run_cli: Run, tmp_path: Path) -> Run:
    """Track with the world's site and radio map into EST.csv of a folder of its own."""

    def run(*arguments: object) -> Any:
        fixed = ("--radio-map", world.folder / "map.npz", "--out", tmp_path / "EST.csv", "--particles", 50)
        return run_cli("track", world.folder / "SITE", *fixed, *arguments)

    return run


def rows(path: Path) -> list[dict[str, str]]:
    with path.open(newline="") as stream:
        return list(csv.DictReader(stream))


def walk_paths(world: Any) -> list[Path]:
    return sorted((world.folder / "walks").rglob("*.txt"))


def places_file(world: Any, folder: Path) -> Path:
    """Places for some access points of the world, as a surveyor might have written them down."""
    n = 12
    rng = np.random.default_rng(1)
    places = ApPlaces(
        world.survey.bssid[:n],
        rng.uniform(5.0, 60.0, n),
        rng.uniform(5.0, 40.0, n),
        np.zeros(n, np.int32),
        np.full(n, np.nan),
    )
    write_ap_places(folder / "aps.csv", places, world.site.floor_names)
    return folder / "aps.csv"


def test_what_a_published_system_needs_is_said(world: Any, run_cli: Run, tmp_path: Path) -> None:
    path, out = walk_paths(world)[0], tmp_path / "EST.csv"
    for method, option in (
        ("chu2009", "--radio-map"),
        ("liu2017", "--access-points"),
        ("li2015", "--access-points"),
    ):
        said = run_cli("track", world.folder / "SITE", path, "--method", method, "--out", out)
        assert said.code == 2
        assert option in said.err
        assert method in said.err
    only_map = ("--radio-map", world.folder / "map.npz")
    said = run_cli("track", world.folder / "SITE", path, "--method", "fused-ranges", "--out", out, *only_map)
    assert said.code == 2
    assert "--access-points" in said.err


def test_the_way_from_plans_to_scores(world: Any, run_cli: Run, tmp_path: Path) -> None:
    site, radio_map, est = tmp_path / "SITE", tmp_path / "map.npz", tmp_path / "EST.csv"
    said = run_cli("site", "import", "ms-indoor", world.folder / "site", "--out", site)
    assert said.code == 0, said.err
    said = run_cli("survey", "build", site, world.folder / "survey", "--out", radio_map, "--jobs", 1)
    assert said.code == 0, said.err
    walks = walk_paths(world)
    common = ("--radio-map", radio_map, *walks, "--method", "fused", "--seed", 0)
    assert run_cli("track", site, *common, "--out", est).code == 0
    header = est.read_text().splitlines()[0]
    assert header.startswith("walk,t_ms,x,y,floor,lat,lon")
    lagged = tmp_path / "lagged.csv"
    assert run_cli("track", site, *common, "--lag", 5, "--out", lagged).code == 0
    said = run_cli("evaluate", est, *walks, "--json", "--replicates", 100, "--plots", tmp_path / "plots")
    assert said.code == 0, said.err
    report = json.loads(said.out)
    assert report["methods"]["fused"]["n_walks"] == 4
    assert report["methods"]["fused"]["1hz"]["mean"] < 8.0
    assert report["plots"]
    better = json.loads(run_cli("evaluate", lagged, *walks, "--json", "--replicates", 100).out)
    assert better["methods"]["fused"]["1hz"]["mean"] < report["methods"]["fused"]["1hz"]["mean"]


def test_rows_are_what_the_contract_says(world: Any, track: Run, tmp_path: Path) -> None:
    said = track(world.folder / "walks")
    assert said.code == 0
    assert "4 of 4 recordings tracked by fused" in said.out
    assert "scans: " in said.out
    found = rows(tmp_path / "EST.csv")
    assert len(found) == int(said.out.split("; ")[1].split()[0])
    for recording in world.walks:
        own = [r for r in found if r["walk"] == recording.name]
        t = np.array([float(r["t_ms"]) for r in own])
        assert np.all(np.diff(t) > 0)
        assert np.all(np.diff(t) <= 1001.0)
        assert {round(s.t * 1000) for s in recording.wifi} <= {round(x) for x in t}
        for r in own[::10]:
            floor = world.site.floors[world.site.floor_index(r["floor"])]
            lon, lat = floor.to_lonlat((float(r["x"]), float(r["y"])))
            assert float(r["lat"]) == pytest.approx(lat, abs=2e-8)
            assert float(r["lon"]) == pytest.approx(lon, abs=2e-8)
            assert r["state"] in {"initialising", "tracking", "lost"}
            assert float(r["r95"]) >= float(r["r68"]) > 0.0
            assert r["method"] == "fused"
    sidecar = json.loads((tmp_path / "EST.csv.json").read_text())
    assert (sidecar["seed"], sidecar["lag"], sidecar["parameters"]["particles"]) == (0, 0.0, 50)


@pytest.mark.parametrize("lag", [0, 3])
def test_the_same_bytes_from_one_process_and_two(world: Any, track: Run, tmp_path: Path, lag: int) -> None:
    files = []
    for jobs in (1, 2):
        assert track(world.folder / "walks", "--jobs", jobs, "--seed", 3, "--lag", lag).code == 0
        files.append((tmp_path / "EST.csv").read_bytes())
    assert files[0] == files[1]
    assert track(world.folder / "walks", "--jobs", 1, "--seed", 4, "--lag", lag).code == 0
    assert (tmp_path / "EST.csv").read_bytes() != files[0]


def test_a_walk_does_not_depend_on_the_others_nor_on_its_truth(
    world: Any, track: Run, tmp_path: Path
) -> None:
    walks = walk_paths(world)
    track(*walks)
    together = [r for r in rows(tmp_path / "EST.csv") if r["walk"] == walks[1].stem]
    track(walks[1])
    assert rows(tmp_path / "EST.csv") == together
    text = walks[1].read_text()
    blind = tmp_path / "blind" / walks[1].name
    blind.parent.mkdir()
    lines = [line for line in text.splitlines() if "TYPE_WAYPOINT" not in line]
    lines = [line.replace("FloorName:F", "FloorName:B") for line in lines]
    assert len(lines) < len(text.splitlines())
    blind.write_text("\n".join(lines) + "\n")
    track(blind)
    assert rows(tmp_path / "EST.csv") == together


def test_all_methods_in_one_file(world: Any, track: Run, tmp_path: Path) -> None:
    path = walk_paths(world)[0]
    chosen = [a for name in METHODS for a in ("--method", name)]
    said = track(path, *chosen, "--start", "waypoint", "--access-points", places_file(world, tmp_path))
    assert said.code == 0, said.err
    assert "no range to an anchor: li2015 knows no position" in said.err
    assert "li2015 does not use: Wi-Fi scan" in said.err
    found = rows(tmp_path / "EST.csv")
    assert {r["method"] for r in found} == set(METHODS)
    again = track(path, "--method", "wknn", "--method", "wknn")
    assert "tracked by wknn;" in again.out


def test_dead_reckoning_starts_where_it_is_told(world: Any, track: Run, tmp_path: Path) -> None:
    path = walk_paths(world)[0]
    assert track(path, "--method", "pdr", "--start", "12.5,11,F2").code == 0
    first = rows(tmp_path / "EST.csv")[0]
    assert (float(first["x"]), float(first["y"]), first["floor"]) == (12.5, 11.0, "F2")
    said = track(path, "--method", "pdr", "--start", "waypoint")
    assert said.code == 0
    assert "not used by this method" in said.out
    stated = world.walks[0].waypoints[0]
    assert float(rows(tmp_path / "EST.csv")[0]["x"]) == pytest.approx(stated.x, abs=2e-3)


@pytest.mark.parametrize("start", ["told", "waypoint"])
def test_published_systems_begin_where_they_are_told(
    world: Any, track: Run, tmp_path: Path, start: str
) -> None:
    path, stated = walk_paths(world)[0], world.walks[0].waypoints[0]
    x, y, floor = place_of(world.site, stated)
    where = "waypoint" if start == "waypoint" else f"{x:.3f},{y:.3f},{world.site.floor_names[floor]}"
    assert track(path, "--method", "he2014", "--method", "karlsson2015", "--start", where).code == 0
    first = {r["method"]: r for r in reversed(rows(tmp_path / "EST.csv"))}
    for method in ("he2014", "karlsson2015"):
        assert np.hypot(float(first[method]["x"]) - x, float(first[method]["y"]) - y) < 1.0
        assert first[method]["state"] == "tracking"


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--method", "pdr"), "--start: this method needs a start"),
        (("--method", "pdr", "--start", "1,2"), "'1,2' is not a start"),
        (("--method", "pdr", "--start", "a,b,F1"), "is not a start"),
        (("--method", "pdr", "--start", "nan,2,F1"), "is not a start"),
        (("--method", "pdr", "--start", "1,2,F9"), "has no floor 'F9'"),
        (("--method", "pdr", "--start", "1,2,F1", "--lag", "5"), "has no lag"),
        (("--method", "nnss", "--lag", "5"), "leave --lag out, or use fused"),
        (("--method", "fused", "--method", "wknn", "--lag", "5"), "has no lag"),
        (("--method", "magic"), "'magic' is not one of"),
        (("--lag", "-1"), "--lag"),
        (("--particles", "3"), "--particles"),
        (("--seed", "x"), "--seed"),
    ],
)
def test_wrong_use_is_one_line_and_status_2(
    world: Any, track: Run, tmp_path: Path, arguments: tuple[str, ...], message: str
) -> None:
    said = track(walk_paths(world)[0], *arguments)
    assert said.code == 2
    assert message in said.err
    assert "Traceback" not in said.err
    assert not (tmp_path / "EST.csv").exists()


def test_where_nothing_can_be_written(world: Any, run_cli: Run, tmp_path: Path) -> None:
    fixed = ("track", world.folder / "SITE", walk_paths(world)[0], "--radio-map", world.folder / "map.npz")
    said = run_cli(*fixed, "--out", tmp_path / "no" / "EST.csv")
    assert (said.code, "there is no folder" in said.err, "create it first" in said.err) == (2, True, True)
    said = run_cli(*fixed, "--out", tmp_path)
    assert (said.code, "is a folder" in said.err) == (2, True)


def test_the_site_has_to_be_one(world: Any, run_cli: Run, tmp_path: Path) -> None:
    fixed = (walk_paths(world)[0], "--radio-map", world.folder / "map.npz", "--out", tmp_path / "EST.csv")
    said = run_cli("track", tmp_path / "nowhere", *fixed)
    assert said.code == 2
    assert "nowhere" in said.err
    damaged = tmp_path / "damaged"
    shutil.copytree(world.folder / "SITE", damaged)
    for content in ("", "{", "[]", '{"format": "wayfuse-site", "version": 1}', '{"format": "other"}'):
        (damaged / "site.json").write_text(content)
        said = run_cli("track", damaged, *fixed)
        assert said.code == 2
        assert "site.json" in said.err
        assert len(said.err.strip().splitlines()) == 1
    assert not (tmp_path / "EST.csv").exists()


def test_the_radio_map_has_to_be_one_of_this_site(world: Any, run_cli: Run, tmp_path: Path) -> None:
    from dataclasses import replace

    from wayfuse.radio.walk_survey import SurveyParameters, WalkRadioMap

    bad = tmp_path / "bad.npz"
    fixed = ("track", world.folder / "SITE", walk_paths(world)[0], "--out", tmp_path / "EST.csv")
    whole = (world.folder / "map.npz").read_bytes()
    middle = len(whole) // 2
    for content, message in (
        (b"", "not a whole zip"),
        (b"PK but no zip", "not a whole zip"),
        (whole[:middle], "not a whole zip"),
        (whole[:middle] + bytes([whole[middle] ^ 255]) + whole[middle + 1 :], "bad.npz"),
    ):
        bad.write_bytes(content)
        said = run_cli(*fixed, "--radio-map", bad)
        assert said.code == 2
        assert message in said.err
        assert "bad.npz" in said.err
    assert run_cli(*fixed, "--radio-map", tmp_path / "absent.npz").code == 2
    floors = replace(world.survey, floors=("G", "H"))
    WalkRadioMap(floors, SurveyParameters(), world.site.name).save(bad)
    for method in (("--method", "fused"), ("--method", "pdr", "--start", "1,1,F1")):
        said = run_cli(*fixed, "--radio-map", bad, *method)
        assert said.code == 2
        assert "the radio map has floors G, H" in said.err
    WalkRadioMap(world.survey, SurveyParameters(), "another mall").save(bad)
    said = run_cli(*fixed, "--radio-map", bad)
    assert said.code == 2
    assert "radio map of site another mall, not of site" in said.err
    assert not (tmp_path / "EST.csv").exists()


def test_one_recording_named_twice_is_tracked_once(world: Any, track: Run, tmp_path: Path) -> None:
    path = walk_paths(world)[0]
    said = track(path, path.parent / ".." / path.parent.name / path.name, path.parent)
    assert said.code == 0
    n = len(list(path.parent.rglob("*.txt")))
    assert f"{n} of {n} recordings" in said.out
    found = [(r["walk"], r["t_ms"]) for r in rows(tmp_path / "EST.csv")]
    assert len(set(found)) == len(found)


def test_two_recordings_of_one_name_are_refused(world: Any, track: Run, tmp_path: Path) -> None:
    path = walk_paths(world)[0]
    other = tmp_path / "elsewhere" / path.name
    other.parent.mkdir()
    shutil.copy(walk_paths(world)[1], other)
    said = track(path, other)
    assert said.code == 2
    assert path.stem in said.err
    assert str(other) in said.err


def test_without_a_radio_map_a_start_will_do(world: Any, run_cli: Any, tmp_path: Path) -> None:
    walk = sorted((world.folder / "walks").rglob("*.txt"))[0]
    given = ("track", str(world.folder / "SITE"), str(walk), "--out", str(tmp_path / "EST.csv"))
    said = run_cli(*given, "--method", "fused-no-wifi", "--start", "waypoint")
    assert said.code == 0
    rows = (tmp_path / "EST.csv").read_text(encoding="utf-8").splitlines()
    assert len(rows) > 20
    assert all(",fused-no-wifi," in row for row in rows[1:])
    said = run_cli(*given)
    assert said.code == 2
    assert "--radio-map: method fused needs a radio map" in said.err
