"""``wayfuse track``: recordings in, EST.csv out."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

if TYPE_CHECKING:
    from collections import Counter
    from collections.abc import Sequence

    from wayfuse.evaluation.estimates_file import WalkEstimates
    from wayfuse.maps.site import Site
    from wayfuse.models.observation.coverage import SurveyDistance
    from wayfuse.radio.survey import Survey
    from wayfuse.radio.walk_survey import WalkRadioMap
    from wayfuse.sensors.quality import Verdict
    from wayfuse.sensors.recording import Recording

__all__ = ["METHODS", "track"]

FROM_START = ("fused-no-wifi", "pdr")  # need a start instead of a radio map
# name -> what it is; built by `presets.methods`
METHODS = {
    "fused": "steps, Wi-Fi and floor plan in a particle filter",
    "fused-no-wifi": "steps, stairs, lifts and floor plan from a known start (--start)",
    "fused-no-barometer": "fused as on a phone without one",
    "fused-no-offset": "fused that takes the phone's levels for the survey's",
    "fused-no-map": "fused without the floor plan",
    "fused-no-steps": "fused without steps",
    "fused-2.4ghz": "fused with the 2.4 GHz band alone",
    "fused-5ghz": "fused with the 5 GHz band alone",
    "random-walk": "particle filter without motion sensors, tuned for itself",
    "wknn": "weighted k nearest neighbours, scan by scan",
    "nnss": "nearest neighbour in signal space, scan by scan",
    "pdr": "steps from a known start (--start)",
}


@click.command(context_settings={"help_option_names": ["-h", "--help"]})
@click.argument("site_folder", metavar="SITE", type=click.Path(path_type=Path))
@click.argument("recordings", metavar="RECORDING...", nargs=-1, required=True)
@click.option(
    "--radio-map",
    type=click.Path(path_type=Path),
    help="From `wayfuse survey build`; only fused-no-wifi and pdr do without.",
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
@click.option("--particles", type=click.IntRange(10, 1_000_000), default=1000, show_default=True)
@click.option(
    "--start",
    help="For fused-no-wifi and pdr: X,Y,FLOOR, or `waypoint` for the first waypoint of each recording.",
)
@click.option("--jobs", type=click.IntRange(1), help="Processes (default: all cores).")
@click.option("--out", type=click.Path(path_type=Path), required=True, help="EST.csv to write.")
def track(
    site_folder: Path,
    recordings: tuple[str, ...],
    radio_map: Path | None,
    methods: tuple[str, ...],
    seed: int,
    lag: float,
    particles: int,
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
    from wayfuse.cli.work import check_target, map_recordings, report_faults
    from wayfuse.evaluation.estimates_file import Sidecar, open_writer
    from wayfuse.formats.reading import expand

    check_target(out)
    methods = tuple(dict.fromkeys(methods))
    paths = list({path.resolve(): path for path in expand(recordings)}.values())
    _check_names(paths)
    worker = _Worker(site_folder, radio_map, methods, seed, lag, particles, start)
    worker.prepare()  # errors of use appear here, once, before any process starts
    parameters: dict[str, Any] = {"methods": list(methods), "particles": particles, "start": start or ""}
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


def _check_made_for(made: WalkRadioMap, site: Site, path: Path) -> None:
    """Refuse the radio map of another site."""
    from wayfuse.core.errors import RadioMapError
    from wayfuse.presets.fused import check_floors

    check_floors(site, made.survey)
    if made.site != site.name:
        raise RadioMapError(
            f"radio map of site {made.site}, not of {site.name}",
            where=path,
            remedy="build the radio map with this site",
        )


class _Result:
    """What became of one recording."""

    def __init__(self, *, ok: bool) -> None:
        from collections import Counter

        self.ok = ok
        self.notes: list[str] = []
        self.estimates: list[WalkEstimates] = []
        self.verdicts: Counter[Verdict] = Counter()


class _Worker:
    """Tracks one recording with every method; sent to each process, which loads site and radio map once."""

    def __init__(
        self,
        site: Path,
        radio_map: Path | None,
        methods: tuple[str, ...],
        seed: int,
        lag: float,
        particles: int,
        start: str | None,
    ) -> None:
        self.paths = site, radio_map
        self.methods, self.seed, self.lag, self.particles, self.start = methods, seed, lag, particles, start
        self.loaded: tuple[Site, SurveyDistance | None, dict[str, Any]] | None = None

    def __getstate__(self) -> dict[str, Any]:
        """Everything but what each process loads itself."""
        return {**self.__dict__, "loaded": None}

    def prepare(self) -> tuple[Site, SurveyDistance | None, dict[str, Any]]:
        """Load site and radio map and build the trackers, once per process."""
        if self.loaded is None:
            from wayfuse.maps.site import Site
            from wayfuse.models.observation.coverage import SurveyDistance
            from wayfuse.presets.methods import build_method

            site = Site.load(self.paths[0])
            if any(name in FROM_START for name in self.methods):
                _check_start(self.start, site)
            survey = self._survey(site)
            trackers = {}
            if survey is not None:
                trackers = {
                    name: build_method(name, site, survey, n_particles=self.particles, lag=self.lag)
                    for name in self.methods
                    if name not in FROM_START
                }
            self.loaded = site, None if survey is None else SurveyDistance.build(survey), trackers
        return self.loaded

    def _survey(self, site: Site) -> Survey | None:
        from wayfuse.core.errors import UsageError
        from wayfuse.radio.walk_survey import load

        wanting = [name for name in self.methods if name not in FROM_START]
        if self.paths[1] is None:
            if wanting:
                raise UsageError(
                    f"method {wanting[0]} needs a radio map",
                    where="--radio-map",
                    remedy="give one, made by `wayfuse survey build`",
                )
            return None
        made = load(self.paths[1])
        _check_made_for(made, site, self.paths[1])
        return made.survey

    def __call__(self, path: Path) -> _Result:
        """Read and track."""
        from wayfuse.core.errors import WayfuseError
        from wayfuse.formats.reading import read

        try:
            recording = read(path)
        except WayfuseError as error:
            failed = _Result(ok=False)
            failed.notes.append(str(error))
            return failed
        return self._track(recording)

    def _track(self, recording: Recording) -> _Result:
        import numpy as np

        from wayfuse.evaluation.estimates_file import from_track

        site, distance, trackers = self.prepare()
        result = _Result(ok=True)
        result.notes += [*recording.report.describe(), *_lacks(recording)]
        for name in self.methods:
            tracker = trackers.get(name) or self._from_start(name, site, recording, result)
            if tracker is None:
                continue
            done = tracker.run(recording, self.seed)
            e = done.estimates
            columns = np.array([(r.x, r.y, r.floor) for r in e]).reshape(-1, 3)
            away = None
            if distance is not None:
                away = distance.at(columns[:, 0], columns[:, 1], columns[:, 2].astype(np.int64))
            anchors = [floor.anchor for floor in site.floors]
            result.estimates.append(from_track(recording.name, name, e, site.floor_names, anchors, away))
            if name == self.methods[0]:
                result.verdicts = done.verdicts
        return result

    def _from_start(self, name: str, site: Site, recording: Recording, result: _Result) -> Any:
        from wayfuse.core.errors import MapError
        from wayfuse.models.survey_walk import place_of
        from wayfuse.presets.methods import build_from_start
        from wayfuse.tracking.dead_reckoning import Start

        start = _check_start(self.start, site)
        if start is None:
            try:
                start = Start(*place_of(site, recording.waypoints[0]))
            except (IndexError, MapError) as error:
                why = "no waypoint" if isinstance(error, IndexError) else str(error)
                result.notes.append(f"{recording.path}: {why}: {name} has no start, not tracked")
                return None
        return build_from_start(name, site, start, n_particles=self.particles, lag=self.lag)


def _check_start(start: str | None, site: Site) -> Any:
    """A start of the command line: ``waypoint`` gives None."""
    from math import isfinite

    from wayfuse.core.errors import UsageError
    from wayfuse.tracking.dead_reckoning import Start

    if start == "waypoint":
        return None
    parts = (start or "").split(",")
    try:
        x, y = float(parts[0]), float(parts[1])
        name = parts[2].strip()
        if not (isfinite(x) and isfinite(y)):
            raise ValueError
    except (IndexError, ValueError):
        raise UsageError(
            "this method needs a start" if not start else f"'{start}' is not a start",
            where="--start",
            remedy="give X,Y,FLOOR in metres of the plan, or waypoint",
        ) from None
    return Start(x, y, site.floor_index(name))


def _lacks(recording: Recording) -> list[str]:
    """What a recording lacks for tracking, a line each."""
    from dataclasses import replace

    where = recording.path or recording.name
    if replace(recording, waypoints=()).is_empty:
        return [f"{where}: empty: no estimate"]
    out = []
    if not recording.wifi:
        out.append(f"{where}: no Wi-Fi scan: the position stays unknown (state initialising)")
    if not len(recording.acceleration):
        out.append(f"{where}: no accelerometer: no steps, the position diffuses between scans")
    return out
