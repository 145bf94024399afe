"""Systems that go by places of access points on the walks of ipin2023-track3 that stay on one floor.

Nobody published those places. They are estimated from the recordings of the other repetitions, which is also what
`fused` has for its survey, so no row goes without one. A repetition is left out at a time, as in docs/results.md.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from wayfuse.evaluation.errors import Scores, score
from wayfuse.evaluation.estimates_file import WalkEstimates, from_track
from wayfuse.evaluation.intervals import Bootstrap, error_intervals
from wayfuse.evaluation.results_folds import Mapper
from wayfuse.evaluation.results_pool import Pooled, pool
from wayfuse.evaluation.results_repetitions import Repetitions, gather, key_of
from wayfuse.maps.site import Site
from wayfuse.models.survey_walk import place_of
from wayfuse.papers.reproduction import Interval, Table
from wayfuse.presets import baselines, fused
from wayfuse.radio.ap_estimation import estimate_places
from wayfuse.radio.ap_places import ApPlaces
from wayfuse.radio.survey import Survey
from wayfuse.sensors.recording import Recording
from wayfuse.tracking.dead_reckoning import Start
from wayfuse.tracking.tracker import Tracker

__all__ = ["SEEDS", "Build", "first_waypoint", "fused_beside", "measure", "steps_alone", "walk_table"]

SEEDS = (0,)  # intervals are over walks
Build: TypeAlias = Callable[[Site, Survey, ApPlaces, Recording], Tracker[Any]]


def first_waypoint(site: Site, recording: Recording) -> Start:
    """Where a walk begins, by its truth."""
    return Start(*place_of(site, recording.waypoints[0]))


def steps_alone(site: Site, survey: Survey, places: ApPlaces, recording: Recording) -> Tracker[Any]:  # noqa: ARG001
    """Dead reckoning from the first waypoint."""
    return baselines.dead_reckoning(site, first_waypoint(site, recording))


def fused_beside(site: Site, survey: Survey, places: ApPlaces, recording: Recording) -> Tracker[Any]:  # noqa: ARG001
    """`fused`, which goes by fingerprints and the floor plan."""
    return fused.build(site, survey)


def measure(
    repetitions: Repetitions, builds: Mapping[str, Build], seeds: Sequence[int], mapper: Mapper
) -> dict[str, Pooled]:
    """Every method on every walk that stays on a floor, pooled over repetitions; a run is (method, seed)."""
    walks = [r for r in repetitions.recordings if not key_of(r.name).changes_floors]
    worker = _Worker(repetitions, builds, tuple(seeds))
    by_number: dict[int, list[Recording]] = {}
    for walk in walks:
        by_number.setdefault(key_of(walk.name).repetition, []).append(walk)
    names = [walk.name for group in by_number.values() for walk in group]
    found = dict(zip(names, mapper(worker, names, "walks of ipin2023"), strict=True))
    scores: list[Scores] = [
        score(
            [one for r in group for one in found[r.name]], group, repetitions.site, repetitions.survey(number)
        )
        for number, group in by_number.items()
    ]
    return pool(scores)


class _Worker:
    """Tracks one recording by every method and seed; travels to the worker processes."""

    def __init__(self, repetitions: Repetitions, builds: Mapping[str, Build], seeds: tuple[int, ...]) -> None:
        self.repetitions, self.builds, self.seeds = repetitions, builds, seeds
        self.recordings = {recording.name: recording for recording in repetitions.recordings}
        self.surveyed: dict[int, tuple[Survey, ApPlaces]] = {}

    def __call__(self, name: str) -> list[WalkEstimates]:
        site, recording, number = self.repetitions.site, self.recordings[name], key_of(name).repetition
        if number not in self.surveyed:
            survey = self.repetitions.survey(number)
            self.surveyed = {number: (survey, estimate_places(survey))}  # walks of a repetition come in a row
        out = []
        for method, build in self.builds.items():
            tracker = build(site, *self.surveyed[number], recording)
            for seed in self.seeds:
                said = tracker.run(recording, seed).estimates
                out.append(from_track(name, f"{method}#{seed}", said, site.floor_names))
        return out


def walk_table(
    title: str,
    folder: Path,
    builds: Mapping[str, Build],
    mapper: Mapper,
    note: str,
    seeds: Sequence[int] = SEEDS,
) -> Table:
    """Mean, median and 90th percentile of the error at the waypoints, the right floor; or that there are no data."""
    if not (folder.is_dir() and any(folder.glob("*.txt"))):
        why = "`wayfuse datasets fetch ipin2023-track3` gets the data set"
        return Table(title, ("not measured",), ((why,),))
    rows: list[tuple[str | float | Interval, ...]] = []
    for name, pooled in measure(gather(folder, mapper), builds, seeds, mapper).items():
        points = pooled.joined("waypoints")
        found = error_intervals(points, Bootstrap())
        cells = [Interval(i.value, i.low, i.high) for i in (found["mean"], found["p50"], found["p90"])]
        floor = f"{100.0 * found['floor_accuracy'].value:.1f} %"
        rows.append((name, str(len(np.unique(points.walk))), *cells, floor))
    return Table(title, ("method", "walks", "mean", "median", "90 %", "right floor"), tuple(rows), note)
