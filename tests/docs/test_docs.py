"""The documents say what is: commands, links, dependencies, skeletons and examples are checked against the code."""

from __future__ import annotations

import doctest
import importlib
import importlib.util
import inspect
import re
import subprocess
import sys
import tomllib
from itertools import chain
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from wayfuse.core.errors import ConfigError, FormatError
from wayfuse.core.philox import Noise
from wayfuse.filters.cloud import Cloud
from wayfuse.radio.archive import read_archive, write_archive

ROOT = Path(__file__).resolve().parents[2]
SOURCE = ROOT / "src"
PAGES = sorted(p for p in [*ROOT.glob("*.md"), *ROOT.glob("docs/**/*.md")])


def _module(path: Path) -> ModuleType:
    """Import a file that lies on no import path, under a name of its own."""
    name = f"checked_{path.parent.name}_{path.stem}"
    spec = importlib.util.spec_from_file_location(name, path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module  # dataclasses look their module up
    spec.loader.exec_module(module)
    return module


# --- the command line -------------------------------------------------------------------------------------

cli_docs = _module(ROOT / "scripts" / "write_cli_docs.py")


@pytest.mark.parametrize("name", cli_docs.command_names())
def test_every_command_and_option_is_documented(name: str) -> None:
    page = cli_docs.PAGE.read_text(encoding="utf-8")
    assert cli_docs.section(name) in page, "docs/cli.md is stale: python scripts/write_cli_docs.py"


def test_the_page_documents_no_command_that_is_not_there() -> None:
    page = cli_docs.PAGE.read_text(encoding="utf-8")
    assert re.findall(r"^## wayfuse (\S+)$", page, re.MULTILINE) == cli_docs.command_names()


def test_options_are_read_from_the_commands() -> None:
    section = cli_docs.section("track")
    assert (
        "| `--radio-map PATH` | From `wayfuse survey build`; methods that begin at a start or go by places of access "
        "points do without. |" in section
    )
    assert "### wayfuse datasets fetch" in cli_docs.section("datasets")


SHELL = re.compile(r"```(?:sh|console|bash)\n(.*?)```", re.DOTALL)


@pytest.mark.parametrize("path", PAGES, ids=lambda p: str(p.relative_to(ROOT)))
def test_commands_in_the_pages_exist(path: Path) -> None:
    """Each ``wayfuse ...`` line of a shell block names a command, and only options that it has."""
    import click

    from wayfuse.cli.main import cli

    for block in SHELL.findall(path.read_text(encoding="utf-8")):
        for line in block.replace("\\\n", " ").splitlines():
            words = line.split("#")[0].removeprefix("$ ").split()
            if not words or not words[0].endswith("wayfuse") or "=" in words[0]:
                continue
            command: click.Command | None = cli
            rest = words[1:]
            while isinstance(command, click.Group) and rest and not rest[0].startswith("-"):
                command = command.get_command(click.Context(command), rest.pop(0))
            assert command is not None, line
            known = {o for p in command.get_params(click.Context(command)) for o in p.opts}
            given = {w.split("=")[0].strip("[]") for w in rest if w.strip("[").startswith("--")}
            assert given <= known, line


# --- links ------------------------------------------------------------------------------------------------

LINK = re.compile(r"\]\(([^)\s]+)\)")


def _anchors(page: Path) -> set[str]:
    """Anchors of a page's headings, as GitHub makes them."""
    text = re.sub(r"```.*?```", "", page.read_text(encoding="utf-8"), flags=re.DOTALL)
    heads = re.findall(r"^#+ +(.*)$", text, re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", h.lower()).replace(" ", "-") for h in heads}


def _broken(page: Path) -> list[str]:
    text = re.sub(r"```.*?```", "", page.read_text(encoding="utf-8"), flags=re.DOTALL)
    out = []
    for link in LINK.findall(text):
        if re.match(r"[a-z]+:", link):
            continue
        target, _, anchor = link.partition("#")
        place = (page.parent / target).resolve() if target else page
        is_missing = not place.exists() or not (place == page or place.is_relative_to(ROOT))
        if is_missing or (anchor and anchor not in _anchors(place)):
            out.append(link)
    return out


@pytest.mark.parametrize("path", PAGES, ids=lambda p: str(p.relative_to(ROOT)))
def test_links_between_pages_resolve(path: Path) -> None:
    assert _broken(path) == []


def test_a_broken_link_is_found(tmp_path: Path) -> None:
    page = ROOT / "docs" / "architecture.md"
    draft = tmp_path / "draft.md"
    draft.write_text(f"# One\n[a]({page}) [b](absent.md) [c](#one) [d](#two)\n", encoding="utf-8")
    assert "absent.md" in _broken(draft)
    assert "#two" in _broken(draft)
    assert "#one" not in _broken(draft)


# --- dependencies -----------------------------------------------------------------------------------------


def test_every_dependency_is_justified_and_no_other() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    extras = project["project"]["optional-dependencies"].values()
    wanted = [*project["project"]["dependencies"], *project["dependency-groups"]["dev"], *chain(*extras)]
    own = project["project"]["name"]  # the development group asks for the package's own extras
    names = [name for line in wanted if (name := re.split(r"[<>=!~ ;\[]", line)[0]) != own]
    page = (ROOT / "docs" / "dependencies.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| `([a-z0-9_-]+)` \|(.*)\|$", page, re.MULTILINE)
    assert sorted(name for name, _ in rows) == sorted(names)
    assert all(len(cell.strip()) > 2 for _, row in rows for cell in row.split("|")), "an empty cell"


# --- the skeletons ----------------------------------------------------------------------------------------

SKELETONS = sorted((ROOT / "docs" / "skeletons").glob("*.py"))


def test_contributing_names_every_skeleton() -> None:
    text = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    assert SKELETONS
    assert [p.name for p in SKELETONS if f"docs/skeletons/{p.name}" not in text] == []


@pytest.mark.slow
def test_skeletons_and_scripts_are_typed_and_tidy() -> None:
    files = [str(p) for p in [*SKELETONS, ROOT / "scripts" / "write_cli_docs.py"]]
    for tool in (["mypy"], ["ruff", "check"], ["ruff", "format", "--check"]):
        run = subprocess.run(
            [sys.executable, "-m", *tool, *files], cwd=ROOT, capture_output=True, text=True, check=False
        )
        assert run.returncode == 0, run.stdout + run.stderr


def test_the_radio_map_skeleton_keeps_the_contract_of_radio_maps(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(ROOT / "tests" / "radio"))
    contract = _module(ROOT / "tests" / "radio" / "test_radio_map_contract.py")
    made_up_survey = importlib.import_module("radio_map_contract").made_up_survey
    skeleton = _module(ROOT / "docs" / "skeletons" / "radio_map.py")
    survey = made_up_survey()
    radio_map = skeleton.fit(survey)
    ran = 0
    for name, test in inspect.getmembers(contract, inspect.isfunction):
        if name.startswith("test_") and list(inspect.signature(test).parameters) == ["fitted"]:
            test((radio_map, survey))
            ran += 1
    assert ran >= 6


def test_the_radio_map_skeleton_comes_back_from_a_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.syspath_prepend(str(ROOT / "tests" / "radio"))
    contract = importlib.import_module("radio_map_contract")
    skeleton = _module(ROOT / "docs" / "skeletons" / "radio_map.py")
    radio_map = skeleton.fit(contract.made_up_survey())
    kind, header, arrays = radio_map.parts()
    write_archive(tmp_path / "map.npz", kind, 1, header, arrays)
    _, header, arrays = read_archive(tmp_path / "map.npz", kind)
    back = skeleton.PlaceMeansMap.from_parts(header, arrays)
    rssi = contract.queries(20)[2]
    np.testing.assert_array_equal(back.locate_all(rssi)[0], radio_map.locate_all(rssi)[0])
    with pytest.raises(ValueError, match="mean"):
        skeleton.PlaceMeansMap.from_parts(header, {**arrays, "mean": arrays["mean"][:-1]})


def _cloud(n: int) -> Cloud:
    ones = np.ones(n, np.float32)
    return Cloud.on_floors(3 * ones, 4 * ones, 0 * ones, 1.1 * ones, np.arange(n, dtype=np.int32) % 2)


def test_the_motion_skeleton_keeps_the_contract_of_motion_models() -> None:
    skeleton = _module(ROOT / "docs" / "skeletons" / "motion_model.py")
    model, cloud = skeleton.UndirectedWalk(), _cloud(4000)
    before = [column.copy() for column in cloud]
    noise, again, moved = Noise.of(7, "walk"), Noise.of(7, "walk"), Noise.of(7, "walk")
    after = model.propagate(noise, cloud, 2.0)
    for column, was, now in zip(cloud, before, after, strict=True):
        np.testing.assert_array_equal(column, was)  # what came in is as it was
        assert now.shape == was.shape
        assert now.dtype == was.dtype
        assert np.all(np.isfinite(now))
    for one, two in zip(after, model.propagate(again, cloud, 2.0), strict=True):
        np.testing.assert_array_equal(one, two)
    model.propagate(moved, cloud._replace(x=cloud.x + 50.0), 0.0)
    assert noise.draw == again.draw == moved.draw > 0  # draws do not depend on the particles
    np.testing.assert_array_equal(after.floor, cloud.floor)


def test_the_motion_skeleton_walks_the_distance_and_no_way_in_particular() -> None:
    skeleton = _module(ROOT / "docs" / "skeletons" / "motion_model.py")
    cloud = _cloud(4000)
    after = skeleton.UndirectedWalk(length_sigma=0.1).propagate(Noise.of(1, "walk"), cloud, 2.0)
    dx, dy = after.x - cloud.x, after.y - cloud.y
    walked = np.hypot(dx, dy)
    deviation = 5 / np.sqrt(cloud.n)  # five standard errors of a mean of unit spread
    assert abs(walked.mean() - 2.2) < 0.22 * deviation
    assert abs(walked.std() - 0.22) < 0.22 * deviation
    assert np.hypot(dx.mean(), dy.mean()) < 2.2 * deviation
    with pytest.raises(ConfigError, match="length_sigma"):
        skeleton.UndirectedWalk(length_sigma=-1.0)


LINES = [f"{k / 50:.3f};acc;0.{k % 10};0.5;9.{k % 7}" for k in range(100)]
LINES += ["1.500;wifi;00:11:22:33:44:55;-61;2437", "1.500;wifi;00:11:22:33:44:56;-70;5180"]
LINES += ["0.000;place;1.0;2.0;F1", "2.000;place;3.5;7.25;F1", "1.000;gyro;0.01;0;-0.02"]


def test_the_format_skeleton_reads_what_was_written(tmp_path: Path) -> None:
    skeleton = _module(ROOT / "docs" / "skeletons" / "format.py")
    path = tmp_path / "walk.log"
    path.write_text("\n".join(LINES) + "\n", encoding="utf-8")
    recording = skeleton.read(path)
    assert recording.name == "walk"
    assert len(recording.acceleration) == 100
    np.testing.assert_allclose(recording.acceleration.values[3], [0.3, 0.5, 9.3])
    assert recording.rotation_rate.values.tolist() == [[0.01, 0.0, -0.02]]
    (scan,) = recording.wifi
    assert (scan.t, scan.rssi.tolist(), scan.frequency.tolist()) == (1.5, [-61.0, -70.0], [2437, 5180])
    assert recording.waypoints[1][:4] == (2.0, 3.5, 7.25, "F1")
    assert recording.report.n_bad == 0


def test_a_bad_line_costs_the_format_skeleton_that_line(tmp_path: Path) -> None:
    skeleton = _module(ROOT / "docs" / "skeletons" / "format.py")
    path = tmp_path / "walk.log"
    bad = ["1.0;acc;x;0;9.8", "nonsense", "1.0;magic;1;2;3", "nan;acc;0;0;9.8", "1.0;acc;inf;0;9.8"]
    path.write_bytes("\r\n".join([*LINES[:50], *bad, "", *LINES[50:]]).encode())
    recording = skeleton.read(path)
    assert len(recording.acceleration) == 100
    assert {kind: issue.lines for kind, issue in recording.report.issues.items()} == {
        "acc: not a number where one is due": [51],
        "not a record": [52],
        "unknown kind magic": [53],
        "acceleration: time not finite or out of range": [54],
        "acceleration: not finite": [55],
    }


def test_the_format_skeleton_reads_alike_in_blocks_of_any_size(tmp_path: Path) -> None:
    skeleton = _module(ROOT / "docs" / "skeletons" / "format.py")
    path = tmp_path / "walk.log"
    path.write_text("\n".join(LINES), encoding="utf-8")
    pieces = list(skeleton.blocks(path, 64))
    assert len(pieces) > 10
    parts = [p.columns["acceleration"].values for p in pieces if "acceleration" in p.columns]
    np.testing.assert_array_equal(np.concatenate(parts), skeleton.read(path).acceleration.values)
    (tmp_path / "empty").touch()
    with pytest.raises(FormatError, match="no record of this format"):
        skeleton.read(tmp_path / "empty")


# --- examples ---------------------------------------------------------------------------------------------


def _with_examples() -> list[str]:
    """Names of the modules whose docstrings hold examples."""
    files = [p for p in (SOURCE / "wayfuse").rglob("*.py") if ">>> " in p.read_text(encoding="utf-8")]
    parts = [p.relative_to(SOURCE).with_suffix("").parts for p in sorted(files)]
    return [".".join(p[:-1] if p[-1] == "__init__" else p) for p in parts]


@pytest.mark.parametrize("name", _with_examples())
def test_examples_in_docstrings_are_true(name: str) -> None:
    module = importlib.import_module(name)
    examples = sum(len(t.examples) for t in doctest.DocTestFinder().find(module))
    assert examples > 0
    assert doctest.testmod(module).failed == 0


def test_the_licence_the_citation_and_the_version_agree() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    citation = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    assert project["license"] == "Apache-2.0"
    assert "license: Apache-2.0" in citation
    assert f"version: {project['version']}" in citation
    assert importlib.import_module("wayfuse").__version__ == project["version"]
    assert "Version 2.0, January 2004" in (ROOT / "LICENSE").read_text(encoding="utf-8")
    assert (SOURCE / "wayfuse" / "py.typed").is_file()


# addresses of the server begin with /api/ and /in/
ABSOLUTE = re.compile(r"(?:^|[\s`(\"'])((?!/(?:api|in)/)/[A-Za-z]+/[\w.]+)", re.MULTILINE)


def test_no_page_names_a_path_of_one_machine() -> None:
    assert ABSOLUTE.findall("see `/opt/x` and r68/r95, a/b") == ["/opt/x"]
    found = {str(p.relative_to(ROOT)): ABSOLUTE.findall(p.read_text(encoding="utf-8")) for p in PAGES}
    assert {page: paths for page, paths in found.items() if paths} == {}


@pytest.mark.slow
def test_the_python_example_of_the_readme_runs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    from wayfuse.cli.demo import run_demo
    from wayfuse.simulator.demo import smallest

    (example,) = re.findall(
        r"```python\n(.*?)```", (ROOT / "README.md").read_text(encoding="utf-8"), re.DOTALL
    )
    run_demo(tmp_path / "demo-out", 0, scenario=smallest(), quiet=True, pictures=False)
    monkeypatch.chdir(tmp_path)
    exec(compile(example, "README.md", "exec"), {"__name__": "readme"})  # noqa: S102
    assert re.search(
        r"^-?\d+\.\d m, -?\d+\.\d m, \d, within \d+\.\d m$", capsys.readouterr().out, re.MULTILINE
    )
