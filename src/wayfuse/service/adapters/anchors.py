"""The anchors' envelope: frames of targets that an anchor overheard, with level, range, channel state and the target's
own motion samples.

An anchor sends frames of many targets; each target becomes a message of its own, with a body that holds its frames
alone, so that the log of one target says nothing of another. A level becomes a scan with one reading, of the anchor:
the scan buffer joins those of several anchors. Several anchors hear the same packet: its motion samples count once.

A target that is a random hardware address is dropped: such an address is nobody's identity.
"""

from __future__ import annotations

import math
from collections import Counter
from typing import Annotated

import msgspec
import numpy as np

from wayfuse.formats.assembly import assemble
from wayfuse.formats.columns import Piece, Rows
from wayfuse.sensors.quality import ReadReport
from wayfuse.sensors.records import CsiFrame, Range, Record, bssid_id
from wayfuse.service.adapters.parts import digest_key, merged, notes_of
from wayfuse.service.identity import is_random_address
from wayfuse.service.message import Message, Part, Profile
from wayfuse.service.wire import Name, check_count, decode, encode

__all__ = ["Anchors"]

_FARTHEST_M = 1e5
_NOISE_DBM = -92.0  # taken where an anchor does not say
Pairs = list[tuple[float, float]]


class _Csi(msgspec.Struct, frozen=True, omit_defaults=True):
    """iq : one list of [re, im] per receiving antenna. agc : dB. noise : dBm."""

    iq: list[Pairs]
    idx: list[int] = []
    agc: float = 0.0
    noise: float = _NOISE_DBM


class _Frame(msgspec.Struct, frozen=True, omit_defaults=True):
    """One packet. t : ns, where it differs from the envelope's. imu : [t (ns), ax, ay, az, gx, gy, gz] each."""

    target: Name
    rssi: float | None = None
    freq_mhz: float = 0.0
    seq: int | None = None
    t: int | None = None
    range_m: float | None = None
    range_std: float | None = None
    csi: _Csi | None = None
    imu: list[tuple[float, float, float, float, float, float, float]] = []


class _Anchor(msgspec.Struct, frozen=True):
    v: Annotated[int, msgspec.Meta(ge=1, le=1)]
    anchor: Name
    t: int  # ns
    frames: list[_Frame]


class Anchors:
    """Adapter of the anchors' envelope."""

    def read(self, body: bytes, profile: Profile, arrived: float) -> list[Message]:
        """A message per target, in the order of their first frames."""
        envelope = decode(body, _Anchor)
        check_count(sum(1 + len(f.imu) + _size(f.csi) for f in envelope.frames))
        of_target: dict[str, list[_Frame]] = {}
        dropped = Counter[str]()
        for frame in envelope.frames:
            if is_random_address(frame.target):
                dropped["target with a random address"] += 1
            else:
                of_target.setdefault(frame.target, []).append(frame)
        out = []
        for target, frames in of_target.items():
            own = body if len(frames) == len(envelope.frames) else encode(_part(envelope, frames))
            out.append(_message(envelope, target, frames, own, profile.track))
        if out:
            out[0] = out[0]._replace(notes=Counter(out[0].notes) + dropped)
        return out


def _part(envelope: _Anchor, frames: list[_Frame]) -> _Anchor:
    return _Anchor(envelope.v, envelope.anchor, envelope.t, frames)


def _size(csi: _Csi | None) -> int:
    return 0 if csi is None else sum(len(antenna) for antenna in csi.iq)


def _message(envelope: _Anchor, target: str, frames: list[_Frame], body: bytes, session: str) -> Message:
    report = ReadReport()
    anchor = bssid_id(envelope.anchor)
    parts = []
    for n, frame in enumerate(frames, 1):
        t = (envelope.t if frame.t is None else frame.t) / 1e9
        number = str(frame.seq) if frame.seq is not None else digest_key(encode(frame))
        parts.append(Part(f"{envelope.anchor} {number} {t}", _radio(frame, t, anchor, n, report)))
        if frame.imu:
            key = f"imu {number}" if frame.seq is not None else ""
            parts.append(Part(key, _motion(frame, n, report)))
    return Message(target, session, body, tuple(parts), False, notes_of(report))


def _radio(frame: _Frame, t: float, anchor: int, n: int, report: ReadReport) -> tuple[Record, ...]:
    rows, more = Rows(), list[Record]()
    rssi = math.nan if frame.rssi is None else frame.rssi
    if frame.rssi is not None:
        rows.add("wifi", n, t, (rssi, frame.freq_mhz, math.nan), anchor)
    if frame.range_m is not None:
        sigma = math.nan if frame.range_std is None else frame.range_std
        if 0.0 <= frame.range_m <= _FARTHEST_M and not sigma <= 0.0:
            more.append(Range(t, anchor, frame.range_m, sigma, rssi))
        else:
            report.add("range: out of range", n)
    if frame.csi is not None:
        csi = _channel(frame.csi)
        if csi is None:
            report.add("csi: antennas of different length, or none", n)
        else:
            more.append(CsiFrame(t, anchor, csi, rssi, frame.csi.agc, frame.csi.noise))
    recording = assemble([Piece(rows.columns())], report, name="", clock="", one_stream=False)
    return merged(recording.records(), more)


def _channel(csi: _Csi) -> np.ndarray[tuple[int, ...], np.dtype[np.complex64]] | None:
    lengths = {len(antenna) for antenna in csi.iq}
    if len(lengths) != 1 or 0 in lengths or (csi.idx and len(csi.idx) not in lengths):
        return None
    iq = np.array(csi.iq, np.float64)
    return (iq[..., 0] + 1j * iq[..., 1]).astype(np.complex64)[:, None, :]


def _motion(frame: _Frame, n: int, report: ReadReport) -> tuple[Record, ...]:
    rows = Rows()
    for t, *values in frame.imu:
        rows.add("acceleration", n, t / 1e9, tuple(values[:3]))
        rows.add("rotation_rate", n, t / 1e9, tuple(values[3:]))
    recording = assemble([Piece(rows.columns())], report, name="", clock="", one_stream=False)
    return merged(recording.records())
