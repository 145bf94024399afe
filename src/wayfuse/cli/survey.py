"""``wayfuse survey``: radio maps from recordings with waypoints."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

if TYPE_CHECKING:
    from wayfuse.maps.site import Site
    from wayfuse.radio.walk_survey import SurveyWalk

__all__ = ["survey"]


@click.group(context_settings={"help_option_names": ["-h", "--help"]})
def survey() -> None:
    """Build radio maps from recordings with waypoints."""


@survey.command("build")
@click.argument("site_folder", metavar="SITE", type=click.Path(path_type=Path))
@click.argument("recordings", metavar="RECORDING...", nargs=-1, required=True)
@click.option("--out", required=True, type=click.Path(path_type=Path), help="File to write the radio map to.")
@click.option("--jobs", type=click.IntRange(1), help="Processes that read recordings (default: all cores).")
@click.option("--json", "as_json", is_flag=True, help="Print what was built as JSON.")
def build_command(
    site_folder: Path, recordings: tuple[str, ...], out: Path, jobs: int | None, as_json: bool
) -> None:
    """Build a radio map of SITE from recordings with waypoints.

    RECORDING is a file, a folder, or @FILE with a path per line.
    """
    from wayfuse.cli.work import check_target, map_recordings, report_faults
    from wayfuse.formats.reading import expand
    from wayfuse.maps.site import Site
    from wayfuse.radio.walk_survey import SurveyParameters, WalkRadioMap, survey_from_walks

    check_target(out)
    site = Site.load(site_folder)
    paths = list({path.resolve(): path for path in expand(recordings)}.values())
    walks: list[SurveyWalk] = []
    notes: list[str] = []
    failed = 0
    for walk, said, ok in map_recordings(_Reader(site), paths, "reading", jobs):
        notes += said
        failed += not ok
        if walk is not None:
            walks.append(walk)
    report_faults(notes)  # before building: they say why nothing could be built
    parameters = SurveyParameters()
    built = survey_from_walks(walks, site.floor_names, parameters)
    WalkRadioMap(built, parameters, site.name).save(out)
    _render(built, len(walks), len(paths), out, as_json)
    if failed:
        raise click.exceptions.Exit(1)


class _Reader:
    """Reads one recording into a survey walk; travels to the worker processes."""

    def __init__(self, site: Site) -> None:
        self.site = site

    def __call__(self, path: Path) -> tuple[SurveyWalk | None, list[str], bool]:
        from wayfuse.core.errors import WayfuseError
        from wayfuse.formats.reading import read
        from wayfuse.models.survey_walk import survey_walk

        try:
            recording = read(path)
        except WayfuseError as error:
            return None, [str(error)], False
        walk, notes = survey_walk(self.site, recording)
        return walk, [*recording.report.describe(), *notes], True


def _render(built: Any, n_walks: int, n_paths: int, out: Path, as_json: bool) -> None:
    import json

    import numpy as np

    counts = np.bincount(built.floor, minlength=len(built.floors)).tolist()
    by_floor = dict(zip(built.floors, counts, strict=True))
    document = {
        "radio_map": str(out),
        "recordings": n_paths,
        "survey_walks": n_walks,
        "fingerprints": len(built),
        "access_points": len(built.bssid),
        "readings": len(built.rssi),
        "fingerprints_by_floor": by_floor,
    }
    if as_json:
        click.echo(json.dumps(document, indent=1, ensure_ascii=False))
        return
    click.echo(
        f"{n_walks} of {n_paths} recordings surveyed: {len(built)} fingerprints, {len(built.bssid)} access points"
    )
    for name, count in by_floor.items():
        hint = "" if count else "   not surveyed: nobody can be found here"
        click.echo(f"  {name:<8}{count:>7} fingerprints{hint}")
    click.echo(f"radio map written to {out} ({out.stat().st_size / 1e6:.1f} MB)")
