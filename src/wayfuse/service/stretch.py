"""A stretch of a track's records as columns, and back: small to keep, quick to track, in the order of a replay."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from operator import attrgetter
from types import MappingProxyType

import numpy as np

from wayfuse.sensors.recording import Recording, Series
from wayfuse.sensors.records import (
    Acceleration,
    BleReading,
    CsiFrame,
    MagneticField,
    Orientation,
    Pressure,
    Range,
    Record,
    RotationRate,
    Step,
    WifiScan,
)

__all__ = ["RANK", "START", "Key", "Keyed", "gathered", "joined", "keyed"]

Key = tuple[float, int]
Keyed = tuple[Key, Record]

START: Key = (-np.inf, -1)  # before all records

_SERIES: Mapping[type, str] = MappingProxyType(
    {
        Acceleration: "acceleration",
        RotationRate: "rotation_rate",
        MagneticField: "magnetic_field",
        Pressure: "pressure",
        Orientation: "orientation",
    }
)
_EVENTS: Mapping[type, str] = MappingProxyType(
    {Step: "steps", WifiScan: "wifi", BleReading: "ble", Range: "ranges", CsiFrame: "csi"}
)
_EMPTY: Mapping[str, Series] = MappingProxyType(
    {name: attrgetter(name)(Recording(name="")) for name in _SERIES.values()}
)
# at equal times the order of `Recording.records`
RANK: Mapping[type, int] = MappingProxyType({kind: n for n, kind in enumerate((*_SERIES, *_EVENTS))})


def keyed(records: Iterable[Record]) -> list[Keyed]:
    """Records with their places in the order of a replay."""
    return [((record.t, RANK[type(record)]), record) for record in records]


def gathered(records: Sequence[Keyed]) -> Recording:
    """Records in order as a recording, whose `records` gives them back in this order."""
    of: dict[type, list[Record]] = {}
    for _, record in records:
        of.setdefault(type(record), []).append(record)
    columns: dict[str, object] = dict(_EMPTY)
    for kind, some in of.items():
        if kind in _SERIES:
            rows = np.array(some, np.float64)
            columns[_SERIES[kind]] = Series(rows[:, 0], rows[:, 1:])
        else:
            columns[_EVENTS[kind]] = tuple(some)
    return Recording(name="", **columns)  # type: ignore[arg-type]


def joined(recordings: Sequence[Recording]) -> Recording:
    """Recordings that follow each other as one."""
    if len(recordings) == 1:
        return recordings[0]
    columns: dict[str, object] = {}
    for name in _SERIES.values():
        some = [s for r in recordings if len(s := attrgetter(name)(r))]
        if some:
            t, values = np.concatenate([s.t for s in some]), np.concatenate([s.values for s in some])
            columns[name] = Series(t, values)
    for name in _EVENTS.values():
        columns[name] = tuple(e for r in recordings for e in attrgetter(name)(r))
    return Recording(name="", **columns)  # type: ignore[arg-type]
