"""Fitting the fields of a Gaussian-process map: places, completion of silence, mean and kernel.

Each round fits the log-distance means, (in the first and last round) the kernel over all floors, and replaces
each unheard value by its expectation given silence under the leave-one-out belief.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayfuse.core.errors import RadioMapError
from wayfuse.core.types import Array
from wayfuse.radio.censoring import expected_when_silent
from wayfuse.radio.gp_regression import Factor, Kernel, factorise, fit_kernel
from wayfuse.radio.log_distance import LogDistance, fit_log_distance
from wayfuse.radio.survey import Survey

__all__ = ["FloorField", "fit_fields"]

_ROUNDS = 3
_MIN_PLACES = 3  # places that must hear an access point for a field of its own
_FIRST_BELOW = 3.0  # dB below the limit: the first guess of an unheard strength
_LOWEST_BELOW = 12.0  # dB below the limit: an expectation further down carries no information
_SILENT_WEIGHT = 0.3  # weight of a completed value in the log-distance fit, against 1 for a heard one
_KERNEL_PLACES = (
    300  # places per floor that the kernel is fitted on: cubic cost, and five numbers need no more
)


class _Table(NamedTuple):
    """Places xy (n, 2); mean (n, a) dBm where heard, else 0; share (n, a) of the visits that heard."""

    xy: Array
    mean: Array
    share: Array
    columns: NDArray[np.int64]


@dataclass(frozen=True, slots=True, eq=False)
class FloorField:
    """Field of one floor: places (n, 2), columns (a,) of the survey, means, factor and weights (n, a)."""

    xy: Array
    columns: NDArray[np.int64]
    trend: LogDistance
    factor: Factor
    weights: Array

    def predict(self, xy: Array) -> tuple[Array, Array]:
        """Mean (N, a) dBm and standard deviation (N,) dB of the latent strength at places (N, 2)."""
        residual, sigma = self.factor.predict(self.weights, xy)
        return self.trend.at(xy) + residual, sigma


def fit_fields(
    survey: Survey, limit: float, dropout: float, max_points: int, kernel: Kernel | None
) -> tuple[list[FloorField | None], Kernel]:
    """Fields of all floors (None where a floor has no usable readings) and the kernel they share."""
    tables = [_table(survey, level, max_points) for level in range(len(survey.floors))]
    used = [t for t in tables if t is not None]
    if not used:
        raise RadioMapError(
            f"no access point is heard at {_MIN_PLACES} places of a floor", remedy="survey more places"
        )
    complete = [np.where(t.share > 0, t.mean, limit - _FIRST_BELOW) for t in used]
    shared, trends, factors, residuals = kernel, [], [], []
    for round_ in range(_ROUNDS):
        trends = [_trend(t, y) for t, y in zip(used, complete, strict=True)]
        residuals = [y - trend.at(t.xy) for t, y, trend in zip(used, complete, trends, strict=True)]
        if kernel is None and round_ in {0, _ROUNDS - 1}:
            shared = fit_kernel(_thinned(used, residuals), shared)
        factors = [factorise(t.xy, shared or Kernel()) for t in used]
        if round_ < _ROUNDS - 1:
            complete = [
                _completed(t, r, trend, f, limit, dropout)
                for t, r, trend, f in zip(used, residuals, trends, factors, strict=True)
            ]
    fields = iter(
        FloorField(t.xy, t.columns, trend, f, f.solve(r))
        for t, trend, f, r in zip(used, trends, factors, residuals, strict=True)
    )
    return [None if t is None else next(fields) for t in tables], shared or Kernel()


def _trend(table: _Table, complete: Array) -> LogDistance:
    weight = _SILENT_WEIGHT + (1.0 - _SILENT_WEIGHT) * table.share
    return fit_log_distance(table.xy, complete, weight)


def _completed(
    table: _Table, residual: Array, trend: LogDistance, factor: Factor, limit: float, dropout: float
) -> Array:
    """Readings with the silent share of each replaced by its expectation."""
    left_out, sigma = factor.leave_one_out(residual)
    silent = expected_when_silent(trend.at(table.xy) + left_out, sigma[:, None], limit, dropout)
    silent = np.maximum(silent, limit - _LOWEST_BELOW)
    return np.asarray(table.share * table.mean + (1.0 - table.share) * silent)


def _thinned(tables: Sequence[_Table], residuals: Sequence[Array]) -> list[tuple[Array, Array]]:
    """Every so many-th place (they are ordered by cell) of each floor, for the kernel."""
    groups = []
    for table, residual in zip(tables, residuals, strict=True):
        n = len(table.xy)
        rows = np.unique(np.linspace(0, n - 1, min(n, _KERNEL_PLACES)).astype(np.int64))
        groups.append((table.xy[rows], residual[rows]))
    return groups


def _table(survey: Survey, level: int, max_points: int) -> _Table | None:
    """Places of a floor, rows of equal place averaged; over growing cells where there are too many."""
    rows = np.flatnonzero(survey.floor == level)
    if not len(rows):
        return None
    part = survey.select(rows)
    cell, size = part.xy, 0.25
    label = np.unique(cell, axis=0, return_inverse=True)[1].ravel()
    while label.max() + 1 > max_points:
        size *= 2.0
        label = np.unique(np.floor(part.xy / size), axis=0, return_inverse=True)[1].ravel()
    n, m = int(label.max()) + 1, len(survey.bssid)
    visits = np.bincount(label, minlength=n)
    xy = np.column_stack([np.bincount(label, part.xy[:, d], n) / visits for d in (0, 1)])
    at = (np.repeat(label, np.diff(part.indptr)), part.indices)
    total, count = np.zeros((n, m)), np.zeros((n, m))
    np.add.at(total, at, part.rssi.astype(np.float64))
    np.add.at(count, at, 1.0)
    columns = np.flatnonzero((count > 0).sum(axis=0) >= _MIN_PLACES)
    if not len(columns) or n < 2:
        return None
    mean = np.divide(total, count, out=np.zeros((n, m)), where=count > 0)
    return _Table(xy, mean[:, columns], (count / visits[:, None])[:, columns], columns)
