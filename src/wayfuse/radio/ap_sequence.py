r"""Places told apart by the order of the access points: similarity-based sequences, without training.

A place is described by the order of its distances to access points whose positions are known (location sequence),
a scan by the order of its signal strengths (RSS sequence). They are compared by Kendall's tau, so neither the
transmission power nor the offset of a phone matters as long as all access points share it. The likelihood of a scan
is a mixture of Gaussians about the k most similar places, in the log domain: the published kernel of 0.1 m underflows
to zero for every particle further than 4 m from all of them.

A pair of access points takes one bit of each of two masks, "first before second" and "second before first"; a pair
tied has neither. Concordant and discordant pairs are then counted by two population counts per 64 pairs.

Rules that the paper leaves open. *Ties* (equal RSS; equal distances, common on a symmetric grid): the pair counts
neither as concordant nor as discordant; with ``tau="a"`` (as printed, Eq. 4) the divisor stays n (n - 1) / 2, with
``tau="b"`` pairs tied on one side are taken out of that side's count. *Unheard access points* come after all heard
ones, tied with each other. *Places that tie for the last of the k ranks* share what is left of the k, each with the
same fraction of a vote, so that the order of the grid does not matter.

>>> map_ = from_positions(np.array([[0.0, 0.0], [10.0, 0.0], [10.0, 10.0]]), (0.0, 0.0, 10.0, 10.0), 5.0)
>>> map_.places[np.argmax(map_.similarity(np.array([-40.0, -60.0, -80.0])))].tolist()
[2.5, 2.5]

References
----------
.. [1] R. Liu, C. Yuen, T.-N. Do, Y. Jiang, X. Liu, U-X. Tan, Indoor positioning using similarity-based sequence and
   dead reckoning without training, 2017 (preset liu2017), Sections II and III-B.
.. [2] M. G. Kendall, The treatment of ties in ranking problems, Biometrika 33, 1945.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayfuse.core.errors import ConfigError, UsageError
from wayfuse.core.jit import COMPILED
from wayfuse.core.types import Array
from wayfuse.radio._rank_kernels import tau_of_places

__all__ = [
    "Neighbours",
    "SequenceMap",
    "Tau",
    "from_positions",
    "grid_places",
    "kendall_tau",
    "kernel_log_likelihood",
    "location_sequence",
    "nearest",
    "rss_sequence",
]

Tau = Literal["a", "b"]
_WORD = 64  # bits
_NEVER = -np.inf  # dBm that stands for "not heard": weaker than any reading, equal to itself
_FLOAT = np.dtype(np.float64)
# sign of the keys, 1 for tau-b, scale, shift: an array, for each number by itself takes a call of compiled code longer
_AS_IT_IS = {"a": np.array([1.0, 0.0, 1.0, 0.0]), "b": np.array([1.0, 1.0, 1.0, 0.0])}
_SIMILARITY = {"a": np.array([-1.0, 0.0, 0.5, 0.5]), "b": np.array([-1.0, 1.0, 0.5, 0.5])}


class Neighbours(NamedTuple):
    """The places most similar to a scan: xy (j, 2) m and log of their weight (j,)."""

    xy: Array
    log_weight: Array


def location_sequence(ap_xy: Array, xy: Array) -> NDArray[np.int64]:
    """Rank (m, n), 1 = nearest, of each of n access points (n, 2) m at places (m, 2) m; equal distances tie.

    The example of Fig. 1: at a place nearest to AP 4, then 3, 1 and 2, the sequence is 3 4 2 1.
    """
    return _ranks(_distances(ap_xy, xy))


def rss_sequence(rssi: NDArray[np.floating]) -> NDArray[np.int64]:
    """Rank (m, n), 1 = strongest, of each access point in scans (m, n) dBm; unheard (NaN) ones tie for the last."""
    return _ranks(-_heard_first(rssi))


def kendall_tau(first: NDArray[np.floating], second: NDArray[np.floating], tau: Tau = "a") -> Array:
    """Kendall's tau (m,) of one sequence of numbers (n,) with m others (m, n), Eq. 4 of [1]_.

    ``tau="a"`` divides by all pairs, ``tau="b"`` is `scipy.stats.kendalltau`; 0 where a divisor is 0.

    Raises
    ------
    UsageError : sequences of another length.
    """
    if second.ndim != 2 or second.shape[1:] != first.shape:
        raise UsageError(f"sequences of shape {first.shape} and {second.shape}", remedy="(n,) and (m, n)")
    return _tau(first, _orders(second), _AS_IT_IS[tau])


def grid_places(extent: tuple[float, float, float, float], size: float) -> Array:
    """Centroids (m, 2) m of square cells that cover x0, y0, x1, y1 (m); the last row and column may stick out."""
    x0, y0, x1, y1 = extent
    if not (size > 0.0 and x1 > x0 and y1 > y0):
        raise ConfigError(f"grid of {size} m over {extent}", remedy="a size above 0 and x0 < x1, y0 < y1")
    columns, rows = (int(np.ceil((high - low) / size - 1e-9)) for low, high in ((x0, x1), (y0, y1)))
    gx, gy = np.meshgrid(x0 + size * (np.arange(columns) + 0.5), y0 + size * (np.arange(rows) + 0.5))
    return np.column_stack([gx.ravel(), gy.ravel()])


@dataclass(frozen=True, slots=True, eq=False)
class SequenceMap:
    """Location sequences of m places (m, 2) m over n access points, packed; made by `from_positions`.

    orders (rows, m): as `_rank_kernels.tau_of_places` takes them.
    """

    places: Array
    n_aps: int
    tau: Tau
    orders: NDArray[np.uint64]

    def similarity(self, rssi: NDArray[np.floating]) -> Array:
        """(m,) sim = (1 + tau) / 2 in [0, 1] of a scan (n,) dBm, NaN where unheard, with each place."""
        if rssi.shape != (self.n_aps,):
            raise UsageError(
                f"a scan of shape {rssi.shape}", remedy=f"one value per access point ({self.n_aps})"
            )
        return _tau(rssi, self.orders, _SIMILARITY[self.tau])

    def neighbours(self, rssi: NDArray[np.floating], k: int) -> Neighbours:
        """The k places most similar to a scan, weighted by their similarity."""
        return nearest(self.places, self.similarity(rssi), k)


def from_positions(
    ap_xy: Array, extent: tuple[float, float, float, float], size: float, *, tau: Tau = "a"
) -> SequenceMap:
    """The map of [1]_ Sec. II-A: the location sequence of the centroid of each cell.

    Parameters
    ----------
    ap_xy : (n, 2) m, positions of the access points; two at least.
    extent : x0, y0, x1, y1 m, the area. size : m, side of a cell.
    tau : ``"a"`` as printed, ``"b"`` corrected for ties.

    Raises
    ------
    ConfigError : fewer than two access points, or an empty grid.
    """
    if ap_xy.ndim != 2 or ap_xy.shape[1] != 2 or len(ap_xy) < 2:
        raise ConfigError(f"access points of shape {ap_xy.shape}", remedy="(n, 2) with two or more")
    places = grid_places(extent, size)
    return SequenceMap(places, len(ap_xy), tau, _orders(_distances(ap_xy, places)))


def nearest(places: Array, similarity: Array, k: int) -> Neighbours:
    """The k places (m, 2) of greatest similarity (m,) in [0, 1]; those that tie for the last ranks share them.

    Raises
    ------
    ConfigError : k is below 1.
    """
    if k < 1:
        raise ConfigError(f"k {k}", remedy="at least 1")
    k = min(k, len(similarity))
    last = np.partition(similarity, len(similarity) - k)[len(similarity) - k]
    above, tied = similarity > last, similarity == last
    share = (k - int(above.sum())) / int(tied.sum())
    rows = np.flatnonzero(above | tied)
    weight = similarity[rows] * np.where(above[rows], 1.0, share)
    kept = weight > 0.0  # a place that contradicts the scan in every pair has no say
    if not kept.any():
        return Neighbours(places[rows], np.full(len(rows), -np.log(len(rows))))
    return Neighbours(places[rows[kept]], np.log(weight[kept]))


def kernel_log_likelihood(neighbours: Neighbours, xy: NDArray[np.floating], precision: float) -> Array:
    r"""Log-likelihood (N,) of particles at (N, 2) m, Eq. 2 of [1]_ in the log domain; finite everywhere.

    .. math:: \log \sum_j \mathrm{sim}_j \exp(-\tfrac12 p\,|x - \ell_j|^2)  (Eq. 2)

    ``precision`` p (1/m²) is lambda where it multiplies, 1 / lambda where it divides as printed (Eq. 3).
    """
    dx = xy[:, :1] - neighbours.xy[:, 0]
    dy = xy[:, 1:] - neighbours.xy[:, 1]
    terms = neighbours.log_weight - 0.5 * precision * (dx * dx + dy * dy)
    top = terms.max(axis=1)
    return np.asarray(top + np.log(np.exp(terms - top[:, None]).sum(axis=1)))


def _distances(ap_xy: Array, xy: Array) -> Array:
    squared = ((xy[:, None] - ap_xy) ** 2).sum(axis=2)
    return np.asarray(np.round(np.sqrt(squared), 6))  # m: equal distances are equal in spite of rounding


def _heard_first(rssi: NDArray[np.floating]) -> Array:
    return np.where(np.isnan(rssi), _NEVER, np.asarray(rssi, dtype=np.float64))


def _ranks(keys: Array) -> NDArray[np.int64]:
    return np.asarray(1 + (keys[:, None, :] < keys[:, :, None]).sum(axis=2), dtype=np.int64)


def _orders(keys: NDArray[np.floating]) -> NDArray[np.uint64]:
    """Pair bits of m sequences of numbers (m, n), smallest first, as `tau_of_places` takes them."""
    first, second = np.triu_indices(keys.shape[1], 1)
    a, b = keys[:, first], keys[:, second]
    ordered = (a != b).sum(axis=1, dtype=np.uint64)
    if np.all(ordered == a.shape[1]):
        return _pack(a < b)
    return np.vstack([_pack(a < b), _pack(a > b), ordered])


def _pack(bits: NDArray[np.bool_]) -> NDArray[np.uint64]:
    words = max(-(-bits.shape[1] // _WORD), 1)
    padded = np.zeros((len(bits), words * _WORD), dtype=np.bool_)
    padded[:, : bits.shape[1]] = bits
    packed = np.packbits(padded, axis=1, bitorder="little").view("<u8")
    return np.ascontiguousarray(packed.T, dtype=np.uint64)


def _tau(keys: NDArray[np.floating], orders: NDArray[np.uint64], numbers: Array) -> Array:
    """Shift + scale tau (m,) of keys (n,) with m sequences: Eq. 4 of [1]_, tau-b of [2]_."""
    out = np.empty(orders.shape[1])
    if keys.dtype is not _FLOAT or not keys.flags.carray:
        keys = np.require(keys, np.float64, ("C", "W"))  # one type, one compiled version
    if COMPILED:
        tau_of_places(keys, orders, numbers, out)
    else:
        with np.errstate(over="ignore"):  # counting bits multiplies modulo 2^64
            tau_of_places(keys, orders, numbers, out)
    return out
