"""``wayfuse simulate``: recordings of a scenario, with the truth beside them."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

if TYPE_CHECKING:
    from collections.abc import Sequence

    from wayfuse.simulator.experiment import Plan, World
    from wayfuse.simulator.experiment_files import WalkFiles

__all__ = ["simulate"]


@click.command(context_settings={"help_option_names": ["-h", "--help"]})
@click.argument("scenario")
@click.option(
    "--out", required=True, type=click.Path(path_type=Path), help="Folder to write into: empty, or a new one."
)
@click.option(
    "--seed", type=click.IntRange(0), help="Instead of the scenario's own; equal seeds give equal bits."
)
@click.option("--jobs", type=click.IntRange(1), help="Processes (default: all cores); without influence.")
@click.option(
    "--picture/--no-picture", default=True, help="Draw floors, access points and ways: DIR/floors.png."
)
@click.option("--json", "as_json", is_flag=True, help="Print what was written as JSON.")
def simulate(
    scenario: str, out: Path, seed: int | None, jobs: int | None, picture: bool, as_json: bool
) -> None:
    """Simulate a SCENARIO: walkers with phones in a building, what the phones record, and the truth.

    SCENARIO is a TOML file, or the name of one that comes with wayfuse: csi-room, house-two-phones,
    moved-access-points, ray-traced-house, throttled-phone, warehouse-rtt. docs/simulator.md has every key.

    DIR gets the site, recordings of survey walks (with waypoints) and of walks to track (without), the places of the
    access points, and the truth: DIR/truth.csv, and DIR/truth for `wayfuse evaluate`.
    """
    import json

    from wayfuse.cli.work import map_recordings, progress_bar
    from wayfuse.simulator.experiment import make_world, plan_walks
    from wayfuse.simulator.experiment_files import check_formats, write_tables
    from wayfuse.simulator.ray_tracer import Work
    from wayfuse.simulator.scenario_file import find_scenario, load_scenario_file

    source = find_scenario(scenario)
    file = load_scenario_file(source)
    _claim(out)
    used = file.seed if seed is None else seed
    site, world = make_world(file, used, source.parent, Work(jobs, progress_bar("tracing rays")))
    plans = plan_walks(world)
    check_formats(world, plans)
    _write_world(out, world, source.read_text(encoding="utf-8"))
    site.save(out / "SITE")
    targets = {out / plan.name: plan for plan in plans}
    done = list(map_recordings(_Walker(world, targets, out), list(targets), "simulating", jobs))
    write_tables(out, done)
    if picture:
        from wayfuse.cli.simulate_picture import write_picture

        write_picture(out / "floors.png", site, world, done)
    document = _summary(source.stem, out, world, done, used)
    click.echo(json.dumps(document, indent=1, ensure_ascii=False) if as_json else _text(document, picture))


class _Walker:
    """Simulates the walk of a path; travels to the worker processes."""

    def __init__(self, world: World, plans: dict[Path, Plan], folder: Path) -> None:
        self.world, self.plans, self.folder = world, plans, folder

    def __call__(self, path: Path) -> WalkFiles:
        from wayfuse.simulator.experiment_files import write_walk

        return write_walk(self.world, self.plans[path], self.folder)


def _claim(out: Path) -> None:
    """Make the folder, or refuse one that holds something."""
    from wayfuse.core.errors import UsageError

    remedy = "name an empty folder, or a new one"
    try:
        if out.exists() and (not out.is_dir() or any(out.iterdir())):
            raise UsageError("is not an empty folder", where=out, remedy=remedy)
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UsageError(f"cannot write: {error.strerror}", where=out, remedy=remedy) from error


def _write_world(out: Path, world: World, text: str) -> None:
    """Folders, the scenario's copy and the access points."""
    from wayfuse import __version__
    from wayfuse.simulator.experiment_files import scenario_copy, write_access_points

    for k, kind in enumerate(world.scenario.output.formats):
        for part in ("survey", "walks"):
            ((out if k == 0 else out / kind) / part).mkdir(parents=True, exist_ok=True)
    (out / "truth").mkdir(exist_ok=True)
    copy = scenario_copy(text, world.seed, __version__, has_folder=bool(world.scenario.site.folder))
    (out / "scenario.toml").write_text(copy, encoding="utf-8", newline="\n")
    write_access_points(out / "access_points.csv", world, world.before)
    if world.scenario.changes.moved or world.scenario.changes.removed:
        write_access_points(out / "access_points_later.csv", world, world.later)


def _summary(name: str, out: Path, world: World, done: Sequence[WalkFiles], seed: int) -> dict[str, Any]:
    from wayfuse import __version__

    count = {role: sum(one.role == role for one in done) for role in ("survey", "walk")}
    return {
        "scenario": name,
        "title": world.scenario.title,
        "seed": seed,
        "version": __version__,
        "out": str(out),
        "site": world.building.name,
        "floors": [storey.name for storey in world.building.storeys],
        "survey_walks": count["survey"],
        "walks": count["walk"],
        "access_points": len(world.before.radios.ap_xy),
        "radio_model": world.scenario.radio.model,
        "formats": list(world.scenario.output.formats),
        "files": sum(1 for path in out.rglob("*") if path.is_file()),
        "commands": _commands(out, world),
    }


def _commands(out: Path, world: World) -> list[str]:
    """What to run on the files next."""
    survey, places = f"wayfuse survey build {out}/SITE {out}/survey --out {out}/map.npz", ""
    track = f"wayfuse track {out}/SITE {out}/walks --radio-map {out}/map.npz"
    if world.scenario.ranges.period_s or world.scenario.csi.period_s:
        places = f" --access-points {out}/access_points.csv"
    commands = [survey]
    if world.scenario.csi.period_s:
        commands.append(f"wayfuse survey channel {out}/SITE {out}/survey{places} --out {out}/channel.npz")
        places += f" --channel-model {out}/channel.npz"
    return [*commands, f"{track}{places} --out {out}/est.csv", f"wayfuse evaluate {out}/est.csv {out}/truth"]


def _text(document: dict[str, Any], picture: bool) -> str:
    out = document["out"]
    walks = f"{document['survey_walks']} survey walks, {document['walks']} walks to track"
    aps = f"{document['access_points']} access points in {document['site']}"
    lines = [
        f"{document['scenario']}, seed {document['seed']}: {walks}, {aps}",
        f"written to {out}" + (f"; picture {Path(str(out)) / 'floors.png'}" if picture else ""),
        "",
        *document["commands"],
    ]
    return "\n".join(lines)
