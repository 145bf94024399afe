"""Reader of the walks of the data set ``wifi-rtt``: ranges by round-trip time to access points at known places.

``raw_data/SCENE/CIRCLE/CPQ.csv`` (circle C; phones 1 and 2 have files of their own) is a table with a header: a time in
ms since the walk began; for each access point its true distance, the measured one, the standard deviation of that (m)
and the RSS (dBm), all 0 where it did not answer; accelerations (m/s², with gravity), rotation rates (rad/s), magnetic
field (µT), the azimuth, pitch and roll made of them (not read), and the true place, in one column ``"[x, y]"`` or in
two. ``SCENE/AP_idx_SCENE.csv`` says where the access points hang. The frame is that of the scene, in metres.

Some tables were filled up to even times: a row repeats readings of the one before. A reading with the same distance,
deviation and RSS as the last of its access point is left out. The true distances are not read: they follow from the
places. The tables of the folder clean_data have no times, so they are no recordings.

References
----------
.. [1] Indoor-localization-data-set, github.com/haiyaoyu/RTT-Indoor-localization-data-set (MIT).
"""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from wayfuse.core.errors import DataMissingError, FormatError
from wayfuse.formats.bounded import read_bounded
from wayfuse.formats.columns import is_number
from wayfuse.sensors.quality import ReadReport
from wayfuse.sensors.recording import Device, Recording, Series
from wayfuse.sensors.records import Range, Waypoint, bssid_id

__all__ = ["PlacedAnchor", "is_table", "read", "read_places"]

_TIME = re.compile(r"M\d Time Stamp \(ms\)")
_DISTANCE = re.compile(r"(AP\d{1,3}) RTT Distance \(m\)")
_TRUTH = re.compile(r"M\d Ground Truth(_x|_y|)")
_HEAD = re.compile(rb"^(?:\xef\xbb\xbf)?M\d Time Stamp \(ms\),AP\d+ True Distance")
_SENSORS: Mapping[str, tuple[str, str, str]] = {
    "acceleration": ("AccX", "AccY", "AccZ"),
    "rotation_rate": ("GyroX", "GyroY", "GyroZ"),
    "magnetic_field": ("MagX", "MagY", "MagZ"),
}
_PLACES = "AP_idx*.csv"
_MOST_BYTES = 1 << 26  # the largest real table has 2 MB
_LONGEST_LINE = 1 << 14
_NEAREST, _FARTHEST = (
    -10.0,
    300.0,
)  # m; the error of a range may exceed a short one, and no building is so large
_LARGEST = 1e4  # of a sensor, a place: m/s², rad/s, µT, m
_LATEST_MS = 1e9


class PlacedAnchor(NamedTuple):
    """An access point: identifier (`bssid_id` of its name ``AP1``, ...) and place (m, frame of the scene)."""

    anchor: int
    x: float
    y: float


class _Columns(NamedTuple):
    """Where things stand in a line."""

    time: int
    ranges: tuple[tuple[int, int], ...]  # anchor, column of the distance; deviation and RSS follow
    sensors: dict[str, tuple[int, ...]]
    truth: tuple[int, ...]


def is_table(head: bytes) -> bool:
    """Whether the first bytes of a file are such a table."""
    return _HEAD.match(head) is not None


def read(path: str | Path) -> Recording:
    """Read a walk: `Range` records, motion sensors (at the rate of the ranges, 2 to 5 Hz) and a waypoint per row.

    Raises
    ------
    DataMissingError : there is no such file. FormatError : it is too large, or no such table.
    """
    path = Path(path)
    lines = read_bounded(path, _MOST_BYTES).decode("utf-8-sig", "replace").splitlines()
    columns = _columns(_fields(lines[0])) if lines else None
    if columns is None:
        raise FormatError(
            "no table of the data set wifi-rtt", where=path, remedy="give raw_data/SCENE/C/CPQ.csv"
        )
    report = ReadReport(path=str(path), n_lines=len(lines))
    walk = _Walk(columns, report)
    for number, line in enumerate(lines[1:], 2):
        if line.strip():
            walk.add(number, line)
    report.n_records = {"ranges": len(walk.ranges), "rows": len(walk.times["acceleration"])}
    scene = path.parent.parent
    acceleration, rotation_rate, magnetic_field = (_series(walk.times[k], walk.values[k]) for k in _SENSORS)
    return Recording(
        path.stem,
        acceleration=acceleration, rotation_rate=rotation_rate, magnetic_field=magnetic_field,
        ranges=tuple(walk.ranges), waypoints=tuple(walk.waypoints),
        site=scene.name if any(scene.glob(_PLACES)) else "",
        clock="since the walk began", device=Device(), path=str(path), report=report,
    )  # fmt: skip


def read_places(scene: str | Path) -> tuple[PlacedAnchor, ...]:
    """Places of the access points of a scene's folder; those at (0, 0), which means "not there", are left out.

    Raises
    ------
    DataMissingError : the folder has no table of places. FormatError : a line of it is damaged.
    """
    tables = sorted(Path(scene).glob(_PLACES))
    if not tables:
        raise DataMissingError("no AP_idx*.csv in this folder", where=scene)
    text = read_bounded(tables[0], _MOST_BYTES).decode("utf-8-sig", "replace")
    out = []
    for number, line in enumerate(text.splitlines()[1:], 2):
        name, *place = _fields(line) or [""]
        if not name and not any(place):
            continue
        values = [_value(p) for p in place]
        if len(values) != 2 or not all(abs(v) < _LARGEST for v in values):
            raise FormatError("not a name, x and y", where=f"{tables[0]}: line {number}")
        if any(values):
            out.append(PlacedAnchor(bssid_id(name), *values))
    return tuple(out)


class _Walk:
    """Builds the columns of a walk, line by line."""

    def __init__(self, columns: _Columns, report: ReadReport) -> None:
        self.ranges: list[Range] = []
        self.waypoints: list[Waypoint] = []
        self.times: dict[str, list[float]] = {kind: [] for kind in _SENSORS}
        self.values: dict[str, list[list[float]]] = {kind: [] for kind in _SENSORS}
        self._columns, self._report = columns, report
        self._width = 1 + max(*columns.truth, *(at for _, at in columns.ranges))
        self._last: dict[int, tuple[float, float, float]] = {}
        self._now = -math.inf

    def add(self, number: int, line: str) -> None:
        """Take a line."""
        fields = _fields(line)
        if len(fields) < self._width:
            self._report.add("a row with too few columns", number)
            return
        ms = _value(fields[self._columns.time])
        if not 0.0 <= ms <= _LATEST_MS:
            self._report.add("a row without a time", number)
        elif 1e-3 * ms <= self._now:
            self._report.add("a time that steps back", number)
        else:
            self._now = 1e-3 * ms
            self._ranges(number, fields)
            self._sensors(number, fields)
            self._truth(number, fields)

    def _ranges(self, number: int, fields: list[str]) -> None:
        for anchor, at in self._columns.ranges:
            reading = (_value(fields[at]), _value(fields[at + 1]), _value(fields[at + 2]))
            distance, sigma, rss = reading
            if distance == 0.0 and rss == 0.0:
                continue  # did not answer
            if not (_NEAREST <= distance <= _FARTHEST and -128.0 <= rss <= 0.0):
                self._report.add("a range or RSS out of range", number)
            elif self._last.get(anchor) == reading:
                self._report.add("a reading repeated", number)
            else:
                self._last[anchor] = reading
                known = sigma if 0.0 < sigma <= _FARTHEST else math.nan
                self.ranges.append(Range(self._now, anchor, distance, known, rss))

    def _sensors(self, number: int, fields: list[str]) -> None:
        for kind, columns in self._columns.sensors.items():
            values = [_value(fields[at]) if at < len(fields) else math.nan for at in columns]
            if all(abs(v) <= _LARGEST for v in values):
                self.times[kind].append(self._now)
                self.values[kind].append(values)
            else:
                self._report.add(f"{kind} that is no number or out of range", number)

    def _truth(self, number: int, fields: list[str]) -> None:
        texts = [fields[at] for at in self._columns.truth]
        if len(texts) == 1:
            texts = texts[0].strip("[] ").split(",")
        place = [_value(text) for text in texts]
        if len(place) == 2 and all(abs(v) <= _LARGEST for v in place):
            self.waypoints.append(Waypoint(self._now, place[0], place[1], ""))
        else:
            self._report.add("a true place that is none", number)


def _columns(names: Sequence[str]) -> _Columns | None:
    """Where things stand, by the header; None where it is of another table."""
    if not names or not _TIME.fullmatch(names[0]):
        return None
    found = [(m, k) for k, name in enumerate(names) if (m := _DISTANCE.fullmatch(name))]
    ranges = tuple((bssid_id(m[1]), k) for m, k in found)
    truth = tuple(k for k, name in enumerate(names) if _TRUTH.fullmatch(name))
    if not ranges or len(truth) not in {1, 2} or max(k for _, k in ranges) + 2 >= len(names):
        return None
    sensors = {
        kind: tuple(names.index(axis) for axis in axes)
        for kind, axes in _SENSORS.items()
        if all(axis in names for axis in axes)
    }
    return _Columns(0, ranges, sensors, truth)


def _fields(line: str) -> list[str]:
    """Fields of a line, none of one that no table has."""
    if len(line) > _LONGEST_LINE:
        return []
    try:
        return [field.strip() for field in next(csv.reader([line]), [])]
    except csv.Error:
        return []


def _value(text: str) -> float:
    """A number, NaN for all else."""
    field = text.strip().encode("utf-8", "replace")
    return float(field) if is_number(field) else math.nan


def _series(times: list[float], values: list[list[float]]) -> Series:
    return Series(np.array(times), np.array(values)) if times else Series.empty(3)
