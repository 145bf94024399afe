"""``wayfuse track``: recordings in, EST.csv out."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from wayfuse.presets.catalogue import METHODS

if TYPE_CHECKING:
    from collections import Counter
    from collections.abc import Sequence

    from wayfuse.sensors.quality import Verdict

__all__ = ["track"]


@click.command(context_settings={"help_option_names": ["-h", "--help"]})
@click.argument("site_folder", metavar="SITE", type=click.Path(path_type=Path))
@click.argument("recordings", metavar="RECORDING...", nargs=-1, required=True)
@click.option(
    "--radio-map",
    type=click.Path(path_type=Path),
    help="From `wayfuse survey build`; methods that begin at a start or go by places of access points do without.",
)
@click.option(
    "--access-points",
    type=click.Path(path_type=Path),
    help="CSV of their places (bssid,x,y,floor,height), for karlsson2015, li2015 and liu2017; without it they are "
    "estimated from the radio map.",
)
@click.option(
    "--channel-model",
    type=click.Path(path_type=Path),
    help="From `wayfuse survey channel`: makes ranges of channel state, for li2015, fused-ranges, and fused with "
    "--access-points.",
)
@click.option(
    "--method",
    "methods",
    multiple=True,
    type=click.Choice(list(METHODS)),
    default=["fused"],
    show_default=True,
    help="May be repeated; the rows of EST.csv name their method.",
)
@click.option("--seed", type=int, default=0, show_default=True, help="Equal seeds give equal bits.")
@click.option(
    "--lag", type=click.FloatRange(0.0, 60.0), default=0.0, help="Seconds an estimate may come later."
)
@click.option(
    "--particles", type=click.IntRange(10, 1_000_000), help="Default: each method's own number; fused: 1000."
)
@click.option(
    "--start",
    help="For fused-no-wifi, pdr and the published systems: X,Y,FLOOR, or `waypoint` for each recording's first.",
)
@click.option("--jobs", type=click.IntRange(1), help="Processes (default: all cores).")
@click.option("--out", type=click.Path(path_type=Path), required=True, help="EST.csv to write.")
def track(
    site_folder: Path,
    recordings: tuple[str, ...],
    radio_map: Path | None,
    access_points: Path | None,
    channel_model: Path | None,
    methods: tuple[str, ...],
    seed: int,
    lag: float,
    particles: int | None,
    start: str | None,
    jobs: int | None,
    out: Path,
) -> None:
    """Track recordings through SITE and write EST.csv.

    RECORDING is a file, a folder, or @FILE with a path per line. Waypoints and floor labels in the recordings are not
    used (except by `--start waypoint`, which says so).

    EST.csv has one row per scan and at least one a second: walk, t_ms (in the recording's own clock), x, y (metres of
    the floor's plan), floor, lat, lon, and more. With --lag L a row's position uses records up to t_ms + L seconds.
    """
    from wayfuse import __version__
    from wayfuse.cli.track_work import Given, Worker
    from wayfuse.cli.work import check_target, map_recordings, report_faults
    from wayfuse.core.jit import load_compiler
    from wayfuse.evaluation.estimates_file import Sidecar, open_writer
    from wayfuse.formats.reading import expand

    check_target(out)
    load_compiler()
    methods = tuple(dict.fromkeys(methods))
    paths = list({path.resolve(): path for path in expand(recordings)}.values())
    _check_names(paths)
    given = Given(site_folder, radio_map, access_points, channel_model)
    worker = Worker(given, methods, seed, lag, particles, start)
    worker.prepare()  # errors of use appear here, once, before any process starts
    parameters: dict[str, Any] = {
        "methods": list(methods),
        "particles": particles or "each method's own",
        "start": start or "",
        "access_points": str(access_points.resolve()) if access_points else "",
        "channel_model": str(channel_model.resolve()) if channel_model else "",
    }
    sidecar = Sidecar(
        site=str(site_folder.resolve()),
        radio_map=str(radio_map.resolve()) if radio_map else "",
        seed=seed,
        lag=lag,
        parameters=parameters,
        version=__version__,
    )
    notes: list[str] = []
    rows = failed = 0
    totals: Counter[Verdict] | None = None
    with open_writer(out, sidecar) as writer:
        for result in map_recordings(worker, paths, "tracking", jobs):
            notes += result.notes
            failed += not result.ok
            totals = result.verdicts if totals is None else totals + result.verdicts
            for estimates in result.estimates:
                rows += writer.add(estimates)
    report_faults(notes)
    click.echo(
        f"{len(paths) - failed} of {len(paths)} recordings tracked by {', '.join(methods)}; {rows} rows: {out}"
    )
    if totals:
        said = ", ".join(
            f"{count} {verdict.value}" for verdict, count in sorted(totals.items(), key=lambda i: i[0].value)
        )
        click.echo(f"scans: {said}")
    if failed:
        raise click.exceptions.Exit(1)


def _check_names(paths: Sequence[Path]) -> None:
    """Refuse recordings that the rows of EST.csv could not tell apart."""
    from wayfuse.core.errors import UsageError

    first: dict[str, Path] = {}
    for path in paths:
        other = first.setdefault(path.stem if path.is_file() else path.name, path)
        if other != path:
            raise UsageError(
                f"has the name of {other}", where=path, remedy="track them apart: walks are told by name"
            )
