"""``wayfuse simulate``: files, errors, the same bytes whatever the processes, and the way to a score."""

from __future__ import annotations

import csv
import hashlib
import json
from pathlib import Path

import pytest

from ray_tracing import skip_without_tracer
from wayfuse import __version__
from wayfuse.evaluation.estimates_file import read_estimates
from wayfuse.formats.reading import read, sniff
from wayfuse.maps.site import Site
from wayfuse.simulator.scenario_file import shipped_scenarios

SCENARIO = """
title = "a small hall"
seed = 4
[site]
building = "hall"
size = [30.0, 20.0]
racks = 1
[walkers]
number = 2
duration_s = [20.0, 25.0]
[radio]
aps_per_floor = 8
[changes]
moved = 1
removed = 1
[ranges]
period_s = 2.0
[survey]
walks = 8
duration_s = [20.0, 25.0]
[output]
formats = ["wayfuse", "ms-indoor", "getsensordata"]
"""


def digest(folder: Path) -> dict[str, str]:
    files = sorted(p for p in folder.rglob("*") if p.is_file())
    return {str(p.relative_to(folder)): hashlib.sha256(p.read_bytes()).hexdigest() for p in files}


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("scenario") / "small.toml"
    path.write_text(SCENARIO, encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def made(file: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    from wayfuse.cli.main import cli

    out = tmp_path_factory.mktemp("made") / "DIR"
    cli.main(args=["simulate", str(file), "--out", str(out), "--jobs", "1"], standalone_mode=False)
    return out


def test_the_folder_holds_what_its_page_says(made):
    names = {p.name for p in made.iterdir()}
    assert names == {
        "SITE", "scenario.toml", "survey", "walks", "truth", "truth.csv", "walks.csv", "access_points.csv",
        "access_points_later.csv", "floors.png", "ms-indoor", "getsensordata",
    }  # fmt: skip
    assert (made / "floors.png").read_bytes()[:4] == b"\x89PNG"
    assert Site.load(made / "SITE").name == "Wayfuse Warehouse"
    assert f'version = "{__version__}"' in (made / "scenario.toml").read_text()
    rows = list(csv.DictReader((made / "walks.csv").read_text().splitlines()))
    assert [row["role"] for row in rows] == ["survey"] * 8 + ["walk"] * 2
    assert all(int(row["scans"]) > 3 and int(row["ranges"]) > 3 and row["csi"] == "0" for row in rows)


def test_every_format_reads_back_as_itself(made):
    for folder, kind in (
        (made, "wayfuse"),
        (made / "ms-indoor", "ms-indoor"),
        (made / "getsensordata", "getsensordata"),
    ):
        walks = sorted((folder / "walks").iterdir())
        assert [sniff(p) for p in walks] == [kind] * 2
        recording, survey = read(walks[0]), read(sorted((folder / "survey").iterdir())[0])
        assert not recording.report.issues
        assert not survey.report.issues
        assert recording.waypoints == ()
        assert len(survey.waypoints) > 1
        assert len(recording.wifi) > 3
        assert len(recording.acceleration) > 500
        assert bool(recording.ranges) == (kind == "wayfuse")


def test_the_truth_is_an_estimate_without_error_and_in_no_recording(made, run_cli):
    truth = read_estimates(made / "truth.csv")
    assert [t.walk for t in truth.tracks][-2:] == ["walk-000", "walk-001"]
    said = run_cli("evaluate", made / "truth.csv", made / "truth", "--json", "--site", made / "SITE")
    assert said.code == 0, said.err
    of = json.loads(said.out)["methods"]["truth"]["waypoints"]
    assert of["n"] > 4
    assert of["mean"] < 0.15
    for path in (made / "walks").iterdir():
        assert "waypoint" not in path.read_text()


def test_processes_change_nothing_and_a_copy_is_the_same_scenario(file, made, tmp_path, run_cli):
    assert run_cli("simulate", made / "scenario.toml", "--out", tmp_path / "b", "--jobs", 2).code == 0
    first, second = digest(made), digest(tmp_path / "b")
    assert first == second
    assert run_cli("simulate", file, "--out", tmp_path / "c", "--seed", 5, "--no-picture").code == 0
    third = digest(tmp_path / "c")
    assert set(first) - set(third) == {"floors.png"}
    assert all(
        third[name] != first[name] for name in third if name.startswith(("walks/", "survey/", "truth"))
    )
    assert "seed = 5" in (tmp_path / "c" / "scenario.toml").read_text()


def test_from_scenario_to_score(made, tmp_path, run_cli):
    steps = (
        ("survey", "build", made / "SITE", made / "survey", "--out", tmp_path / "map.npz"),
        (
            "track",
            made / "SITE",
            made / "walks",
            "--radio-map",
            tmp_path / "map.npz",
            "--out",
            tmp_path / "est.csv",
        ),
        ("evaluate", tmp_path / "est.csv", made / "truth", "--json"),
    )
    for step in steps:
        said = run_cli(*step)
        assert said.code == 0, said.err
    of = json.loads(said.out)["methods"]["fused"]["1hz"]
    assert of["n"] > 30
    assert of["p50"] < 3.5  # a hall of 30 m x 20 m: a guess of its middle has about 9 m
    assert of["floor_accuracy"] == 1.0


def test_json_says_what_was_written(file, tmp_path, run_cli):
    said = run_cli("simulate", file, "--out", tmp_path / "d", "--json", "--no-picture")
    document = json.loads(said.out)
    assert document["seed"] == 4
    assert (document["survey_walks"], document["walks"], document["access_points"]) == (8, 2, 8)
    assert document["files"] == len(digest(tmp_path / "d"))


def test_mistakes_end_with_status_two_and_one_line(file, made, tmp_path, run_cli):
    bad = tmp_path / "bad.toml"
    bad.write_text("[walkers]\nnumbr = 3\n")
    full = made
    for arguments, said in (
        ((bad, "--out", tmp_path / "x"), "bad.toml: walkers: unknown key 'numbr'"),
        (("no-such", "--out", tmp_path / "x"), "no such scenario"),
        ((file, "--out", full), "is not an empty folder"),
        ((file, "--out", file), "is not an empty folder"),
        ((file, "--out", file / "below"), "cannot write"),
    ):
        got = run_cli("simulate", *arguments)
        assert got.code == 2, got
        assert said in got.err
        assert got.err.count("\n") == 1
    assert not (tmp_path / "x").exists()


def test_help_names_the_scenarios_that_come_with_the_package(run_cli):
    said = " ".join(run_cli("simulate", "--help").out.split())
    assert ", ".join(shipped_scenarios()) in said.replace("- ", "-")  # click wraps at hyphens


@pytest.mark.slow
@pytest.mark.parametrize("name", shipped_scenarios())
def test_scenarios_that_come_with_the_package_can_be_tracked(name, tmp_path, run_cli):
    if name == "ray-traced-house":
        skip_without_tracer()
    out = tmp_path / name
    steps = (
        ("simulate", name, "--out", out),
        ("survey", "build", out / "SITE", out / "survey", "--out", tmp_path / "map.npz"),
        (
            "track",
            out / "SITE",
            out / "walks",
            "--radio-map",
            tmp_path / "map.npz",
            "--out",
            tmp_path / "est.csv",
        ),
        ("evaluate", tmp_path / "est.csv", out / "truth", "--json"),
    )
    for step in steps:
        said = run_cli(*step)
        assert said.code == 0, said.err
    assert json.loads(said.out)["methods"]["fused"]["1hz"]["p50"] < 5.0
