"""The work of ``wayfuse track``: one recording through every method; what a method needs, lacks and does not use."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from wayfuse.presets.catalogue import METHODS, NEEDS, PAPERS

if TYPE_CHECKING:
    from collections import Counter

    from wayfuse.evaluation.estimates_file import WalkEstimates
    from wayfuse.maps.site import Site
    from wayfuse.models.observation.coverage import SurveyDistance
    from wayfuse.radio.ap_places import ApPlaces
    from wayfuse.radio.channel_ranging import ChannelRanging
    from wayfuse.radio.survey import Survey
    from wayfuse.radio.walk_survey import WalkRadioMap
    from wayfuse.sensors.quality import Verdict
    from wayfuse.sensors.recording import Recording
    from wayfuse.tracking.dead_reckoning import Start

__all__ = ["Given", "Result", "Worker"]


def _check_made_for(made: WalkRadioMap, site: Site, path: Path) -> None:
    """Refuse the radio map of another site."""
    from wayfuse.core.errors import RadioMapError
    from wayfuse.presets.given import check_floors

    check_floors(site, made.survey)
    if made.site != site.name:
        raise RadioMapError(
            f"radio map of site {made.site}, not of {site.name}",
            where=path,
            remedy="build the radio map with this site",
        )


class Result:
    """What became of one recording."""

    def __init__(self, *, ok: bool) -> None:
        from collections import Counter

        self.ok = ok
        self.notes: list[str] = []
        self.estimates: list[WalkEstimates] = []
        self.verdicts: Counter[Verdict] = Counter()


class _Loaded:
    """What a process loads once. trackers : by method; of a method that needs a start only where one is told."""

    def __init__(
        self, site: Site, survey: Survey | None, places: ApPlaces | None, channel: ChannelRanging | None
    ) -> None:
        from wayfuse.models.observation.coverage import SurveyDistance

        self.site, self.survey, self.places, self.channel = site, survey, places, channel
        self.distance: SurveyDistance | None = None if survey is None else SurveyDistance.build(survey)
        self.trackers: dict[str, Any] = {}


class Given(NamedTuple):
    """Files of the command line: folder of the site, and what belongs to it."""

    site: Path
    radio_map: Path | None
    access_points: Path | None
    channel_model: Path | None


class Worker:
    """Tracks one recording with every method; sent to each process, which loads site and radio map once."""

    def __init__(
        self,
        given: Given,
        methods: tuple[str, ...],
        seed: int,
        lag: float,
        particles: int | None,
        start: str | None,
    ) -> None:
        self.given = given
        self.methods, self.seed, self.lag, self.particles, self.start = methods, seed, lag, particles, start
        self.loaded: _Loaded | None = None

    def __getstate__(self) -> dict[str, Any]:
        """Everything but what each process loads itself."""
        return {**self.__dict__, "loaded": None}

    def prepare(self) -> _Loaded:
        """Load site and radio map and build the trackers, once per process.

        Raises
        ------
        UsageError : a method lacks what it needs.
        """
        if self.loaded is None:
            from wayfuse.maps.site import Site

            site = Site.load(self.given.site)
            self._check_needs()
            start = _check_start(self.start, site) if self.start is not None or self._need("start") else None
            survey = None if self.given.radio_map is None else _survey(site, self.given.radio_map)
            channel = _channel(site, self.given.channel_model)
            loaded = _Loaded(site, survey, _places(site, self.given.access_points), channel)
            loaded.trackers = {
                name: self._build(loaded, name, start)
                for name in self.methods
                if start is not None or "start" not in METHODS[name].needs
            }
            self.loaded = loaded
        return self.loaded

    def _need(self, what: str) -> list[str]:
        return [name for name in self.methods if what in METHODS[name].needs]

    def _check_needs(self) -> None:
        """Say which option is missing before anything is loaded."""
        from wayfuse.core.errors import UsageError

        has_map, has_places = self.given.radio_map is not None, self.given.access_points is not None
        for name in self._need("survey"):
            if not has_map:
                raise UsageError(
                    f"method {name} needs a radio map",
                    where=NEEDS["survey"],
                    remedy="give one, made by `wayfuse survey build`",
                )
        for name in self.methods:
            needs = METHODS[name].needs
            if ("places" in needs and not (has_map or has_places)) or ("anchors" in needs and not has_places):
                raise UsageError(
                    f"method {name} needs the places of access points",
                    where=NEEDS["places"],
                    remedy="give a CSV of them"
                    + ("" if "anchors" in needs else f", or {NEEDS['survey']} to have them estimated"),
                )

    def _build(self, loaded: _Loaded, name: str, start: Start | None) -> Any:
        from dataclasses import replace

        from wayfuse.presets.methods import begun_at, build_from_start, build_method

        if "start" in METHODS[name].needs:
            assert start is not None  # noqa: S101 (`prepare` asked for one, or the recording has one)
            n_particles = 1000 if self.particles is None else self.particles
            return build_from_start(name, loaded.site, start, n_particles=n_particles, lag=self.lag)
        tracker = build_method(
            name, loaded.site, loaded.survey, places=loaded.places, n_particles=self.particles, lag=self.lag
        )
        tracker = replace(tracker, channel=loaded.channel)
        return begun_at(tracker, start) if start is not None and METHODS[name].may_start else tracker

    def __call__(self, path: Path) -> Result:
        """Read and track."""
        from wayfuse.core.errors import WayfuseError
        from wayfuse.formats.reading import read

        try:
            recording = read(path)
        except WayfuseError as error:
            failed = Result(ok=False)
            failed.notes.append(str(error))
            return failed
        return self._track(recording)

    def _track(self, recording: Recording) -> Result:
        import numpy as np

        from wayfuse.evaluation.estimates_file import from_track

        loaded = self.prepare()
        site = loaded.site
        result = Result(ok=True)
        result.notes += [
            *recording.report.describe(),
            *_lacks(recording, self.methods, loaded.channel is not None),
        ]
        for name in self.methods:
            tracker = loaded.trackers.get(name)
            if self.start == "waypoint" and METHODS[name].takes_start:
                tracker = self._from_its_start(loaded, name, recording, result)
            if tracker is None:
                continue
            done = tracker.run(recording, self.seed)
            e = done.estimates
            columns = np.array([(r.x, r.y, r.floor) for r in e]).reshape(-1, 3)
            away = None
            if loaded.distance is not None:
                away = loaded.distance.at(columns[:, 0], columns[:, 1], columns[:, 2].astype(np.int64))
            anchors = [floor.anchor for floor in site.floors]
            result.estimates.append(from_track(recording.name, name, e, site.floor_names, anchors, away))
            if name == self.methods[0]:
                result.verdicts = done.verdicts
        return result

    def _from_its_start(self, loaded: _Loaded, name: str, recording: Recording, result: Result) -> Any:
        """The tracker from the recording's first waypoint; None, and a note, where a method needs one and has none."""
        from wayfuse.core.errors import MapError
        from wayfuse.models.survey_walk import place_of
        from wayfuse.presets.methods import begun_at
        from wayfuse.tracking.dead_reckoning import Start

        try:
            start = Start(*place_of(loaded.site, recording.waypoints[0]))
        except (IndexError, MapError) as error:
            if "start" in METHODS[name].needs:
                why = "no waypoint" if isinstance(error, IndexError) else str(error)
                result.notes.append(f"{recording.path}: {why}: {name} has no start, not tracked")
            return loaded.trackers.get(name)
        made = loaded.trackers.get(name)
        return self._build(loaded, name, start) if made is None else begun_at(made, start)


def _survey(site: Site, path: Path) -> Survey:
    from wayfuse.radio.walk_survey import load

    made = load(path)
    _check_made_for(made, site, path)
    return made.survey


def _places(site: Site, path: Path | None) -> ApPlaces | None:
    from wayfuse.radio.ap_places import read_ap_places

    return None if path is None else read_ap_places(path, site.floor_names)


def _channel(site: Site, path: Path | None) -> ChannelRanging | None:
    from wayfuse.radio.channel_model import load_channel_model
    from wayfuse.radio.channel_ranging import ChannelRanging

    return None if path is None else ChannelRanging(model=load_channel_model(path, site.name))


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


_KINDS = {"scans": "Wi-Fi scan", "ranges": "range", "pressure": "pressure"}


def _lacks(recording: Recording, methods: tuple[str, ...], channel: bool) -> list[str]:
    """What a recording lacks for a method, and what it has that a published system makes nothing of, a line each."""
    from dataclasses import replace

    where = recording.path or recording.name
    if replace(recording, waypoints=()).is_empty:
        return [f"{where}: empty: no estimate"]
    has = {
        "scans": bool(recording.wifi),
        "ranges": bool(recording.ranges) or (bool(recording.csi) and channel),
        "pressure": len(recording.pressure) > 0,
        "steps": bool(recording.steps) or len(recording.acceleration) > 0,
    }
    out = []
    if not has["scans"] and any("scans" in METHODS[name].hears for name in methods):
        out.append(f"{where}: no Wi-Fi scan: the position stays unknown (state initialising)")
    for name in methods:
        if "ranges" in METHODS[name].hears and not has["ranges"]:
            hint = "; channel state needs --channel-model" if recording.csi and not channel else ""
            out.append(f"{where}: no range to an anchor: {name} knows no position (state initialising){hint}")
        unused = [kind for key, kind in _KINDS.items() if has[key] and key not in METHODS[name].hears]
        if unused and name in PAPERS:
            out.append(f"{where}: {name} does not use: {', '.join(unused)}")
    if not has["steps"]:
        out.append(f"{where}: no accelerometer: no steps, the position diffuses between scans")
    return out
