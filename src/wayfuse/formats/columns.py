"""What a reader yields: columns of records in file order, and how to build them record by record."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayfuse.core.types import Array, BoolArray, IdArray
from wayfuse.sensors.quality import ReadReport
from wayfuse.sensors.records import Waypoint

__all__ = ["WIDTHS", "Column", "LineArray", "Piece", "Rows", "count_lines", "is_number", "quaternions"]

WIDTHS: Mapping[str, int] = {
    "acceleration": 3,
    "rotation_rate": 3,
    "magnetic_field": 3,
    "pressure": 1,
    "orientation": 4,
    "wifi": 3,  # rssi (dBm), frequency (MHz, 0 unknown), last seen (s, NaN unknown)
    "ble": 2,  # rssi (dBm), tx power (dBm, NaN unknown)
    "beacon": 2,  # as ble, from a second record of the same advertisements
    "linear": 3,  # acceleration without gravity, m/s², and
    "gravity": 3,  # gravity apart, until a reader joins them
}

LineArray = NDArray[np.int64]

_NUMBER = re.compile(rb"-?\d+(\.\d*)?([eE][+-]?\d+)?|-?\.\d+([eE][+-]?\d+)?")
_NOT_FINITE = {b"nan", b"inf", b"infinity"}


def is_number(text: bytes) -> bool:
    """Whether a field is a decimal number, or one of the words for NaN and infinity (judged later)."""
    return _NUMBER.fullmatch(text) is not None or text.lower().lstrip(b"+-") in _NOT_FINITE


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
    """A part of a file: columns by kind (`WIDTHS`), waypoints with their lines, header fields met in it."""

    columns: dict[str, Column] = field(default_factory=dict)
    waypoints: list[tuple[int, Waypoint]] = field(default_factory=list)
    header: dict[str, str] = field(default_factory=dict)


class Rows:
    """Builds the columns of a piece record by record (the careful path of the readers)."""

    def __init__(self) -> None:
        self._rows: dict[str, tuple[list[int], list[float], list[tuple[float, ...]], list[int]]] = {}
        self.waypoints: list[tuple[int, Waypoint]] = []

    def add(
        self, kind: str, line: int, t: float, values: tuple[float, ...], identifier: int | None = None
    ) -> None:
        """Append one record."""
        rows = self._rows.get(kind)
        if rows is None:
            rows = self._rows[kind] = ([], [], [], [])
        rows[0].append(line)
        rows[1].append(t)
        rows[2].append(values)
        if identifier is not None:
            rows[3].append(identifier)

    def columns(self) -> dict[str, Column]:
        """The columns built so far."""
        return {
            kind: Column(
                np.array(line, np.int64),
                np.array(t, np.float64),
                np.array(values, np.float64).reshape(len(t), WIDTHS[kind]),
                np.array(ids, np.uint64),
            )
            for kind, (line, t, values, ids) in self._rows.items()
        }


def quaternions(xyz: Array) -> Array:
    """(n, 4) unit quaternions (w, x, y, z), w >= 0, of rotation vectors (n, 3) that hold their last three
    parts.

    A vector longer than 1 by rounding gets w = 0; one that is no part of a unit quaternion keeps its length,
    so that the norm shows it.
    """
    x, y, z = xyz[:, 0], xyz[:, 1], xyz[:, 2]
    out = np.empty((len(xyz), 4))
    out[:, 0] = np.sqrt(np.maximum(0.0, 1.0 - x * x - y * y - z * z))
    out[:, 1:] = xyz
    return out


def count_lines(report: ReadReport, kind: str, lines: LineArray) -> None:
    """Count a fault at each of the lines (n,)."""
    for line in lines[:5].tolist():
        report.add(kind, line)
    if len(lines) > 5:
        report.issues[kind].count += len(lines) - 5
