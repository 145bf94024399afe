"""Systems that go by places of access points on the walks of ipin2023-track3 that stay on one floor.

Nobody published those places. They are estimated from the recordings of the other repetitions, which is also what
`fused` has for its survey, so no row goes without one. A repetition is left out at a time, as in docs/results.md.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias

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
from wayfuse.presets.methods import begun_at
from wayfuse.radio.ap_estimation import estimate_places
from wayfuse.radio.ap_places import ApPlaces
from wayfuse.radio.survey import Survey
from wayfuse.sensors.recording import Recording
from wayfuse.tracking.dead_reckoning import Start
from wayfuse.tracking.tracker import Tracker

__all__ = ["SEEDS", "Build", "WalkMethod", "fused_beside", "measure", "steps_alone", "walk_table"]

SEEDS = (0,)  # intervals are over walks
Build: TypeAlias = Callable[[Site, Survey, ApPlaces], Tracker[Any]]


class WalkMethod(NamedTuple):
    """A row of the table. build : its tracker. from_waypoint : it is told where a walk begins."""

    build: Build
    from_waypoint: bool = False


def steps_alone(site: Site, survey: Survey, places: ApPlaces) -> Tracker[Any]:  # noqa: ARG001
    """Dead reckoning, from a start yet to be told."""
    return baselines.dead_reckoning(site, Start(0.0, 0.0, 0))


def fused_beside(site: Site, survey: Survey, places: ApPlaces) -> Tracker[Any]:  # noqa: ARG001
    """`fused`, which goes by fingerprints and the floor plan."""
    return fused.build(site, survey)


def measure(
    repetitions: Repetitions, rows: Mapping[str, WalkMethod], seeds: Sequence[int], mapper: Mapper
) -> dict[str, Pooled]:
    """Every method on every walk that stays on a floor, pooled over repetitions; a run is (method, seed)."""
    walks = [r for r in repetitions.recordings if not key_of(r.name).changes_floors]
    worker = _Worker(repetitions, rows, tuple(seeds))
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

    def __init__(
        self, repetitions: Repetitions, rows: Mapping[str, WalkMethod], seeds: tuple[int, ...]
    ) -> None:
        self.repetitions, self.rows, self.seeds = repetitions, rows, seeds
        self.recordings = {recording.name: recording for recording in repetitions.recordings}
        self.trackers: dict[int, dict[str, Tracker[Any]]] = {}  # by repetition and row

    def __call__(self, name: str) -> list[WalkEstimates]:
        site, recording, number = self.repetitions.site, self.recordings[name], key_of(name).repetition
        if number not in self.trackers:
            survey = self.repetitions.survey(number)
            places = estimate_places(survey)
            made = {method: row.build(site, survey, places) for method, row in self.rows.items()}
            self.trackers = {number: made}  # walks of a repetition come one after another
        out = []
        start = Start(*place_of(site, recording.waypoints[0]))
        for method, built in self.trackers[number].items():
            tracker = begun_at(built, start) if self.rows[method].from_waypoint else built
            for seed in self.seeds:
                said = tracker.run(recording, seed).estimates
                out.append(from_track(name, f"{method}#{seed}", said, site.floor_names))
        return out


def walk_table(
    title: str,
    folder: Path,
    methods: Mapping[str, WalkMethod],
    mapper: Mapper,
    note: str,
    seeds: Sequence[int] = SEEDS,
) -> Table:
    """Mean, median and 90th percentile of the error at the waypoints, the right floor; or that there are no data."""
    if not (folder.is_dir() and any(folder.glob("*.txt"))):
        why = "`wayfuse datasets fetch ipin2023-track3` gets the data set"
        return Table(title, ("not measured",), ((why,),))
    rows: list[tuple[str | float | Interval, ...]] = []
    for name, pooled in measure(gather(folder, mapper), methods, seeds, mapper).items():
        points = pooled.joined("waypoints")
        found = error_intervals(points, Bootstrap())
        cells = [Interval(i.value, i.low, i.high) for i in (found["mean"], found["p50"], found["p90"])]
        floor = f"{100.0 * found['floor_accuracy'].value:.1f} %"
        rows.append((name, str(len(np.unique(points.walk))), *cells, floor))
    return Table(title, ("method", "walks", "mean", "median", "90 %", "right floor"), tuple(rows), note)
