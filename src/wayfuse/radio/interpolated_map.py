r"""Characteristic levels at training places, read between them: the radio map of chu2009, Section 3.4, on a survey.

.. math:: \log p(z \mid x) = -\sum_a (z_a - \bar r_a(x))^2 / (2 \sigma^2)   \quad (3.6, 3.7)

A training place has the average of the *histogram* of its readings, access point by access point. Between the training
places of a floor the levels are interpolated linearly over the triangles of Delaunay; outside their hull those of the
nearest place hold. The triangles are looked up on a grid of nodes, so a query costs the same for few and many places.

An access point that neither the query nor the place hears says nothing; one that only one of the two hears counts as
``missing`` on the other. `gaussian_kernel` is the same likelihood on inverse distances to the nearest places.

References
----------
.. [1] Chu, Wireless location tracking by a sensor-enhanced particle filter in 2.5D buildings, thesis, National
   Chiao Tung University, 2009.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wayfuse.core.types import Array, Array32, BoolArray, IdArray
from wayfuse.radio.radio_map import query_vector, require, require_readings
from wayfuse.radio.survey import Fingerprint, Survey

__all__ = ["FloorTable", "InterpolatedMap", "TrainingPlaces", "fit", "training_places"]

_MARGIN = 2.0  # m that the nodes reach beyond the training places
_MOST_NODES = 60_000  # of a floor; beyond, nodes are farther apart


@dataclass(frozen=True, slots=True, eq=False)
class TrainingPlaces:
    """Training places of a survey: xy (p, 2) m, floor (p,), levels (p, m) dBm, NaN where unheard, n_samples (p,)."""

    xy: Array
    floor: NDArray[np.int32]
    levels: Array
    n_samples: NDArray[np.int64]


@dataclass(frozen=True, slots=True, eq=False)
class FloorTable:
    """Where to read on one floor: nodes on a grid (r rows along y, c columns along x; node = row * c + column).

    origin (2,) m of node 0; step m; shape (r, c); member (r * c, 3) training places of the triangle around each node;
    weight (r * c, 3), sum 1.
    """

    origin: Array
    step: float
    shape: tuple[int, int]
    member: NDArray[np.int32]
    weight: Array32

    def mixture(self, xy: NDArray[np.floating], n_places: int) -> Array32:
        """(N, p) share of each training place in the levels at places (N, 2) m; rows sum to 1."""
        rows, columns = self.shape
        at = np.clip((np.asarray(xy, np.float64) - self.origin) / self.step, 0.0, [columns - 1, rows - 1])
        low = np.minimum(at.astype(np.int64), [columns - 2, rows - 2])
        u, v = (at - low).T
        first = low[:, 1] * columns + low[:, 0]
        node = np.stack([first, first + 1, first + columns, first + columns + 1], axis=1)
        bilinear = np.stack([(1 - u) * (1 - v), u * (1 - v), (1 - u) * v, u * v], axis=1)
        share = bilinear[:, :, None] * self.weight[node]
        flat = self.member[node].reshape(len(at), -1) + n_places * np.arange(len(at))[:, None]
        total = np.bincount(flat.ravel(), share.ravel(), len(at) * n_places)
        return total.reshape(len(at), n_places).astype(np.float32)


@dataclass(frozen=True, slots=True, eq=False)
class InterpolatedMap:
    """Fitted map.

    bssid (m,) ascending; floors; xy (p, 2) m, floor (p,): training places; level (p, m) dBm, ``missing`` where unheard;
    tables: one per floor, None where it has no training place; sigma dB, missing dBm as in `fit`.
    """

    bssid: IdArray
    floors: tuple[str, ...]
    xy: Array
    floor: NDArray[np.int32]
    level: Array32
    tables: tuple[FloorTable | None, ...]
    sigma: float
    missing: float

    def characteristic(self, xy: NDArray[np.floating], floor: NDArray[np.integer]) -> Array32:
        """(N, m) dBm at places (N, 2) m, floor (N,); ``missing`` throughout on a floor without training places."""
        out = np.full((len(xy), len(self.bssid)), self.missing, np.float32)
        for f, table in enumerate(self.tables):
            rows = np.flatnonzero(np.asarray(floor) == f)
            if table is None or not len(rows):
                continue
            share = table.mixture(np.asarray(xy)[rows], len(self.xy))
            used = np.flatnonzero(share.any(axis=0))  # a cloud in one place needs few of many
            out[rows] = share[:, used] @ self.level[used]
        return out

    def log_likelihood(
        self, fingerprint: Fingerprint, xy: NDArray[np.floating], floor: NDArray[np.integer]
    ) -> Array:
        """(N,) log-likelihood (Eq. 3.6-3.7) at places (N, 2) m, floor (N,); all 0 where nothing known is heard."""
        z, heard = self._query(fingerprint)
        if not heard.any():
            return np.zeros(len(xy))
        return self._kernel(self.characteristic(xy, floor), z)

    def at_places(self, fingerprint: Fingerprint) -> Array | None:
        """(p,) log-likelihood at the training places; None where nothing known is heard."""
        z, heard = self._query(fingerprint)
        return self._kernel(self.level, z) if heard.any() else None

    def _query(self, fingerprint: Fingerprint) -> tuple[Array32, BoolArray]:
        vector = query_vector(self.bssid, fingerprint)
        heard = np.isfinite(vector)
        return np.where(heard, vector, np.float32(self.missing)), heard

    def _kernel(self, level: Array32, z: Array32) -> Array:
        off = level - z
        return np.asarray(-0.5 * np.einsum("na,na->n", off, off) / self.sigma**2, np.float64)


def fit(
    survey: Survey,
    *,
    sigma: float = 3.0,
    missing: float = -100.0,
    cell: float = 0.0,
    rare: float = 0.1,
    outlier: float = 0.02,
    step: float = 1.0,
) -> InterpolatedMap:
    """Fit a map.

    Parameters
    ----------
    survey : its rows are samples. sigma : dB, width of the kernel. missing : dBm that stands for "not heard".
    cell, rare, outlier : as in `training_places`. step : m between the nodes that are looked up.

    Raises
    ------
    ConfigError : a parameter is out of range. RadioMapError : the survey has no readings.
    """
    require(sigma > 0, f"sigma {sigma}", "above 0 dB")
    require(missing < 0, f"missing {missing}", "dBm below 0")
    require(step > 0, f"step {step}", "above 0 m")
    places = training_places(survey, cell=cell, rare=rare, outlier=outlier)
    tables = []
    for floor in range(len(survey.floors)):
        rows = np.flatnonzero(places.floor == floor)
        tables.append(_table(places.xy[rows], rows, step) if len(rows) else None)
    level = np.where(np.isfinite(places.levels), places.levels, missing).astype(np.float32)
    return InterpolatedMap(
        survey.bssid, survey.floors, places.xy, places.floor, level, tuple(tables), sigma, missing
    )


def training_places(
    survey: Survey, *, cell: float = 0.0, rare: float = 0.1, outlier: float = 0.02
) -> TrainingPlaces:
    """Training places of a survey, and the histogram average of each access point there.

    Parameters
    ----------
    survey : its rows are samples.
    cell : m; rows in one square of this size are samples of one training place at their mean. 0: rows of equal place.
    rare : share of a place's samples in which an access point must be heard to count as heard there.
    outlier : share of its readings that a bin of 1 dB must hold to count: one odd sample of a hundred does not.
    """
    require(cell >= 0, f"cell {cell}", "0 m or more")
    require(0 <= rare <= 1, f"rare {rare}", "a share")
    require(0 <= outlier < 0.5, f"outlier {outlier}", "a share below one half")
    require_readings(survey)
    key = survey.xy if cell == 0.0 else np.floor(survey.xy / cell)
    label = np.unique(np.column_stack([survey.floor, key]), axis=0, return_inverse=True)[1].ravel()
    p, m = int(label.max()) + 1, len(survey.bssid)
    n_samples = np.bincount(label, minlength=p)
    xy = np.column_stack([np.bincount(label, survey.xy[:, d], p) / n_samples for d in (0, 1)])
    floor = np.zeros(p, np.int32)
    floor[label] = survey.floor
    pair = np.repeat(label, np.diff(survey.indptr)) * m + survey.indices
    pairs, count, average = _histogram_average(pair, survey.rssi.astype(np.float64), outlier)
    often = count >= np.maximum(rare * n_samples[pairs // m], 1.0)
    levels = np.full(p * m, np.nan)
    levels[pairs[often]] = average[often]
    return TrainingPlaces(xy, floor, levels.reshape(p, m), n_samples)


def _histogram_average(
    pair: NDArray[np.int64], rssi: Array, outlier: float
) -> tuple[NDArray[np.int64], NDArray[np.int64], Array]:
    """The pairs (place, access point) there are, ascending; readings of each; mean over its bins that hold enough."""
    pairs, of = np.unique(pair, return_inverse=True)
    count = np.bincount(of)
    at_bin = np.round(rssi).astype(np.int64)
    low = int(at_bin.min())
    width = int(at_bin.max()) - low + 1
    bins, which, held = np.unique(of * width + (at_bin - low), return_inverse=True, return_counts=True)
    of_pair = bins // width
    most = np.maximum.reduceat(held, np.searchsorted(of_pair, np.arange(len(pairs))))
    enough = (held >= outlier * count[of_pair]) | (held == most[of_pair])
    # readings keep their fraction: a survey may have been shifted between phones
    total = np.bincount(of_pair, np.bincount(which, rssi, len(bins)) * enough, len(pairs))
    return pairs, count, total / np.bincount(of_pair, held * enough, len(pairs))


def _table(xy: Array, rows: NDArray[np.int64], step: float) -> FloorTable:
    """Nodes over the training places (q, 2) m of a floor, which are ``rows`` (q,) of all."""
    from scipy.spatial import Delaunay, QhullError, cKDTree

    low, high = xy.min(axis=0) - _MARGIN, xy.max(axis=0) + _MARGIN
    step = max(step, float(np.sqrt(np.prod(high - low) / _MOST_NODES)))
    nx, ny = np.ceil((high - low) / step).astype(int) + 1
    node = np.stack(np.meshgrid(np.arange(nx), np.arange(ny)), axis=-1).reshape(-1, 2) * step + low
    nearest = np.asarray(cKDTree(xy).query(node)[1])
    member = np.repeat(nearest[:, None], 3, axis=1)
    weight = np.tile([1.0, 0.0, 0.0], (len(node), 1))
    try:
        triangles = Delaunay(xy)
    except (QhullError, ValueError):  # fewer than three places, or all on a line: the nearest it is
        triangles = None
    if triangles is not None:
        found = triangles.find_simplex(node)
        inside = np.flatnonzero(found >= 0)
        affine = triangles.transform[found[inside]]
        two = np.einsum("nij,nj->ni", affine[:, :2], node[inside] - affine[:, 2])
        ok = np.isfinite(two).all(axis=1)  # slivers have no inverse
        inside, two = inside[ok], two[ok]
        member[inside] = triangles.simplices[found[inside]]
        weight[inside] = np.clip(np.column_stack([two, 1.0 - two.sum(axis=1)]), 0.0, 1.0)
        weight /= weight.sum(axis=1, keepdims=True)
    return FloorTable(low, step, (ny, nx), rows[member].astype(np.int32), weight.astype(np.float32))
