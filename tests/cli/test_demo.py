"""wayfuse demo and warmup: the commands they show, the files they leave, the folders they refuse."""

from __future__ import annotations

import json
import shlex
from pathlib import Path

import pytest
from click.testing import CliRunner

from wayfuse.cli.demo import METHODS, run_demo
from wayfuse.cli.main import COMMANDS, cli
from wayfuse.core.errors import UsageError
from wayfuse.simulator.demo import smallest


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("demo") / "out"
    run_demo(folder, 0, smallest(), quiet=True)
    return folder


def content(folder: Path) -> dict[str, bytes]:
    return {str(p.relative_to(folder)): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()}


def test_all_files_are_there(made: Path) -> None:
    pictures = {str(p.relative_to(made / "pictures")) for p in (made / "pictures").rglob("*.png")}
    assert {
        "cdf.png",
        "error_by_time.png",
        "coverage.png",
        "site/0.png",
        "site/1.png",
        "site/2.png",
    } <= pictures
    assert sum(name.startswith("walks/") for name in pictures) == 1
    report = json.loads((made / "report.json").read_text())
    assert tuple(report["methods"]) == METHODS
    assert report["n_walks"] == 1
    assert all(of["1hz"]["n"] > 10 for of in report["methods"].values())


def test_the_commands_shown_are_commands_and_leave_the_same_estimates(
    made: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "a b"  # a name that a shell would split
    run_demo(folder, 0, smallest(), pictures=False)
    said = capsys.readouterr().out
    lines = [shlex.split(line[2:]) for line in said.splitlines() if line.startswith("$ ")]
    assert [line[:2] for line in lines] == [
        ["wayfuse", name] for name in ("site", "survey", "track", "evaluate")
    ]
    assert {line[1] for line in lines} <= set(COMMANDS)
    assert (folder / "estimates.csv").read_bytes() == (made / "estimates.csv").read_bytes()
    track = next(line for line in lines if line[1] == "track")
    again = [word.replace("estimates.csv", "again.csv") for word in track[1:]]
    done = CliRunner().invoke(cli, again)
    assert done.exit_code == 0, done.output
    assert (folder / "again.csv").read_bytes() == (made / "estimates.csv").read_bytes()
    ending = said[said.index("Error (m) of the simulated walks") :]
    assert all(any(row.startswith(name) for row in ending.splitlines()) for name in METHODS)


def test_an_earlier_demo_is_replaced_and_files_beside_it_stay(tmp_path: Path) -> None:
    folder = tmp_path / "out"
    run_demo(folder, 0, smallest(), quiet=True, pictures=False)
    before = content(folder)
    (folder / "notes.txt").write_text("mine")
    (folder / "data" / "walks" / "old.txt").write_text("left over")
    run_demo(folder, 0, smallest(), quiet=True, pictures=False)
    assert content(folder) == before | {"notes.txt": b"mine"}


def test_quiet_is_quiet(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    run_demo(tmp_path, 1, smallest(), quiet=True, pictures=False)
    assert capsys.readouterr() == ("", "")


@pytest.mark.parametrize("kind", ["folder", "file"])
def test_what_is_not_the_demos_is_left_alone(tmp_path: Path, kind: str) -> None:
    folder = tmp_path / "out"
    if kind == "folder":
        (folder / "data").mkdir(parents=True)
        (folder / "data" / "thesis.tex").write_text("years")
    else:
        folder.write_text("years")
    before = content(tmp_path)
    with pytest.raises(UsageError, match="empty folder"):
        run_demo(folder, 0, smallest(), quiet=True)
    assert content(tmp_path) == before


def test_warm_up_leaves_nothing_behind(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    done = CliRunner().invoke(cli, ["warmup"])
    assert done.exit_code == 0, done.output
    assert done.output.startswith("kernels compiled (")
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
def test_the_whole_demo_ranks_the_methods(tmp_path: Path) -> None:
    done = CliRunner().invoke(cli, ["demo", "--out", str(tmp_path / "out")])
    assert done.exit_code == 0, done.output
    report = json.loads((tmp_path / "out" / "report.json").read_text())
    mean = {name: of["1hz"]["mean"] for name, of in report["methods"].items()}
    assert mean["fused"] < 0.8 * min(mean["nnss"], mean["random-walk"])
    assert report["methods"]["fused"]["1hz"]["known_floor_accuracy"] > 0.95
