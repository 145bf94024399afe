"""Horus: a Gaussian per surveyed place and access point, and the centre of the most likely places.

Each place keeps, of every access point, the mean and spread of its readings and how often it was heard. The
spread is shrunk to a prior (one sample per place is common), the rate of hearing to one half. A query reading
at a place that never heard the access point is taken for a weak one, from a broad Gaussian near the noise
floor.

References
----------
.. [1] M. Youssef, A. Agrawala, The Horus WLAN location determination system, MobiSys 2005,
   10.1145/1067170.1067193 (parametric Gaussian distributions, centre of mass of the top places).

Notes
-----
Departs from [1]_: hearing is part of the likelihood; the likelihood is tempered by ``exponent``, for readings
of neighbouring access points err together.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wayfuse.core.types import Array, IdArray
from wayfuse.radio.radio_map import (
    check_queries,
    group_positions,
    locate_one,
    mixture_log_likelihood,
    parts_error,
    query_vector,
    require,
    require_readings,
    weighted_places,
)
from wayfuse.radio.survey import Fingerprint, Fix, Survey

__all__ = ["HorusMap", "fit"]

_PRIOR_HEARD = 0.5  # pseudo-count of hearing and of not hearing: one heard sample gives 3/4
_UNSEEN_DBM = -95.0  # centre and spread of a reading where the survey heard nothing; by CV on a training file
_UNSEEN_SIGMA = 8.0


@dataclass(frozen=True, slots=True, eq=False)
class HorusMap:
    """Fitted Horus map.

    bssid (m,); floors; xy (p, 2) m, floor (p,): the places; mean, sigma (p, m) dBm and dB, ``heard`` (p, m)
    the probability of hearing; n_candidates, exponent, bandwidth as in `fit`.
    """

    bssid: IdArray
    floors: tuple[str, ...]
    xy: Array
    floor: NDArray[np.int32]
    mean: Array
    sigma: Array
    heard: Array
    n_candidates: int
    exponent: float
    bandwidth: float

    def log_probability(self, rssi: NDArray[np.floating]) -> Array:
        """(q, p) natural log of the likelihood of queries (q, m) dBm at the places, untempered.

        A quadratic in the reading, summed by matrix products:
        sum_a log p_a - log sigma_a - (z_a - mean_a)^2 / (2 sigma_a^2) over heard, log(1 - p_a) over unheard.
        """
        queries = check_queries(rssi, len(self.bssid)).astype(np.float64)
        is_heard = np.isfinite(queries)
        z, on = np.where(is_heard, queries, 0.0), is_heard.astype(np.float64)
        precision = 1.0 / self.sigma**2
        constant = np.log(self.heard) - np.log(self.sigma) - 0.5 * self.mean**2 * precision
        silent = np.log1p(-self.heard)
        quadratic = -0.5 * (z * z) @ precision.T + z @ (self.mean * precision).T
        return np.asarray(quadratic + on @ (constant - silent).T + silent.sum(axis=1)[None])

    def candidates(self, rssi: NDArray[np.floating]) -> tuple[Array, NDArray[np.int64]]:
        """Probabilities (q, k), which sum to 1, and places (q, k) of the most likely places, best first."""
        log_p = self.exponent * self.log_probability(rssi)
        best = np.argsort(-log_p, axis=1, kind="stable")[:, : self.n_candidates]
        top = np.take_along_axis(log_p, best, axis=1)
        weight = np.exp(top - top[:, :1])
        return weight / weight.sum(axis=1, keepdims=True), best

    def locate_all(self, rssi: NDArray[np.floating]) -> tuple[Array, NDArray[np.int32]]:
        """xy (q, 2) m and floor (q,) of queries (q, m) dBm, NaN where unheard."""
        weight, best = self.candidates(rssi)
        return weighted_places(weight, self.xy[best], self.floor[best], len(self.floors))

    def locate(self, fingerprint: Fingerprint) -> Fix:
        """Place of a fingerprint; `RadioMapError` where it holds no known access point."""
        return locate_one(self, fingerprint)

    def log_likelihood(
        self, fingerprint: Fingerprint, xy: NDArray[np.floating], floor: NDArray[np.integer]
    ) -> Array:
        """(N,) log of a mixture of Gaussians on the likely places; 0 where nothing is known."""
        vector = query_vector(self.bssid, fingerprint)
        if not np.isfinite(vector).any():
            return np.zeros(len(xy))
        weight, best = self.candidates(vector[None])
        places, floors = self.xy[best[0]], self.floor[best[0]]
        return mixture_log_likelihood(weight[0], places, floors, xy, floor, self.bandwidth)

    def parts(self) -> tuple[str, Mapping[str, Any], Mapping[str, NDArray[Any]]]:
        """Kind, parameters and arrays for `wayfuse.radio.map_file.save`."""
        names = ("bssid", "xy", "floor", "mean", "sigma", "heard")
        values = {"n_candidates": self.n_candidates, "exponent": self.exponent, "bandwidth": self.bandwidth}
        return "horus", {"floors": list(self.floors), **values}, {name: getattr(self, name) for name in names}

    @classmethod
    def from_parts(cls, header: Mapping[str, Any], arrays: Mapping[str, NDArray[Any]]) -> HorusMap:
        """The map of what `parts` gave; `ValueError` where they do not fit."""
        m, p = len(arrays["bssid"]), len(arrays["floor"])
        shapes = {
            "bssid": (m,),
            "xy": (p, 2),
            "floor": (p,),
            "mean": (p, m),
            "sigma": (p, m),
            "heard": (p, m),
        }
        if fault := parts_error(arrays, shapes, "ufifff"):
            raise ValueError(fault)
        names = ("n_candidates", "exponent", "bandwidth")
        fields: dict[str, Any] = {**{name: header[name] for name in names}, **arrays}
        return cls(floors=tuple(header["floors"]), **fields)


def fit(
    survey: Survey,
    *,
    sigma: float = 4.0,
    prior_count: float = 4.0,
    n_candidates: int = 10,
    exponent: float = 0.3,
    bandwidth: float = 3.0,
) -> HorusMap:
    """Fit a Horus map.

    Parameters
    ----------
    survey : rows of equal place and floor are the samples of that place.
    sigma : dB, spread of readings a priori. prior_count : samples that this prior is worth.
    n_candidates : most likely places that are averaged.
    exponent : of the likelihood, in (0, 1]; 1 trusts access points as independent.
    bandwidth : m, of the likelihood around each place.

    Raises
    ------
    ConfigError : a parameter is out of range. RadioMapError : the survey has no readings.

    Notes
    -----
    The defaults of sigma, n_candidates and exponent come from a grid search on one training file, the sum of
    the errors of leave-one-position-out and of leaving out all places within 1.5 m.
    """
    require(sigma > 0 and prior_count > 0, f"sigma {sigma}, prior_count {prior_count}", "both above 0")
    require(n_candidates >= 1, f"n_candidates {n_candidates}", "at least 1")
    require(0 < exponent <= 1, f"exponent {exponent}", "in (0, 1]")
    require(bandwidth > 0, f"bandwidth {bandwidth}", "above 0 m")
    require_readings(survey)
    positions = group_positions(survey)
    shape = (len(positions.xy), len(survey.bssid))
    rows = np.repeat(positions.row_position, np.diff(survey.indptr))
    at = (rows, survey.indices)
    total, count, squared = np.zeros(shape), np.zeros(shape), np.zeros(shape)
    reading = survey.rssi.astype(np.float64)
    np.add.at(total, at, reading)
    np.add.at(count, at, 1.0)
    mean = np.divide(total, count, out=np.full(shape, _UNSEEN_DBM), where=count > 0)
    np.add.at(squared, at, (reading - mean[at]) ** 2)
    spread = np.sqrt((prior_count * sigma**2 + squared) / (prior_count + count))
    visits = np.bincount(positions.row_position, minlength=shape[0])[:, None]
    return HorusMap(
        bssid=survey.bssid,
        floors=survey.floors,
        xy=positions.xy,
        floor=positions.floor,
        mean=mean,
        sigma=np.where(count > 0, spread, _UNSEEN_SIGMA),
        heard=(count + _PRIOR_HEARD) / (visits + 2.0 * _PRIOR_HEARD),
        n_candidates=int(n_candidates),
        exponent=float(exponent),
        bandwidth=float(bandwidth),
    )
