r"""Places of access points from a survey: where would each have to hang to be heard as it was?

For each access point by itself. *Floor*: where it is loudest, by the mean of its few loudest readings. *Readings*: of
that floor, averaged over cells of 2 m, so that a minute in one spot counts as one place. *Fit*: a log-distance path
loss at every candidate of a grid (`radio.log_distance`), robust (Huber weights, iterated), loud readings with more
weight, for shadowing grows with the way. To the squared residuals two terms are added: the level at 1 m is that of an
access point (a far one would need a transmitter that nobody may run), and loud places draw it towards them. *Place*:
the mean over the grid by

.. math:: p(g) \propto \exp\Big(-\tfrac12 \big[\tfrac{S(g)}{T s^2} + \big(\tfrac{P_1(g) - \mu}{\sigma_\mu}\big)^2 +
   \big(\tfrac{|g - c|}{r}\big)^2\big]\Big)

S the weighted squares, s their deviation at the best candidate, T for residuals of neighbouring cells being alike, c
the centroid of power. Its standard deviation per axis comes with it: an access point that was passed on one side only
has a wide one.

Numbers were chosen on sodindoorloc, whose access points hang at known places; how far off they are there is printed by
``wayfuse reproduce liu2017``. Between two floors, or under a survey that is a single corridor, expect worse. Access
points that move (phones, buses) get a place too: a wide sigma is the only sign.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wayfuse.core.errors import ConfigError, RadioMapError
from wayfuse.core.types import Array, IntArray
from wayfuse.radio.ap_places import ApPlaces
from wayfuse.radio.log_distance import GridFit, grid_about, grid_fit
from wayfuse.radio.survey import Survey

__all__ = ["EstimationParameters", "estimate_places"]

_ROUNDS = 4  # of Huber weights; the last two hardly change a place
_HUBER = 1.5  # deviations from which a residual counts less
_NORMAL = 1.4826  # deviation of a normal over its median absolute value
_LEAST_DEVIATION = 3.0  # dB; readings scatter by more than a good fit of a few cells says
_LEAST_SCALE = 1.0  # dB, of the Huber weights


@dataclass(frozen=True, slots=True, kw_only=True)
class EstimationParameters:
    """What the estimate is made with.

    cell : m, readings of a cell are averaged. min_places : cells in which an access point must be heard on its floor;
    others get no place. n_loudest : readings that tell the floor. loudness : dB that multiply the weight of a reading
    by ten. level, level_sigma : dBm at 1 m. reach : m, standard deviation about the centroid of power. dependence : T.
    """

    cell: float = 2.0
    min_places: int = 8
    n_loudest: int = 5
    loudness: float = 40.0
    level: float = -40.0
    level_sigma: float = 6.0
    reach: float = 6.0
    dependence: float = 3.0

    def __post_init__(self) -> None:
        lengths = (self.cell, self.loudness, self.level_sigma, self.reach, self.dependence)
        if not all(value > 0.0 for value in lengths) or self.min_places < 4 or self.n_loudest < 1:
            raise ConfigError(
                f"cannot estimate places with {self}",
                where="EstimationParameters",
                remedy="positive lengths and deviations, min_places at least 4",
            )


def estimate_places(survey: Survey, parameters: EstimationParameters | None = None) -> ApPlaces:
    """Places of the access points of a survey that were heard in enough cells, in the order of the survey.

    Raises
    ------
    RadioMapError : none was.
    """
    p = parameters or EstimationParameters()
    found: list[tuple[int, int, float, float, float]] = []
    for column, rows, rssi in _by_access_point(survey):
        if len(rows) < p.min_places:
            continue
        floor = _loudest_floor(survey.floor[rows], rssi, p.n_loudest)
        here = survey.floor[rows] == floor
        xy, mean = _cells(survey.xy[rows[here]], rssi[here], p.cell)
        if len(xy) >= p.min_places:
            found.append((column, floor, *_place(xy, mean, p)))
    if not found:
        raise RadioMapError(
            f"no access point was heard in {p.min_places} places of a floor", remedy="give a larger survey"
        )
    columns, floors, x, y, sigma = (np.array(values) for values in zip(*found, strict=True))
    unknown = np.full(len(found), np.nan)
    return ApPlaces(
        survey.bssid[columns], x, y, floors.astype(np.int32), unknown, is_estimated=True, sigma=sigma
    )


def _by_access_point(survey: Survey) -> Iterator[tuple[int, IntArray, Array]]:
    """Column, rows of the fingerprints that heard it, and how strongly (dBm), for each access point that was heard."""
    row = np.repeat(np.arange(len(survey)), np.diff(survey.indptr))
    order = np.argsort(survey.indices, kind="stable")
    column, row, rssi = survey.indices[order], row[order], survey.rssi[order].astype(np.float64)
    starts = np.flatnonzero(np.diff(column, prepend=-1))
    for start, end in zip(starts, [*starts[1:], len(column)], strict=True):
        yield int(column[start]), row[start:end], rssi[start:end]


def _loudest_floor(floor: NDArray[np.int32], rssi: Array, n: int) -> int:
    floors = np.unique(floor)
    return int(floors[np.argmax([np.sort(rssi[floor == f])[-n:].mean() for f in floors])])


def _cells(xy: Array, rssi: Array, size: float) -> tuple[Array, Array]:
    """Mean place (k, 2) m and mean reading (k,) dBm of each cell that has any."""
    _, cell, count = np.unique(
        np.floor(xy / size).astype(np.int64), axis=0, return_inverse=True, return_counts=True
    )
    x, y, mean = (np.bincount(cell.ravel(), values) / count for values in (*xy.T, rssi))
    return np.column_stack([x, y]), mean


def _place(xy: Array, rssi: Array, p: EstimationParameters) -> tuple[float, float, float]:
    """x, y and standard deviation per axis (m) from mean readings (k,) dBm of cells (k, 2) m."""
    fit, weight = _robust_fit(xy, rssi, np.power(10.0, (rssi - rssi.max()) / p.loudness))
    squares = fit.cost[:, 0]
    variance = max(float(squares.min()) / max(float(weight.sum()) - 4.0, 1.0), _LEAST_DEVIATION**2)
    power = np.power(10.0, (rssi - rssi.max()) / 10.0)
    centre = power @ xy / power.sum()
    level = fit.level[0] + fit.exponent[:, 0] * fit.decades[:, 0]  # dBm at 1 m
    surprise = squares / (p.dependence * variance) + ((level - p.level) / p.level_sigma) ** 2
    surprise += ((fit.xy - centre) ** 2).sum(axis=1) / p.reach**2
    share = np.exp(-0.5 * (surprise - surprise.min()))
    share /= share.sum()
    x, y = share @ fit.xy
    spread = share @ ((fit.xy - (x, y)) ** 2).sum(axis=1)
    step = float(np.ptp(np.unique(fit.xy[:, 0])[:2]))  # a grid does not know better than its step
    return float(x), float(y), float(np.sqrt(0.5 * spread + step**2 / 12.0))


def _robust_fit(xy: Array, rssi: Array, weight: Array) -> tuple[GridFit, Array]:
    """The fit at every candidate, and the weights (k,) it was made with in the end."""
    grid, trust = grid_about(xy), np.ones(len(rssi))
    for _ in range(_ROUNDS):
        fit = grid_fit(grid, rssi[:, None], (weight * trust)[:, None])
        residual = np.abs(rssi - fit.best().at(xy)[:, 0])
        scale = max(_LEAST_SCALE, _NORMAL * float(np.median(residual)))
        used, trust = trust, np.minimum(1.0, _HUBER * scale / np.maximum(residual, 1e-9))
    return fit, weight * used
