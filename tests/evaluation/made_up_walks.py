"""Small walks with known truth, and estimates with known errors, for the tests of this folder."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from wayfuse.core.types import Array
from wayfuse.evaluation.estimates_file import WalkEstimates
from wayfuse.sensors.recording import Recording
from wayfuse.sensors.records import Waypoint, WifiScan


def scan(t: float) -> WifiScan:
    bssid, rssi, frequency = np.array([1], np.uint64), np.array([-50], np.float32), np.array([2412], np.int32)
    return WifiScan(t, bssid, rssi, frequency, np.array([t]))


def recording(
    name: str = "a",
    waypoints: Sequence[Waypoint] = (Waypoint(100.0, 0.0, 0.0, "F1"), Waypoint(110.0, 10.0, 0.0, "F1")),
    scans: Sequence[float] = (101.5, 103.5),
    floor: str = "",
) -> Recording:
    return Recording(name, wifi=tuple(scan(t) for t in scans), waypoints=tuple(waypoints), floor=floor)


def track(
    t: Sequence[float] | Array,
    xy: Sequence[tuple[float, float]] | Array,
    floor: str | Sequence[str] = "F1",
    *,
    walk: str = "a",
    method: str = "m",
    **numbers: Sequence[float] | Array,
) -> WalkEstimates:
    times = np.asarray(t, dtype=np.float64)
    names = [floor] * len(times) if isinstance(floor, str) else list(floor)
    return WalkEstimates(
        walk=walk,
        method=method,
        t=times,
        xy=np.asarray(xy, dtype=np.float64).reshape(-1, 2),
        floor=np.array(names, dtype=np.str_),
        lonlat=np.full((len(times), 2), np.nan),
        numbers={k: np.asarray(v, dtype=np.float64) for k, v in numbers.items()},
    )
