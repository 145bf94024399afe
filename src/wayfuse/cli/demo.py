"""``wayfuse demo``: the whole pipeline on a simulated building, by the commands a user would type.

Each step prints its command line and then runs that command in this process, so the demo both shows and tests the
way from floor plans and recordings to errors and pictures.
"""

from __future__ import annotations

import contextlib
import io
import shlex
import shutil
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

if TYPE_CHECKING:
    from wayfuse.simulator.scenario import Scenario

__all__ = ["METHODS", "demo", "run_demo"]

METHODS = ("fused", "random-walk", "wknn", "nnss", "pdr")
_ALONE = (
    "--jobs",
    "1",
)  # so few walks: several processes would each compile the kernels, where they are not yet
_WALK_PICTURES = 6
_MARK = "wayfuse-demo.txt"  # tells a folder of the demo from one that is somebody's own
_MARK_TEXT = "Written by `wayfuse demo`, which replaces the folder's content when it runs again.\n"
_DATA, _SITE, _MAP, _ESTIMATES, _PICTURES = "data", "site", "radio-map.npz", "estimates.csv", "pictures"
_REPORT = "report.json"
_PARTS = (_DATA, _SITE, _MAP, _ESTIMATES, f"{_ESTIMATES}.json", _PICTURES, _REPORT)


@click.command(context_settings={"help_option_names": ["-h", "--help"]})
@click.option("--out", required=True, type=click.Path(path_type=Path), help="Folder for all files.")
@click.option("--seed", type=int, default=0, show_default=True, help="Another seed, another building.")
def demo(out: Path, seed: int) -> None:
    """Simulate a building of three floors and its walkers, then import, survey, track, evaluate and draw.

    The walkers change floors by stairs and lift. The plans are an IMDF archive, the recordings GetSensorData logs.

    An earlier demo in --out is replaced; a folder that holds anything else is refused.
    """
    run_demo(out, seed)


def run_demo(
    folder: Path, seed: int, scenario: Scenario | None = None, quiet: bool = False, *, pictures: bool = True
) -> None:
    """Run the demo into a folder (made where absent, an earlier demo replaced).

    Parameters
    ----------
    scenario : what to simulate; None is the demo's own.
    quiet : say nothing. pictures : draw the site and the evaluation.

    Raises
    ------
    UsageError : the folder holds something that is not the demo's.
    """
    _claim(folder)
    with contextlib.ExitStack() as stack:
        if quiet:
            stack.enter_context(contextlib.redirect_stdout(io.StringIO()))
            stack.enter_context(contextlib.redirect_stderr(io.StringIO()))
        plan = _simulate(folder, seed, scenario)
        _say("Import the floor plans.")
        _run("site", "import", "imdf", plan, "--out", folder / _SITE)
        if pictures:
            _say("Draw the floors.")
            _run("site", "show", folder / _SITE, "--out", folder / _PICTURES / "site")
        _say("Build the radio map from the survey walks.")
        _run("survey", "build", folder / _SITE, folder / _DATA / "survey", *_ALONE, "--out", folder / _MAP)
        _track(folder, seed)
        _evaluate(folder, pictures)


def _claim(folder: Path) -> None:
    """Empty the folder of an earlier demo, or make it; refuse what is not the demo's."""
    from wayfuse.core.errors import UsageError

    remedy = "name an empty folder, or a new one"
    if folder.exists() and not folder.is_dir():
        raise UsageError("is a file", where=folder, remedy=remedy)
    try:
        if folder.is_dir() and not (folder / _MARK).is_file() and any(folder.iterdir()):
            raise UsageError(
                "holds files that are not of an earlier demo: left alone", where=folder, remedy=remedy
            )
        folder.mkdir(parents=True, exist_ok=True)
        for part in (folder / name for name in _PARTS):
            if part.is_dir() and not part.is_symlink():
                shutil.rmtree(part)
            else:
                part.unlink(missing_ok=True)
        (folder / _MARK).write_text(_MARK_TEXT, encoding="utf-8")
    except OSError as error:
        raise UsageError(f"cannot write: {error.strerror}", where=folder, remedy=remedy) from error


def _simulate(folder: Path, seed: int, scenario: Scenario | None) -> Path:
    """Write the data; the floor plans."""
    from wayfuse.simulator.house_demo import write_house_demo

    made = write_house_demo(folder / _DATA, seed, scenario)
    building = made.site.building
    ways = ", ".join(passage.connector.name for passage in building.passages)
    click.echo(
        f"Simulated a building of {len(building.storeys)} floors ({ways}), {len(made.survey)} survey walks and"
        f" {len(made.walks)} walks to track, seed {seed}: {folder / _DATA}"
    )
    return made.plan


def _track(folder: Path, seed: int) -> None:
    _say("Track the other walks by each method (pdr is told where it starts).")
    methods = [word for name in METHODS for word in ("--method", name)]
    walks, made = folder / _DATA / "walks", folder / _MAP
    options = ("--start", "waypoint", "--seed", seed, *_ALONE, "--out", folder / _ESTIMATES)
    _run("track", folder / _SITE, walks, "--radio-map", made, *methods, *options)


def _evaluate(folder: Path, pictures: bool) -> None:
    import json

    _say("Compare the estimates with the waypoints of the walks.")
    drawn = ("--plots", folder / _PICTURES, "--max-pictures", _WALK_PICTURES) if pictures else ()
    report = folder / _REPORT
    _run("evaluate", folder / _ESTIMATES, folder / _DATA / "walks", *drawn, "--out", report)
    click.echo(_table(json.loads(report.read_text(encoding="utf-8"))))
    if pictures:
        click.echo(f"\nerrors of all methods     {folder / _PICTURES / 'cdf.png'}")
        click.echo(f"paths of single walks     {folder / _PICTURES / 'walks'}")
        click.echo(f"floor plans               {folder / _PICTURES / 'site'}")


def _table(report: dict[str, Any]) -> str:
    """The errors in a few lines, the end of the demo."""
    from wayfuse.evaluation.report import table

    rows = []
    for name, method in report["methods"].items():
        of = method["1hz"]
        share = of["known_floor_accuracy"]
        floor = "-" if share is None else f"{100 * share:.1f} %"
        rows.append(
            [name, *("-" if of[k] is None else f"{of[k]:.2f}" for k in ("mean", "p50", "p90")), floor]
        )
    title = "\nError (m) of the simulated walks, once a second from the first scan on"
    note = "The floor is looked at where both waypoints around are on one: between two floors the truth is not known."
    return table(title, ["method", "mean", "median", "90 %", "right floor"], rows) + f"\n\n{note}"


def _say(line: str) -> None:
    click.echo(f"\n# {line}")


def _run(*arguments: object) -> None:
    """Show a command line and run it."""
    from wayfuse.cli.main import cli

    words = [str(a) for a in arguments]
    click.echo(f"$ wayfuse {shlex.join(words)}")
    status = cli.main(args=words, prog_name="wayfuse", standalone_mode=False)
    if status:
        raise click.exceptions.Exit(int(status))
