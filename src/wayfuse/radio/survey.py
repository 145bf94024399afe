"""A survey: fingerprints with places, as a sparse matrix of readings.

A *fingerprint* is the set of readings (access point, RSSI) heard at one place. A large building has thousands of
access points of which a place hears a hundred, so readings are stored row by row (CSR).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayfuse.core.errors import RadioMapError
from wayfuse.core.types import Array, Array32, IdArray

__all__ = ["Fingerprint", "Fix", "Survey"]


class Fingerprint(NamedTuple):
    """A query: what is heard now. bssid (n,) identifiers, rssi (n,) dBm, frequency (n,) MHz (0 unknown)."""

    bssid: IdArray
    rssi: Array32
    frequency: NDArray[np.int32]


class Fix(NamedTuple):
    """A position from one fingerprint: x, y (m), floor (index into the survey's floors), n_aps used."""

    x: float
    y: float
    floor: int
    n_aps: int


@dataclass(frozen=True, slots=True, eq=False)
class Survey:
    """Fingerprints of a site.

    bssid : (m,) identifiers, ascending. frequency : (m,) MHz, the commonest channel of each, 0 unknown.
    xy : (n, 2) m, building frame. floor : (n,) index into ``floors``. walk : (n,) index into ``walks``.
    indptr : (n + 1,), indices : (k,) column of each reading, rssi : (k,) dBm: the readings, row by row.
    accuracy : m, how well its own fingerprints are found by those of other walks (`radio.survey_accuracy`), NaN where
    nobody looked. usual : (n,) signal distance of each fingerprint from the nearest of other walks, NaN where nobody
    looked (`radio.novelty`); empty = of none.
    """

    bssid: IdArray
    frequency: NDArray[np.int32]
    xy: Array
    floor: NDArray[np.int32]
    walk: NDArray[np.int32]
    indptr: NDArray[np.int64]
    indices: NDArray[np.int32]
    rssi: Array32
    floors: tuple[str, ...]
    walks: tuple[str, ...]
    accuracy: float = math.nan
    usual: Array32 = field(default_factory=lambda: np.empty(0, np.float32))

    def __post_init__(self) -> None:
        n, m = len(self.xy), len(self.bssid)
        if (
            len(self.indptr) != n + 1
            or len(self.floor) != n
            or len(self.walk) != n
            or len(self.frequency) != m
            or len(self.usual) not in {0, n}
        ):
            raise RadioMapError(
                f"survey arrays disagree: {n} places, {len(self.indptr) - 1} rows, {m} access points"
            )
        if m and np.any(np.diff(self.bssid.astype(np.uint64)) == 0):
            raise RadioMapError("survey: access points must be unique and ascending")

    def __len__(self) -> int:
        return len(self.xy)

    @classmethod
    def from_dense(
        cls,
        rssi: NDArray[np.floating],
        xy: NDArray[np.floating],
        floor: NDArray[np.integer],
        floors: tuple[str, ...],
        *,
        bssid: IdArray | None = None,
        frequency: NDArray[np.integer] | None = None,
        walk: NDArray[np.integer] | None = None,
        walks: tuple[str, ...] = ("",),
    ) -> Survey:
        """Survey from an (n, m) matrix of dBm with NaN where an access point was not heard."""
        n, m = rssi.shape
        heard = np.isfinite(rssi)
        rows, columns = np.nonzero(heard)
        indptr = np.concatenate([[0], np.cumsum(heard.sum(axis=1))]).astype(np.int64)
        return cls(
            bssid=np.arange(1, m + 1, dtype=np.uint64) if bssid is None else bssid.astype(np.uint64),
            frequency=np.zeros(m, np.int32) if frequency is None else frequency.astype(np.int32),
            xy=np.asarray(xy, dtype=np.float64),
            floor=floor.astype(np.int32),
            walk=np.zeros(n, np.int32) if walk is None else walk.astype(np.int32),
            indptr=indptr,
            indices=columns.astype(np.int32),
            rssi=rssi[rows, columns].astype(np.float32),
            floors=floors,
            walks=walks,
        )

    def dense(self, missing: float = np.nan) -> Array32:
        """(n, m) dBm with ``missing`` where an access point was not heard."""
        out = np.full((len(self), len(self.bssid)), missing, dtype=np.float32)
        rows = np.repeat(np.arange(len(self)), np.diff(self.indptr))
        out[rows, self.indices] = self.rssi
        return out

    def columns(self, bssid: IdArray) -> NDArray[np.int64]:
        """Column of each identifier, -1 where the survey does not know it."""
        if not len(self.bssid):
            return np.full(len(bssid), -1, np.int64)
        i = np.minimum(np.searchsorted(self.bssid, bssid), len(self.bssid) - 1)
        return np.where(self.bssid[i] == bssid, i, -1)

    def vector(self, fingerprint: Fingerprint, missing: float = np.nan) -> Array32:
        """(m,) dBm of a query over the survey's access points; unknown access points are left out."""
        out = np.full(len(self.bssid), missing, dtype=np.float32)
        column = self.columns(fingerprint.bssid)
        out[column[column >= 0]] = fingerprint.rssi[column >= 0]
        return out

    def fingerprint(self, row: int) -> Fingerprint:
        """What was heard at a place."""
        part = slice(int(self.indptr[row]), int(self.indptr[row + 1]))
        column = self.indices[part]
        return Fingerprint(self.bssid[column], self.rssi[part], self.frequency[column])

    def select(self, rows: NDArray[np.integer] | NDArray[np.bool_]) -> Survey:
        """The survey of some rows; access points and names stay."""
        index = np.flatnonzero(rows) if rows.dtype == np.bool_ else np.asarray(rows)
        spans = [np.arange(self.indptr[i], self.indptr[i + 1]) for i in index]
        take = np.concatenate(spans) if spans else np.empty(0, np.int64)
        counts = np.diff(self.indptr)[index]
        return Survey(
            bssid=self.bssid,
            frequency=self.frequency,
            xy=self.xy[index],
            floor=self.floor[index],
            walk=self.walk[index],
            indptr=np.concatenate([[0], np.cumsum(counts)]).astype(np.int64),
            indices=self.indices[take],
            rssi=self.rssi[take],
            floors=self.floors,
            walks=self.walks,
            accuracy=self.accuracy,
            usual=self.usual[index] if len(self.usual) else self.usual,
        )
