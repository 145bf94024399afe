"""``wayfuse evaluate``: score estimates against the waypoints of recordings."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

if TYPE_CHECKING:
    from wayfuse.evaluation.errors import Scores
    from wayfuse.evaluation.estimates_file import EstimatesFile, WalkEstimates
    from wayfuse.maps.site import Site
    from wayfuse.radio.survey import Survey
    from wayfuse.sensors.recording import Recording

__all__ = ["evaluate", "name_methods", "sidecar_place"]

_BAR_FROM = 20  # recordings or pictures from which on a progress bar is worth its line
_SHOWN_FAULTS = 10  # lines about bad data in recordings that are shown


@click.command(context_settings={"help_option_names": ["-h", "--help"]})
@click.argument("arguments", metavar="EST.csv... RECORDING...", nargs=-1, required=True)
@click.option("--json", "as_json", is_flag=True, help="Print the report as JSON.")
@click.option("--out", type=click.Path(path_type=Path), help="Also write the report as JSON to this file.")
@click.option("--plots", type=click.Path(path_type=Path), help="Folder for the pictures.")
@click.option(
    "--max-pictures",
    type=click.IntRange(0),
    default=40,
    show_default=True,
    help="Most pictures of single walks.",
)
@click.option(
    "--site",
    "site_folder",
    type=click.Path(path_type=Path),
    help="Site of the estimates (default: that of EST.csv.json).",
)
@click.option(
    "--radio-map",
    "radio_map",
    type=click.Path(path_type=Path),
    help="Radio map, for the split by distance to the survey (default: that of EST.csv.json).",
)
@click.option(
    "--missing",
    type=click.Choice(["skip", "backfill", "all"]),
    default="skip",
    show_default=True,
    help="Times before a method's first estimate: leave out, fill back, or all times filled back.",
)
@click.option("--baseline", metavar="METHOD", help="Method to compare with (default: nnss, else the worst).")
@click.option(
    "--level",
    type=click.FloatRange(0.5, 0.999),
    default=0.90,
    show_default=True,
    help="Level of the intervals.",
)
@click.option(
    "--replicates", type=click.IntRange(100), default=2000, show_default=True, help="Bootstrap replicates."
)
@click.option("--seed", type=int, default=0, show_default=True, help="Seed of the bootstrap.")
def evaluate(
    arguments: tuple[str, ...],
    as_json: bool,
    out: Path | None,
    plots: Path | None,
    max_pictures: int,
    site_folder: Path | None,
    radio_map: Path | None,
    missing: str,
    baseline: str | None,
    level: float,
    replicates: int,
    seed: int,
) -> None:
    """Score estimates against the waypoints of recordings.

    EST.csv is what track writes, or any file that begins walk,t_ms,x,y,floor,lat,lon; several may be given,
    each with one or more methods. RECORDING is a file, a folder, or @FILE with a path per line. An estimate
    counts from its time on, until the next one: errors are taken at the waypoints and once a second from the
    first Wi-Fi scan on.
    """
    from wayfuse.evaluation.errors import score
    from wayfuse.evaluation.estimates_file import read_estimates
    from wayfuse.evaluation.intervals import Bootstrap
    from wayfuse.evaluation.report import build_report, render

    tables, others = _sort_arguments(arguments)
    files = [read_estimates(path) for path in tables]
    tracks = name_methods(files)
    place, place_note = sidecar_place(files, "site", site_folder)
    site = _site(place)
    map_place, map_note = sidecar_place(files, "radio_map", radio_map)
    paths, unread = _wanted(others, {track.walk for track in tracks})
    scores = score(tracks, _read(paths), site, _survey(map_place))
    scores = _with_unread(scores, unread)
    notes = [*place_note, *map_note, *_file_notes(files)]
    report = build_report(
        scores, missing=missing, baseline=baseline, bootstrap=Bootstrap(replicates, level, seed), notes=notes
    )
    if plots is not None:
        report["plots"], note = _plots(scores, report, plots, site, max_pictures)
        report["notes"] += note
    _emit(report, render(report), as_json, out)
    for line in _faults(scores.reports):
        click.echo(line, err=True)


def _sort_arguments(arguments: Sequence[str]) -> tuple[list[Path], list[str]]:
    """Files of estimates, and the rest, which names recordings."""
    from wayfuse.core.errors import UsageError
    from wayfuse.evaluation.estimates_file import is_estimates_file, read_estimates

    tables = [Path(a) for a in arguments if is_estimates_file(a)]
    others = [a for a in arguments if Path(a) not in tables]
    if not tables:
        for path in (Path(a) for a in others if a.lower().endswith(".csv")):
            read_estimates(path)  # says what is wrong with it
        raise UsageError(
            "no file of estimates among the arguments", remedy="give the EST.csv of `wayfuse track`"
        )
    if not others:
        raise UsageError("no recordings among the arguments", remedy="give the recordings that were tracked")
    return tables, others


def name_methods(files: Sequence[EstimatesFile]) -> list[WalkEstimates]:
    """All tracks; methods of the same name that share a walk are told apart by the stem of their file."""
    from dataclasses import replace

    from wayfuse.core.errors import UsageError

    seen: set[tuple[str, str]] = set()
    clashing: set[str] = set()
    for file in files:
        keys = {(track.method, track.walk) for track in file.tracks}
        clashing |= {method for method, _ in keys & seen}
        seen |= keys
    stems = [Path(file.path).stem for file in files]
    if clashing and len(set(stems)) < len(stems):
        what = f"method {min(clashing)!r} is in several files of the same name"
        raise UsageError(what, remedy="give each method a name of its own in the column method")
    return [
        replace(track, method=f"{track.method} ({stem})") if track.method in clashing else track
        for file, stem in zip(files, stems, strict=True)
        for track in file.tracks
    ]


def sidecar_place(
    files: Sequence[EstimatesFile], name: str, given: Path | None
) -> tuple[Path | None, list[str]]:
    """Path of the ``site`` or ``radio_map``: the one given, else the one all sidecars name; and a note.

    A path of a sidecar is looked up as it stands and beside its file.
    """
    if given is not None:
        return given, []
    found: dict[str, Path] = {}
    for file in files:
        text = "" if file.sidecar is None else str(getattr(file.sidecar, name))
        if text:
            places = (Path(text), Path(file.path).parent / text)
            found[text] = next((p for p in places if p.exists()), Path(text))
    option = name.replace("_", "-")
    if len(found) > 1:
        return None, [f"The files name different {option}s: none is used; give --{option}."]
    for path in found.values():
        return (
            (path, []) if path.exists() else (None, [f"The {option} {path} is not there; give --{option}."])
        )
    return None, []


def _site(folder: Path | None) -> Site | None:
    from wayfuse.maps.site import Site

    return None if folder is None else Site.load(folder)


def _survey(path: Path | None) -> Survey | None:
    """Survey of a radio map, for its places."""
    if path is None:
        return None
    from importlib import import_module

    survey: Survey = import_module("wayfuse.radio.walk_survey").load(path).survey
    return survey


def _wanted(arguments: Sequence[str], walks: set[str]) -> tuple[list[Path], list[str]]:
    """Paths of the recordings that are walks of the estimates, and the names of the others, which are not
    read."""
    from wayfuse.formats.reading import expand

    paths = list(dict.fromkeys(expand(arguments)))
    names = [path.stem if path.is_file() else path.name for path in paths]
    wanted = [path for path, name in zip(paths, names, strict=True) if name in walks]
    return wanted, [name for name in names if name not in walks]


def _read(paths: Sequence[Path]) -> Iterator[Recording]:
    from wayfuse.formats.reading import read

    with _bar(paths, "reading") as bar:
        for path in bar:
            yield read(path)


def _bar(items: Sequence[Any], label: str) -> Any:
    import sys

    if len(items) < _BAR_FROM or not sys.stderr.isatty():
        return nullcontext(items)
    return click.progressbar(items, label=label, file=sys.stderr)


def _with_unread(scores: Scores, unread: Sequence[str]) -> Scores:
    from dataclasses import replace

    from wayfuse.evaluation.errors import NO_ESTIMATES

    return replace(scores, unscored=(*scores.unscored, *((name, NO_ESTIMATES) for name in unread)))


def _file_notes(files: Sequence[EstimatesFile]) -> list[str]:
    notes = [note for file in files for note in file.notes]
    for file in files:
        if file.sidecar is not None and file.sidecar.lag > 0:
            lag = file.sidecar.lag
            notes.append(
                f"{file.path}: lag {lag:g} s, a row may rest on records up to {lag:g} s after its time."
            )
    return notes


def _plots(
    scores: Scores, report: dict[str, Any], folder: Path, site: Site | None, most: int
) -> tuple[list[str], list[str]]:
    """Write the pictures; their paths, and a note where not every walk has one."""
    from wayfuse.evaluation.plots import choose_walks, write_plots

    walks, note = choose_walks(scores, most)
    with _bar(walks, "drawing") as bar:
        paths = write_plots(scores, folder, bar, site, report["protocol"]["missing"])
    return [str(path) for path in paths], [note] if note else []


def _emit(report: dict[str, Any], text: str, as_json: bool, out: Path | None) -> None:
    import json

    from wayfuse.core.errors import UsageError

    document = json.dumps(report, indent=1, ensure_ascii=False, allow_nan=False)
    click.echo(document if as_json else text, nl=as_json)
    if out is not None:
        try:
            out.write_text(document + "\n", encoding="utf-8")
        except OSError as error:
            raise UsageError(
                f"cannot write: {error.strerror}", where=out, remedy="name another file"
            ) from error


def _faults(lines: Sequence[str]) -> list[str]:
    shown = list(lines[:_SHOWN_FAULTS])
    left = len(lines) - len(shown)
    return [*shown, *([f"... and {left} more lines about recordings; see `wayfuse inspect`"] if left else [])]
