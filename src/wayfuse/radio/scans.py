"""From delivered sweeps to fingerprints: age limit, repeats, twins.

A phone delivers a list every few seconds, and that list repeats readings of earlier sweeps: on the ms-indoor
recordings 217 access points are listed of which about 80 were heard in the last 2.5 s, and some are a minute old.
`ScanBuffer` keeps the newest reading of each access point until it is ``max_age`` old, counted from when it was
*heard* (``last_seen``), not from when it was delivered. A single sweep is incomplete, so readings are kept across
deliveries rather than dropped as repeats.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayfuse.core.types import Array, Array32, IdArray
from wayfuse.radio.survey import Fingerprint
from wayfuse.sensors.records import WifiScan

__all__ = ["Readings", "ScanBuffer", "ScanState", "readings"]

RSSI_LIMITS = (-127.0, 0.0)  # dBm; Android reports -127 for "none", positive values are driver faults


@dataclass(frozen=True, slots=True, eq=False)
class Readings:
    """Distinct readings of a walk: when heard ``t`` (n,) s, when delivered (n,) s, whose, how strong (dBm)."""

    t: Array
    delivered: Array
    bssid: IdArray
    rssi: Array32
    frequency: NDArray[np.int32]


def readings(scans: tuple[WifiScan, ...]) -> Readings:
    """All distinct readings of a walk, ordered by the time they were heard; repeats of (bssid, time) appear once."""
    if not scans:
        nothing = np.empty(0)
        return Readings(
            nothing, nothing, nothing.astype(np.uint64), nothing.astype(np.float32), nothing.astype(np.int32)
        )
    delivered = np.concatenate([np.full(len(s.bssid), s.t) for s in scans])
    heard = np.concatenate([_heard(s) for s in scans])
    bssid = np.concatenate([s.bssid for s in scans])
    rssi = np.concatenate([s.rssi for s in scans])
    frequency = np.concatenate([s.frequency for s in scans])
    valid = (rssi >= RSSI_LIMITS[0] + 1) & (rssi <= RSSI_LIMITS[1])
    order = np.lexsort((delivered, heard, bssid))
    order = order[valid[order]]
    fresh = np.ones(len(order), dtype=bool)
    fresh[1:] = (np.diff(heard[order]) != 0) | (bssid[order][1:] != bssid[order][:-1])
    keep = order[fresh]
    keep = keep[np.argsort(heard[keep], kind="stable")]
    return Readings(heard[keep], delivered[keep], bssid[keep], rssi[keep].astype(np.float32), frequency[keep])


class ScanState(NamedTuple):
    """What scan handling remembers: the readings kept, and the last delivery (to notice a repeat)."""

    bssid: IdArray
    rssi: Array32
    frequency: NDArray[np.int32]
    heard: Array
    last: tuple[bytes, bytes, bytes]


@dataclass(frozen=True, slots=True)
class ScanBuffer:
    """Streaming scan handling: each delivered scan in, the fingerprint of now out.

    Parameters
    ----------
    max_age : s; a reading is kept until it is this old (4 s: best of 2.5, 4, 10, 30 s on the ms-indoor survey).
    """

    max_age: float = 4.0

    def init(self) -> ScanState:
        """State before the first scan."""
        nothing = np.empty(0)
        return ScanState(
            nothing.astype(np.uint64),
            nothing.astype(np.float32),
            nothing.astype(np.int32),
            nothing,
            (b"", b"", b""),
        )

    def step(self, state: ScanState, scan: WifiScan) -> tuple[ScanState, Fingerprint | None]:
        """Take a delivered scan; the fingerprint of now, or None where the scan says nothing new.

        A scan says nothing new when no reading is younger than ``max_age``, or when it repeats the scan before
        reading by reading (a throttled phone, or a record delivered twice).
        """
        signature = scan.bssid.tobytes(), scan.rssi.tobytes(), scan.last_seen.tobytes()
        if signature == state.last:
            return state, None
        heard = _heard(scan)
        # NaN compares false, so a reading that is not a number is not valid
        valid = (
            (scan.rssi > RSSI_LIMITS[0]) & (scan.rssi <= RSSI_LIMITS[1]) & (scan.t - heard <= self.max_age)
        )
        bssid = np.concatenate([state.bssid, scan.bssid[valid]])
        rssi = np.concatenate([state.rssi, scan.rssi[valid].astype(np.float32)])
        frequency = np.concatenate([state.frequency, scan.frequency[valid]])
        heard = np.concatenate([state.heard, heard[valid]])
        order = np.lexsort((heard, bssid))
        newest = np.ones(len(order), dtype=bool)
        newest[:-1] = bssid[order][1:] != bssid[order][:-1]
        keep = order[newest]
        keep = keep[scan.t - heard[keep] <= self.max_age]
        after = ScanState(bssid[keep], rssi[keep], frequency[keep], heard[keep], signature)
        if not len(keep):
            return after, None
        return after, Fingerprint(after.bssid, after.rssi, after.frequency)


def _heard(scan: WifiScan) -> Array:
    """When each reading was heard: ``last_seen`` where recorded and not in the future, else the delivery."""
    seen = scan.last_seen
    return np.where(np.isfinite(seen) & (seen <= scan.t), seen, scan.t)
