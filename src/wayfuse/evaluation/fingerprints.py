"""Scores of radio maps on static fingerprints: the three buildings of SODIndoorLoc, official files.

Every line of a test table is one query, located alone; the error is horizontal (m), the floor is scored
apart. The ten samples of a test point are far from independent, so intervals draw whole points (`Bootstrap`).
The parameters of the maps come from the training table of CETC331 (k-NN, Horus, Gaussian kernel), and those of
the noise of the Gaussian process from HCXY and SYL as development sets: there its rows are optimistic. The
test table of CETC331 chose no parameter, but was looked at more than once while the methods were built.

References
----------
.. [1] J. Bi et al. 2022, 10.1186/s43020-022-00086-y.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from wayfuse.core.errors import DataMissingError, UsageError
from wayfuse.core.types import Array, IntArray
from wayfuse.evaluation.intervals import Bootstrap, Interval, replicated_percentiles
from wayfuse.formats.sodindoorloc import StaticSet, read
from wayfuse.radio import gaussian_kernel, gaussian_process, horus, knn, nnss
from wayfuse.radio.radio_map import RadioMap
from wayfuse.radio.representation import Representation
from wayfuse.radio.survey import Survey

__all__ = ["METHODS", "SPLITS", "Split", "StaticScore", "score_map", "score_static", "survey_of", "table_of"]

_PERCENTS = (50, 75, 95)


@dataclass(frozen=True, slots=True)
class Split:
    """A training and a test table, below the folder of the data set."""

    name: str
    training: str
    test: str


SPLITS: tuple[Split, ...] = (
    Split("CETC331", "CETC331/Training_CETC331.csv", "CETC331/Testing_CETC331.csv"),
    Split("HCXY AP_Avg", "HCXY/Training_HCXY_AP_Avg.csv", "HCXY/Testing_HCXY_AP.csv"),
    Split("HCXY AP_30", "HCXY/Training_HCXY_AP_30.csv", "HCXY/Testing_HCXY_AP.csv"),
    Split("HCXY All_Avg", "HCXY/Training_HCXY_All_Avg.csv", "HCXY/Testing_HCXY_All.csv"),
    Split("SYL AP_Avg", "SYL/Training_SYL_AP_Avg.csv", "SYL/Testing_SYL_AP.csv"),
    Split("SYL AP_30", "SYL/Training_SYL_AP_30.csv", "SYL/Testing_SYL_AP.csv"),
    Split("SYL All_Avg", "SYL/Training_SYL_All_Avg.csv", "SYL/Testing_SYL_All.csv"),
)


def _plain_knn(survey: Survey) -> RadioMap:
    return knn.fit(survey, k=5, metric="euclidean", representation=Representation("raw", -104.0))


METHODS: Mapping[str, Callable[[Survey], RadioMap]] = {
    "nnss": nnss.fit,
    "knn raw euclid -104": _plain_knn,
    "knn powed sorensen": knn.fit,
    "gaussian kernel": gaussian_kernel.fit,
    "horus": horus.fit,
    "gaussian process": gaussian_process.fit,
}


@dataclass(frozen=True, slots=True)
class StaticScore:
    """Figures of one method on one split: errors in m, intervals over test points, share of right floors."""

    split: str
    method: str
    n: int
    n_points: int
    mean: Interval
    p50: Interval
    p75: Interval
    p95: Interval
    floor_accuracy: float


def survey_of(table: StaticSet, labels: Sequence[int]) -> Survey:
    """Survey of a table; ``labels`` are the numbers of the floors, bottom up."""
    floor = np.searchsorted(np.asarray(labels), table.floor)
    names = tuple(str(label) for label in labels)
    return Survey.from_dense(table.rssi, table.xy, floor, names, bssid=table.bssid)


def score_map(
    radio_map: RadioMap, test: StaticSet, labels: Sequence[int], bootstrap: Bootstrap | None = None
) -> tuple[dict[str, Interval], float]:
    """Figures (mean, p50, p75, p95) of a map on a test table, and the share of right floors."""
    if not np.array_equal(radio_map.bssid, test.bssid):
        raise UsageError("the test table has other access points than the map", where=test.report.path)
    draw = Bootstrap() if bootstrap is None else bootstrap
    xy, floor = radio_map.locate_all(test.rssi)
    error = np.hypot(*(xy - test.xy).T)
    figures = _intervals(error, _points(test), draw)
    return figures, float(np.mean(np.asarray(labels)[floor] == test.floor))


def score_static(
    root: str | Path,
    *,
    splits: Sequence[Split] = SPLITS,
    methods: Mapping[str, Callable[[Survey], RadioMap]] = METHODS,
    bootstrap: Bootstrap | None = None,
) -> list[StaticScore]:
    """Fit every method on every training table and score it on the test table.

    Parameters
    ----------
    root : folder of the data set (it holds CETC331, HCXY, SYL).
    bootstrap : drawing of test points; None takes 2000 replicates, 90 %, seed 0.

    Raises
    ------
    DataMissingError : a table is not there.
    """
    root = Path(root)
    if not root.is_dir():
        raise DataMissingError(
            "there is no such folder", where=root, remedy="fetch with `wayfuse datasets fetch sodindoorloc`"
        )
    scores = []
    for split in splits:
        training, test = read(root / split.training), read(root / split.test)
        labels = sorted(set(training.floor.tolist()))
        survey = survey_of(training, labels)
        n, n_points = len(test.xy), int(_points(test).max()) + 1
        for name, fit in methods.items():
            figures, floor_accuracy = score_map(fit(survey), test, labels, bootstrap)
            scores.append(
                StaticScore(split.name, name, n, n_points, **figures, floor_accuracy=floor_accuracy)
            )
    return scores


def table_of(scores: Sequence[StaticScore]) -> str:
    """The scores as a Markdown table; errors in m, intervals of the mean."""
    lines = [
        "| split | method | mean (interval) | median | 75 % | 95 % | floor | queries, points |",
        "|---|---|---|---|---|---|---|---|",
    ]
    lines += [
        f"| {s.split} | {s.method} | {s.mean.value:.3f} ({s.mean.low:.2f}-{s.mean.high:.2f}) | "
        f"{s.p50.value:.3f} | {s.p75.value:.3f} | {s.p95.value:.3f} | {s.floor_accuracy:.3f} | "
        f"{s.n}, {s.n_points} |"
        for s in scores
    ]
    return "\n".join(lines)


def _points(test: StaticSet) -> IntArray:
    """(n,) index of the test point of each line: lines of equal place and floor."""
    keys = np.column_stack([test.floor.astype(np.float64), test.xy])
    return np.unique(keys, axis=0, return_inverse=True)[1].ravel()


def _intervals(error: Array, point: IntArray, draw: Bootstrap) -> dict[str, Interval]:
    """Mean and percentiles of errors (n,) with intervals over points (n,)."""
    n_points = int(point.max()) + 1
    counts = draw.counts(n_points)
    sums, sizes = np.bincount(point, error, n_points), np.bincount(point, minlength=n_points)
    out = {"mean": draw.interval(float(error.mean()), (counts @ sums) / (counts @ sizes))}
    replicates = replicated_percentiles(error, point, counts, _PERCENTS)
    for k, percent in enumerate(_PERCENTS):
        out[f"p{percent}"] = draw.interval(float(np.percentile(error, percent)), replicates[:, k])
    return out
