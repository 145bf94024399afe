"""Reader of wayfuse logs: JSON lines with every type of record (`docs/formats.md`), written by `wayfuse simulate`.

The first line says what the file is; each other line is a list: kind, time, fields. A damaged line costs that line and
is counted. Records are put in the order of their times where they are not, which is counted too; values that are not
finite stay, for the tracker to judge.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from itertools import pairwise
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from wayfuse.core.errors import FormatError
from wayfuse.sensors.quality import ReadReport
from wayfuse.sensors.recording import Device, Recording, Series
from wayfuse.sensors.records import BleReading, CsiFrame, Range, Step, Waypoint, WifiScan, bssid_id

__all__ = ["read"]

_VERSION = 1
_WIDTHS = {"acceleration": 3, "rotation_rate": 3, "magnetic_field": 3, "pressure": 1, "orientation": 4}
_EVENTS = {
    "wifi": "wifi",
    "ble": "ble",
    "range": "ranges",
    "step": "steps",
    "csi": "csi",
    "waypoint": "waypoints",
}
_NOT_FINITE = {None: float("nan"), "inf": float("inf"), "-inf": float("-inf")}
_DIGEST = 1 << 63
_LARGEST = 1 << 64
_CSI_AXES = 3
_Rows: TypeAlias = dict[str, list[tuple[float, ...]]]


def read(path: str | Path) -> Recording:
    """Read a whole log.

    Raises
    ------
    FormatError : the first line is not that of a wayfuse log, or of a later version of it.
    """
    path = Path(path)
    report = ReadReport(path=str(path))
    lines = path.read_text(encoding="utf-8", errors="replace").split("\n")
    head = _head(lines[0], path)
    rows, events = _records(lines[1:], report)
    series = {kind: _series(kind, rows[kind], report) for kind in _WIDTHS}
    recording = Recording(
        name=_text(head, "name") or path.stem,
        acceleration=series["acceleration"],
        rotation_rate=series["rotation_rate"],
        magnetic_field=series["magnetic_field"],
        pressure=series["pressure"],
        orientation=series["orientation"],
        wifi=_ordered("wifi", events, report),
        ble=_ordered("ble", events, report),
        ranges=_ordered("range", events, report),
        steps=_ordered("step", events, report),
        csi=_ordered("csi", events, report),
        waypoints=_ordered("waypoint", events, report),
        site=_text(head, "site"),
        floor=_text(head, "floor"),
        clock=_text(head, "clock"),
        device=_device(head),
        path=str(path),
        report=report,
    )
    if recording.is_empty:
        report.add("no record in the recording", report.n_lines)
    return recording


def _records(lines: list[str], report: ReadReport) -> tuple[_Rows, dict[str, list[Any]]]:
    """Samples and events by kind, of the lines after the first."""
    rows: _Rows = {kind: [] for kind in _WIDTHS}
    events: dict[str, list[Any]] = {kind: [] for kind in _EVENTS}
    for number, line in enumerate(lines, start=2):
        if not line.strip():
            continue
        report.n_lines = number
        try:
            kind, *fields = json.loads(line)
            if kind in _WIDTHS:
                rows[kind].append(_sample(fields, _WIDTHS[kind]))
            elif kind in _EVENTS:
                events[kind].append(_MAKERS[kind](fields))
            else:
                report.add("a record of an unknown kind", number)
                continue
        except (ValueError, TypeError, OverflowError):
            report.add("not a record", number)
            continue
        report.n_records[kind] = report.n_records.get(kind, 0) + 1
    return rows, events


def _head(line: str, path: Path) -> Mapping[str, Any]:
    try:
        head = json.loads(line)
    except ValueError:
        head = None
    if not isinstance(head, dict) or not isinstance(head.get("wayfuse-log"), int):
        raise FormatError("the first line is not that of a wayfuse log", where=path)
    if head["wayfuse-log"] > _VERSION:
        raise FormatError(
            f"a wayfuse log of version {head['wayfuse-log']}", where=path, remedy="update wayfuse"
        )
    return head


def _text(head: Mapping[str, Any], key: str) -> str:
    value = head.get(key, "")
    return value if isinstance(value, str) else ""


def _device(head: Mapping[str, Any]) -> Device:
    words = head.get("device")
    if isinstance(words, list) and len(words) == 3 and all(isinstance(w, str) for w in words):
        return Device(*words)
    return Device()


def _number(value: Any) -> float:
    """A number, with the words for those that JSON lacks."""
    if value is None or isinstance(value, str):
        if value in _NOT_FINITE:
            return _NOT_FINITE[value]
        raise ValueError(value)
    if isinstance(value, bool):
        raise TypeError(value)
    return float(value)


def _time(value: Any) -> float:
    t = _number(value)
    if not np.isfinite(t):
        raise ValueError(value)
    return t


def _identifier(value: Any) -> int:
    if isinstance(value, str):
        return int(value[1:], 16) | _DIGEST if value.startswith("#") else bssid_id(value)
    if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value < _LARGEST:
        raise TypeError(value)
    return value


def _sample(fields: list[Any], width: int) -> tuple[float, ...]:
    if len(fields) != width + 1:
        raise ValueError(len(fields))
    return (_time(fields[0]), *map(_number, fields[1:]))


def _wifi(fields: list[Any]) -> WifiScan:
    t, readings = fields
    table = [(_identifier(b), _number(r), int(f), _number(s)) for b, r, f, s in readings]
    return WifiScan(
        _time(t),
        np.array([row[0] for row in table], dtype=np.uint64),
        np.array([row[1] for row in table], dtype=np.float32),
        np.array([row[2] for row in table], dtype=np.int32),
        np.array([row[3] for row in table], dtype=np.float64),
    )


def _ble(fields: list[Any]) -> BleReading:
    t, identifier, rssi, power = fields
    return BleReading(_time(t), _identifier(identifier), _number(rssi), _number(power))


def _range(fields: list[Any]) -> Range:
    t, anchor, distance, sigma, rssi = fields
    return Range(_time(t), _identifier(anchor), _number(distance), _number(sigma), _number(rssi))


def _step(fields: list[Any]) -> Step:
    t, length, heading = fields
    return Step(_time(t), _number(length), _number(heading))


def _csi(fields: list[Any]) -> CsiFrame:
    t, anchor, rss, agc, noise, shape, parts = fields
    if len(shape) != _CSI_AXES:
        raise ValueError(shape)
    flat = np.array([_number(p) for p in parts], dtype=np.float32).view(np.complex64)
    frame = flat.reshape([int(n) for n in shape])
    return CsiFrame(_time(t), _identifier(anchor), frame, _number(rss), _number(agc), _number(noise))


def _waypoint(fields: list[Any]) -> Waypoint:
    t, x, y, floor, lat, lon = fields
    if not isinstance(floor, str):
        raise TypeError(floor)
    return Waypoint(_time(t), _number(x), _number(y), floor, _number(lat), _number(lon))


_MAKERS: Mapping[str, Callable[[list[Any]], Any]] = {
    "wifi": _wifi,
    "ble": _ble,
    "range": _range,
    "step": _step,
    "csi": _csi,
    "waypoint": _waypoint,
}


def _series(kind: str, rows: list[tuple[float, ...]], report: ReadReport) -> Series:
    table = np.array(rows, dtype=np.float64).reshape(len(rows), _WIDTHS[kind] + 1)
    late = int(np.count_nonzero(np.diff(table[:, 0]) < 0.0))
    if late:
        report.add(f"{kind}: out of order, sorted", 0, late)
        table = table[np.argsort(table[:, 0], kind="stable")]
    return Series(table[:, 0].copy(), table[:, 1:].copy())


def _ordered(kind: str, events: Mapping[str, list[Any]], report: ReadReport) -> tuple[Any, ...]:
    times = [one.t for one in events[kind]]
    if any(b < a for a, b in pairwise(times)):
        report.add(f"{kind}: out of order, sorted", 0)
        return tuple(sorted(events[kind], key=lambda one: one.t))
    return tuple(events[kind])
