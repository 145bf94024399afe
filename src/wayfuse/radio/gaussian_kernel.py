r"""Gaussian kernel map: interpolated fingerprints and a Gaussian kernel per access point.

.. math:: \log p(z \mid x) = -\sum_a (z_a - \bar r_a(x))^2 / (2 \sigma^2)   (Eq. 3.6-3.7 of [1]_)

with the characteristic fingerprint r(x) interpolated, by inverse squared distance, from the nearest surveyed
places of the floor. An access point heard by only one side counts as ``missing`` dBm on the
other.

References
----------
.. [1] chu2009, Sec. 3.4.

Notes
-----
Departs from [1]_: works in the log domain (the product underflows with many access points), and the exponent
may be below 1, for readings of neighbouring access points err together.
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
    parts_error,
    query_vector,
    require,
    require_readings,
    weighted_places,
)
from wayfuse.radio.survey import Fingerprint, Fix, Survey

__all__ = ["GaussianKernelMap", "fit"]

_NEAREST = 0.1  # m: a place nearer than this counts as this far, so that weights stay finite


@dataclass(frozen=True, slots=True, eq=False)
class GaussianKernelMap:
    """Fitted Gaussian kernel map.

    bssid (m,); floors; xy (p, 2) m, floor (p,): the places; mean (p, m) dBm, ``missing`` where unheard;
    sigma (dB), missing (dBm), n_neighbours, exponent as in `fit`.
    """

    bssid: IdArray
    floors: tuple[str, ...]
    xy: Array
    floor: NDArray[np.int32]
    mean: Array
    sigma: float
    missing: float
    n_neighbours: int
    exponent: float

    def characteristic(self, xy: NDArray[np.floating], floor: NDArray[np.integer]) -> Array:
        """(N, m) dBm: the fingerprint interpolated at xy (N, 2) m; missing on unsurveyed floors."""
        out = np.full((len(xy), len(self.bssid)), self.missing)
        for level in np.unique(floor):
            places = np.flatnonzero(self.floor == level)
            if not len(places):
                continue
            here = np.flatnonzero(np.asarray(floor) == level)
            apart = np.asarray(xy, np.float64)[here][:, None] - self.xy[places][None]
            squared = np.maximum((apart**2).sum(axis=-1), _NEAREST**2)
            k = min(self.n_neighbours, len(places))
            near = np.argpartition(squared, k - 1, axis=1)[:, :k]
            weight = 1.0 / np.take_along_axis(squared, near, axis=1)
            weight /= weight.sum(axis=1, keepdims=True)
            out[here] = np.einsum("nk,nkm->nm", weight, self.mean[places[near]])
        return out

    def locate_all(self, rssi: NDArray[np.floating]) -> tuple[Array, NDArray[np.int32]]:
        """xy (q, 2) m and floor (q,) of queries (q, m) dBm: the centre of the places by likelihood."""
        queries = check_queries(rssi, len(self.bssid)).astype(np.float64)
        z = np.where(np.isfinite(queries), queries, self.missing)
        cross = z @ self.mean.T
        squared = (z * z).sum(axis=1)[:, None] - 2.0 * cross + (self.mean**2).sum(axis=1)[None]
        log_p = -0.5 * self.exponent * squared / self.sigma**2
        weight = np.exp(log_p - log_p.max(axis=1, keepdims=True))
        places = np.broadcast_to(self.xy, (len(z), *self.xy.shape))
        return weighted_places(weight, places, np.broadcast_to(self.floor, weight.shape), len(self.floors))

    def locate(self, fingerprint: Fingerprint) -> Fix:
        """Place of a fingerprint; `RadioMapError` where it holds no known access point."""
        return locate_one(self, fingerprint)

    def log_likelihood(
        self, fingerprint: Fingerprint, xy: NDArray[np.floating], floor: NDArray[np.integer]
    ) -> Array:
        """(N,) log-likelihood (Eq. 3.6-3.7) at interpolated fingerprints; 0 where nothing is known."""
        vector = query_vector(self.bssid, fingerprint).astype(np.float64)
        if not np.isfinite(vector).any():
            return np.zeros(len(xy))
        z = np.where(np.isfinite(vector), vector, self.missing)
        squared = ((self.characteristic(xy, floor) - z) ** 2).sum(axis=1)
        return np.asarray(-0.5 * self.exponent * squared / self.sigma**2)

    def parts(self) -> tuple[str, Mapping[str, Any], Mapping[str, NDArray[Any]]]:
        """Kind, parameters and arrays for `wayfuse.radio.map_file.save`."""
        values = {name: getattr(self, name) for name in ("sigma", "missing", "n_neighbours", "exponent")}
        arrays = {name: getattr(self, name) for name in ("bssid", "xy", "floor", "mean")}
        return "gaussian_kernel", {"floors": list(self.floors), **values}, arrays

    @classmethod
    def from_parts(cls, header: Mapping[str, Any], arrays: Mapping[str, NDArray[Any]]) -> GaussianKernelMap:
        """The map of what `parts` gave; `ValueError` where they do not fit."""
        m, p = len(arrays["bssid"]), len(arrays["floor"])
        if fault := parts_error(arrays, {"bssid": (m,), "xy": (p, 2), "floor": (p,), "mean": (p, m)}, "ufif"):
            raise ValueError(fault)
        names = ("sigma", "missing", "n_neighbours", "exponent")
        fields: dict[str, Any] = {**{name: header[name] for name in names}, **arrays}
        return cls(floors=tuple(header["floors"]), **fields)


def fit(
    survey: Survey,
    *,
    sigma: float = 6.0,
    missing: float = -95.0,
    n_neighbours: int = 4,
    exponent: float = 1.0,
) -> GaussianKernelMap:
    """Fit a Gaussian kernel map.

    Parameters
    ----------
    survey : rows of equal place and floor are averaged.
    sigma : dB, width of the kernel. missing : dBm that stands for "not heard".
    n_neighbours : surveyed places that a fingerprint is interpolated from.
    exponent : of the likelihood, in (0, 1]; 1 is the paper's.

    Raises
    ------
    ConfigError : a parameter is out of range. RadioMapError : the survey has no readings.

    Notes
    -----
    The defaults come from a grid search on one training file, the sum of the errors of leave-one-position-out
    and of leaving out all places within 1.5 m.
    """
    require(sigma > 0, f"sigma {sigma}", "above 0 dB")
    require(missing < 0, f"missing {missing}", "dBm below 0")
    require(n_neighbours >= 1, f"n_neighbours {n_neighbours}", "at least 1")
    require(0 < exponent <= 1, f"exponent {exponent}", "in (0, 1]")
    require_readings(survey)
    means = position_means(survey)
    return GaussianKernelMap(
        bssid=survey.bssid,
        floors=survey.floors,
        xy=means.xy,
        floor=means.floor,
        mean=means.dense(missing).astype(np.float64),
        sigma=float(sigma),
        missing=float(missing),
        n_neighbours=int(n_neighbours),
        exponent=float(exponent),
    )
