r"""Bootstrap intervals over walks, of one method and of the paired difference between two.

Points of one walk are far from independent, so whole walks are drawn with replacement, never points (the
cluster bootstrap, percentile method). A replicate is a row of counts, how often each walk was drawn; means
follow from sums per walk, percentiles from the errors in ascending order with the counts as repetitions. A
paired comparison draws the same walks for both methods, which takes the difficulty of the walks out of the
difference.

References
----------
.. [1] Efron, Tibshirani, An Introduction to the Bootstrap, 1993, ch. 13 (percentile intervals).
.. [2] Davison, Hinkley, Bootstrap Methods and their Application, 1997, sec. 3.8 (hierarchical data).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from wayfuse.core.errors import ConfigError
from wayfuse.core.types import Array, BoolArray, IntArray
from wayfuse.evaluation.errors import PointErrors

__all__ = [
    "STATISTICS",
    "Bootstrap",
    "Comparison",
    "Interval",
    "compare",
    "error_intervals",
    "replicated_percentiles",
]

_CHUNK = 2_000_000  # cells of the table of cumulated counts held at once
STATISTICS = ("mean", "p50", "p75", "p90", "p95")


@dataclass(frozen=True, slots=True)
class Interval:
    """A value with the ends of its interval; the ends are NaN where fewer than two walks are there."""

    value: float
    low: float
    high: float


@dataclass(frozen=True, slots=True)
class Bootstrap:
    """Drawing of walks: number of replicates, level of the interval, seed."""

    n: int = 2000
    level: float = 0.90
    seed: int = 0

    def __post_init__(self) -> None:
        if self.n < 1 or not 0.0 < self.level < 1.0:
            raise ConfigError(
                f"bootstrap: n = {self.n}, level = {self.level}", remedy="n >= 1, 0 < level < 1"
            )

    def counts(self, n_walks: int) -> IntArray:
        """(n, n_walks) how often each walk is in each replicate; the same for the same number of walks."""
        rng = np.random.default_rng(self.seed)
        draws = rng.integers(0, n_walks, size=(self.n, n_walks))
        flat = draws + n_walks * np.arange(self.n)[:, None]
        return np.bincount(flat.ravel(), minlength=self.n * n_walks).reshape(self.n, n_walks)

    def interval(self, value: float, replicates: Array) -> Interval:
        """Percentile interval of replicates (n,); those that are NaN (nothing was drawn) are left out."""
        good = replicates[np.isfinite(replicates)]
        if not len(good):
            return Interval(value, float("nan"), float("nan"))
        tail = 50.0 * (1.0 - self.level)
        low, high = np.percentile(good, (tail, 100.0 - tail))
        return Interval(value, float(low), float(high))

    def share(self, good: BoolArray, walk: IntArray) -> Interval:
        """Interval of the share of points (k,) for which ``good`` holds; ``walk`` (k,) is each point's
        walk."""
        if not len(good):
            return Interval(float("nan"), float("nan"), float("nan"))
        return self.interval(float(np.mean(good)), _replicates(self, good.astype(np.float64), walk, ())[0])


def replicated_percentiles(
    values: Array, walk: IntArray, counts: IntArray, percents: Sequence[float]
) -> Array:
    """Percentiles (n_replicates, n_percents) of values (k,) repeated as often as their walk is drawn.

    Equal to `numpy.percentile` of the repeated values; NaN for a replicate without any.

    Parameters
    ----------
    walk : (k,) index into the columns of ``counts`` (n_replicates, n_walks).
    """
    order = np.argsort(values, kind="stable")
    ascending, column = values[order], walk[order]
    out = np.full((len(counts), len(percents)), np.nan)
    narrow = counts.astype(np.int32)
    step = max(1, _CHUNK // max(1, len(values)))
    for start in range(0, len(counts), step):
        cumulated = np.cumsum(narrow[start : start + step][:, column], axis=1, dtype=np.int32)
        for i, row in enumerate(cumulated):
            total = int(row[-1])
            if total == 0:
                continue
            position = (total - 1) * np.asarray(percents) / 100.0
            below = np.floor(position)
            low = ascending[np.searchsorted(row, below, side="right")]
            high = ascending[np.searchsorted(row, np.minimum(below + 1, total - 1), side="right")]
            out[start + i] = low + (high - low) * (position - below)
    return out


def _replicates(
    bootstrap: Bootstrap, values: Array, walk: IntArray, percents: Sequence[float], n_min: int = 2
) -> tuple[Array, Array]:
    """Replicates of the mean (n,) and of percentiles (n, p) of values (k,) by walk (k,); NaN below two
    walks."""
    names, column = np.unique(walk, return_inverse=True)
    if len(names) < n_min:
        return np.full(bootstrap.n, np.nan), np.full((bootstrap.n, len(percents)), np.nan)
    counts = bootstrap.counts(len(names))
    sums = np.bincount(column, weights=values, minlength=len(names))
    sizes = np.bincount(column, minlength=len(names))
    means = (counts @ sums) / (counts @ sizes)
    if not percents:
        return means, np.empty((bootstrap.n, 0))
    return means, replicated_percentiles(values, column, counts, percents)


def error_intervals(points: PointErrors, bootstrap: Bootstrap | None = None) -> dict[str, Interval]:
    """Intervals of the figures of points: mean, p50, p75, p90, p95, floor_accuracy, combined_mean, ipin."""
    draw = Bootstrap() if bootstrap is None else bootstrap
    nothing = Interval(float("nan"), float("nan"), float("nan"))
    names = (*STATISTICS, "floor_accuracy", "combined_mean", "ipin")
    out = dict.fromkeys(names, nothing)
    if len(points):
        out.update(_all(draw, points.error, points.walk))
    known = np.isfinite(points.floor_steps)
    if known.any():
        walk, combined = points.walk[known], points.combined[known]
        out["floor_accuracy"] = draw.share(points.floor_steps[known] == 0, walk)
        means, p75 = _replicates(draw, combined, walk, (75,))
        out["combined_mean"] = draw.interval(float(np.mean(combined)), means)
        out["ipin"] = draw.interval(float(np.percentile(combined, 75)), p75[:, 0])
    return out


def _all(draw: Bootstrap, values: Array, walk: IntArray) -> dict[str, Interval]:
    percents = tuple(int(name[1:]) for name in STATISTICS[1:])
    means, quantiles = _replicates(draw, values, walk, percents)
    out = {"mean": draw.interval(float(np.mean(values)), means)}
    for k, (name, percent) in enumerate(zip(STATISTICS[1:], percents, strict=True)):
        out[name] = draw.interval(float(np.percentile(values, percent)), quantiles[:, k])
    return out


@dataclass(frozen=True, slots=True)
class Comparison:
    """Two methods at the points where both have an estimate.

    difference : m, method minus baseline, by figure (mean, p50, ...). reduction : 1 - method / baseline.
    """

    method: str
    baseline: str
    n: int
    n_walks: int
    difference: dict[str, Interval]
    reduction: dict[str, Interval]


def compare(
    name: str, points: PointErrors, base_name: str, base: PointErrors, bootstrap: Bootstrap | None = None
) -> Comparison:
    """Paired comparison of a method with a baseline; both tables come from one `score` and one `used`."""
    draw = Bootstrap() if bootstrap is None else bootstrap
    rows, base_rows = _common(points, base)
    a, b, walk = points.error[rows], base.error[base_rows], points.walk[rows]
    percents = tuple(int(s[1:]) for s in STATISTICS[1:])
    (mean_a, quantile_a), (mean_b, quantile_b) = (_replicates(draw, e, walk, percents) for e in (a, b))
    replicates = {"mean": (mean_a, mean_b)}
    replicates |= {s: (quantile_a[:, k], quantile_b[:, k]) for k, s in enumerate(STATISTICS[1:])}
    difference, reduction = {}, {}
    for figure, (of_a, of_b) in replicates.items():
        value_a, value_b = _figure(a, figure), _figure(b, figure)
        difference[figure] = draw.interval(value_a - value_b, of_a - of_b)
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = 1.0 - value_a / value_b if value_b > 0 else float("nan")
            reduction[figure] = draw.interval(ratio, 1.0 - of_a / of_b)
    return Comparison(name, base_name, len(a), len(np.unique(walk)), difference, reduction)


def _figure(values: Array, name: str) -> float:
    if not len(values):
        return float("nan")
    return float(np.mean(values) if name == "mean" else np.percentile(values, int(name[1:])))


def _common(points: PointErrors, base: PointErrors) -> tuple[IntArray, IntArray]:
    """Rows of both tables that are of the same walk and time."""
    index = {key: i for i, key in enumerate(zip(base.walk.tolist(), base.t.tolist(), strict=True))}
    matches = [index.get(key, -1) for key in zip(points.walk.tolist(), points.t.tolist(), strict=True)]
    of_base = np.array(matches, dtype=np.int64)
    return np.flatnonzero(of_base >= 0), of_base[of_base >= 0]
