r"""Reader of captures of the Nexmon CSI extractor (Broadcom cards), ``.pcap``.

The card's firmware sends each core and stream of a packet as a UDP datagram to port 5500: a head of 18 bytes,
little-endian - magic 0x1111, RSSI (dBm, signed) and frame control (older firmware: magic again), source address (6),
sequence control, core (bits 0-2) and stream (3-5), channel, chip - then a word of 4 bytes for each subcarrier. Words
are two signed 16-bit parts, real first, on the BCM43455c0 and 4339; on the 4358 and 4366c0 two magnitudes with signs
and a common exponent. The head's chip does not tell which (it may be anything), the words do: the packed ones leave
their upper bits clear.

Datagrams of one packet follow each other; they become one frame (cores, streams, subcarriers), zeros where one is
missing. Subcarriers are in the order of a Fourier transform, 0 first (`radio.csi.fourier_order`). Channel state is in
the card's own units; its gain is not recorded. The clock is that of the capturing machine.

References
----------
.. [1] M. Schulz, D. Wegemer, M. Hollick, Nexmon: the C-based firmware patching framework, 2017, nexmon.org; F.
   Gringoli, M. Schulz, J. Link, M. Hollick, Free your CSI: a channel state information extraction platform for modern
   Wi-Fi chipsets, WiNTECH 2019, doi:10.1145/3349623.3355477.
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
from wayfuse.sensors.quality import ReadReport
from wayfuse.sensors.recording import Recording
from wayfuse.sensors.records import CsiFrame

__all__ = ["Packet", "is_capture", "read", "read_packets"]

_PORT = 5500
_MAGIC = 0x11
_HEAD = struct.Struct("<BBbB6sHHHH")
_SIZES = (64, 128, 256, 512)  # subcarriers at 20, 40, 80, 160 MHz
_PCAP = {  # magic of the file: byte order, seconds per unit of the fraction
    b"\xd4\xc3\xb2\xa1": ("<", 1e-6),
    b"\xa1\xb2\xc3\xd4": (">", 1e-6),
    b"\x4d\x3c\xb2\xa1": ("<", 1e-9),
    b"\xa1\xb2\x3c\x4d": (">", 1e-9),
}
_PCAP_HEAD, _PACKET_HEAD, _ETHERNET_HEAD, _UDP_HEAD = 24, 16, 14, 8  # bytes
_ETHERNET = 1  # link type
_LONGEST = 1 << 18  # bytes of a captured packet; the program that captures cuts at this
_MOST_BYTES = 1 << 30
_PACKED = ((9, 5), (12, 6))  # bits of a part with its sign, bits of the exponent: 4358, 4366c0


class Packet(NamedTuple):
    """A packet as an anchor heard it: transmitter (48-bit address), sequence number (-1 unknown), channel state."""

    target: int
    sequence: int
    frame: CsiFrame


class _Datagram(NamedTuple):
    t: float
    rssi: int
    target: int
    sequence: int
    core: int
    stream: int
    channel: int
    payload: bytes


def read(path: str | Path, *, anchor: int = 0) -> Recording:
    """Read a capture: a recording with `CsiFrame` only, in the order of their times.

    Parameters
    ----------
    path : the file. anchor : identifier of the receiver that the capture is of.

    Raises
    ------
    DataMissingError : there is no such file. FormatError : it is too large, or has no channel state.
    """
    packets, report = read_packets(path, anchor=anchor)
    frames = sorted((packet.frame for packet in packets), key=lambda frame: frame.t)
    return Recording(Path(path).stem, csi=tuple(frames), clock="Unix time", path=str(path), report=report)


def read_packets(path: str | Path, *, anchor: int = 0) -> tuple[list[Packet], ReadReport]:
    """The packets of a capture in file order with their transmitters and sequence numbers, and what was wrong.

    Damaged datagrams are left out and counted by the number of the captured packet; so are datagrams of other sizes.

    Raises
    ------
    DataMissingError, FormatError : as `read`.
    """
    path = Path(path)
    report = ReadReport(path=str(path))
    grams = list(_datagrams(read_bounded(path, _MOST_BYTES), report))
    if not grams:
        raise FormatError(
            "no channel state of Nexmon", where=path, remedy="give a pcap of UDP port 5500, or leave it out"
        )
    bits = np.bitwise_or.reduce([np.bitwise_or.reduce(np.frombuffer(g.payload, "<u4")) for g in grams])
    packets = [_packet(group, anchor, int(bits)) for group in _grouped(grams)]
    report.n_records["CSI"] = len(packets)
    return packets, report


def is_capture(head: bytes) -> bool:
    """Whether the first bytes of a file are a pcap with channel state among its first packets."""
    return next(_datagrams(head, ReadReport()), None) is not None


def _datagrams(data: bytes, report: ReadReport) -> Iterator[_Datagram]:
    known = _PCAP.get(data[:4])
    if known is None or len(data) < _PCAP_HEAD:
        return
    order, unit = known
    if struct.unpack_from(f"{order}I", data, 20)[0] != _ETHERNET:
        report.add("a capture of another link than Ethernet", 1)
        return
    head = struct.Struct(f"{order}IIII")
    at, number = _PCAP_HEAD, 0
    while at + _PACKET_HEAD <= len(data):
        number += 1
        seconds, fraction, size, _ = head.unpack_from(data, at)
        body = data[at + _PACKET_HEAD : at + _PACKET_HEAD + size]
        if size > _LONGEST or len(body) < size:
            fault = (
                "a packet longer than a capture holds" if size > _LONGEST else "a packet cut off by the end"
            )
            report.add(fault, number)
            break
        at += _PACKET_HEAD + size
        content = _udp(body)
        if content is None:
            continue
        gram = _parsed(seconds + unit * fraction, content)
        if isinstance(gram, str):
            report.add(gram, number)
        else:
            yield gram
    report.n_lines = number


def _udp(body: bytes) -> bytes | None:
    """What an Ethernet frame carries to the port of channel state, None for all else."""
    if len(body) < _ETHERNET_HEAD + 20 or body[12:14] != b"\x08\x00" or body[14] >> 4 != 4 or body[23] != 17:
        return None
    at = _ETHERNET_HEAD + 4 * (body[14] & 15)
    if len(body) < at + _UDP_HEAD:
        return None
    _, port, size, _ = struct.unpack_from(">HHHH", body, at)
    return body[at + _UDP_HEAD : at + size] if port == _PORT else None


def _parsed(t: float, content: bytes) -> _Datagram | str:
    """A datagram, or what is wrong with it."""
    if len(content) < _HEAD.size:
        return "a datagram shorter than its head"
    magic, again, rssi, control, source, sequence, place, channel, _ = _HEAD.unpack_from(content)
    if (magic, again) != (_MAGIC, _MAGIC):
        return "a datagram of another magic"
    payload = content[_HEAD.size :]
    if len(payload) not in {4 * n for n in _SIZES}:
        return "a datagram of no known bandwidth"
    is_old = (rssi, control) == (_MAGIC, _MAGIC)
    return _Datagram(
        t, 0 if is_old else rssi, int.from_bytes(source, "big"), sequence >> 4, place & 7, place >> 3 & 7, channel,
        payload,
    )  # fmt: skip


def _grouped(grams: list[_Datagram]) -> Iterator[list[_Datagram]]:
    """Datagrams in a row that are of one packet: same transmitter, number and channel, no core and stream twice."""
    group: list[_Datagram] = []
    for gram in grams:
        same = group and (gram.target, gram.sequence, gram.channel, len(gram.payload)) == (
            group[0].target, group[0].sequence, group[0].channel, len(group[0].payload)
        )  # fmt: skip
        if not same or (gram.core, gram.stream) in {(g.core, g.stream) for g in group}:
            if group:
                yield group
            group = []
        group.append(gram)
    if group:
        yield group


def _packet(group: list[_Datagram], anchor: int, bits: int) -> Packet:
    first = group[0]
    n_rx, n_tx = 1 + max(g.core for g in group), 1 + max(g.stream for g in group)
    csi = np.zeros((n_rx, n_tx, len(first.payload) // 4), dtype=np.complex64)
    for g in group:
        csi[g.core, g.stream] = _decoded(np.frombuffer(g.payload, dtype="<u4"), bits)
    heard = [g.rssi for g in group if g.rssi < 0]
    rss = float(max(heard)) if heard else float("nan")
    frame = CsiFrame(first.t, anchor, csi, rss, float("nan"), float("nan"))
    return Packet(first.target, first.sequence, frame)


def _decoded(words: NDArray[np.uint32], bits: int) -> NDArray[np.complex64]:
    """Channel state (n,) of words (n,); ``bits`` : all bits that are set in any word of the capture."""
    for part, exponent in _PACKED:
        if bits < 1 << (2 * part + exponent):
            return _unpacked(words.astype(np.int64), part, exponent)
    parts = words.view(np.int16).astype(np.float32)
    return np.asarray(parts[0::2] + 1j * parts[1::2], dtype=np.complex64)


def _unpacked(words: NDArray[np.int64], part: int, exponent: int) -> NDArray[np.complex64]:
    """Sign and magnitude of the real part, of the imaginary one, and a common exponent in two's complement."""
    mask = (1 << (part - 1)) - 1
    power = words & ((1 << exponent) - 1)
    power = np.where(power >= 1 << (exponent - 1), power - (1 << exponent), power)
    values = []
    for low in (exponent + part, exponent):
        magnitude = (words >> low & mask).astype(np.float64)
        is_negative = words >> (low + part - 1) & 1 == 1
        values.append(np.ldexp(np.where(is_negative, -magnitude, magnitude), power))
    return np.asarray(values[0] + 1j * values[1], dtype=np.complex64)
