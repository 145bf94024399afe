"""Weighted k nearest neighbours in signal space.

The k survey fingerprints nearest to a query, weighted by 1 / (distance + epsilon), and their mean place.
The default (Sorensen distance on the powed representation) was chosen by leave-one-position-out on a
training file only. With ``Representation("raw", missing=-104)``, ``metric="euclidean"`` and k = 5 it is the
plain form that other libraries publish figures of. Dense arrays: for surveys of one site up to some ten
thousand rows; `wayfuse.radio.sparse_knn` is for large walk surveys.

References
----------
.. [1] P. Bahl, V. Padmanabhan, RADAR, INFOCOM 2000, 10.1109/INFCOM.2000.832252.
.. [2] J. Torres-Sospedra et al. 2015, 10.1016/j.eswa.2015.08.013 (distances and representations).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from wayfuse.core.types import Array, IdArray
from wayfuse.radio.radio_map import (
    check_queries,
    locate_one,
    mixture_log_likelihood,
    query_vector,
    require,
    require_readings,
    weighted_places,
)
from wayfuse.radio.representation import Representation
from wayfuse.radio.survey import Fingerprint, Fix, Survey

__all__ = ["METRICS", "KnnMap", "Metric", "distances", "fit"]

Metric = Literal["sorensen", "cosine", "euclidean"]
METRICS: tuple[Metric, ...] = ("sorensen", "cosine", "euclidean")
_EPSILON = 1e-9  # added to a distance, so that an equal fingerprint has a finite weight
_CHUNK = 256  # queries at a time: bounds the memory of the distance matrix


def distances(queries: Array, references: Array, metric: Metric) -> Array:
    """Distances (q, n) of represented queries (q, m) to represented references (n, m).

    Sorensen (Bray-Curtis) is sum |a - b| / sum (a + b), 1 where both are empty; cosine is 1 - cos, 1 where
    one is empty; both need representations >= 0.
    """
    from scipy.spatial.distance import cdist

    if metric == "euclidean":
        return np.asarray(cdist(queries, references, "euclidean"))
    if metric == "sorensen":
        total = queries.sum(axis=1)[:, None] + references.sum(axis=1)[None]
        apart = np.asarray(cdist(queries, references, "cityblock"))
        return np.asarray(np.divide(apart, total, out=np.ones_like(apart), where=total > 0.0))
    norm = np.linalg.norm(queries, axis=1)[:, None] * np.linalg.norm(references, axis=1)[None]
    product = queries @ references.T
    cosine = np.divide(product, norm, out=np.zeros_like(product), where=norm > 0.0)
    return np.asarray(np.maximum(1.0 - cosine, 0.0))


@dataclass(frozen=True, slots=True, eq=False)
class KnnMap:
    """Fitted weighted k-NN map: the survey, its represented rows (n, m), and the parameters of `fit`."""

    survey: Survey
    features: Array
    representation: Representation
    metric: Metric
    k: int
    bandwidth: float

    @property
    def bssid(self) -> IdArray:
        """(m,) access points, ascending."""
        return self.survey.bssid

    @property
    def floors(self) -> tuple[str, ...]:
        """Names of the floors."""
        return self.survey.floors

    def neighbours(self, rssi: NDArray[np.floating]) -> tuple[Array, NDArray[np.int64]]:
        """Weights (q, k), which sum to 1, and rows (q, k) of the nearest neighbours, nearest first."""
        queries = self.representation(check_queries(rssi, len(self.bssid)))
        k = min(self.k, len(self.features))
        rows = np.empty((len(queries), k), np.int64)
        weight = np.empty((len(queries), k))
        for start in range(0, len(queries), _CHUNK):
            part = slice(start, start + _CHUNK)
            distance = distances(queries[part], self.features, self.metric)
            rows[part] = np.argsort(distance, axis=1, kind="stable")[:, :k]
            weight[part] = 1.0 / (np.take_along_axis(distance, rows[part], axis=1) + _EPSILON)
        return weight / weight.sum(axis=1, keepdims=True), rows

    def locate_all(self, rssi: NDArray[np.floating]) -> tuple[Array, NDArray[np.int32]]:
        """xy (q, 2) m and floor (q,) of queries (q, m) dBm, NaN where unheard."""
        weight, rows = self.neighbours(rssi)
        return weighted_places(weight, self.survey.xy[rows], self.survey.floor[rows], len(self.floors))

    def locate(self, fingerprint: Fingerprint) -> Fix:
        """Place of a fingerprint; `RadioMapError` where it holds no known access point."""
        return locate_one(self, fingerprint)

    def log_likelihood(
        self, fingerprint: Fingerprint, xy: NDArray[np.floating], floor: NDArray[np.integer]
    ) -> Array:
        """(N,) log of a mixture of Gaussians (``bandwidth``) on the neighbours; 0 where nothing is known."""
        vector = query_vector(self.bssid, fingerprint)
        if not np.isfinite(vector).any():
            return np.zeros(len(xy))
        weight, rows = self.neighbours(vector[None])
        places, floors = self.survey.xy[rows[0]], self.survey.floor[rows[0]]
        return mixture_log_likelihood(weight[0], places, floors, xy, floor, self.bandwidth)

    def parts(self) -> tuple[str, Mapping[str, Any], Mapping[str, NDArray[Any]]]:
        """Kind, parameters and arrays for `wayfuse.radio.map_file.save`."""
        from wayfuse.radio.survey_file import survey_parts

        header, arrays = survey_parts(self.survey)
        r = self.representation
        shown = {"representation": r.kind, "missing": r.missing, "parameter": r.parameter}
        values = {"metric": self.metric, "k": self.k, "bandwidth": self.bandwidth}
        return "knn", {**header, **shown, **values}, arrays

    @classmethod
    def from_parts(cls, survey: Survey, header: Mapping[str, Any]) -> KnnMap:
        """The map of what `parts` gave: fitting is cheap and exact, so it is fitted again."""
        shown = Representation(header["representation"], header["missing"], header["parameter"])
        bandwidth, k = header["bandwidth"], header["k"]
        return fit(survey, k=k, metric=header["metric"], representation=shown, bandwidth=bandwidth)


def fit(
    survey: Survey,
    *,
    k: int = 5,
    metric: Metric = "sorensen",
    representation: Representation | None = None,
    bandwidth: float = 3.0,
) -> KnnMap:
    """Fit a weighted k-NN map.

    Parameters
    ----------
    survey : places and readings; every row is a neighbour of its own.
    k : number of neighbours.
    metric : ``sorensen``, ``cosine`` or ``euclidean``.
    representation : of readings; None takes powed with exponent 1.5 and missing -100 dBm, the best of a
        leave-one-position-out search over representations on a training file.
    bandwidth : m, of the likelihood around each neighbour.

    Raises
    ------
    ConfigError : a parameter is out of range. RadioMapError : the survey has no readings.
    """
    shown = Representation("powed", -100.0, 1.5) if representation is None else representation
    require(k >= 1, f"k {k}", "at least 1")
    require(metric in METRICS, f"metric {metric!r}", f"one of {', '.join(METRICS)}")
    require(bandwidth > 0, f"bandwidth {bandwidth}", "above 0 m")
    require(metric == "euclidean" or shown.kind != "raw", f"metric {metric} on raw dBm", "take another one")
    require_readings(survey)
    return KnnMap(survey, shown(survey.dense()), shown, metric, int(k), float(bandwidth))
