"""``wayfuse survey channel``, and channel state on the command line from simulation to estimates."""

from __future__ import annotations

import csv
import json
import shlex
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from wayfuse.radio.channel_model import load_channel_model

Run = Callable[..., Any]


@pytest.fixture(scope="module")
def room(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, list[list[str]]]:
    """The files of the scenario csi-room, and the commands it proposes."""
    from click.testing import CliRunner

    from wayfuse.cli.main import cli

    out = tmp_path_factory.mktemp("csi") / "sim"
    said = CliRunner().invoke(cli, ["simulate", "csi-room", "--out", str(out), "--jobs", "1", "--json"])
    assert said.exit_code == 0, said.output
    return out, [shlex.split(command)[1:] for command in json.loads(said.stdout)["commands"]]


def test_the_proposed_commands_go_from_channel_state_to_places(
    room: tuple[Path, list[list[str]]], run_cli: Run
) -> None:
    out, commands = room
    assert [" ".join(c[:2]) for c in commands[:2]] == ["survey build", "survey channel"]
    surveyed = run_cli(*commands[1], "--jobs", "1")
    assert surveyed.code == 0, surveyed.err
    assert "of 8 walks, 4 anchors" in surveyed.out
    model = load_channel_model(out / "channel.npz")
    assert (len(model.anchors), {len(antennas) for antennas in model.anchors.values()}) == (4, {3})
    track = [a for k, a in enumerate(commands[2]) if "--radio-map" not in commands[2][max(k - 1, 0) : k + 1]]
    said = run_cli(*track, "--method", "fused-ranges", "--method", "li2015", "--jobs", "1")
    assert said.code == 0, said.err
    assert "no range to an anchor" not in said.err
    scored = run_cli(*commands[3], "--json")
    assert scored.code == 0, scored.err
    with (out / "est.csv").open() as lines:
        rows = list(csv.DictReader(line for line in lines if not line.startswith("#")))
    assert {r["state"] for r in rows if r["method"] == "fused-ranges" and float(r["t_ms"]) > 5000.0} == {
        "tracking"
    }
    blind = [a for k, a in enumerate(track) if "--channel-model" not in track[max(k - 1, 0) : k + 1]]
    without = run_cli(*blind, "--method", "li2015", "--jobs", "1")
    assert "channel state needs --channel-model" in without.err


def test_json_says_how_wrong_ranges_are(
    room: tuple[Path, list[list[str]]], run_cli: Run, tmp_path: Path
) -> None:
    out, commands = room
    said = run_cli(*commands[1][:-1], tmp_path / "m.npz", "--json", "--jobs", "1")
    document = json.loads(said.out)
    assert document["survey_walks"] == 8
    assert 0.2 < document["held_out_error"]["median_m"] < document["held_out_error"]["p90_m"] < 12.0
    exponents = np.array(list(document["path_loss_exponents"].values()))
    assert ((exponents > 0.8) & (exponents < 4.0)).all()
    one = run_cli(
        "survey", "channel", out / "SITE", out / "survey" / "survey-0-000.jsonl",
        "--access-points", out / "access_points.csv", "--out", tmp_path / "one.npz",
    )  # fmt: skip
    assert one.code == 0, one.err
    assert "error of ranges unknown" in one.out


def test_wrong_use_is_one_line_and_status_2(
    room: tuple[Path, list[list[str]]], world: Any, run_cli: Run, tmp_path: Path
) -> None:
    out, _ = room
    fixed = ("--access-points", out / "access_points.csv", "--out", tmp_path / "m.npz")
    no_truth = run_cli("survey", "channel", out / "SITE", out / "walks", *fixed)
    assert no_truth.code == 2
    assert "no frame of a known anchor between two waypoints" in no_truth.err
    assert "no channel state" in no_truth.err
    assert not (tmp_path / "m.npz").exists()
    for arguments, message in (
        ((tmp_path / "gone", out / "survey", *fixed), "gone"),
        ((out / "SITE", out / "survey", *fixed[:2], "--out", tmp_path / "no" / "m.npz"), "create it first"),
    ):
        said = run_cli("survey", "channel", *arguments)
        assert said.code == 2
        assert message in said.err
        assert "Traceback" not in said.err
    run_cli("survey", "channel", out / "SITE", out / "survey", *fixed)
    said = run_cli(
        "track", world.folder / "SITE", out / "walks", "--radio-map", world.folder / "map.npz",
        "--channel-model", tmp_path / "m.npz", "--out", tmp_path / "e.csv",
    )  # fmt: skip
    assert said.code == 2
    assert "channel model of site" in said.err
