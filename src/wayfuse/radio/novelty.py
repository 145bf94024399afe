r"""Scans made where nobody surveyed: told from others by being more unlike the survey than it is unlike itself.

How far a scan is from its nearest fingerprint depends on the place: where many weak access points are heard, two scans
of the same spot differ more. So the distance d of a scan is compared with the distances u_j that its neighbours
themselves have from the nearest fingerprint of other walks (`Survey.usual`); the excess is averaged over some scans:

.. math:: \nu \leftarrow \nu + \frac{1}{m} \Big(d - \sum_j w_j u_j - \nu\Big)

Away from the survey the places that look most like a scan all lie on surveyed ways, beside the true one, and scan after
scan errs the same way. There a scan counts less (`Novelty.trust`), and the steps more.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from wayfuse.core.errors import ConfigError
from wayfuse.core.types import Array32
from wayfuse.radio.sparse_knn import Neighbours, SparseKnn
from wayfuse.radio.survey import Survey

__all__ = ["Novelty", "usual_distances"]

_MOST = 4000  # fingerprints looked at: a large survey has neighbours enough that were


def usual_distances(survey: Survey, most: int = _MOST) -> Array32:
    """(n,) signal distance of each fingerprint from the nearest of other walks.

    NaN where there is none, and for most fingerprints of a survey of many more than ``most``; empty with one walk.
    """
    if len(survey.walks) < 2 or not len(survey):
        return np.empty(0, np.float32)
    radio_map = SparseKnn(survey, k=1)
    usual = np.full(len(survey), np.nan, np.float32)
    for row in np.unique(np.linspace(0, len(survey) - 1, most).astype(np.int64)).tolist():
        near = radio_map.neighbours(survey.fingerprint(row), without_walk=int(survey.walk[row]))
        if near is not None and near.distance < 1.0:
            usual[row] = near.distance
    return usual


@dataclass(frozen=True, slots=True, kw_only=True)
class Novelty:
    """Parameters, in signal distance (0 to 1).

    memory : m, scans. first : share that the first scan's excess counts. known : novelty of scans where the survey was
    made; other phones and hours add some. width : novelty beyond it at which a scan would count nothing. least : trust
    is never below.
    """

    memory: float = 4.0
    first: float = 0.5
    known: float = 0.03
    width: float = 0.1
    least: float = 0.2

    def __post_init__(self) -> None:
        shares = self.first, self.least
        if not (self.memory >= 1.0 and self.width > 0.0 and min(shares) >= 0.0 and max(shares) <= 1.0):
            raise ConfigError(
                "memory at least 1, width positive, first and least are shares", where="Novelty"
            )

    def step(self, novelty: float, near: Neighbours) -> float:
        """Novelty after a scan; NaN before the first, and for good where the survey knows no usual distances."""
        excess = near.distance - near.usual
        if math.isnan(excess):
            return novelty
        if math.isnan(novelty):
            novelty = self.first * max(excess, 0.0)
        return novelty + (excess - novelty) / self.memory

    def trust(self, novelty: float) -> float:
        """What a scan counts, ``least`` to 1; 1 where nothing is known."""
        if math.isnan(novelty):
            return 1.0
        return min(max(1.0 - (novelty - self.known) / self.width, self.least), 1.0)
