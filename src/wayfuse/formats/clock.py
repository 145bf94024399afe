"""The clock of a file: lone outliers are dropped, a sustained jump back continues one sample later.

Phones set their clock while they record, and single lines carry a foreign time. Within one sensor a record is
*behind* when it lies more than a second before the latest time reached. If the next 20 records stay behind,
the clock was set back: an offset lets time continue; if fewer do, they are outliers. Likewise the few records
that ran ahead before the time fell back are the outliers, not the many after them. (Between sensors seconds
of disorder are normal: radio events are delivered late, a waypoint is stated after it was passed.)
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from wayfuse.core.types import Array, BoolArray
from wayfuse.formats.columns import Column, LineArray, count_lines
from wayfuse.sensors.quality import ReadReport
from wayfuse.sensors.records import Waypoint

__all__ = ["SUSTAINED", "mend_clock"]

SUSTAINED = 20  # records that make a jump of the clock out of what fewer make outliers
_BEHIND_S = 1.0  # disorder up to here is sorted
_ABSURD_GAP_S = 3600.0  # a recording that pauses longer is none
_FAR_S = 3600.0  # a waypoint so far from every other record has a foreign time

Waypoints = list[tuple[int, Waypoint]]


class _Mended(NamedTuple):
    """What became of a sequence of times: kept (n,), offset (n,) s, index and size (s) of each jump."""

    kept: BoolArray
    offset: Array
    jumps: list[tuple[int, float]]


def mend_clock(
    columns: Mapping[str, Column], waypoints: Waypoints, report: ReadReport, *, one_stream: bool
) -> tuple[dict[str, Column], Waypoints]:
    """Columns and waypoints on one clock that runs forward; what is dropped or shifted is counted."""
    out = dict(columns)
    if one_stream and out:
        main = max(out, key=lambda kind: (_is_series(kind), len(out[kind].t)))
        reference = out[main]
        mended = _mend(reference.t)
        if mended is not None:
            out[main] = _apply(reference, mended, report, main)
            if mended.jumps:
                follow = _Follow(reference, mended)
                out = {k: c if k == main else follow.column(k, c) for k, c in out.items()}
                waypoints = follow.waypoints(waypoints)
    for kind, column in out.items():
        later = _mend(column.t)
        if later is not None:
            out[kind] = _apply(column, later, report, kind)
    return out, _near(out, waypoints, report)


def _is_series(kind: str) -> bool:
    return kind not in {"wifi", "ble", "beacon"}


def _mend(t: Array) -> _Mended | None:
    """Outliers and jumps of a sequence in file order; None where it is as it should be."""
    if len(t) < 2:
        return None
    step = np.diff(t)
    if step.min() >= 0.0 and step.max() <= _ABSURD_GAP_S:
        return None
    if step.max() <= _ABSURD_GAP_S and bool((t >= np.maximum.accumulate(t) - _BEHIND_S).all()):
        return None
    sizes = step[(step > 0.0) & (step <= _BEHIND_S)]
    sample = float(np.median(sizes)) if len(sizes) else 0.0
    return _walk(t.tolist(), sample)


def _walk(t: list[float], sample: float) -> _Mended:
    """Judge the times one by one; only files with a fault come here.

    Equal times in a row (the readings of a scan) count once, so that one scan with a foreign time is one
    outlier.
    """
    n = len(t)
    kept, offset = np.ones(n, np.bool_), np.zeros(n)
    jumps: list[tuple[int, float]] = []
    shift, i = 0.0, 0
    path: list[tuple[int, float]] = []  # records so far that raised the latest time: index, mended time
    while i < n:
        v = t[i] + shift
        top = path[-1][1] if path else v
        if v >= top - _BEHIND_S and v <= top + _ABSURD_GAP_S:
            offset[i] = shift
            if not path or v > top:
                path.append((i, v))
            i += 1
            continue
        stop, length = _run(t, i, shift, top)
        if v > top:  # an absurd gap: the shorter side is foreign, two long sides are a pause
            if length < SUSTAINED and len(path) >= length:
                kept[i:stop] = False
                i = stop
            else:
                if len(path) < SUSTAINED:
                    kept[: path[-1][0] + 1] = False
                path.append((i, v))
                offset[i] = shift
                i += 1
            continue
        ahead = next((k for k, (_, w) in enumerate(reversed(path)) if w <= v + _BEHIND_S), len(path))
        if ahead < SUSTAINED and ahead < length:  # the few before are foreign
            for k, _ in path[len(path) - ahead :]:
                kept[k] = False
            del path[len(path) - ahead :]
        elif length >= SUSTAINED:
            shift += top + sample - v
            jumps.append((i, shift))
        else:
            kept[i:stop] = False
            i = stop
    return _Mended(kept, offset, jumps)


def _run(t: list[float], i: int, shift: float, top: float) -> tuple[int, int]:
    """End of the run from i that lies on the same side of ``top``, and its number of different times."""
    ahead = t[i] + shift > top
    j, length = i, 0
    while j < len(t) and length <= SUSTAINED:
        v = t[j] + shift
        if (v <= top + _ABSURD_GAP_S) if ahead else (v >= top - _BEHIND_S):
            break
        length += j == i or t[j] != t[j - 1]
        j += 1
    return j, length


def _apply(column: Column, mended: _Mended, report: ReadReport, kind: str) -> Column:
    label = kind.replace("_", " ")
    count_lines(report, f"{label}: clock outlier", column.line[~mended.kept])
    for i, _ in mended.jumps:
        report.add(f"{label}: clock set back, time continued", int(column.line[i]))
    return _shifted(column, mended.offset, kind).take(mended.kept)


def _shifted(column: Column, offset: Array, kind: str) -> Column:
    if not offset.any():
        return column
    values = column.values
    if kind == "wifi":  # last seen is on the same clock
        values = values.copy()
        values[:, 2] += offset
    return column._replace(t=column.t + offset, values=values)


class _Follow:
    """Gives the records of the other kinds the offset of the reference sensor, by line and by fit.

    Near a jump a record that was delivered late still carries the old clock: of the offsets the one is taken
    that brings it nearest to the reference's time at its line.
    """

    def __init__(self, reference: Column, mended: _Mended) -> None:
        self._line = reference.line[mended.kept]
        self._t = (reference.t + mended.offset)[mended.kept]
        self._offsets = np.array([0.0, *(size for _, size in mended.jumps)])

    def column(self, kind: str, column: Column) -> Column:
        """A column on the reference's clock."""
        return _shifted(column, self._offset(column.line, column.t), kind)

    def waypoints(self, waypoints: Waypoints) -> Waypoints:
        """Waypoints on the reference's clock."""
        line = np.array([n for n, _ in waypoints], np.int64)
        offset = self._offset(line, np.array([w.t for _, w in waypoints]))
        return [(n, w._replace(t=w.t + float(d))) for (n, w), d in zip(waypoints, offset, strict=True)]

    def _offset(self, line: LineArray, t: Array) -> Array:
        due = np.interp(line, self._line, self._t)
        fit = np.abs(t[:, None] + self._offsets - due[:, None])
        return np.asarray(self._offsets[np.argmin(fit, axis=1)])


def _near(columns: Mapping[str, Column], waypoints: Waypoints, report: ReadReport) -> Waypoints:
    """Waypoints whose time lies within an hour of the other records (all, where there are no others)."""
    ends = [(c.t.min(), c.t.max()) for c in columns.values() if len(c.t)]
    if not ends or not waypoints:
        return waypoints
    start, stop = min(e[0] for e in ends) - _FAR_S, max(e[1] for e in ends) + _FAR_S
    kept = [(n, w) for n, w in waypoints if start <= w.t <= stop]
    for n, w in waypoints:
        if not start <= w.t <= stop:
            report.add("waypoint: clock outlier", n)
    return kept
