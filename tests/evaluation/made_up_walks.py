"""Small walks with known truth, and estimates with known errors, for the tests of this folder."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from wayfuse.core.frames import GeoAnchor
from wayfuse.core.types import Array
from wayfuse.evaluation.errors import Scores, score
from wayfuse.evaluation.estimates_file import WalkEstimates
from wayfuse.sensors.recording import Recording
from wayfuse.sensors.records import Waypoint, WifiScan

RHO68, RHO95 = (float(np.sqrt(-2 * np.log(1 - p))) for p in (0.68, 0.95))  # of a circular Gaussian


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


@dataclass(frozen=True)
class Storey:
    """What scoring asks of a floor."""

    name: str


@dataclass(frozen=True)
class House:
    """A site whose floors have frames of their own: floor i begins ``offsets[i]`` off the common frame."""

    names: tuple[str, ...] = ("B1", "F1", "F2")
    offsets: tuple[tuple[float, float], ...] = ((0.0, 0.0), (0.0, 0.0), (0.0, 0.0))
    reference: int = 1
    anchor: GeoAnchor | None = None

    @property
    def floors(self) -> Sequence[Storey]:
        return [Storey(name) for name in self.names]

    def shift(self, source: int, target: int) -> Array:
        return np.array(self.offsets[source]) - np.array(self.offsets[target])


def noisy_scores(
    n_walks: int = 12, methods: Mapping[str, float] | None = None, seed: int = 3, length: int = 40
) -> Scores:
    """Walks along x with circular Gaussian errors of a standard deviation (m) per method, radii to match."""
    rng = np.random.default_rng(seed)
    sigmas = {"good": 1.0, "bad": 3.0} if methods is None else methods
    recordings, tracks = [], []
    for i in range(n_walks):
        end = Waypoint(float(length), float(length), 0.0, "F1")
        recordings.append(recording(f"w{i}", (Waypoint(0.0, 0.0, 0.0, "F1"), end), (1.0,)))
        for name, sigma in sigmas.items():
            t = np.arange(1.0, length + 1.0)
            xy = np.stack([t, np.zeros_like(t)], axis=1) + sigma * rng.normal(size=(len(t), 2))
            full = np.full_like(t, sigma)
            numbers = {
                "r68": full * RHO68,
                "r95": full * RHO95,
                "var_x": full**2,
                "var_y": full**2,
                "cov_xy": 0 * t,
            }
            tracks.append(track(t, xy, walk=f"w{i}", method=name, **numbers))
    return score(tracks, recordings)
