"""What every radio map does, and what the maps share.

A map is fitted once (`fit(survey, *, ...) -> Map`, a frozen dataclass) and then answers two questions about a
fingerprint: where is it (`locate`, for many queries at once `locate_all`), and how likely is it at given
places (`log_likelihood`, for a particle filter). Access points the map does not know are ignored.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from wayfuse.core.errors import ConfigError, RadioMapError
from wayfuse.core.types import Array, Array32, IdArray
from wayfuse.radio.survey import Fingerprint, Fix, Survey

__all__ = [
    "Positions",
    "RadioMap",
    "check_queries",
    "group_positions",
    "locate_one",
    "mixture_log_likelihood",
    "parts_error",
    "query_vector",
    "require",
    "require_readings",
    "weighted_places",
]

_OUTSIDE_SHARE = 1e-3  # part of the probability that is spread evenly: keeps every place possible and finite
_OUTSIDE_AREA = 1e4  # m2 over which it is spread


class RadioMap(Protocol):
    """A fitted radio map. ``floors`` names the floors; ``bssid`` (m,) are the columns, ascending."""

    @property
    def bssid(self) -> IdArray:
        """(m,) access points of the map, ascending."""
        ...

    @property
    def floors(self) -> tuple[str, ...]:
        """Names of the floors that `Fix.floor` indexes."""
        ...

    def locate(self, fingerprint: Fingerprint) -> Fix:
        """Best single place of a fingerprint; `RadioMapError` where it holds no known access point."""
        ...

    def locate_all(self, rssi: NDArray[np.floating]) -> tuple[Array, NDArray[np.int32]]:
        """xy (q, 2) m and floor (q,) of queries (q, m) dBm over the map's columns, NaN where unheard."""
        ...

    def log_likelihood(
        self, fingerprint: Fingerprint, xy: NDArray[np.floating], floor: NDArray[np.integer]
    ) -> Array:
        """(N,) natural log up to a constant, finite, at xy (N, 2) m, floor (N,); all 0 if nothing known."""
        ...

    def parts(self) -> tuple[str, Mapping[str, Any], Mapping[str, NDArray[Any]]]:
        """Kind, JSON-able parameters and arrays: what `wayfuse.radio.map_file.save` writes."""
        ...


class Positions(NamedTuple):
    """Rows of a survey gathered by place: xy (p, 2) m, floor (p,), row_position (n,) index of each row."""

    xy: Array
    floor: NDArray[np.int32]
    row_position: NDArray[np.int64]


def require(condition: bool, what: str, remedy: str) -> None:
    """Raise `ConfigError` unless a parameter is in its range."""
    if not condition:
        raise ConfigError(what, remedy=remedy)


def parts_error(
    arrays: Mapping[str, NDArray[Any]], shapes: Mapping[str, tuple[int, ...]], dtypes: str
) -> str:
    """What is wrong with the arrays of a stored map: a shape, a kind of dtype (one letter each); "" if sound."""
    for (name, shape), kind in zip(shapes.items(), dtypes, strict=True):
        array = arrays[name]
        if array.shape != shape or array.dtype.kind != kind:
            return f"{name} is {array.dtype} of shape {array.shape}, not {shape}"
        if kind == "f" and not np.all(np.isfinite(array)):
            return f"{name} is not finite"
    return ""


def require_readings(survey: Survey) -> None:
    """Raise `RadioMapError` unless the survey has places, readings and finite coordinates."""
    if len(survey) == 0 or len(survey.rssi) == 0:
        raise RadioMapError("the survey has no readings", remedy="give places with access points")
    if not np.all(np.isfinite(survey.xy)) or not np.all(np.isfinite(survey.rssi)):
        raise RadioMapError("the survey has places or readings that are not finite", remedy="drop these rows")


def check_queries(rssi: NDArray[np.floating], n_columns: int) -> NDArray[np.floating]:
    """The queries as (q, m); `RadioMapError` where their width is not the map's."""
    queries = np.atleast_2d(rssi)
    if queries.ndim != 2 or queries.shape[1] != n_columns:
        raise RadioMapError(
            f"queries of shape {rssi.shape} do not fit {n_columns} access points",
            remedy="give dBm over the map's columns, NaN where unheard",
        )
    return queries


def query_vector(bssid: IdArray, fingerprint: Fingerprint) -> Array32:
    """(m,) dBm of a query over columns ``bssid``, NaN where unheard; others and non-finite are left out."""
    out = np.full(len(bssid), np.nan, np.float32)
    if len(bssid) and len(fingerprint.bssid):
        column = np.minimum(np.searchsorted(bssid, fingerprint.bssid), len(bssid) - 1)
        known = (bssid[column] == fingerprint.bssid) & np.isfinite(fingerprint.rssi)
        out[column[known]] = fingerprint.rssi[known]
    return out


def locate_one(radio_map: RadioMap, fingerprint: Fingerprint) -> Fix:
    """`Fix` of one fingerprint by the map's `locate_all`; `RadioMapError` where nothing known is heard."""
    vector = query_vector(radio_map.bssid, fingerprint)
    n_aps = int(np.isfinite(vector).sum())
    if n_aps == 0:
        raise RadioMapError(
            "the fingerprint holds no access point of this radio map",
            remedy="survey this place, or check that map and scan are of the same site",
        )
    xy, floor = radio_map.locate_all(vector[None])
    return Fix(float(xy[0, 0]), float(xy[0, 1]), int(floor[0]), n_aps)


def group_positions(survey: Survey) -> Positions:
    """Gather rows of equal place and floor; places in order of floor, x, y."""
    keys = np.column_stack([survey.floor.astype(np.float64), survey.xy])
    unique, inverse = np.unique(keys, axis=0, return_inverse=True)
    return Positions(unique[:, 1:], unique[:, 0].astype(np.int32), inverse.ravel().astype(np.int64))


def weighted_places(
    weight: Array, xy: Array, floor: NDArray[np.int32], n_floors: int
) -> tuple[Array, NDArray[np.int32]]:
    """Centre of weighted places: the floor of most weight, then the weighted mean of the places on it.

    ``weight`` (q, k) >= 0 with a positive sum, ``xy`` (q, k, 2), ``floor`` (q, k).
    """
    share = np.stack([np.where(floor == f, weight, 0.0).sum(axis=1) for f in range(n_floors)], axis=1)
    best = np.argmax(share, axis=1).astype(np.int32)
    kept = np.where(floor == best[:, None], weight, 0.0)
    return np.einsum("qk,qkd->qd", kept / kept.sum(axis=1, keepdims=True), xy), best


def mixture_log_likelihood(
    weight: Array,
    centre_xy: Array,
    centre_floor: NDArray[np.int32],
    xy: NDArray[np.floating],
    floor: NDArray[np.integer],
    bandwidth: float,
) -> Array:
    """Log of a mixture of round Gaussians, one on each weighted place, plus a thin even share.

    Parameters
    ----------
    weight : (k,), >= 0, sum 1. centre_xy : (k, 2) m. centre_floor : (k,).
    xy, floor : (N, 2) m, (N,): where to evaluate.
    bandwidth : standard deviation of the Gaussians (m).

    Returns
    -------
    (N,) natural log of a density per m2, never below that of the even share.
    """
    squared = ((np.asarray(xy, np.float64)[:, None] - centre_xy[None]) ** 2).sum(axis=-1)
    density = np.exp(-0.5 * squared / bandwidth**2) / (2.0 * np.pi * bandwidth**2)
    density *= np.asarray(floor)[:, None] == centre_floor[None]
    even = _OUTSIDE_SHARE / _OUTSIDE_AREA
    return np.asarray(np.log((1.0 - _OUTSIDE_SHARE) * (density @ weight) + even))
