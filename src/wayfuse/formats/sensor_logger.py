"""Reader of Sensor Logger recordings: CSV folder or ZIP, JSON export; Android and iOS conventions.

Columns are read by the names in the header, for their order is unusual and changes. On iOS, unless
"Standardise Units & Frames" was on, acceleration and gravity have the opposite sign and the reference frame
of the orientation has x to the north; a file that does not name its platform is refused, for the sign cannot
be told from the data of a turning phone. ``TotalAcceleration`` (Android) is the specific force; elsewhere it
is ``Accelerometer`` + ``Gravity``. There is no scan identifier: Wi-Fi rows within half a second are one scan,
delivered at the last of them.

The app's documents define yaw, not the quaternion. The quaternion is therefore checked against gravity and
the magnetometer, and an orientation that contradicts them is left out and counted.

References
----------
.. [1] Sensor Logger: UNITS.md, COORDINATES.md, CROSSPLATFORM.md, github.com/tszheichoi/awesome-sensor-logger.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np

from wayfuse.core.errors import FormatError, UsageError
from wayfuse.core.types import Array
from wayfuse.formats.assembly import assemble
from wayfuse.formats.columns import Column, Piece, Rows, count_lines, is_number
from wayfuse.formats.sensor_logger_tables import Batch, batches, is_recording
from wayfuse.sensors.quality import ReadReport
from wayfuse.sensors.recording import Device, Recording
from wayfuse.sensors.records import bssid_id

__all__ = ["PLATFORMS", "blocks", "read", "recording_of"]

PLATFORMS = ("android", "ios")
SCAN_GAP_S = 0.5  # rows of one scan come within milliseconds, scans every few seconds
_GRAVITY_GAP_S = (
    0.1  # Accelerometer and Gravity are sampled together; further apart they do not belong together
)
_AGREES = math.cos(
    math.radians(60.0)
)  # iron in a building turns the magnetic north by tens of degrees, not by 90

_SENSORS: Mapping[str, tuple[str, tuple[str, ...]]] = {
    "totalacceleration": ("acceleration", ("x", "y", "z")),
    "accelerometer": ("linear", ("x", "y", "z")),
    "gravity": ("gravity", ("x", "y", "z")),
    "gyroscope": ("rotation_rate", ("x", "y", "z")),
    "magnetometer": ("magnetic_field", ("x", "y", "z")),
    "barometer": ("pressure", ("pressure",)),
    "orientation": ("orientation", ("qw", "qx", "qy", "qz")),
    "wifi": ("wifi", ("level", "frequency", "bssid")),
    "bluetooth": ("ble", ("rssi", "id")),
}
_OPTIONAL = {"wifi": "frequency", "bluetooth": "txpowerlevel"}


class _Profile(NamedTuple):
    """Conventions of a recording: the platform, and whether the app converted to those of Android."""

    platform: str
    standardised: bool


def read(path: str | Path, *, platform: str | None = None) -> Recording:
    """Read a folder, ZIP or JSON export.

    Parameters
    ----------
    path : the folder of CSV files, the ZIP of it, or the JSON file.
    platform : ``"android"`` or ``"ios"``; needed only where the recording does not say.

    Raises
    ------
    FormatError : nothing of this format is there, or the platform is neither recorded nor given.
    UsageError : ``platform`` is no such word, or contradicts the recording.
    """
    path = Path(path)
    if not is_recording(path):
        raise FormatError("neither a CSV folder, a ZIP nor a JSON export of Sensor Logger", where=path)
    report = ReadReport(path=str(path))
    pieces = list(blocks(path, report=report))
    metadata: dict[str, str] = {}
    for piece in pieces:
        metadata |= piece.header
    profile = _profile(metadata, platform, path)
    system = f"{profile.platform} {metadata.get('platform version', '')}".strip()
    return recording_of(
        _join(pieces),
        report,
        platform=profile.platform,
        standardised=profile.standardised,
        name=path.stem if path.is_file() else path.name,
        device=Device("", metadata.get("device name", ""), system),
    )


def recording_of(
    columns: Mapping[str, Column],
    report: ReadReport,
    *,
    platform: str,
    standardised: bool,
    name: str,
    device: Device | None = None,
) -> Recording:
    """The records of columns in the app's own conventions (kinds of `blocks`), also of a part of a recording.

    platform, standardised : whose conventions, and whether the app converted to those of Android.
    """
    columns = dict(columns)
    _physical(columns, _Profile(platform, standardised), report)
    return assemble([Piece(columns)], report, name=name, clock="Unix time", device=device, one_stream=False)


def blocks(path: str | Path, *, report: ReadReport | None = None) -> Iterator[Piece]:
    """Pieces of a recording in its own conventions; ``linear`` and ``gravity`` are still apart."""
    report = ReadReport(path=str(path)) if report is None else report
    for batch in batches(Path(path), report):
        name = batch.sensor.lower()
        if name == "metadata":
            yield Piece(header=dict(zip(batch.columns, batch.rows[0], strict=True)) if batch.rows else {})
        elif name in _SENSORS:
            yield _piece(name, batch, report)
        else:  # other sensors, annotations, pictures
            _count(report, batch.sensor, len(batch.rows))


def _piece(name: str, batch: Batch, report: ReadReport) -> Piece:
    kind, wanted = _SENSORS[name]
    optional = _OPTIONAL.get(name, "")
    missing = [c for c in ("time", *wanted) if c not in batch.columns and c != optional]
    if missing:
        if batch.rows:
            report.add(f"{batch.sensor}: no column {', '.join(missing)}", batch.lines[0], len(batch.rows))
        return Piece()
    columns = {} if kind in {"wifi", "ble"} else _plain_columns(kind, wanted, batch)
    if not columns:
        columns = _careful_columns(name, batch, report)
    _count(report, batch.sensor, len(columns[kind].t) if kind in columns else 0)
    return Piece(columns)


def _plain_columns(kind: str, wanted: tuple[str, ...], batch: Batch) -> dict[str, Column]:
    """Columns of a motion sensor whose fields are all numbers; nothing where one of them is not."""
    if not batch.rows:
        return {}
    fields = dict(zip(batch.columns, zip(*batch.rows, strict=True), strict=True))
    try:
        t = np.array([int(text) / 1e9 for text in fields["time"]])
        values = np.column_stack([np.array([float(text) for text in fields[c]]) for c in wanted])
    except ValueError:
        return {}
    return {kind: Column(np.array(batch.lines, np.int64), t, values, np.empty(0, np.uint64))}


def _careful_columns(name: str, batch: Batch, report: ReadReport) -> dict[str, Column]:
    """Columns of any sensor, row by row; a row with a fault is counted."""
    kind, wanted = _SENSORS[name]
    optional = _OPTIONAL.get(name, "")
    place = {c: k for k, c in enumerate(batch.columns)}
    time, rows = place["time"], Rows()
    for line, row in zip(batch.lines, batch.rows, strict=True):
        try:
            t = _seconds(row[time])
            if kind == "wifi":
                mhz = float(row[place["frequency"]] or 0) if "frequency" in place else 0.0
                values: tuple[float, ...] = (_number(row[place["level"]]), mhz, math.nan)
                identifier = _identifier(row[place["bssid"]])
            elif kind == "ble":
                power = row[place[optional]] if optional in place else ""
                values = (_number(row[place["rssi"]]), _number(power) if power else math.nan)
                identifier = _identifier(row[place["id"]])
            else:
                values, identifier = tuple(_number(row[place[c]]) for c in wanted), None
        except ValueError:
            report.add(f"{batch.sensor}: not a number where one is due", line)
            continue
        rows.add(kind, line, t, values, identifier)
    return rows.columns()


def _seconds(text: str) -> float:
    """Unix time in s of nanoseconds; whole numbers keep every digit that a float64 of seconds can hold."""
    return int(text) / 1e9 if text.isdecimal() else _number(text) / 1e9


def _number(text: str) -> float:
    if not is_number(text.strip().encode()):
        raise ValueError(text)
    return float(text)


def _identifier(text: str) -> int:
    if not text.strip():
        raise ValueError("empty identifier")
    return bssid_id(text.strip())


def _count(report: ReadReport, sensor: str, n: int) -> None:
    if n:
        report.n_records[sensor] = report.n_records.get(sensor, 0) + n


def _profile(metadata: Mapping[str, str], platform: str | None, path: Path) -> _Profile:
    """Platform of the recording, else of the caller; never a guess."""
    given = platform.lower() if platform else ""
    if given and given not in PLATFORMS:
        raise UsageError(
            f"unknown platform {platform!r}", where="platform", remedy=f"use {' or '.join(PLATFORMS)}"
        )
    recorded = metadata.get("platform", "").strip().lower()
    if recorded not in PLATFORMS:
        recorded = ""
    if given and recorded and given != recorded:
        raise UsageError(
            f"the recording says {recorded}, the option {given}", where=path, remedy="drop the option"
        )
    if not (recorded or given):
        raise FormatError(
            "the recording does not say whether it is from Android or iOS, whose axes differ in sign",
            where=path,
            remedy="give --platform android or --platform ios",
        )
    standardised = metadata.get("standardisation", "").strip().lower() in {"true", "1", "yes", "on"}
    return _Profile(recorded or given, standardised)


def _join(pieces: list[Piece]) -> dict[str, Column]:
    parts: dict[str, list[Column]] = {}
    for piece in pieces:
        for kind, column in piece.columns.items():
            parts.setdefault(kind, []).append(column)
    return {
        kind: Column(*(np.concatenate(arrays) for arrays in zip(*columns, strict=True)))
        for kind, columns in parts.items()
    }


def _physical(columns: dict[str, Column], profile: _Profile, report: ReadReport) -> None:
    """Bring the columns to the conventions of the records, in place."""
    linear, gravity = columns.pop("linear", None), columns.pop("gravity", None)
    if "acceleration" not in columns and linear is not None:
        if gravity is None:
            count_lines(report, "Accelerometer: no Gravity to go with it, not used", linear.line)
        else:
            columns["acceleration"] = _with_gravity(linear, gravity, report)
    apple = profile.platform == "ios" and not profile.standardised
    if apple and "acceleration" in columns:
        c = columns["acceleration"]
        columns["acceleration"] = c._replace(values=-c.values)
    if apple and "orientation" in columns:
        c = columns["orientation"]
        columns["orientation"] = c._replace(values=_from_north_west_up(c.values))
    if "wifi" in columns:
        columns["wifi"] = _grouped(columns["wifi"])
    _check_orientation(columns, report)


def _with_gravity(linear: Column, gravity: Column, report: ReadReport) -> Column:
    """Specific force: linear acceleration plus the gravity of the same moment."""
    order = np.argsort(gravity.t, kind="stable")
    t = gravity.t[order]
    near = np.clip(np.searchsorted(t, linear.t), 1, max(len(t) - 1, 1))
    gap = np.minimum(np.abs(t[near - 1] - linear.t), np.abs(t[np.minimum(near, len(t) - 1)] - linear.t))
    together = gap <= _GRAVITY_GAP_S
    count_lines(report, "Accelerometer: no Gravity at its time, not used", linear.line[~together])
    g = np.column_stack([np.interp(linear.t, t, gravity.values[order, k]) for k in range(3)])
    return linear._replace(values=linear.values + g).take(together)


def _from_north_west_up(q: Array) -> Array:
    """Quaternions into east-north-up of those into north-west-up: a quarter turn about up from the left."""
    w, x, y, z = q.T
    return np.column_stack([w - z, x - y, x + y, w + z]) * math.sqrt(0.5)


def _grouped(column: Column) -> Column:
    """One delivery time for the rows of a scan: that of its last row."""
    order = np.argsort(column.t, kind="stable")
    t = column.t[order].copy()
    stops = np.append(np.flatnonzero(np.diff(t) > SCAN_GAP_S) + 1, len(t))
    start = 0
    for stop in stops.tolist():
        t[start:stop] = t[stop - 1]
        start = stop
    delivered = np.empty_like(t)
    delivered[order] = t
    return column._replace(t=delivered)


def _check_orientation(columns: dict[str, Column], report: ReadReport) -> None:
    """Leave the orientation out where its up or its north contradicts the other sensors ."""
    q = columns.get("orientation")
    if q is None or not len(q.t):
        return
    w, x, y, z = q.values.T
    up = np.column_stack([2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)])
    north = np.column_stack([2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)])
    east = np.cross(north, up)
    force, field = _at(columns.get("acceleration"), q.t), _at(columns.get("magnetic_field"), q.t)
    fault = ""
    if force is not None:
        along = np.einsum("ij,ij->i", up, force).mean()
        if along < _AGREES * np.linalg.norm(force, axis=1).mean():
            fault = "Orientation: its up contradicts gravity, not used"
    if not fault and field is not None:
        n, e = np.einsum("ij,ij->i", north, field).mean(), np.einsum("ij,ij->i", east, field).mean()
        if n < _AGREES * math.hypot(n, e):
            fault = "Orientation: its north contradicts the magnetometer, not used"
    if fault:
        count_lines(report, fault, q.line)
        del columns["orientation"]


def _at(column: Column | None, t: Array) -> Array | None:
    """A sensor's values at times of another, None where it has no samples."""
    if column is None or not len(column.t):
        return None
    order = np.argsort(column.t, kind="stable")
    return np.column_stack([np.interp(t, column.t[order], column.values[order, k]) for k in range(3)])
