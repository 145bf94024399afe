"""Load a tracker's compiled kernels before the first phone waits for them: track a few seconds that nobody walked."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from wayfuse.radio.ap_places import ApPlaces
from wayfuse.radio.survey import Survey
from wayfuse.sensors.recording import Recording, Series
from wayfuse.sensors.records import Range, WifiScan
from wayfuse.tracking.tracker import Tracker

__all__ = ["warm"]

_SECONDS, _HZ, _STEP_HZ = 6.0, 50.0, 2.0
_AT = (1.0, 3.0, 5.0)  # s, of scans and ranges
_GRAVITY, _SWING = 9.81, 3.0  # m/s²


def warm(tracker: Tracker[Any], survey: Survey | None, places: ApPlaces | None = None) -> None:
    """Take a made-up walk, with scans of fingerprints of the survey and ranges to anchors of known places.

    Nothing of it stays but what was loaded.
    """
    t = np.arange(0.0, _SECONDS, 1.0 / _HZ)
    still = np.zeros((len(t), 3))
    up = np.column_stack([still[:, :2], _GRAVITY + _SWING * np.sin(2.0 * np.pi * _STEP_HZ * t)])
    scans = (
        () if survey is None else tuple(_scan(survey, n, at) for n, at in enumerate(_AT) if n < len(survey))
    )
    anchors = () if places is None else places.bssid[:4].tolist()
    walk = Recording(
        name="warm",
        acceleration=Series(t, up),
        rotation_rate=Series(t, still),
        pressure=Series(t, np.full((len(t), 1), 1000.0)),
        wifi=scans,
    )
    ranges = tuple(Range(at, anchor, 5.0) for at in _AT for anchor in anchors)
    for heard in (walk, replace(walk, ranges=ranges)) if ranges else (walk,):
        batch = tracker.extend(tracker.init(walk.name), heard)
        tracker.flush(batch.state, _SECONDS)


def _scan(survey: Survey, n: int, t: float) -> WifiScan:
    row = slice(int(survey.indptr[n]), int(survey.indptr[n + 1]))
    columns = survey.indices[row]
    return WifiScan(
        t, survey.bssid[columns], survey.rssi[row], survey.frequency[columns], np.full(len(columns), t)
    )
