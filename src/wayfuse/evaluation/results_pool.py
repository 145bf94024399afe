"""Pooling: errors of several seeds and folds in one table, with intervals that draw a walk with all its seeds.

Seeds of a method are no new data: a replicate of the bootstrap draws walks, and takes the errors of all seeds of a
drawn walk. Walks of different folds are different walks.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from wayfuse.evaluation.calibration import calibrate, time_bins
from wayfuse.evaluation.errors import PointErrors, Scores, summarise
from wayfuse.evaluation.intervals import Bootstrap, compare, error_intervals
from wayfuse.evaluation.report import survey_bins
from wayfuse.evaluation.results_folds import Mapper, in_turn
from wayfuse.evaluation.truth import TIMES

__all__ = [
    "Pooled",
    "comparison",
    "coverage_of",
    "figures",
    "figures_of_all",
    "paired",
    "pool",
    "pool_known",
    "splits",
]

_APART = 1e10  # s between the times of seeds, beyond any clock


@dataclass(frozen=True, slots=True, eq=False)
class Pooled:
    """One method: the points of each seed, at 1 Hz and at waypoints, over all folds pooled."""

    name: str
    seeds: tuple[Mapping[str, PointErrors], ...]

    def used(self, at: str) -> list[PointErrors]:
        """Points of each seed from the first scan on, where there is an estimate."""
        return [of_seed[at].used() for of_seed in self.seeds]

    def joined(self, at: str) -> PointErrors:
        """Points of all seeds, one below the other."""
        return PointErrors.join(self.used(at))

    def each(self, kept: Callable[[PointErrors], PointErrors]) -> Pooled:
        """The same with what ``kept`` leaves of the points of each seed."""
        seeds = tuple({at: kept(points) for at, points in seed.items()} for seed in self.seeds)
        return replace(self, seeds=seeds)


def pool(scores: Sequence[Scores]) -> dict[str, Pooled]:
    """Methods of several scorings of different walks, whose names are ``method#seed``."""
    first_walk = np.cumsum([0, *(len(s.walks) for s in scores)]).tolist()
    parts: dict[str, dict[str, list[Mapping[str, PointErrors]]]] = {}
    for start, of_fold in zip(first_walk, scores, strict=False):
        for method in of_fold.methods:
            name, _, seed = method.name.partition("#")
            moved = {at: replace(method.points[at], walk=method.points[at].walk + start) for at in TIMES}
            parts.setdefault(name, {}).setdefault(seed, []).append(moved)
    return {
        name: Pooled(
            name,
            tuple(
                {at: PointErrors.join([f[at] for f in of_folds]) for at in TIMES}
                for of_folds in seeds.values()
            ),
        )
        for name, seeds in parts.items()
    }


def pool_known(scores: Sequence[Scores]) -> dict[str, Pooled]:
    """As `pool`, where the truth knows the floor."""
    return {name: pooled.each(PointErrors.of_known_floor) for name, pooled in pool(scores).items()}


def figures(pooled: Pooled, at: str, draw: Bootstrap) -> dict[str, Any]:
    """Figures of a method with intervals; the means and medians of its seeds; points are counted once."""
    points = pooled.joined(at)
    by_seed = [summarise(p) for p in pooled.used(at)]
    raw = PointErrors.join([of_seed[at] for of_seed in pooled.seeds])
    return {
        "n": round(len(points) / len(by_seed)),
        "n_walks": len(np.unique(points.walk)),
        "n_seeds": len(by_seed),
        "availability": raw.availability,
        "figures": {name: asdict(i) for name, i in error_intervals(points, draw).items()},
        "mean_by_seed": [s.mean for s in by_seed],
        "p50_by_seed": [s.p50 for s in by_seed],
    }


def figures_of_all(
    label: str, of: Mapping[str, Pooled], draw: Bootstrap, mapper: Mapper = in_turn
) -> dict[str, dict[str, Any]]:
    """Figures at 1 Hz and at waypoints, by method."""
    found = list(mapper(_Bootstrapper(of, draw), list(of), f"intervals, {label}"))
    return {at: {method: f[at] for method, f in zip(of, found, strict=True)} for at in TIMES}


class _Bootstrapper:
    """Figures of one method; travels to the worker processes."""

    def __init__(self, of: Mapping[str, Pooled], draw: Bootstrap) -> None:
        self.of, self.draw = of, draw

    def __call__(self, method: str) -> dict[str, Any]:
        return {at: figures(self.of[method], at, self.draw) for at in TIMES}


def comparison(method: Pooled, base: Pooled, draw: Bootstrap) -> dict[str, Any]:
    """Paired difference of a method and a baseline at 1 Hz: same walk, same time, and seed with seed.

    A method without seeds stands beside each seed of the other.
    """
    points, base_points = paired(method, base, "1hz")
    found = compare(method.name, points, base.name, base_points, draw)
    wanted = ("mean", "p50", "p90")
    return {
        "method": method.name,
        "baseline": base.name,
        "n_walks": found.n_walks,
        "difference": {name: asdict(found.difference[name]) for name in wanted},
        "reduction": {name: asdict(found.reduction[name]) for name in wanted},
    }


def paired(method: Pooled, base: Pooled, at: str) -> tuple[PointErrors, PointErrors]:
    """Points of both, all seeds below each other, whose times tell the seed; for `wayfuse.evaluation.intervals`."""
    a, b = method.used(at), base.used(at)
    n = max(len(a), len(b))
    one, other = (PointErrors.join([_apart(side[s % len(side)], s) for s in range(n)]) for side in (a, b))
    return one, other


def _apart(points: PointErrors, seed: int) -> PointErrors:
    """Points whose times tell the seed: only points of one seed share a time."""
    return replace(points, t=points.t + _APART * seed)


def coverage_of(pooled: Pooled, draw: Bootstrap) -> dict[str, Any] | None:
    """Coverage of a method's radii at 1 Hz, None where it states none."""
    found = calibrate(pooled.joined("1hz"), draw)
    return None if found is None else {"overall": asdict(found.overall), "nees": found.mean_nees}


def splits(pooled: Pooled) -> dict[str, dict[str, Any]]:
    """Figures at 1 Hz by distance of the true place to the survey and by time since the first scan."""
    points = pooled.joined("1hz")
    n_seeds = len(pooled.seeds)

    def rows(bins: Sequence[tuple[str, Any]]) -> dict[str, Any]:
        out = {}
        for label, of in bins:
            found = summarise(points.select(of))
            out[label] = {"n": round(found.n / n_seeds), "mean": found.mean, "p50": found.p50}
        return out

    return {"by_survey_distance": rows(survey_bins(points)), "by_time": rows(time_bins(points))}
