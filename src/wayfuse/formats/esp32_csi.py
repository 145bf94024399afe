r"""Reader of the serial logs of ESP32 cards: lines ``CSI_DATA,...``, one packet each.

Three layouts are read: 26 columns of the ESP32 CSI Tool [1]_ (the type comes first, then the role), 25 of Espressif's
csi_recv, and 15 of its form for the C5 and C6 (with a sequence number, gains of FFT and AGC). A header line, where
there is one, names the columns; else their number tells the layout. The last column holds, between brackets, the parts
of the channel state, imaginary first, separated by blanks or commas.

The clock is the card's (us, 32 bits, wraps undone), at which the packet was received; the log has no other. A line that
repeats the packet before it (same transmitter, time and channel state) is left out and counted. Frames are (1, 1, n),
with n as the card delivers them: 64 first, in the order of a Fourier transform, are those of the legacy training
field. Channel state is in the card's own units; the gain is recorded by the C5 and C6 only.

References
----------
.. [1] S. M. Hernandez, E. Bulut, Lightweight and standalone IoT based WiFi sensing for active repositioning and
   mobility, WoWMoM 2020.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayfuse.core.errors import FormatError
from wayfuse.formats.bounded import read_bounded
from wayfuse.formats.card_clock import CardClock
from wayfuse.formats.columns import is_number
from wayfuse.formats.nexmon import Packet
from wayfuse.sensors.quality import ReadReport
from wayfuse.sensors.recording import Recording
from wayfuse.sensors.records import CsiFrame, bssid_id

__all__ = ["is_log", "read", "read_packets"]

_MARK = b"CSI_DATA,"
_LAYOUTS: Mapping[int, tuple[bytes, ...]] = {  # number of columns: their names, as far as they are used
    26: (b"type", b"role", b"mac", b"rssi", *[b""] * 10, b"noise_floor", *[b""] * 3, b"local_timestamp", *[b""] * 7),
    25: (b"type", b"seq", b"mac", b"rssi", *[b""] * 10, b"noise_floor", *[b""] * 3, b"local_timestamp", *[b""] * 6),
    15: (b"type", b"seq", b"mac", b"rssi", b"rate", b"noise_floor", b"fft_gain", b"agc_gain", b"",
         b"local_timestamp", *[b""] * 5),
}  # fmt: skip
_ADDRESS = re.compile(rb"[0-9A-Fa-f]{2}(?::[0-9A-Fa-f]{2}){5}")
_NEEDED = (b"mac", b"rssi", b"local_timestamp")
_LONGEST_LINE = 1 << 16  # bytes; 612 numbers of 4 characters and a blank are the most a card delivers
_MOST_BYTES = 1 << 30
_WRAP = 1 << 32  # µs
_RSSI = (-128.0, 0.0)  # dBm


class _Line(NamedTuple):
    mac: int
    sequence: int
    stamp: int
    rssi: float
    agc: float
    noise: float
    csi: NDArray[np.complex64]


def is_log(head: bytes) -> bool:
    """Whether the first bytes of a file are such a log."""
    return head.startswith(_MARK) or b"\n" + _MARK in head


def read(path: str | Path, *, anchor: int = 0) -> Recording:
    """Read a log: a recording with `CsiFrame` only, in the order of their times.

    Parameters
    ----------
    path : the file. anchor : identifier of the card that the log is of.

    Raises
    ------
    DataMissingError : there is no such file. FormatError : it is too large, or has no packet.
    """
    packets, report = read_packets(path, anchor=anchor)
    frames = sorted((packet.frame for packet in packets), key=lambda frame: frame.t)
    return Recording(Path(path).stem, csi=tuple(frames), clock="network card", path=str(path), report=report)


def read_packets(path: str | Path, *, anchor: int = 0) -> tuple[list[Packet], ReadReport]:
    """The packets of a log in file order, with transmitters and (C5, C6) sequence numbers, and what was wrong.

    Raises
    ------
    DataMissingError, FormatError : as `read`.
    """
    path = Path(path)
    report = ReadReport(path=str(path))
    packets: list[Packet] = []
    before: _Line | None = None
    clock, layout = CardClock(), None
    for number, raw in enumerate(read_bounded(path, _MOST_BYTES).split(b"\n"), 1):
        text = raw.strip()
        report.n_lines += bool(text)
        if text.startswith(b"type,"):
            layout = tuple(text.split(b","))
        if not text.startswith(_MARK):
            continue
        line = _parsed(text, layout)
        if isinstance(line, str):
            report.add(line, number)
            continue
        if before is not None and _is_repeated(before, line):
            report.add("a line that repeats the packet before", number)
            continue
        if before is not None and 0 < before.stamp - line.stamp < _WRAP // 2:
            report.add("a clock that steps back", number)
        before = line
        frame = CsiFrame(clock.seconds(line.stamp), anchor, line.csi, line.rssi, line.agc, line.noise)
        packets.append(Packet(line.mac, line.sequence, frame))
    if not packets:
        raise FormatError("no line of channel state", where=path, remedy="give a log with CSI_DATA lines")
    report.n_records["CSI"] = len(packets)
    return packets, report


def _parsed(text: bytes, layout: tuple[bytes, ...] | None) -> _Line | str:
    """A line, or what is wrong with it."""
    if len(text) > _LONGEST_LINE:
        return "a line longer than a card writes"
    head, bracket, rest = text.partition(b"[")
    fields = [*head.rstrip(b'"').rstrip(b",").split(b","), b""]  # the channel state is the last column
    names = _LAYOUTS.get(len(fields)) if layout is None else layout
    if not bracket or names is None or len(names) != len(fields) or not set(_NEEDED) <= set(names):
        return f"CSI_DATA: {len(fields)} columns of none of the layouts"
    values = dict(zip(names, fields, strict=True))
    csi = _channel(rest)
    if csi is None:
        return "CSI_DATA: channel state that is no list of pairs of signed bytes"
    if not _ADDRESS.fullmatch(values[b"mac"]):
        return "CSI_DATA: a transmitter that is no address"
    stamp, rssi = values[b"local_timestamp"], _number(values[b"rssi"])
    if not (stamp.isdigit() and len(stamp) <= 10 and int(stamp) < _WRAP) or rssi is None:
        return "CSI_DATA: a time or strength that is no number"
    if not _RSSI[0] <= rssi <= _RSSI[1]:
        return "CSI_DATA: a strength out of range"
    sequence = values.get(b"seq", b"")
    unknown = float("nan")
    agc, noise = _number(values.get(b"agc_gain", b"")), _number(values.get(b"noise_floor", b""))
    return _Line(
        bssid_id(values[b"mac"].decode("ascii")),
        int(sequence) if sequence.isdigit() and len(sequence) < 10 else -1,
        int(stamp), rssi, unknown if agc is None else agc, unknown if noise is None else noise, csi,
    )  # fmt: skip


def _number(text: bytes) -> float | None:
    value = float(text) if is_number(text) else float("nan")
    return value if np.isfinite(value) else None


def _channel(rest: bytes) -> NDArray[np.complex64] | None:
    """Channel state (1, 1, n) of what follows the bracket; None where it is not whole."""
    inside, bracket, _ = rest.partition(b"]")
    parts = inside.replace(b",", b" ").split()
    if not bracket or not parts or len(parts) % 2 or not all(p.removeprefix(b"-").isdigit() for p in parts):
        return None
    if max(map(len, parts)) > 4:
        return None
    values = np.array([int(p) for p in parts], dtype=np.float32)
    if np.abs(values).max() > 128.0:
        return None
    return np.asarray(values[1::2] + 1j * values[0::2], dtype=np.complex64)[None, None]


def _is_repeated(before: _Line, line: _Line) -> bool:
    same = (before.mac, before.stamp, before.csi.shape) == (line.mac, line.stamp, line.csi.shape)
    return same and bool((before.csi == line.csi).all())
