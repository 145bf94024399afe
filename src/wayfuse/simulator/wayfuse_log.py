"""Writes recordings as wayfuse logs: every record there is, one on a line, nothing lost.

::

    {"wayfuse-log": 1, "name": "walk-00", "site": "...", "floor": "", "clock": "...", "device": ["", "phone", ""]}
    ["acceleration", 0.1, 0.02, 0.31, 9.79]
    ["wifi", 1.25, [["0a:74:9c:2e:af:f7", -61.0, 2437, 0.71]]]

The first line is an object, each other line a list: kind, time (s), fields in the order of the record's type
(`wayfuse.sensors.records`). Numbers are written with all their digits; NaN is null, an infinite one "inf" or "-inf". An
identifier is a hardware address, a digest as `bssid_text` writes it, or a number. A scan is a list of readings; channel
state is its shape and its parts, real and imaginary in turn. `docs/formats.md` has the table.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from wayfuse.sensors.recording import Recording
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
    Waypoint,
    WifiScan,
    bssid_text,
)

__all__ = ["VERSION", "wayfuse_log_lines", "write_wayfuse_log"]

VERSION = 1
_KINDS: dict[type[Any], str] = {
    Acceleration: "acceleration",
    RotationRate: "rotation_rate",
    MagneticField: "magnetic_field",
    Pressure: "pressure",
    Orientation: "orientation",
    WifiScan: "wifi",
    BleReading: "ble",
    Range: "range",
    Step: "step",
    CsiFrame: "csi",
    Waypoint: "waypoint",
}
_ADDRESS_END, _DIGEST = 1 << 48, 1 << 63


def wayfuse_log_lines(recording: Recording) -> Iterator[str]:
    """The lines of a recording, in time order."""
    device = recording.device
    head = {
        "wayfuse-log": VERSION,
        "name": recording.name,
        "site": recording.site,
        "floor": recording.floor,
        "clock": recording.clock,
        "device": [device.brand, device.model, device.system],
    }
    yield json.dumps(head, ensure_ascii=False)
    for record in recording.records():
        row = [_KINDS[type(record)], *_fields(record)]
        yield json.dumps(row, ensure_ascii=False, separators=(", ", ": "), allow_nan=False)


def write_wayfuse_log(path: Path, recording: Recording) -> None:
    """Write a recording as a wayfuse log."""
    text = "\n".join(wayfuse_log_lines(recording))
    path.write_text(text + "\n", encoding="utf-8", newline="\n")


def _fields(record: Record) -> list[Any]:
    if isinstance(record, WifiScan):
        columns = record.bssid, record.rssi, record.frequency, record.last_seen
        readings = zip(*(column.tolist() for column in columns), strict=True)
        return [_plain(record.t), [[_name(b), _plain(r), f, _plain(s)] for b, r, f, s in readings]]
    if isinstance(record, CsiFrame):
        head = [_plain(record.t), _name(record.anchor), *map(_plain, (record.rss, record.agc, record.noise))]
        parts = np.ascontiguousarray(record.csi).view(np.float32).ravel().tolist()
        return [*head, list(record.csi.shape), [_plain(p) for p in parts]]
    if isinstance(record, BleReading | Range):
        return [_plain(record.t), _name(record[1]), *map(_plain, record[2:])]
    return [_plain(value) for value in record]


def _plain(value: float | str) -> float | str | None:
    """A value as JSON has it."""
    if isinstance(value, str) or math.isfinite(value):
        return value
    return None if math.isnan(value) else ("inf" if value > 0 else "-inf")


def _name(identifier: int) -> str | int:
    """An identifier as text where the text says all of it."""
    i = int(identifier)
    return bssid_text(i) if i < _ADDRESS_END or i & _DIGEST else i
