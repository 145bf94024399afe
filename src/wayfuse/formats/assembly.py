"""From the columns of a file, in file order, to a `Recording`: clock, ranges, duplicates, scans.

Every reader yields `Piece` objects, bounded parts of its file with the line number of each record. `assemble` joins
them and applies the rules that are the same for all formats, each with a counter in the `ReadReport`:

* values that are not finite or outside what the sensor can say are dropped;
* the clock is mended (`wayfuse.formats.clock`): lone outliers dropped, a sustained jump back continued;
* a sensor's small disorder is sorted (stable); exact repeats of a Wi-Fi reading are dropped;
* Wi-Fi readings of one delivery time become one `WifiScan`.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayfuse.core.types import Array, BoolArray, IdArray
from wayfuse.formats.clock import mend_clock
from wayfuse.sensors.quality import ReadReport
from wayfuse.sensors.recording import Device, Recording, Series
from wayfuse.sensors.records import BleReading, Waypoint, WifiScan

__all__ = ["WIDTHS", "Column", "Piece", "Rows", "assemble"]

WIDTHS: Mapping[str, int] = {
    "acceleration": 3,
    "rotation_rate": 3,
    "magnetic_field": 3,
    "pressure": 1,
    "orientation": 4,
    "wifi": 3,  # rssi (dBm), frequency (MHz, 0 unknown), last seen (s, NaN unknown)
    "ble": 2,  # rssi (dBm), tx power (dBm, NaN unknown)
}

# What the first columns of a kind can say, (column count, lowest, highest); beyond it the record is dropped.
_RANGES: Mapping[str, tuple[int, float, float]] = {
    "acceleration": (3, -1e3, 1e3),  # m/s²: phones end at 160
    "rotation_rate": (3, -1e3, 1e3),  # rad/s: phones end at 35
    "magnetic_field": (3, -1e5, 1e5),  # µT: phones end at 5000
    "pressure": (1, 300.0, 1200.0),  # hPa: range of the sensors, 9 km up to a deep mine
    "orientation": (4, -1.0, 1.0),
    "wifi": (1, -127.0, 20.0),  # dBm
    "ble": (1, -127.0, 20.0),  # dBm
}

LineArray = NDArray[np.int64]


class Column(NamedTuple):
    """Records of one kind in file order: line (n,) 1-based, t (n,) s, values (n, k), ids (n,) or (0,)."""

    line: LineArray
    t: Array
    values: Array
    ids: IdArray

    @classmethod
    def empty(cls, kind: str) -> Column:
        """A column of a kind without records."""
        return cls(np.empty(0, np.int64), np.empty(0), np.empty((0, WIDTHS[kind])), np.empty(0, np.uint64))

    def take(self, index: NDArray[np.int64] | BoolArray) -> Column:
        """The records at an index or mask."""
        ids = self.ids[index] if len(self.ids) else self.ids
        return Column(self.line[index], self.t[index], self.values[index], ids)


@dataclass(slots=True)
class Piece:
    """A part of a file: columns by kind (`WIDTHS`), waypoints with their lines, and header fields met in it."""

    columns: dict[str, Column] = field(default_factory=dict)
    waypoints: list[tuple[int, Waypoint]] = field(default_factory=list)
    header: dict[str, str] = field(default_factory=dict)


class Rows:
    """Builds the columns of a piece record by record (the careful path of the readers)."""

    def __init__(self) -> None:
        self._rows: dict[str, tuple[list[int], list[float], list[tuple[float, ...]], list[int]]] = {}
        self.waypoints: list[tuple[int, Waypoint]] = []

    def add(self, kind: str, line: int, t: float, values: tuple[float, ...], identifier: int = 0) -> None:
        """Append one record."""
        rows = self._rows.get(kind)
        if rows is None:
            rows = self._rows[kind] = ([], [], [], [])
        rows[0].append(line)
        rows[1].append(t)
        rows[2].append(values)
        rows[3].append(identifier)

    def columns(self) -> dict[str, Column]:
        """The columns built so far."""
        out = {}
        for kind, (line, t, values, ids) in self._rows.items():
            out[kind] = Column(
                np.array(line, np.int64),
                np.array(t, np.float64),
                np.array(values, np.float64).reshape(len(t), WIDTHS[kind]),
                np.array(ids, np.uint64),
            )
        return out


def assemble(
    pieces: Iterable[Piece],
    report: ReadReport,
    *,
    name: str,
    clock: str,
    device: Device | None = None,
    site: str = "",
    floor: str = "",
    one_stream: bool = True,
) -> Recording:
    """Join the pieces of a file into a recording and count in ``report`` what was dropped or mended.

    ``one_stream`` says that the line numbers order all records of the recording (one file), so that the clock is
    judged over all of them; otherwise each kind is judged by itself.
    """
    columns, waypoints = _join(pieces)
    columns = {kind: _in_range(kind, column, report) for kind, column in columns.items()}
    columns, waypoints = mend_clock(columns, waypoints, report, one_stream=one_stream)
    series = {kind: _series(kind, columns, report) for kind in WIDTHS if kind not in {"wifi", "ble"}}
    recording = Recording(
        name=name,
        **series,
        wifi=_scans(_sorted("wifi", columns.get("wifi"), report), report),
        ble=_ble(_sorted("ble", columns.get("ble"), report)),
        waypoints=tuple(sorted((w for _, w in waypoints), key=lambda w: w.t)),
        site=site,
        floor=floor,
        clock=clock,
        device=device or Device(),
        path=report.path,
        report=report,
    )
    if recording.is_empty:
        report.add("no records in the recording", max(report.n_lines, 1))
    return recording


def stem(path: Path) -> str:
    """Name of a recording: the file name without its last suffix."""
    return path.stem if path.is_file() else path.name


def _join(pieces: Iterable[Piece]) -> tuple[dict[str, Column], list[tuple[int, Waypoint]]]:
    parts: dict[str, list[Column]] = {}
    waypoints: list[tuple[int, Waypoint]] = []
    for piece in pieces:
        for kind, column in piece.columns.items():
            parts.setdefault(kind, []).append(column)
        waypoints.extend(piece.waypoints)
    joined = {}
    for kind, columns in parts.items():
        if len(columns) == 1:
            joined[kind] = columns[0]
        else:
            line, t, values, ids = (np.concatenate(arrays) for arrays in zip(*columns, strict=True))
            joined[kind] = Column(line, t, values, ids)
    return joined, waypoints


def _in_range(kind: str, column: Column, report: ReadReport) -> Column:
    """Drop records whose values are not finite or outside the sensor's range."""
    k, low, high = _RANGES[kind]
    values = column.values[:, :k]
    if not len(values) or (values.min() >= low and values.max() <= high):  # NaN fails both
        return column
    finite = np.isfinite(values).all(axis=1)
    inside = finite & ((values >= low) & (values <= high)).all(axis=1)
    label = kind.replace("_", " ")
    _count(report, f"{label}: not finite", column.line[~finite])
    _count(report, f"{label}: out of range", column.line[finite & ~inside])
    return column.take(inside)


def _sorted(kind: str, column: Column | None, report: ReadReport) -> Column:
    if column is None:
        return Column.empty(kind)
    t = column.t
    if len(t) < 2 or bool((t[1:] >= t[:-1]).all()):
        return column
    late = t < np.maximum.accumulate(t)
    _count(report, f"{kind.replace('_', ' ')}: out of time order, sorted", column.line[late])
    return column.take(np.argsort(t, kind="stable"))


def _series(kind: str, columns: Mapping[str, Column], report: ReadReport) -> Series:
    column = _sorted(kind, columns.get(kind), report)
    return Series(column.t, column.values)


def _scans(column: Column, report: ReadReport) -> tuple[WifiScan, ...]:
    """One scan per delivery time, exact repeats dropped."""
    column = _without_repeats(column, report)
    n = len(column.t)
    if not n:
        return ()
    rssi = column.values[:, 0].astype(np.float32)
    frequency = column.values[:, 1].astype(np.int32)
    last_seen = np.ascontiguousarray(column.values[:, 2])
    edges = np.flatnonzero(column.t[1:] != column.t[:-1]) + 1
    starts, stops = [0, *edges.tolist()], [*edges.tolist(), n]
    times, ids = column.t, column.ids
    return tuple(
        WifiScan(float(times[i]), ids[i:j], rssi[i:j], frequency[i:j], last_seen[i:j])
        for i, j in zip(starts, stops, strict=True)
    )


def _without_repeats(column: Column, report: ReadReport) -> Column:
    seen: set[tuple[object, ...]] = set()
    keep = np.ones(len(column.t), bool)
    rows = zip(column.t.tolist(), column.ids.tolist(), map(tuple, column.values.tolist()), strict=True)
    for i, row in enumerate(rows):
        key = repr(row)
        if key in seen:
            keep[i] = False
        seen.add(key)
    if keep.all():
        return column
    _count(report, "wifi: exact repeat of a reading", column.line[~keep])
    return column.take(keep)


def _ble(column: Column) -> tuple[BleReading, ...]:
    return tuple(
        map(
            BleReading,
            column.t.tolist(),
            column.ids.tolist(),
            column.values[:, 0].tolist(),
            column.values[:, 1].tolist(),
        )
    )


def _count(report: ReadReport, kind: str, lines: LineArray) -> None:
    """Count a fault at each of the lines."""
    for line in lines[:5].tolist():
        report.add(kind, line)
    if len(lines) > 5:
        report.issues[kind].count += len(lines) - 5
