"""From the columns of a file, in file order, to a `Recording`: ranges, clock, order, repeats, scans.

Every reader yields `Piece` objects, bounded parts of its file with the line number of each record. `assemble`
joins them and applies the rules that are the same for all formats, each with a counter in the `ReadReport`:

* values that are not finite or outside what the sensor can say are dropped;
* the clock is mended (`wayfuse.formats.clock`): lone outliers dropped, a sustained jump back continued;
* a sensor's small disorder is sorted (stable); exact repeats of a Wi-Fi reading are dropped;
* Wi-Fi readings of one delivery time become one `WifiScan`.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from itertools import repeat

import numpy as np

from wayfuse.core.types import BoolArray
from wayfuse.formats._kernels import mark_repeats
from wayfuse.formats.clock import mend_clock
from wayfuse.formats.columns import Column, Piece, count_lines
from wayfuse.sensors.quality import ReadReport
from wayfuse.sensors.recording import Device, Recording, Series
from wayfuse.sensors.records import BleReading, Waypoint, WifiScan

__all__ = ["assemble"]

# What the first columns of a kind can say, (column count, lowest, highest); beyond it the record is dropped.
_RANGES: Mapping[str, tuple[int, float, float]] = {
    "acceleration": (3, -1e3, 1e3),  # m/s²: phones end at 160
    "rotation_rate": (3, -1e3, 1e3),  # rad/s: phones end at 35
    "magnetic_field": (3, -1e5, 1e5),  # µT: phones end at 5000
    "pressure": (1, 300.0, 1200.0),  # hPa: range of the sensors, 9 km up to a deep mine
    "orientation": (4, -1.001, 1.001),
    "wifi": (1, -127.0, 20.0),  # dBm
    "ble": (1, -127.0, 20.0),  # dBm
    "beacon": (1, -127.0, 20.0),  # dBm
}
_NORM = 1e-3  # a quaternion's squared length may differ so much from 1: seven printed digits, with room
_LATEST_S = 1e11  # s since 1970: the year 5138; beyond it the unit is mistaken
_HIGHEST_MHZ = 100_000.0  # the 60 GHz band ends below
_STALE_SPREAD_S = 1.0  # scans are delivered this evenly after their freshest reading


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
    foreign_last_seen: bool = False,
) -> Recording:
    """Join the pieces of a file into a recording and count in ``report`` what was dropped or mended.

    ``one_stream`` says that the line numbers order all records of the recording (one file), so that a jump of
    the clock holds for all kinds; otherwise each kind is judged by itself. ``foreign_last_seen`` says that
    the readings were stamped by another clock, which is then shifted onto the recording's.
    """
    columns, waypoints = _join(pieces)
    columns = {kind: _in_range(kind, column, report) for kind, column in columns.items()}
    columns, waypoints = mend_clock(columns, waypoints, report, one_stream=one_stream)
    wifi = _sorted("wifi", columns.get("wifi"), report)
    if foreign_last_seen:
        wifi = _on_own_clock(wifi, report)
    recording = Recording(
        name=name,
        acceleration=_series("acceleration", columns, report),
        rotation_rate=_series("rotation_rate", columns, report),
        magnetic_field=_series("magnetic_field", columns, report),
        pressure=_series("pressure", columns, report),
        orientation=_series("orientation", columns, report),
        wifi=_scans(_without_repeats(wifi, report)),
        ble=_ble(columns),
        waypoints=tuple(sorted((w for _, w in waypoints), key=lambda w: w.t)),
        site=site,
        floor=floor,
        clock=clock,
        device=device or Device(),
        path=report.path,
        report=report,
    )
    if recording.is_empty:
        report.add("no record in the recording", report.n_lines)
    return recording


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
    """Drop records whose values are not finite or out of range; unknown frequencies become 0."""
    k, low, high = _RANGES[kind]
    label = kind.replace("_", " ")
    if len(column.t) and not (column.t.min() >= 0.0 and column.t.max() <= _LATEST_S):
        timed = (column.t >= 0.0) & (column.t <= _LATEST_S)
        count_lines(report, f"{label}: time not finite or out of range", column.line[~timed])
        column = column.take(timed)
    values = column.values[:, :k]
    if len(values) and not (values.min() >= low and values.max() <= high):  # NaN fails both
        finite: BoolArray = np.all(np.isfinite(values), axis=1)
        inside: BoolArray = finite & ((values >= low) & (values <= high)).all(axis=1)
        count_lines(report, f"{label}: not finite", column.line[~finite])
        count_lines(report, f"{label}: out of range", column.line[finite & ~inside])
        column = column.take(inside)
    if kind == "orientation":
        unit = np.abs(np.einsum("ij,ij->i", column.values, column.values) - 1.0) <= _NORM
        if not unit.all():
            count_lines(report, f"{label}: no unit quaternion", column.line[~unit])
            column = column.take(unit)
    elif kind == "wifi":
        mhz = column.values[:, 1]
        if len(mhz) and not (mhz.min() >= 0.0 and mhz.max() <= _HIGHEST_MHZ):
            strange = ~((mhz >= 0.0) & (mhz <= _HIGHEST_MHZ))
            count_lines(report, "wifi: frequency out of range, taken as unknown", column.line[strange])
            values = column.values.copy()
            values[strange, 1] = 0.0
            column = column._replace(values=values)
    return column


def _sorted(kind: str, column: Column | None, report: ReadReport | None) -> Column:
    """A column in time order; records that came late are counted."""
    if column is None:
        return Column.empty(kind)
    t = column.t
    if len(t) < 2 or bool((t[1:] >= t[:-1]).all()):
        return column
    if report is not None:
        late = t < np.maximum.accumulate(t)
        count_lines(report, f"{kind.replace('_', ' ')}: out of time order, sorted", column.line[late])
    return column.take(np.argsort(t, kind="stable"))


def _series(kind: str, columns: Mapping[str, Column], report: ReadReport) -> Series:
    column = _sorted(kind, columns.get(kind), report)
    return Series(column.t, column.values)


def _without_repeats(column: Column, report: ReadReport) -> Column:
    n = len(column.t)
    if n < 2:
        return column
    table = np.full(1 << (2 * n - 1).bit_length(), -1, np.int64)
    repeat = np.empty(n, np.bool_)
    with np.errstate(over="ignore"):  # the hash wraps around, which only uncompiled code mentions
        mark_repeats(column.t, column.ids, column.values, table, repeat)
    if not repeat.any():
        return column
    count_lines(report, "wifi: exact repeat of a reading", column.line[repeat])
    return column.take(~repeat)


def _scans(column: Column) -> tuple[WifiScan, ...]:
    """One scan per delivery time; ``column`` in time order."""
    n = len(column.t)
    if not n:
        return ()
    rssi = column.values[:, 0].astype(np.float32)
    frequency = column.values[:, 1].astype(np.int32)
    last_seen = np.ascontiguousarray(column.values[:, 2])
    edges = (np.flatnonzero(column.t[1:] != column.t[:-1]) + 1).tolist()
    times, ids = column.t, column.ids
    return tuple(
        WifiScan(float(times[i]), ids[i:j], rssi[i:j], frequency[i:j], last_seen[i:j])
        for i, j in zip([0, *edges], [*edges, n], strict=True)
    )


def _on_own_clock(column: Column, report: ReadReport) -> Column:
    """Shift ``last_seen`` from the clock of the radio onto that of the recording.

    One shift serves the whole file, so that repeats of a reading keep one time: the freshest reading of the
    promptest scan was seen when that scan was delivered. Where the two clocks always agree the time was not
    recorded.
    """
    if not len(column.t):
        return column
    values = column.values.copy()
    seen = values[:, 2]
    starts = np.concatenate([[0], np.flatnonzero(np.diff(column.t)) + 1])
    delay = column.t[starts] - np.fmax.reduceat(seen, starts)
    delay = delay[np.isfinite(delay)]
    if not len(delay) or bool((column.t == seen).all()):
        seen[:] = np.nan
        return column._replace(values=values)
    prompt = delay[delay >= np.median(delay) - _STALE_SPREAD_S].min()
    values[:, 2] = seen + prompt
    late = values[:, 2] > column.t + 1e-6
    if late.any():
        count_lines(report, "wifi: last seen after delivery, taken as unknown", column.line[late])
        values[late, 2] = np.nan
    values[:, 2] = np.fmin(values[:, 2], column.t, where=~np.isnan(values[:, 2]), out=values[:, 2])
    return column._replace(values=values)


def _ble(columns: Mapping[str, Column]) -> tuple[BleReading, ...]:
    """Advertisements in time order; beacons also heard in ``ble`` only add their tx power there."""
    ble = columns.get("ble", Column.empty("ble"))
    beacon = columns.get("beacon")
    if beacon is not None and len(ble.t):
        power = dict(zip(beacon.ids.tolist(), beacon.values[:, 1].tolist(), strict=True))
        ids = ble.ids.tolist()
        values = ble.values.copy()
        values[:, 1] = list(map(power.get, ids, repeat(np.nan)))
        ble, heard = ble._replace(values=values), set(ids)
        beacon = None if heard.issuperset(power) else beacon.take(~np.isin(beacon.ids, ble.ids))
    if beacon is not None and len(beacon.t):
        ble = Column(*(np.concatenate(pair) for pair in zip(ble, beacon, strict=True)))
    column = _sorted("ble", ble, None)  # two paths deliver advertisements: their order is no fault
    rssi, power_dbm = column.values[:, 0].tolist(), column.values[:, 1].tolist()
    rows = zip(column.t.tolist(), column.ids.tolist(), rssi, power_dbm, strict=True)
    return tuple(map(tuple.__new__, repeat(BleReading), rows))  # as `_make` does, in compiled code alone
