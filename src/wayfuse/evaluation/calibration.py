r"""Whether the radii an estimate states hold the truth as often as they say, and how small they are.

A radius r68 is to hold the truth in 68 % of cases. *Coverage* is the share of points with error <= radius;
*sharpness* the mean radius, for a radius can always be made to cover by being useless. Between and beyond the
two radii a level is read off by taking the radius to grow in proportion to that of a circular Gaussian,

.. math:: \rho(p) = \sqrt{-2 \ln(1 - p)},

linear between (0, 0), (rho(0.68), r68), (rho(0.95), r95): for a circular Gaussian that is exact. The nominal
level at which a point's error lies is uniform on [0, 1] for calibrated radii (probability integral transform,
[1]_). NEES is the squared error in units of the stated covariance; its mean is 2 for a consistent estimator
in the plane [2]_.

References
----------
.. [1] Gneiting, Balabdaoui, Raftery, Probabilistic forecasts, calibration and sharpness, JRSS B 69, 2007.
.. [2] Bar-Shalom, Li, Kirubarajan, Estimation with Applications to Tracking and Navigation, 2001, sec. 5.4.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from wayfuse.core.types import Array, BoolArray
from wayfuse.evaluation.errors import PointErrors
from wayfuse.evaluation.intervals import Bootstrap, Interval

__all__ = [
    "TIME_BINS",
    "Calibration",
    "Coverage",
    "calibrate",
    "coverage",
    "nees",
    "nominal_level",
    "time_bins",
]

TIME_BINS = (0.0, 5.0, 10.0, 20.0, 40.0, float("inf"))  # s since the first scan
_RHO68, _RHO95 = (float(np.sqrt(-2.0 * np.log(1.0 - p))) for p in (0.68, 0.95))


@dataclass(frozen=True, slots=True)
class Coverage:
    """Share of n points within r68 and r95, and the mean radii (m)."""

    n: int
    within68: Interval
    within95: Interval
    mean_r68: float
    mean_r95: float


@dataclass(frozen=True, slots=True)
class Calibration:
    """Coverage over all points with radii, by state and by time since the first scan; mean NEES (2 is
    consistent).

    n_without : points without radii. nees is NaN where no point has a covariance.
    """

    overall: Coverage
    by_state: dict[str, Coverage]
    by_time: dict[str, Coverage]
    n_without: int
    mean_nees: float


def coverage(points: PointErrors, bootstrap: Bootstrap | None = None) -> Coverage:
    """Coverage and sharpness of points, all with radii."""
    draw = Bootstrap() if bootstrap is None else bootstrap
    nan = float("nan")
    return Coverage(
        n=len(points),
        within68=draw.share(points.error <= points.r68, points.walk),
        within95=draw.share(points.error <= points.r95, points.walk),
        mean_r68=float(np.mean(points.r68)) if len(points) else nan,
        mean_r95=float(np.mean(points.r95)) if len(points) else nan,
    )


def calibrate(points: PointErrors, bootstrap: Bootstrap | None = None) -> Calibration | None:
    """Coverage of a method's radii; None where it states none."""
    stated = np.isfinite(points.r68) & np.isfinite(points.r95)
    if not stated.any():
        return None
    given = points.select(stated)
    squared = nees(given)
    known = np.isfinite(squared)
    states = sorted(set(given.state.tolist()) - {""})
    return Calibration(
        overall=coverage(given, bootstrap),
        by_state={s: coverage(given.select(given.state == s), bootstrap) for s in states},
        by_time={
            label: coverage(given.select(rows), bootstrap) for label, rows in time_bins(given) if rows.any()
        },
        n_without=int(np.sum(~stated)),
        mean_nees=float(np.mean(squared[known])) if known.any() else float("nan"),
    )


def time_bins(points: PointErrors) -> list[tuple[str, BoolArray]]:
    """Label and rows of each span of time since the first scan (s); points before it are in the first."""
    since = np.maximum(points.since_start, 0.0)
    return [(_span(a, b), (since >= a) & (since < b)) for a, b in pairwise(TIME_BINS)]


def _span(low: float, high: float) -> str:
    return f"{low:g}-{high:g} s" if np.isfinite(high) else f">= {low:g} s"


def nominal_level(error: Array, r68: Array, r95: Array) -> Array:
    """Level p in [0, 1] at which the radius of a point would just reach its error (n,); needs 0 < r68 <=
    r95."""
    with np.errstate(divide="ignore", invalid="ignore"):
        inner = _RHO68 * error / r68
        outer = _RHO68 + (_RHO95 - _RHO68) * (error - r68) / (r95 - r68)
    rho = np.where(error <= r68, inner, outer)
    rho = np.where((error > r68) & (r95 <= r68), np.inf, rho)
    rho = np.where(error <= 0.0, 0.0, rho)
    return np.asarray(-np.expm1(-0.5 * rho**2))


def nees(points: PointErrors) -> Array:
    """Normalised estimation error squared (n,), NaN where the covariance is not given or not positive
    definite."""
    xx, yy, xy = points.cov.T
    determinant = xx * yy - xy**2
    good = np.isfinite(determinant) & (determinant > 0) & (xx > 0)
    dx, dy = points.offset.T
    with np.errstate(divide="ignore", invalid="ignore"):
        squared = (yy * dx**2 - 2.0 * xy * dx * dy + xx * dy**2) / determinant
    return np.where(good, squared, np.nan)
