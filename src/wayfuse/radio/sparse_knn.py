r"""k nearest neighbours in signal space for walk surveys: thousands of fingerprints, thousands of access points.

The distance of a query q and a fingerprint r is Sorensen's (Bray-Curtis), each access point a weighted by how rare
it is among the fingerprints (inverse document frequency, as in text retrieval):

.. math:: d(q, r) = 1 - \frac{2 \sum_a w_a \min(v_{qa}, v_{ra})}{\sum_a w_a v_{qa} + \sum_a w_a v_{ra}},
          \quad v = \left(\frac{\max(\mathrm{rssi} - r_0, 0)}{70}\right)^{2.2}, \quad w_a = 2 + \log\frac{n}{n_a}

The two keeps access points in the account that are heard everywhere: their levels still tell places apart, and in a
small building there are no others.

Only access points heard in both add to the overlap, so an inverted index (access point -> fingerprints that heard
it) answers a query in a fraction of a millisecond. Use it for surveys from walks; for small static sets `knn` has
more choices. Euclidean distance over thousands of access points does markedly worse and is not offered.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, fields
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayfuse.core.errors import ConfigError, RadioMapError
from wayfuse.core.types import Array32
from wayfuse.radio._kernels import accumulate_overlap, nearest_by_overlap, nearest_mean_distances
from wayfuse.radio.survey import Fingerprint, Fix, Survey
from wayfuse.radio.twins import twin_shares

__all__ = ["Neighbours", "SparseKnn", "fix_of"]

_LANES = 16


class Neighbours(NamedTuple):
    """The k nearest fingerprints: x, y (k,) m, floor (k,), weight (k,) summing to 1.

    ``distance`` is that of the nearest in signal space, 0 (the same) to 1 (nothing in common); ``n_aps`` counts the
    query's access points that the survey knows. ``usual`` is the distance that the neighbours have from fingerprints of
    other walks than their own (`radio.novelty`); NaN where the survey does not say.
    """

    x: Array32
    y: Array32
    floor: NDArray[np.int32]
    weight: Array32
    distance: float
    n_aps: int
    usual: float = math.nan


@dataclass(frozen=True, slots=True, eq=False)
class SparseKnn:
    """A survey with an inverted index.

    Parameters
    ----------
    survey : fingerprints.
    k : neighbours. temperature : of the neighbours' weights exp(-(d - d_0) / temperature).
    rssi_floor : r_0 (dBm). exponent : of the powed representation. idf : weight by rarity; ``common`` is the weight of
    an access point heard everywhere.
    bands : which bands to use, in MHz intervals; empty = all. share_twins : let the networks of one radio (`twins`)
    count once together; off, for it did not help on the ms-indoor development folds.
    """

    survey: Survey
    k: int = 40
    temperature: float = 0.02
    rssi_floor: float = -100.0
    exponent: float = 2.2
    idf: bool = True
    common: float = 2.0
    bands: tuple[tuple[int, int], ...] = ()
    share_twins: bool = False
    _start: NDArray[np.int64] = field(init=False, repr=False)
    _rows: NDArray[np.int32] = field(init=False, repr=False)
    _values: Array32 = field(init=False, repr=False)
    _weight: Array32 = field(init=False, repr=False)
    _row_sum: Array32 = field(init=False, repr=False)
    _knows_usual: bool = field(init=False, repr=False)

    def __post_init__(self) -> None:
        if self.k < 1 or self.temperature <= 0.0:
            raise ConfigError(f"k-NN needs k >= 1 and temperature > 0, got {self.k}, {self.temperature}")
        s = self.survey
        n, m = len(s), len(s.bssid)
        if not n:
            raise RadioMapError("the survey has no fingerprint", remedy="give survey recordings")
        heard = np.bincount(s.indices, minlength=m)
        order = np.argsort(s.indices, kind="stable")
        rows = np.repeat(np.arange(n, dtype=np.int32), np.diff(s.indptr))
        values = self._represent(s.rssi)
        rarity = self.common + np.log(n / np.maximum(heard, 1)) if self.idf else np.ones(m)
        weight = np.where(self._in_bands(s.frequency), np.maximum(rarity, 1e-3), 0.0).astype(np.float32)
        if self.share_twins:
            weight = weight * twin_shares(s)
        row_sum = np.bincount(rows, weight[s.indices] * values, minlength=n).astype(np.float32)
        for name, value in {
            "_start": np.concatenate([[0], np.cumsum(heard)]).astype(np.int64),
            "_rows": rows[order],
            "_values": values[order],
            "_weight": weight,
            "_row_sum": row_sum,
            "_knows_usual": len(s.usual) > 0 and self._is_plain,
        }.items():
            object.__setattr__(self, name, value)

    @property
    def _is_plain(self) -> bool:
        """Whether distances are those that `Survey.usual` was measured in."""
        names = "rssi_floor", "exponent", "idf", "common", "bands", "share_twins"
        mine = {f.name: f.default for f in fields(self) if f.name in names}
        return all(getattr(self, name) == default for name, default in mine.items())

    @property
    def floors(self) -> tuple[str, ...]:
        """Names of the floors."""
        return self.survey.floors

    def distances(self, fingerprint: Fingerprint) -> tuple[Array32, int]:
        """(n,) distance to every fingerprint, and how many access points of the query are known."""
        overlap, query_sum, n_aps = self._overlap(fingerprint)
        total = self._row_sum + query_sum + np.float32(1e-6)
        distance: Array32 = np.float32(1.0) - np.float32(2.0) * overlap / total
        return distance, n_aps

    def _overlap(self, fingerprint: Fingerprint) -> tuple[Array32, np.float32, int]:
        """(n,) overlap with every fingerprint, the sum of the query, and how many of its access points are known."""
        column = self.survey.columns(fingerprint.bssid)
        known = column >= 0
        column = column[known]
        value, weight = self._represent(fingerprint.rssi[known]), self._weight[column]
        overlap = np.zeros(len(self.survey), np.float32)
        accumulate_overlap(column, value, weight, self._start, self._rows, self._values, overlap)
        weighted = weight * value
        return overlap, np.float32(np.sum(weighted)), int(np.count_nonzero(weighted > 0.0))

    def neighbours(self, fingerprint: Fingerprint, without_walk: int | None = None) -> Neighbours | None:
        """The k nearest, those of one walk left out; None where the survey knows no access point of the query."""
        overlap, query_sum, n_aps = self._overlap(fingerprint)
        if without_walk is not None:
            overlap[self.survey.walk == without_walk] = 0.0
        if n_aps == 0:
            return None
        index, best = np.empty(self.k, np.int32), np.empty(self.k, np.float32)
        n = nearest_by_overlap(overlap, self._row_sum, query_sum, self.k, index, best)
        index, best = index[:n], best[:n]
        weight = np.exp(-(best - best[0]) / np.float32(self.temperature))
        s = self.survey
        return Neighbours(
            s.xy[index, 0].astype(np.float32),
            s.xy[index, 1].astype(np.float32),
            s.floor[index],
            (weight / weight.sum()).astype(np.float32),
            float(best[0]),
            n_aps,
            self._usual_of(index, weight),
        )

    def _usual_of(self, index: NDArray[np.int32], weight: Array32) -> float:
        if not self._knows_usual:
            return math.nan
        usual = self.survey.usual[index]
        known = ~np.isnan(usual)
        total = float(weight @ known)
        return float(weight[known] @ usual[known]) / total if total > 0.0 else math.nan

    def mean_distances(self, column: NDArray[np.int64], rssi: Array32, k: int) -> Array32:
        """Mean distance of the k nearest for versions of a query, (S,): rssi (A, S) dBm of the survey's columns (A,).

        Fewer than k fingerprints count as if the missing had distance 1.
        """
        versions = rssi.shape[1]
        # whole vectors of the processor: the innermost loop goes over versions
        value = np.zeros((len(column), -(-versions // _LANES) * _LANES), np.float32)
        value[:, :versions] = self._represent(rssi)
        out = np.empty(value.shape[1], np.float32)
        best = np.empty((value.shape[1], k), np.float32)
        nearest_mean_distances(
            column,
            value,
            self._weight[column],
            self._start,
            self._rows,
            self._values,
            self._row_sum,
            best,
            out,
        )
        return out[:versions]

    def locate(self, fingerprint: Fingerprint) -> Fix | None:
        """Weighted mean of the neighbours on the heaviest floor; None where no access point is known."""
        near = self.neighbours(fingerprint)
        return None if near is None else fix_of(near, len(self.floors))

    def _represent(self, rssi: Array32) -> Array32:
        value: Array32 = (np.clip((rssi - self.rssi_floor) / 70.0, 0.0, None) ** self.exponent).astype(
            np.float32
        )
        return value

    def _in_bands(self, frequency: NDArray[np.int32]) -> NDArray[np.bool_]:
        if not self.bands:
            return np.ones(len(frequency), dtype=bool)
        inside = np.zeros(len(frequency), dtype=bool)
        for low, high in self.bands:
            inside |= (frequency >= low) & (frequency < high)
        return inside


def fix_of(near: Neighbours, n_floors: int) -> Fix:
    """Weighted mean position of neighbours on their heaviest floor."""
    floor = int(np.argmax(np.bincount(near.floor, near.weight, minlength=n_floors)))
    on = near.floor == floor
    weight = near.weight[on] / near.weight[on].sum()
    return Fix(float(weight @ near.x[on]), float(weight @ near.y[on]), floor, near.n_aps)
