"""How accurate a survey makes a fix, by the survey itself: each walk is found by the others.

A filter has to know how far the fingerprints nearest in signal lie from the truth. It depends on the building, on the
density of the walks and on the number of access points, so it is measured where it is used: some fingerprints of every
walk are located by those of all other walks (nearest neighbours as in `sparse_knn`), and the *lower quartile* of the
errors is kept. Not the median: bad fixes are the filter's background, the width of a kernel is that of good ones.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayfuse.core.types import Array
from wayfuse.radio.sparse_knn import SparseKnn, fix_of
from wayfuse.radio.survey import Survey

__all__ = ["HeldOut", "held_out", "held_out_errors", "survey_accuracy"]

_LEAST = 20  # held-out fixes below which nothing is said


class HeldOut(NamedTuple):
    """Fixes of a survey's own fingerprints by the walks they are not of: rows (k,) of the survey, errors (k,) m."""

    rows: NDArray[np.int64]
    errors: Array


def survey_accuracy(survey: Survey, n: int = 300) -> float:
    """Lower quartile of `held_out_errors` (m).

    NaN with fewer than two walks, too little in common, or hardly a fingerprint found on its floor.
    """
    errors = np.sort(held_out_errors(survey, n))
    if len(errors) < _LEAST or np.isinf(errors[math.ceil(0.25 * (len(errors) - 1))]):
        return math.nan
    return float(np.quantile(errors, 0.25))


def held_out_errors(survey: Survey, n: int = 300) -> Array:
    """Errors (m) of about n fingerprints, evenly spread, by the walks they are not of; wrong floors count infinite."""
    return held_out(survey, n).errors


def held_out(survey: Survey, n: int = 300) -> HeldOut:
    """The same errors, and of which fingerprints they are."""
    if len(survey.walks) < 2 or not len(survey):
        return HeldOut(np.empty(0, np.int64), np.empty(0))
    radio_map = SparseKnn(survey)
    rows: list[int] = []
    errors: list[float] = []
    for row in np.unique(np.linspace(0, len(survey) - 1, n).astype(np.int64)).tolist():
        near = radio_map.neighbours(survey.fingerprint(row), without_walk=int(survey.walk[row]))
        if (
            near is None or near.distance >= 1.0
        ):  # the nearest of the other walks has nothing in common with it
            continue
        fix = fix_of(near, len(survey.floors))
        x, y = survey.xy[row]
        rows.append(row)
        errors.append(math.hypot(fix.x - x, fix.y - y) if fix.floor == survey.floor[row] else math.inf)
    return HeldOut(np.array(rows, np.int64), np.array(errors))
