"""Damage for scenario tests: recordings, record streams and files as bad days deliver them.

Faults of content take a `Recording` and return another; faults of order and clock take records one by one,
for a `Recording` keeps its columns in order; faults of a file take its text. Nothing changes in place.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace

import numpy as np

from wayfuse.core.types import Array
from wayfuse.sensors.recording import Recording, Series
from wayfuse.sensors.records import Record, WifiScan

__all__ = [
    "clock_jump",
    "duplicated",
    "garbled_text",
    "gyro_spike",
    "joined_lines",
    "late_records",
    "pressure_step",
    "text_clock_jump",
    "truncated_text",
    "unknown_access_points",
    "with_not_finite",
    "without_imu",
    "without_pressure",
    "without_wifi",
]

_HPA_PER_M = 0.12  # of air near the ground


def without_wifi(recording: Recording, after: float = -np.inf, until: float = np.inf) -> Recording:
    """No Wi-Fi scan with after < t <= until (s, the recording's clock)."""
    return replace(recording, wifi=tuple(scan for scan in recording.wifi if not after < scan.t <= until))


def without_imu(recording: Recording, after: float = -np.inf, until: float = np.inf) -> Recording:
    """No motion sensor's record with after < t <= until (s)."""

    def cut(series: Series) -> Series:
        keep = ~((series.t > after) & (series.t <= until))
        return Series(series.t[keep], series.values[keep])

    return replace(
        recording,
        acceleration=cut(recording.acceleration),
        rotation_rate=cut(recording.rotation_rate),
        magnetic_field=cut(recording.magnetic_field),
        orientation=cut(recording.orientation),
    )


def without_pressure(recording: Recording) -> Recording:
    """A phone that has no barometer."""
    return replace(recording, pressure=Series.empty(1))


def pressure_step(recording: Recording, at: float, metres: float) -> Recording:
    """From ``at`` (s) on the pressure is that of a place ``metres`` higher: a door opens and stays open."""
    series = recording.pressure
    later = (series.t >= at)[:, None]
    return replace(
        recording,
        pressure=Series(series.t, np.where(later, series.values - _HPA_PER_M * metres, series.values)),
    )


def gyro_spike(recording: Recording, at: float, duration: float = 0.1, rate: float = 30.0) -> Recording:
    """The gyroscope reads ``rate`` rad/s on all axes for ``duration`` s from ``at`` (s) on."""
    series = recording.rotation_rate
    hit = (series.t >= at) & (series.t < at + duration)
    return replace(recording, rotation_rate=Series(series.t, np.where(hit[:, None], rate, series.values)))


def with_not_finite(recording: Recording, every: int, value: float = np.nan) -> Recording:
    """Every ``every``-th inertial sample, and one reading per scan, is ``value``: NaN or infinite."""

    def spoil(series: Series) -> Series:
        values: Array = series.values.copy()
        values[::every] = value
        return Series(series.t, values)

    def spoil_scan(scan: WifiScan) -> WifiScan:
        rssi = scan.rssi.copy()
        rssi[:1] = value
        return replace(scan, rssi=rssi)

    return replace(
        recording,
        acceleration=spoil(recording.acceleration),
        rotation_rate=spoil(recording.rotation_rate),
        orientation=spoil(recording.orientation),
        wifi=tuple(spoil_scan(scan) for scan in recording.wifi),
    )


def unknown_access_points(recording: Recording, rng: np.random.Generator, share: float = 1.0) -> Recording:
    """A share of the networks is exchanged for ones no survey knows: the house has bought new ones."""
    known = np.unique(np.concatenate([scan.bssid for scan in recording.wifi] or [np.empty(0, np.uint64)]))
    fresh = np.where(rng.random(len(known)) < share, known ^ np.uint64(0xF0_00_00_00_00_00), known)

    def exchange(scan: WifiScan) -> WifiScan:
        return replace(scan, bssid=fresh[np.searchsorted(known, scan.bssid)])

    return replace(recording, wifi=tuple(exchange(scan) for scan in recording.wifi))


def clock_jump(records: Iterable[Record], at: float, seconds: float) -> Iterator[Record]:
    """From the first record at or after ``at`` (s) on, the clock is ``seconds`` ahead, negative: back."""
    jumped = False
    for record in records:
        jumped = jumped or record.t >= at
        yield _moved(record, seconds) if jumped else record


def late_records(
    records: Iterable[Record],
    delay: float,
    which: Callable[[Record], bool] = lambda r: isinstance(r, WifiScan),
) -> Iterator[Record]:
    """Chosen records (Wi-Fi scans unless told otherwise) arrive ``delay`` s late, their times unchanged."""
    waiting: list[Record] = []
    for record in records:
        while waiting and waiting[0].t + delay <= record.t:
            yield waiting.pop(0)
        if which(record):
            waiting.append(record)
        else:
            yield record
    yield from waiting


def duplicated(records: Iterable[Record], every: int) -> Iterator[Record]:
    """Every ``every``-th record arrives twice."""
    for i, record in enumerate(records):
        yield record
        if i % every == 0:
            yield record


def truncated_text(text: str, share: float) -> str:
    """The first ``share`` of a file, cut in the middle of a line: a full disk."""
    end = int(share * len(text))
    if end and text[end - 1] == "\n":
        end -= 3
    return text[:end]


def garbled_text(text: str, rng: np.random.Generator, share: float) -> str:
    """A share of the record lines loses its last fields or has letters for a number; the header stays."""
    out = []
    mark, between = _layout(text)
    for line in text.splitlines():
        broken = line
        if not line.startswith(mark) and rng.random() < share:
            fields = line.split(between)
            broken = between.join(
                fields[:-2] if rng.random() < 0.5 else [*fields[:2], "x1.2", *fields[3:-1], "no"]
            )
        out.append(broken)
    return "\n".join(out) + "\n"


def joined_lines(text: str, every: int) -> str:
    """Every ``every``-th line end between two records is missing, as in some of the public files."""
    lines = text.splitlines()
    out: list[str] = []
    mark, _ = _layout(text)
    for i, line in enumerate(lines):
        join = i % every == every - 1 and not line.startswith(mark) and not lines[i - 1].startswith(mark)
        if join and out:
            out[-1] += line
        else:
            out.append(line)
    return "\n".join(out) + "\n"


def text_clock_jump(text: str, share: float, ms: int) -> str:
    """After a share of the lines, every record's time is ``ms`` milliseconds ahead, negative: back."""
    lines = text.splitlines()
    mark, between = _layout(text)
    for i in range(int(share * len(lines)), len(lines)):
        if lines[i].startswith(mark):
            continue
        if between == ";":  # kind; time in s; ...
            kind, time, rest = lines[i].split(";", 2)
            lines[i] = f"{kind};{float(time) + ms / 1000:.4f};{rest}"
        else:
            time, tab, rest = lines[i].partition("\t")
            lines[i] = f"{int(time) + ms}{tab}{rest}"
    return "\n".join(lines) + "\n"


def _layout(text: str) -> tuple[str, str]:
    """How a file marks its header lines, and what is between fields: ms-indoor text, or GetSensorData log."""
    return ("%", ";") if text.startswith("%") else ("#", "\t")


def _moved(record: Record, seconds: float) -> Record:
    if isinstance(record, WifiScan):
        return replace(record, t=record.t + seconds, last_seen=record.last_seen + seconds)
    if isinstance(record, tuple):
        return record._replace(t=record.t + seconds)
    return replace(record, t=record.t + seconds)
