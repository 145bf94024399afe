"""``wayfuse results``: measure every figure afresh and write docs/results.md."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar, cast

import click

if TYPE_CHECKING:
    from wayfuse.evaluation.results_folds import Mapper

__all__ = ["make_mapper", "results"]

S = TypeVar("S")
T = TypeVar("T")


@click.command(context_settings={"help_option_names": ["-h", "--help"]})
@click.option("--out", required=True, type=click.Path(path_type=Path), help="Markdown file to write.")
@click.option(
    "--data", type=click.Path(path_type=Path), help="Folder of the data sets (default: $WAYFUSE_DATA)."
)
@click.option(
    "--only",
    multiple=True,
    metavar="SECTION",
    help="ms-indoor, speed, ipin2023, behaviours, hcu, sodindoorloc, oxford-steps; repeatable.",
)
@click.option("--json", "json_file", type=click.Path(path_type=Path), help="Also write all figures as JSON.")
@click.option(
    "--date", default="", help="A date to write into the file; left out, reruns differ in nothing but time."
)
@click.option("--jobs", type=click.IntRange(1), help="Processes (default: all cores).")
def results(
    out: Path, data: Path | None, only: tuple[str, ...], json_file: Path | None, date: str, jobs: int | None
) -> None:
    """Measure every figure of docs/results.md anew on the public data sets.

    A section whose data set is missing says that it was not measured, and the exit status is 1.
    """
    import json

    from wayfuse import __version__
    from wayfuse.cli.results_page import page
    from wayfuse.cli.work import check_target
    from wayfuse.evaluation.results import measure
    from wayfuse.formats.datasets import data_root

    for target in (out, *([json_file] if json_file else [])):
        check_target(target)
    sections = measure(data or data_root(), only, make_mapper(jobs))
    if json_file is not None:
        document = {"version": __version__, "date": date, "sections": sections}
        json_file.write_text(json.dumps(document, indent=1, allow_nan=False) + "\n", encoding="utf-8")
    out.write_text(page(sections, __version__, date), encoding="utf-8")
    click.echo(f"results written to {out}")
    _tell(sections)


def make_mapper(jobs: int | None) -> Mapper:
    """What works through items in processes, with a progress bar."""
    from wayfuse.cli.work import map_recordings

    def run(work: Callable[[S], T], items: Sequence[S], label: str, /) -> Iterator[T]:
        # what it says of paths holds of any item
        return map_recordings(cast("Callable[[Path], T]", work), cast("Sequence[Path]", items), label, jobs)

    return run


def _tell(sections: dict[str, dict[str, Any]]) -> None:
    """Bars that do not hold, and sections that were not measured: exit status 1 for the latter."""
    bars = [bar for section in sections.values() for bar in section.get("bars", ())]
    click.echo(f"{sum(bar['met'] for bar in bars)} of {len(bars)} bars hold")
    for bar in bars:
        if not bar["met"]:
            click.echo(f"does not hold: {bar['what']} {bar['bound']}")
    missing = [(name, s["why"]) for name, s in sections.items() if not s["measured"]]
    for name, why in missing:
        click.echo(f"NOT MEASURED: {name}: {why}", err=True)
    if missing:
        sys.exit(1)  # click's own exit would only come back as a value
