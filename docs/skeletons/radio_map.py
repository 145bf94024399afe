"""Skeleton of a radio map: a Gaussian in signal space around the mean fingerprint of each surveyed place.

Copy this file to ``src/wayfuse/radio/<method>.py``, rename the class and the kind, and replace the method. Then add

* a branch for the kind to ``wayfuse.radio.map_file._rebuilt``, so that saved maps load again,
* a row to ``FITS`` in ``tests/radio/radio_map_contract.py``: the contract tests then run on the new map,
* a section to ``docs/methods.md`` and a line to ``CHANGELOG.md``.

The module docstring says the idea, when to use it, its limits, and the source: author, title, venue, year.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wayfuse.core.types import Array, IdArray
from wayfuse.radio.nnss import position_means
from wayfuse.radio.radio_map import (
    check_queries,
    locate_one,
    mixture_log_likelihood,
    parts_error,
    query_vector,
    require,
    require_readings,
    weighted_places,
)
from wayfuse.radio.survey import Fingerprint, Fix, Survey

__all__ = ["PlaceMeansMap", "fit"]


@dataclass(frozen=True, slots=True, eq=False)
class PlaceMeansMap:
    """Fitted map.

    bssid (m,); floors; xy (p, 2) m, floor (p,): the places; mean (p, m) dBm, ``missing`` where unheard;
    sigma (dB), missing (dBm), bandwidth (m) as in `fit`.
    """

    bssid: IdArray
    floors: tuple[str, ...]
    xy: Array
    floor: NDArray[np.int32]
    mean: Array
    sigma: float
    missing: float
    bandwidth: float

    def weights(self, rssi: NDArray[np.floating]) -> Array:
        """(q, p) weights of the places, each row with sum 1, for queries (q, m) dBm, NaN where unheard."""
        queries = check_queries(rssi, len(self.bssid))  # refuses queries of another width
        z = np.where(np.isfinite(queries), queries, self.missing).astype(np.float64)
        squared = ((z[:, None] - self.mean[None]) ** 2).sum(axis=-1)
        log_weight = -0.5 * squared / self.sigma**2
        weight = np.exp(log_weight - log_weight.max(axis=1, keepdims=True))  # never underflows to all zeros
        return np.asarray(weight / weight.sum(axis=1, keepdims=True))

    def locate_all(self, rssi: NDArray[np.floating]) -> tuple[Array, NDArray[np.int32]]:
        """xy (q, 2) m and floor (q,) of queries (q, m) dBm, NaN where unheard."""
        weight = self.weights(rssi)
        places = np.broadcast_to(self.xy, (*weight.shape, 2))
        return weighted_places(weight, places, np.broadcast_to(self.floor, weight.shape), len(self.floors))

    def locate(self, fingerprint: Fingerprint) -> Fix:
        """Place of a fingerprint; `RadioMapError` where it holds no known access point."""
        return locate_one(self, fingerprint)

    def log_likelihood(
        self, fingerprint: Fingerprint, xy: NDArray[np.floating], floor: NDArray[np.integer]
    ) -> Array:
        """(N,) log of a mixture of Gaussians (``bandwidth``) on the places; 0 where nothing is known."""
        vector = query_vector(self.bssid, fingerprint)
        if not np.isfinite(vector).any():
            return np.zeros(len(xy))
        weight = self.weights(vector[None])[0]
        return mixture_log_likelihood(weight, self.xy, self.floor, xy, floor, self.bandwidth)

    def parts(self) -> tuple[str, Mapping[str, Any], Mapping[str, NDArray[Any]]]:
        """Kind, parameters and arrays for `wayfuse.radio.map_file.save`."""
        values = {name: getattr(self, name) for name in ("sigma", "missing", "bandwidth")}
        arrays = {name: getattr(self, name) for name in ("bssid", "xy", "floor", "mean")}
        return "place_means", {"floors": list(self.floors), **values}, arrays

    @classmethod
    def from_parts(cls, header: Mapping[str, Any], arrays: Mapping[str, NDArray[Any]]) -> PlaceMeansMap:
        """The map of what `parts` gave; `ValueError` where the arrays do not fit together."""
        m, p = len(arrays["bssid"]), len(arrays["floor"])
        if fault := parts_error(arrays, {"bssid": (m,), "xy": (p, 2), "floor": (p,), "mean": (p, m)}, "ufif"):
            raise ValueError(fault)
        values = {name: header[name] for name in ("sigma", "missing", "bandwidth")}
        fields: dict[str, Any] = {**values, **arrays}
        return cls(floors=tuple(header["floors"]), **fields)


def fit(
    survey: Survey, *, sigma: float = 4.0, missing: float = -95.0, bandwidth: float = 2.0
) -> PlaceMeansMap:
    """Fit the map.

    Parameters
    ----------
    survey : rows of equal place and floor are averaged.
    sigma : dB, spread of a reading. missing : dBm that stands for "not heard". bandwidth : m, of the likelihood.

    Raises
    ------
    ConfigError : a parameter is out of range. RadioMapError : the survey has no readings.
    """
    require(sigma > 0, f"sigma {sigma}", "above 0 dB")
    require(missing < 0, f"missing {missing}", "dBm below 0")
    require(bandwidth > 0, f"bandwidth {bandwidth}", "above 0 m")
    require_readings(survey)
    means = position_means(survey)
    return PlaceMeansMap(
        bssid=survey.bssid,
        floors=survey.floors,
        xy=means.xy,
        floor=means.floor,
        mean=means.dense(missing).astype(np.float64),
        sigma=float(sigma),
        missing=float(missing),
        bandwidth=float(bandwidth),
    )
