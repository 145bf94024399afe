"""``wayfuse survey``: radio maps from recordings with waypoints, the places of access points from a radio map."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from wayfuse.cli.survey_channel import channel_command

if TYPE_CHECKING:
    from wayfuse.maps.site import Site
    from wayfuse.radio.ap_places import ApPlaces
    from wayfuse.radio.survey import Survey
    from wayfuse.radio.walk_survey import SurveyWalk

__all__ = ["survey"]


@click.group(context_settings={"help_option_names": ["-h", "--help"]})
def survey() -> None:
    """Build radio maps from recordings with waypoints, place access points, fit channel state to distances."""


survey.add_command(channel_command)


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


@survey.command("access-points")
@click.argument("radio_map", metavar="RADIO_MAP", type=click.Path(path_type=Path))
@click.option("--out", required=True, type=click.Path(path_type=Path), help="CSV to write the places to.")
@click.option(
    "--min-places",
    type=click.IntRange(4),
    default=8,
    show_default=True,
    help="Cells of 2 m in which an access point must have been heard on its floor.",
)
@click.option(
    "--most-sigma",
    type=click.FloatRange(0.0, min_open=True),
    help="Leave out places with a wider standard deviation (m).",
)
@click.option("--json", "as_json", is_flag=True, help="Print what was estimated as JSON.")
def access_points_command(
    radio_map: Path, out: Path, min_places: int, most_sigma: float | None, as_json: bool
) -> None:
    """Estimate where the access points of RADIO_MAP hang, and write bssid,x,y,floor,height,sigma,power.

    They are estimates, and the file says so (its column sigma): measured places are better, where there are any.
    """
    from dataclasses import replace

    from wayfuse.cli.work import check_target
    from wayfuse.radio.ap_estimation import EstimationParameters, estimate_places
    from wayfuse.radio.ap_hearing import DEFAULT_BANDS, fitted_levels
    from wayfuse.radio.ap_places import write_ap_places
    from wayfuse.radio.walk_survey import load

    check_target(out)
    built = load(radio_map).survey
    found = estimate_places(built, EstimationParameters(min_places=min_places))
    if most_sigma is not None and found.sigma is not None:
        found = found.select(found.sigma <= most_sigma)
    levels = fitted_levels(built, found, DEFAULT_BANDS)
    write_ap_places(out, replace(found, power=levels.power), built.floors)
    _render_places(found, built, out, as_json)


def _render_places(found: ApPlaces, built: Survey, out: Path, as_json: bool) -> None:
    import json

    import numpy as np

    counts = np.bincount(found.floor, minlength=len(built.floors)).tolist()
    sigma = float(np.median(found.sigma)) if found.sigma is not None and len(found) else None
    document = {
        "access_points": str(out),
        "heard": len(built.bssid),
        "placed": len(found),
        "median_sigma_m": None if sigma is None else round(sigma, 2),
        "placed_by_floor": dict(zip(built.floors, counts, strict=True)),
    }
    if as_json:
        click.echo(json.dumps(document, indent=1, ensure_ascii=False))
        return
    spread = "" if sigma is None else f", median standard deviation {sigma:.1f} m"
    click.echo(f"places of {len(found)} of {len(built.bssid)} access points estimated{spread}")
    for name, count in zip(built.floors, counts, strict=True):
        click.echo(f"  {name:<8}{count:>7} access points")
    click.echo(f"written to {out}")


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
