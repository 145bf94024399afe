"""ipin2023-track3, leave one repetition out: what was read, and every method tracked on it.

Each trial was walked several times. A recording is tracked with a survey of all recordings that bear another number of
repetition; *off route* those of its own trial are left out of the survey as well. Trials above 50 change floors and
are here once each, so no flight of stairs and no ride that is tracked was surveyed.
"""

from __future__ import annotations

import re
from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

from wayfuse.core.errors import DataMissingError
from wayfuse.core.types import Array
from wayfuse.evaluation.errors import Scores, score
from wayfuse.evaluation.estimates_file import WalkEstimates, from_track
from wayfuse.evaluation.results_folds import SEEDS, Mapper, in_turn
from wayfuse.formats.reading import read
from wayfuse.maps.importers.ipin2023 import import_site
from wayfuse.maps.site import Site
from wayfuse.models.survey_walk import survey_walk
from wayfuse.presets.methods import FIXES, build_method
from wayfuse.radio.device_offset import DeviceOffset
from wayfuse.radio.scans import ScanBuffer
from wayfuse.radio.sparse_knn import SparseKnn
from wayfuse.radio.survey import Survey
from wayfuse.radio.walk_survey import SurveyParameters, SurveyWalk, survey_from_walks
from wayfuse.sensors.recording import Recording
from wayfuse.tracking.tracker import Tracker

__all__ = ["METHODS", "OFF_ROUTE", "Key", "Repetitions", "Tracked", "end_shift", "gather", "key_of", "track"]

METHODS = ("fused", "fused-no-barometer", "fused-no-offset", "random-walk", *FIXES)
OFF_ROUTE = ("fused", "fused-no-barometer", "random-walk", "wknn")
_FIRST_CONNECTOR_TRIAL = 51
_NAME = re.compile(r"Trial(\d+)_repetition(\d+)")


class Key(NamedTuple):
    """Trial and repetition of a recording."""

    trial: int
    repetition: int

    @property
    def changes_floors(self) -> bool:
        """Whether the trial goes over stairs or by lift."""
        return self.trial >= _FIRST_CONNECTOR_TRIAL


def key_of(name: str) -> Key:
    """Trial and repetition by the name of a log.

    Raises
    ------
    DataMissingError : the name does not say.
    """
    found = _NAME.search(name)
    if found is None:
        raise DataMissingError(
            "the name says no trial and repetition", where=name, remedy="fetch ipin2023-track3 anew"
        )
    return Key(int(found[1]), int(found[2]))


@dataclass(frozen=True, slots=True, eq=False)
class Repetitions:
    """The site, the recordings in the order of their names, and the walks that survey (not every one may)."""

    site: Site
    recordings: tuple[Recording, ...]
    walks: tuple[SurveyWalk, ...]
    _surveys: dict[Hashable, Survey] = field(default_factory=dict, init=False, repr=False)

    @property
    def numbers(self) -> tuple[int, ...]:
        """Numbers of the repetitions, ascending."""
        return tuple(sorted({key_of(r.name).repetition for r in self.recordings}))

    def of(self, repetition: int) -> list[Recording]:
        """Recordings of a repetition."""
        return [r for r in self.recordings if key_of(r.name).repetition == repetition]

    def survey(
        self, repetition: int, without_trial: int = 0, parameters: SurveyParameters | None = None
    ) -> Survey:
        """Survey of all recordings of other repetitions, a trial left out if one is named; made once."""
        wanted = repetition, without_trial, parameters
        if wanted not in self._surveys:
            self._surveys[wanted] = self._survey(repetition, without_trial, parameters)
        return self._surveys[wanted]

    def _survey(self, repetition: int, without_trial: int, parameters: SurveyParameters | None) -> Survey:
        keys = [key_of(walk.name) for walk in self.walks]
        kept = [
            walk
            for walk, key in zip(self.walks, keys, strict=True)
            if key.repetition != repetition and key.trial != without_trial
        ]
        return survey_from_walks(kept, self.site.floor_names, parameters)


def gather(folder: Path, mapper: Mapper = in_turn) -> Repetitions:
    """Read all logs of a folder, once.

    Raises
    ------
    MapError : there are no logs.
    """
    site, _ = import_site(folder)
    paths = sorted(folder.glob("*.txt"))
    recordings = tuple(mapper(_read, paths, "reading"))
    walks = (survey_walk(site, recording)[0] for recording in recordings)
    return Repetitions(site, recordings, tuple(walk for walk in walks if walk is not None))


def _read(path: Path) -> Recording:
    return read(path)


class Tracked(NamedTuple):
    """Scores (methods are named ``method#seed``), one for each survey, and all tracks."""

    scores: list[Scores]
    tracks: list[WalkEstimates]


def track(
    repetitions: Repetitions,
    methods: Sequence[str] = METHODS,
    seeds: Sequence[int] = SEEDS,
    mapper: Mapper = in_turn,
    *,
    off_route: bool = False,
) -> Tracked:
    """Track every recording (off route: those that stay on a floor) by every method and seed, and score it."""
    worker = _Worker(repetitions, methods, seeds, off_route)
    mine = [r for r in repetitions.recordings if not (off_route and key_of(r.name).changes_floors)]
    by_survey: dict[tuple[int, int], list[Recording]] = {}
    for recording in mine:
        by_survey.setdefault(_surveyed_by(recording.name, off_route), []).append(recording)
    names = [recording.name for group in by_survey.values() for recording in group]
    label = "tracking off route" if off_route else "tracking"
    found = dict(zip(names, mapper(worker, names, label), strict=True))
    scores = [
        score(
            [one for r in group for one in found[r.name]], group, repetitions.site, repetitions.survey(*key)
        )
        for key, group in by_survey.items()
    ]
    return Tracked(scores, [one for of_recording in found.values() for one in of_recording])


def _surveyed_by(name: str, off_route: bool) -> tuple[int, int]:
    """Repetition and trial that are left out of the survey of a recording; trial 0 is none."""
    key = key_of(name)
    return key.repetition, key.trial if off_route else 0


class _Worker:
    """Tracks one recording by every method and seed; travels to the worker processes."""

    def __init__(
        self, repetitions: Repetitions, methods: Sequence[str], seeds: Sequence[int], off_route: bool
    ) -> None:
        self.repetitions, self.off_route = repetitions, off_route
        self.methods, self.seeds = tuple(methods), tuple(seeds)
        self.recordings = {recording.name: recording for recording in repetitions.recordings}
        self.known: tuple[int, int] = (-1, -1)
        self.trackers: Mapping[str, Tracker[Any]] = {}

    def __call__(self, name: str) -> list[WalkEstimates]:
        trackers, site = self._trackers(_surveyed_by(name, self.off_route)), self.repetitions.site
        out = []
        for method in self.methods:
            for seed in self.seeds if method not in FIXES else self.seeds[:1]:
                done = trackers[method].run(self.recordings[name], seed)
                out.append(from_track(name, f"{method}#{seed}", done.estimates, site.floor_names))
        return out

    def _trackers(self, wanted: tuple[int, int]) -> Mapping[str, Tracker[Any]]:
        """Trackers of a survey; the last are kept, for recordings of one survey come in a row."""
        if wanted != self.known:
            survey = self.repetitions.survey(*wanted)
            site = self.repetitions.site
            self.trackers = {name: build_method(name, site, survey) for name in self.methods}
            self.known = wanted
        return self.trackers


def end_shift(recording: Recording, survey: Survey) -> Array:
    """Shift (2,) dB of the 2.4 and the 5 GHz band that was estimated at the end of a recording."""
    radio_map, device, buffer = SparseKnn(survey), DeviceOffset(), ScanBuffer()
    state, scans = device.init(), buffer.init()
    for scan in recording.wifi:
        scans, fingerprint = buffer.step(scans, scan)
        if fingerprint is not None:
            state = device.step(state, radio_map, fingerprint)
    return device.shift(state)
