"""The folds of ms-indoor site1, and every method tracked on them.

A walk's share is ``int(sha256(name).hexdigest(), 16) % 10``. Share 1 is the development set, its survey all walks of
share 2 and above; the folds of share 2 and 3 are surveyed by all other walks. Share 0 is kept out of all of it: it is
for tests that nothing was chosen on. Each recording is read once; surveys are built in memory, as
``wayfuse survey build`` builds them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from hashlib import sha256
from pathlib import Path
from typing import Any, Protocol, TypeVar

import numpy as np

from wayfuse.core.errors import DataMissingError, MapError
from wayfuse.evaluation.errors import Scores, score
from wayfuse.evaluation.estimates_file import WalkEstimates, from_track
from wayfuse.formats.reading import expand, read
from wayfuse.maps.importers.ms_indoor import import_site
from wayfuse.maps.site import Site
from wayfuse.models.survey_walk import place_of, survey_walk
from wayfuse.presets import baselines, fused
from wayfuse.presets.methods import build_method
from wayfuse.radio.survey import Survey
from wayfuse.radio.walk_survey import SurveyWalk, survey_from_walks
from wayfuse.sensors.recording import Recording
from wayfuse.tracking.dead_reckoning import Start
from wayfuse.tracking.tracker import Tracker

__all__ = ["FIRST", "FOLDS", "LAG", "METHODS", "SEEDS", "Folds", "Mapper", "build_tracker", "gather", "in_turn",
           "minutes_of", "share_of", "track_fold"]  # fmt: skip

FOLDS = (1, 2, 3)  # the first is the development set
SEEDS = (0, 1, 2)  # of the methods that draw random numbers
LAG = 5.0  # s
_SEALED = 0  # share that is neither tracked nor surveyed with
_LAGGED = f"fused --lag {LAG:g}"
FIRST = "fused, first release"
# `fused` with the parameters it had before it knew of stairs, lifts and phones: what came since is to cost nothing
# in a building without them
_FIRST_CONFIG = replace(
    fused.Config(),
    kernel_limits=(4.0, 4.0),
    background=0.05,
    exponent=0.45,
    heading_sigma=0.06,
    bias_sigma=0.015,
    first_bias_sigma=0.2,
    first_scale_sigma=0.09,
    injection=0.0,
    injection_least=0.005,
    device_offset=False,
    novelty=None,
    use_vertical=False,
)
# name -> whether it draws random numbers
METHODS: Mapping[str, bool] = {
    "fused": True,
    _LAGGED: True,
    FIRST: True,
    "fused-no-map": True,
    "fused-barriers": True,
    "fused-no-steps": True,
    "fused-2.4ghz": True,
    "fused-5ghz": True,
    "random-walk": True,
    "wknn": False,
    "nnss": False,
    "pdr": False,
}

S = TypeVar("S")
T = TypeVar("T")


class Mapper(Protocol):
    """Applies a function to each item, in their order; the command line brings one with processes and a bar."""

    def __call__(self, work: Callable[[S], T], items: Sequence[S], label: str, /) -> Iterator[T]:
        """Results of ``work``, in the order of the items."""
        ...


def in_turn(work: Callable[[S], T], items: Sequence[S], label: str, /) -> Iterator[T]:  # noqa: ARG001
    """One after the other, in this process, in silence."""
    return map(work, items)


@dataclass(frozen=True, slots=True, eq=False)
class Folds:
    """What was read: the site, the survey of each fold, the recordings to track by path, all paths by fold.

    n_read : recordings read, share 0 left out. n_notes : lines of the readers on what was bad in them.
    """

    site: Site
    surveys: Mapping[int, Survey]
    recordings: Mapping[Path, Recording]
    paths: Mapping[int, tuple[Path, ...]]
    n_read: int
    n_notes: int = 0

    def of(self, fold: int) -> list[Recording]:
        """Recordings to track in a fold."""
        return [self.recordings[path] for path in self.paths[fold]]


def share_of(name: str) -> int:
    """Share 0 to 9 of a walk by its name (file stem)."""
    return int(sha256(name.encode()).hexdigest(), 16) % 10


def gather(folder: Path, folds: Sequence[int] = FOLDS, mapper: Mapper = in_turn) -> Folds:
    """Read the site and all recordings below a folder, once, and build the survey of each fold.

    Raises
    ------
    DataMissingError : no recording, or a fold without a walk.
    """
    site, _ = import_site(folder)
    paths = [path for path in expand([folder]) if share_of(path.stem) != _SEALED]
    mine = {fold: tuple(p for p in paths if share_of(p.stem) == fold) for fold in folds}
    for fold, walks in mine.items():
        if not walks:
            raise DataMissingError(
                f"no walk of share {fold}", where=folder, remedy="fetch the data set whole"
            )
    surveyed: dict[Path, SurveyWalk] = {}
    recordings: dict[Path, Recording] = {}
    n_notes = 0
    for path, (recording, walk, said) in zip(
        paths, mapper(_Reader(site, tuple(folds)), paths, "reading"), strict=True
    ):
        n_notes += len(said)
        if walk is not None:
            surveyed[path] = walk
        if recording is not None:
            recordings[path] = recording
    surveys = {
        fold: survey_from_walks(
            [walk for path, walk in surveyed.items() if share_of(path.stem) != fold], site.floor_names
        )
        for fold in folds
    }
    return Folds(site, surveys, recordings, mine, len(paths), n_notes)


class _Reader:
    """Reads one recording; travels to the worker processes."""

    def __init__(self, site: Site, folds: tuple[int, ...]) -> None:
        self.site, self.folds = site, folds

    def __call__(self, path: Path) -> tuple[Recording | None, SurveyWalk | None, list[str]]:
        recording = read(path)
        walk, notes = survey_walk(self.site, recording)
        keep = recording if share_of(path.stem) in self.folds else None
        return keep, walk, [*recording.report.describe(), *notes]


def build_tracker(name: str, site: Site, survey: Survey) -> Tracker[Any]:
    """The tracker of a method of `METHODS` (``pdr`` has one per walk)."""
    if name == _LAGGED:
        return build_method("fused", site, survey, lag=LAG)
    if name == FIRST:
        return fused.build(site, survey, _FIRST_CONFIG)
    return build_method(name, site, survey)


class _Worker:
    """Tracks one walk of a fold by every method and seed; travels to the worker processes."""

    def __init__(self, folds: Folds, fold: int, methods: Sequence[str], seeds: Sequence[int]) -> None:
        self.site, self.survey = folds.site, folds.surveys[fold]
        self.recordings = {path: folds.recordings[path] for path in folds.paths[fold]}
        self.methods, self.seeds = tuple(methods), tuple(seeds)
        self.trackers: dict[str, Tracker[Any]] = {}

    def __call__(self, path: Path) -> list[WalkEstimates]:
        recording = self.recordings[path]
        out = []
        for name in self.methods:
            tracker = self._tracker(name, recording)
            for seed in self.seeds if METHODS[name] else self.seeds[:1]:
                if tracker is not None:
                    done = tracker.run(recording, seed)
                    out.append(
                        from_track(recording.name, f"{name}#{seed}", done.estimates, self.site.floor_names)
                    )
        return out

    def _tracker(self, name: str, recording: Recording) -> Tracker[Any] | None:
        if name == "pdr":
            try:
                start = Start(*place_of(self.site, recording.waypoints[0]))
            except (IndexError, MapError):
                return None
            return baselines.dead_reckoning(self.site, start)
        if name not in self.trackers:
            self.trackers[name] = build_tracker(name, self.site, self.survey)
        return self.trackers[name]


def track_fold(
    folds: Folds,
    fold: int,
    methods: Sequence[str] = tuple(METHODS),
    seeds: Sequence[int] = SEEDS,
    mapper: Mapper = in_turn,
) -> Scores:
    """Track every walk of a fold and score it; the methods of the scores are named ``method#seed``."""
    worker = _Worker(folds, fold, methods, seeds)
    label = f"tracking fold {fold}"
    tracks = [track for of_walk in mapper(worker, folds.paths[fold], label) for track in of_walk]
    return score(tracks, folds.of(fold), folds.site, folds.surveys[fold])


def minutes_of(recordings: Sequence[Recording]) -> float:
    """Length of recordings from the first to the last record, in minutes."""
    return float(np.sum([recording.span[1] - recording.span[0] for recording in recordings])) / 60.0
