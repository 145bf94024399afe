"""The own envelope: raw samples or steps, scans and ranges of a phone, as `wire.Envelope`."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from wayfuse.formats.assembly import assemble
from wayfuse.formats.columns import Column, Piece, Rows
from wayfuse.sensors.quality import ReadReport
from wayfuse.sensors.records import Range, Record, Step
from wayfuse.service.adapters.parts import digest_key, identifier, merged, notes_of
from wayfuse.service.message import Message, Part, Profile
from wayfuse.service.wire import Distance, Envelope, Stepped, check_count, decode

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
        recording = assemble([Piece(_columns(envelope))], report, name="", clock="", one_stream=False)
        ranges = [_range(row) for row in envelope.ranges if _is_possible(row, report)]
        steps = [_step(row) for row in envelope.steps]
        records = merged(recording.records(), [*ranges, *steps])
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
            line = np.arange(1, len(rows) + 1)
            columns[kind] = Column(line, values[:, 0], values[:, 1:], np.empty(0, np.uint64))
    rows_of = Rows()
    n = 0
    for scan in envelope.wifi:
        for ap in scan.aps:
            n += 1
            seen = math.nan if ap.seen is None else ap.seen
            rows_of.add("wifi", n, scan.t, (ap.rssi, ap.mhz, seen), identifier(ap.bssid))
    for n, heard in enumerate(envelope.ble, 1):
        power = math.nan if heard.tx_power is None else heard.tx_power
        rows_of.add("ble", n, heard.t, (heard.rssi, power), identifier(heard.id))
    return columns | rows_of.columns()


def _step(row: Stepped) -> Record:
    return Step(row.t, math.nan if row.length is None else row.length, row.heading)


def _range(row: Distance) -> Record:
    sigma = math.nan if row.sigma is None else row.sigma
    rssi = math.nan if row.rssi is None else row.rssi
    return Range(row.t, identifier(row.anchor), row.distance, sigma, rssi)


def _is_possible(row: Distance, report: ReadReport) -> bool:
    sound = (
        math.isfinite(row.t)
        and 0.0 <= row.distance <= _FARTHEST_M
        and (row.sigma is None or 0.0 < row.sigma <= _FARTHEST_M)
    )
    if not sound:
        report.add("range: out of range", 0)
    return sound
