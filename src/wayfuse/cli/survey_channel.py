"""``wayfuse survey channel``: from walks with channel state and waypoints to a model that makes ranges of it."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

if TYPE_CHECKING:
    from collections.abc import Sequence

    from wayfuse.core.types import Array
    from wayfuse.maps.site import Site
    from wayfuse.radio.ap_places import ApPlaces
    from wayfuse.radio.channel_model import ChannelModel
    from wayfuse.sensors.records import CsiFrame

__all__ = ["channel_command"]


@click.command("channel")
@click.argument("site_folder", metavar="SITE", type=click.Path(path_type=Path))
@click.argument("recordings", metavar="RECORDING...", nargs=-1, required=True)
@click.option(
    "--access-points",
    required=True,
    type=click.Path(path_type=Path),
    help="CSV of where the anchors hang (bssid,x,y,floor,height), measured.",
)
@click.option("--out", required=True, type=click.Path(path_type=Path), help="File to write the model to.")
@click.option("--jobs", type=click.IntRange(1), help="Processes that read recordings (default: all cores).")
@click.option("--json", "as_json", is_flag=True, help="Print what was fitted as JSON.")
def channel_command(
    site_folder: Path,
    recordings: tuple[str, ...],
    access_points: Path,
    out: Path,
    jobs: int | None,
    as_json: bool,
) -> None:
    """Fit what turns channel state into ranges to the anchors of SITE.

    RECORDING is a file, a folder, or @FILE with a path per line, with channel state and waypoints. Walk near each
    anchor and far from it. `wayfuse track --channel-model` and `wayfuse serve` use the file.
    """
    from wayfuse.cli.work import check_target, map_recordings, report_faults
    from wayfuse.formats.reading import expand
    from wayfuse.maps.site import Site
    from wayfuse.radio.ap_places import read_ap_places
    from wayfuse.radio.channel_model import fit_channel_model

    check_target(out)
    site = Site.load(site_folder)
    places = read_ap_places(access_points, site.floor_names)
    paths = list({path.resolve(): path for path in expand(recordings)}.values())
    walks: list[tuple[tuple[CsiFrame, ...], Array]] = []
    notes: list[str] = []
    failed = 0
    for walk, said, ok in map_recordings(_Reader(site, places), paths, "reading", jobs):
        notes += said
        failed += not ok
        if walk is not None:
            walks.append(walk)
    report_faults(notes)
    model = fit_channel_model(*_joined(walks), site.name)
    model.save(out)
    _render(model, walks, out, as_json)
    if failed:
        raise click.exceptions.Exit(1)


class _Reader:
    """Reads one recording: its frames of known distance; travels to the worker processes."""

    def __init__(self, site: Site, places: ApPlaces) -> None:
        self.site, self.places = site, places

    def __call__(self, path: Path) -> tuple[tuple[tuple[CsiFrame, ...], Array] | None, list[str], bool]:
        import numpy as np

        from wayfuse.core.errors import WayfuseError
        from wayfuse.formats.reading import read
        from wayfuse.models.channel_survey import anchor_distances

        try:
            recording = read(path)
            distances = anchor_distances(self.site, recording, self.places)
        except WayfuseError as error:
            return None, [str(error)], False
        notes, known = recording.report.describe(), np.isfinite(distances)
        if not known.any():
            why = (
                "no channel state"
                if not recording.csi
                else "no frame of a known anchor between two waypoints"
            )
            return None, [*notes, f"{path}: {why}: nothing surveyed"], True
        frames = tuple(f for f, is_known in zip(recording.csi, known.tolist(), strict=True) if is_known)
        return (frames, distances[known]), notes, True


def _joined(walks: Sequence[tuple[tuple[CsiFrame, ...], Array]]) -> tuple[list[CsiFrame], Array]:
    import numpy as np

    distances = [distances for _, distances in walks]
    return [frame for frames, _ in walks for frame in frames], np.concatenate([np.empty(0), *distances])


def _render(
    model: ChannelModel, walks: Sequence[tuple[tuple[CsiFrame, ...], Array]], out: Path, as_json: bool
) -> None:
    import json

    import numpy as np

    from wayfuse.core.errors import RadioMapError
    from wayfuse.radio.channel_accuracy import range_errors
    from wayfuse.sensors.records import bssid_text

    try:
        errors = np.abs(range_errors(walks)) if len(walks) > 1 else np.empty(0)
    except RadioMapError:  # too little is left without one of the walks
        errors = np.empty(0)
    accuracy: dict[str, float] | None = None
    if len(errors):
        accuracy = {"median_m": float(np.median(errors)), "p90_m": float(np.quantile(errors, 0.9))}
    anchors: dict[str, Any] = {
        bssid_text(anchor): [round(antenna.path_loss_exponent, 2) for antenna in antennas]
        for anchor, antennas in model.anchors.items()
    }
    n = sum(len(frames) for frames, _ in walks)
    if as_json:
        document = {
            "channel_model": str(out),
            "survey_walks": len(walks),
            "frames": n,
            "path_loss_exponents": anchors,
            "held_out_error": accuracy,
        }
        click.echo(json.dumps(document, indent=1))
        return
    click.echo(
        f"{n} frames of {len(walks)} walks, {len(anchors)} anchors; path loss exponent of each antenna:"
    )
    for name, exponents in anchors.items():
        click.echo(f"  {name}  {'  '.join(f'{e:.1f}' for e in exponents)}")
    if accuracy is None:
        click.echo("error of ranges unknown: it takes two walks and more, each near and far from the anchors")
    else:
        click.echo(
            f"ranges on walks left out of the fit: wrong by {accuracy['median_m']:.1f} m (median), "
            f"{accuracy['p90_m']:.1f} m (90 %)"
        )
    click.echo(f"channel model written to {out}")
