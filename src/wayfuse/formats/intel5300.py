r"""Reader of channel state logs of the Linux 802.11n CSI Tool (Intel Wi-Fi Link 5300), ``.dat``.

A log is a row of fields: length (2 bytes, big-endian, of what follows), a code, the rest. Code 0xBB is a received
packet: a head of 20 bytes, little-endian, then for 30 groups of subcarriers 3 bits to skip and a complex number of two
signed bytes for each pair of receive and transmit antenna, not aligned to bytes. Other codes are skipped. The source
address of the packet is not in the record: a log is to be of one transmitter. The clock is that of the card (us since
its start), whose 32 bits wrap after 71.6 minutes; wraps are undone here.

Channel state comes in the card's own units, before which the gain control has levelled it; `CsiFrame.rss` and ``agc``
go with it (`radio.csi` scales by them). Receive antennas are in their order A, B, C, whatever the record's; a packet of
A and C alone has a row of zeros for B.

References
----------
.. [1] Halperin, Hu, Sheth, Wetherall, Tool release: gathering 802.11n traces with channel state information, SIGCOMM
   CCR 2011, doi:10.1145/1925861.1925870.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayfuse.core.errors import FormatError
from wayfuse.formats.bounded import read_bounded
from wayfuse.formats.card_clock import CardClock
from wayfuse.sensors.quality import ReadReport
from wayfuse.sensors.recording import Recording
from wayfuse.sensors.records import CsiFrame

__all__ = ["N_GROUPS", "Head", "frames_of", "is_log", "read"]

N_GROUPS = 30  # groups of subcarriers
_CSI = 0xBB
_HEAD = struct.Struct("<IHHBBBBBbBBHH")
_NO_NOISE = -127  # dBm, the card's word for "unknown"
_RSSI_OFFSET = 44.0  # dB, from the card's units to dBm with the gain known
_MOST_ANTENNAS = 3
_MOST_BYTES = 1 << 30  # of a log: an hour and more at 1000 packets a second
_LOOK = 64  # records to look at for the first packet


class Head(NamedTuple):
    """The head of a record, as it is stored.

    timestamp_low : µs, 32 bits. bfee_count : packets counted by the card; a gap is what the driver lost. n_rx, n_tx :
    antennas. rssi_a, rssi_b, rssi_c : 0 where the antenna is absent. noise : dBm, -127 unknown. agc : dB. antenna_sel :
    order of the antennas. length : bytes of channel state. rate : rate and flags.
    """

    timestamp_low: int
    bfee_count: int
    reserved: int
    n_rx: int
    n_tx: int
    rssi_a: int
    rssi_b: int
    rssi_c: int
    noise: int
    agc: int
    antenna_sel: int
    length: int
    rate: int

    @property
    def rss(self) -> float:
        """Received power of all antennas together, dBm at the antenna; NaN where there is none."""
        power = sum(10.0 ** (0.1 * r) for r in (self.rssi_a, self.rssi_b, self.rssi_c) if r)
        return float(10.0 * np.log10(power)) - _RSSI_OFFSET - self.agc if power else float("nan")

    def order(self) -> list[int]:
        """Which antenna (0, 1, 2) each stored row is of; as stored where the record names none, or one twice."""
        order = [(self.antenna_sel >> (2 * i)) & 3 for i in range(self.n_rx)]
        is_sound = len(set(order)) == self.n_rx and max(order) < _MOST_ANTENNAS
        return order if is_sound else list(range(self.n_rx))


def is_log(head: bytes) -> bool:
    """Whether the first bytes of a file are such a log: records in a row, one of them a sound packet."""
    at = 0
    for _ in range(_LOOK):
        size = int.from_bytes(head[at : at + 2], "big")
        body = head[at + 3 : at + 2 + size]
        if size == 0 or len(body) < size - 1:
            return False
        if head[at + 2] == _CSI:
            return not _fault(body)
        at += 2 + size
    return False


def read(path: str | Path, *, anchor: int = 0) -> Recording:
    """Read a whole log.

    Parameters
    ----------
    path : the file. anchor : identifier of the receiver the log is of.

    Returns
    -------
    a recording with `CsiFrame` only: (n_rx, n_tx, 30) complex64 in the card's units, noise NaN where unknown. Damaged
    records are left out and counted in its report, with the number of the record as place; so are steps back of the
    clock (captures joined in one file), after which the frames are in the order of their times.

    Raises
    ------
    DataMissingError : there is no such file. FormatError : it is too large, or has no whole record of channel state.
    """
    path = Path(path)
    report = ReadReport(path=str(path))
    frames = frames_of(read_bounded(path, _MOST_BYTES), report, anchor=anchor)
    if not frames:
        raise FormatError(
            "no record of channel state", where=path, remedy="give a log of the CSI Tool, or leave it out"
        )
    report.n_records["CSI"] = len(frames)
    frames.sort(key=lambda frame: frame.t)
    return Recording(path.stem, csi=tuple(frames), clock="network card", path=str(path), report=report)


def frames_of(data: bytes, report: ReadReport, *, anchor: int = 0) -> list[CsiFrame]:
    """The frames of records in a row, as they come; what is damaged is counted in ``report``, as by `read`."""
    frames: list[CsiFrame] = []
    clock = CardClock()
    for number, head, payload in _records(data, report):
        t, noise = clock.seconds(head.timestamp_low), float(head.noise if head.noise != _NO_NOISE else "nan")
        if frames and t < frames[-1].t:
            report.add("a clock that steps back", number)
        frames.append(CsiFrame(t, anchor, _decode(head, payload), head.rss, float(head.agc), noise))
    return frames


def _records(data: bytes, report: ReadReport) -> Iterator[tuple[int, Head, bytes]]:
    """Whole records of channel state: number in the file, head, payload."""
    at, number = 0, 0
    while at + 3 <= len(data):
        number += 1
        size, code = int.from_bytes(data[at : at + 2], "big"), data[at + 2]
        body = data[at + 3 : at + 2 + size]
        if size == 0 or len(body) < size - 1:
            report.add("a record cut off by the end of the file" if size else "a record of no length", number)
            break
        at += 2 + size
        if code != _CSI:
            continue
        fault = _fault(body)
        if fault:
            report.add(fault, number)
            continue
        head = Head(*_HEAD.unpack_from(body))
        yield number, head, body[_HEAD.size : _HEAD.size + head.length]
    else:
        if at < len(data):
            report.add("bytes after the last record", number + 1)
    report.n_lines = number


def _fault(body: bytes) -> str:
    """What is wrong with a record, empty if nothing."""
    if len(body) < _HEAD.size:
        return "a record shorter than its head"
    head = Head(*_HEAD.unpack_from(body))
    if not (1 <= head.n_rx <= _MOST_ANTENNAS and 1 <= head.n_tx <= _MOST_ANTENNAS):
        return "an impossible number of antennas"
    if head.length != _length(head.n_rx * head.n_tx) or len(body) < _HEAD.size + head.length:
        return "a length that does not go with the antennas"
    return ""


def _length(n_pairs: int) -> int:
    """Bytes of channel state of pairs of antennas."""
    return (N_GROUPS * (n_pairs * 16 + 3) + 7) // 8


def _decode(head: Head, payload: bytes) -> NDArray[np.complex64]:
    """Channel state (n_rx, n_tx, 30) of a payload; in the file the transmit antenna runs fastest."""
    n = head.n_rx * head.n_tx
    group, value = np.arange(N_GROUPS)[:, None], np.arange(2 * n)
    bit = 3 * (group + 1) + 16 * n * group + 8 * value
    at, shift = bit >> 3, (bit & 7).astype(np.uint16)
    raw = np.frombuffer(payload + b"\0", dtype=np.uint8).astype(np.uint16)
    parts = ((raw[at] >> shift) | (raw[at + 1] << (8 - shift))).astype(np.uint8).view(np.int8)
    stored = (parts[:, 0::2] + 1j * parts[:, 1::2].astype(np.float32)).astype(np.complex64)
    order = head.order()
    out = np.zeros((max(order) + 1, head.n_tx, N_GROUPS), dtype=np.complex64)
    out[order] = stored.T.reshape(head.n_rx, head.n_tx, N_GROUPS)
    return out
