"""The own envelope: raw samples or steps, scans and ranges of a phone, as `wire.Envelope`."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

import numpy as np

from wayfuse.core.types import IdArray
from wayfuse.formats.assembly import assemble
from wayfuse.formats.columns import Column, LineArray, Piece
from wayfuse.sensors.quality import ReadReport
from wayfuse.sensors.records import Range, Record, Step
from wayfuse.service.adapters.parts import digest_key, identifier, merged, notes_of
from wayfuse.service.message import Message, Part, Profile
from wayfuse.service.wire import Advertisement, Ap, Distance, Envelope, Scan, Stepped, check_count, decode

__all__ = ["Own"]

_SERIES = ("acceleration", "rotation_rate", "magnetic_field", "orientation", "pressure")
_FARTHEST_M = 1e5


class Own:
    """Adapter of the own envelope."""

    def read(self, body: bytes, profile: Profile, arrived: float) -> list[Message]:
        """One message per body."""
        envelope = decode(body, Envelope)
        check_count(_count(envelope))
        report = ReadReport()
        columns = _columns(envelope)
        sensed: Iterable[Record] = ()
        if columns:
            recording = assemble([Piece(columns)], report, name="", clock="", one_stream=False)
            sensed = recording.records()
        ranges = [_range(row) for row in envelope.ranges if _is_possible(row, report)]
        steps = [_step(row) for row in envelope.steps]
        records = merged(sensed, [*ranges, *steps])
        key = digest_key(body) if envelope.id is None else f"id {envelope.id}"
        return [
            Message(
                envelope.device,
                envelope.track or profile.track,
                body,
                (Part(key, records),),
                envelope.end,
                notes_of(report),
            )
        ]


def _count(e: Envelope) -> int:
    n = sum(len(getattr(e, kind)) for kind in _SERIES)
    return n + sum(len(scan.aps) for scan in e.wifi) + len(e.ble) + len(e.ranges) + len(e.steps)


def _columns(envelope: Envelope) -> dict[str, Column]:
    columns = {}
    for kind in _SERIES:
        rows: Sequence[tuple[float, ...]] = getattr(envelope, kind)
        if rows:
            values = np.array(rows, np.float64)
            columns[kind] = Column(_lines(len(rows)), values[:, 0], values[:, 1:], np.empty(0, np.uint64))
    if any(scan.aps for scan in envelope.wifi):
        columns["wifi"] = _wifi(envelope.wifi)
    if envelope.ble:
        columns["ble"] = _ble(envelope.ble)
    return columns


def _wifi(scans: Sequence[Scan]) -> Column:
    """Readings of all scans. Column by column: a scan has hundreds, and a phone sends one every other second."""
    aps: list[Ap] = [ap for scan in scans for ap in scan.aps]
    t = np.repeat([scan.t for scan in scans], [len(scan.aps) for scan in scans])
    values = np.empty((len(aps), 3))
    values[:, 0] = [ap.rssi for ap in aps]
    values[:, 1] = [ap.mhz for ap in aps]
    values[:, 2] = [_known(ap.seen) for ap in aps]
    return Column(_lines(len(aps)), t, values, _identifiers([ap.bssid for ap in aps]))


def _ble(heard: Sequence[Advertisement]) -> Column:
    t = np.array([h.t for h in heard], np.float64)
    values = np.array([(h.rssi, _known(h.tx_power)) for h in heard], np.float64)
    return Column(_lines(len(heard)), t, values, _identifiers([h.id for h in heard]))


def _lines(n: int) -> LineArray:
    return np.arange(1, n + 1)


def _identifiers(texts: Iterable[str]) -> IdArray:
    return np.array(list(map(identifier, texts)), np.uint64)


def _known(value: float | None) -> float:
    return math.nan if value is None else value


def _step(row: Stepped) -> Record:
    return Step(row.t, _known(row.length), row.heading)


def _range(row: Distance) -> Record:
    return Range(row.t, identifier(row.anchor), row.distance, _known(row.sigma), _known(row.rssi))


def _is_possible(row: Distance, report: ReadReport) -> bool:
    sound = (
        math.isfinite(row.t)
        and 0.0 <= row.distance <= _FARTHEST_M
        and (row.sigma is None or 0.0 < row.sigma <= _FARTHEST_M)
    )
    if not sound:
        report.add("range: out of range", 0)
    return sound
