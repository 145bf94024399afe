"""Log-distance path loss of many access points at once, each with an estimated position.

rssi(x) = intercept - 10 exponent log10 sqrt(|x - p|^2 + h^2)

The position p of each access point is the best of a grid over the survey and a margin around it; intercept
and exponent are least squares at each candidate, in closed form for all access points together. h keeps the
model finite under an access point (ceiling height over the phone). These are fitted positions of a mean
function: they explain the survey, and are no claim about where an access point hangs.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from wayfuse.core.types import Array

__all__ = ["Grid", "GridFit", "LogDistance", "fit_log_distance", "grid_about", "grid_fit"]

_HEIGHT = 2.0  # m
_EXPONENT_PRIOR = 2.5  # indoor path-loss exponents: 1.6 (corridor) to 4 (through walls)
_PRIOR_WEIGHT = 50.0  # dB2 per squared exponent: fades out where the survey spans some tens of metres
_EXPONENT_RANGE = (0.5, 6.0)
_MARGIN = 10.0  # m around the survey in which access points are looked for
_N_CANDIDATES = 600


class LogDistance(NamedTuple):
    """Path loss of m access points: xy (m, 2) m, intercept (m,) dBm at 1 m, exponent (m,)."""

    xy: Array
    intercept: Array
    exponent: Array

    def at(self, xy: Array) -> Array:
        """(N, m) dBm at places (N, 2) m."""
        return self.intercept - self.exponent * _decades(xy, self.xy)


def _decades(xy: Array, ap_xy: Array) -> Array:
    """10 log10 of the distances (N, m) of places (N, 2) from access points (m, 2)."""
    dx, dy = (xy[:, None, k] - ap_xy[None, :, k] for k in (0, 1))
    return np.asarray(5.0 * np.log10(dx * dx + dy * dy + _HEIGHT**2))


class Grid(NamedTuple):
    """Candidate positions xy (g, 2) m, and 10 log10 of their distances (g, n) from the places of readings."""

    xy: Array
    decades: Array


class GridFit(NamedTuple):
    """Fits of m access points at each of g candidate positions.

    xy (g, 2) m. cost (g, m) dB², weighted squares and the prior of the exponent. exponent (g, m). level (m,) dBm and
    decades (g, m): mean reading and mean of 10 log10 distance, through which each fit goes.
    """

    xy: Array
    cost: Array
    exponent: Array
    level: Array
    decades: Array

    def best(self) -> LogDistance:
        """The candidate of least cost of each access point."""
        best, each = np.argmin(self.cost, axis=0), np.arange(self.cost.shape[1])
        chosen = self.exponent[best, each]
        return LogDistance(self.xy[best], self.level + chosen * self.decades[best, each], chosen)


def fit_log_distance(xy: Array, rssi: Array, weight: Array) -> LogDistance:
    """Weighted least squares over a grid of access-point positions.

    Parameters
    ----------
    xy : (n, 2) m. rssi : (n, m) dBm, finite. weight : (n, m) >= 0 with a positive sum per access point.
    """
    return grid_fit(grid_about(xy), rssi, weight).best()


def grid_about(xy: Array) -> Grid:
    """The candidates for readings made at places (n, 2) m."""
    candidates = _candidates(xy)
    return Grid(candidates, _decades(xy, candidates).T)


def grid_fit(grid: Grid, rssi: Array, weight: Array) -> GridFit:
    """The fits behind `fit_log_distance`, at every candidate; rssi and weight as there."""
    candidates, x = grid
    total = weight.sum(axis=0)
    y_mean = (weight * rssi).sum(axis=0) / total
    centred = weight * (rssi - y_mean)
    x_mean = x @ weight / total
    sxx = np.maximum((x * x) @ weight - x_mean**2 * total, 0.0)
    sxy = x @ centred
    syy = (centred * (rssi - y_mean)).sum(axis=0)
    slope = (_PRIOR_WEIGHT * _EXPONENT_PRIOR - sxy) / (sxx + _PRIOR_WEIGHT)
    exponent = np.clip(slope, *_EXPONENT_RANGE)
    cost = syy + 2.0 * exponent * sxy + exponent**2 * sxx + _PRIOR_WEIGHT * (exponent - _EXPONENT_PRIOR) ** 2
    return GridFit(candidates, cost, exponent, y_mean, x_mean)


def _candidates(xy: Array) -> Array:
    """About `_N_CANDIDATES` positions on a square grid over the survey and a margin."""
    low, high = xy.min(axis=0) - _MARGIN, xy.max(axis=0) + _MARGIN
    step = max(1.0, float(np.sqrt(np.prod(high - low) / _N_CANDIDATES)))
    gx, gy = np.meshgrid(np.arange(low[0], high[0] + step, step), np.arange(low[1], high[1] + step, step))
    return np.column_stack([gx.ravel(), gy.ravel()])
