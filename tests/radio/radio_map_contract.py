"""Maps and made-up surveys that the radio tests share."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from wayfuse.radio import gaussian_kernel, gaussian_process, horus, knn, nnss
from wayfuse.radio.radio_map import RadioMap
from wayfuse.radio.representation import Representation
from wayfuse.radio.survey import Fingerprint, Survey

FITS: dict[str, Callable[[Survey], RadioMap]] = {
    "nnss": nnss.fit,
    "knn": knn.fit,
    "knn euclid raw": lambda s: knn.fit(s, metric="euclidean", representation=Representation("raw", -104.0)),
    "knn cosine exponential": lambda s: knn.fit(
        s, metric="cosine", representation=Representation("exponential", -104.0)
    ),
    "gaussian kernel": gaussian_kernel.fit,
    "horus": horus.fit,
    "gaussian process": lambda s: gaussian_process.fit(s, step=1.0),
}


def field(xy: np.ndarray, floor: np.ndarray, n_aps: int = 8) -> np.ndarray:
    """(n, n_aps) dBm of a log-distance field, half of the access points on each floor, without noise."""
    aps = np.random.default_rng(1).uniform((0, 0), (20, 12), (n_aps, 2))
    distance = np.hypot(*(xy[:, None] - aps[None]).transpose(2, 0, 1))
    other = floor[:, None] != (np.arange(n_aps) % 2)[None]
    return np.asarray(-35.0 - 30.0 * np.log10(np.hypot(distance, 2.0)) - 18.0 * other)


def made_up_survey(seed: int = 0, repeats: int = 1, noise: float = 2.0) -> Survey:
    """Two floors of 20 x 12 m, a place every 2 m; readings below -85 dBm are not heard."""
    rng = np.random.default_rng(seed)
    gx, gy, floor = np.meshgrid(np.arange(0, 21, 2.0), np.arange(0, 13, 2.0), [0, 1])
    xy = np.repeat(np.column_stack([gx.ravel(), gy.ravel()]), repeats, axis=0)
    level = np.repeat(floor.ravel(), repeats)
    rssi = field(xy, level) + rng.normal(0.0, noise, (len(xy), 8))
    rssi[rssi < -85.0] = np.nan
    ids = np.arange(100, 900, 100, dtype=np.uint64)
    return Survey.from_dense(rssi, xy, level, ("EG", "OG"), bssid=ids)


def queries(n: int, seed: int = 5) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """xy (n, 2), floor (n,), rssi (n, 8) of noisy queries inside the made-up survey."""
    rng = np.random.default_rng(seed)
    xy, floor = rng.uniform((1, 1), (19, 11), (n, 2)), rng.integers(0, 2, n)
    rssi = field(xy, floor) + rng.normal(0.0, 2.0, (n, 8))
    rssi[rssi < -85.0] = np.nan
    return xy, floor, rssi


def fingerprint(bssid: np.ndarray, rssi: np.ndarray) -> Fingerprint:
    """The fingerprint of a row of dBm, NaN where unheard."""
    heard = np.isfinite(rssi)
    return Fingerprint(bssid[heard], rssi[heard].astype(np.float32), np.zeros(int(heard.sum()), np.int32))
