"""The reader of Nexmon captures: against bytes written here, and against another decoder on a real capture."""

from __future__ import annotations

import struct
from hashlib import sha256
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from wayfuse.core.errors import DataMissingError, FormatError
from wayfuse.formats import nexmon
from wayfuse.formats.reading import read, sniff

# digest of the array (4, 256) complex64 that csiread 1.4.1 gives for the published capture (chip 4358)
ORACLE = "dc13ce81bedf775fe6dd1c86b757832ad90c331524e946749e1cf67884c4331f"


def udp(content: bytes, port: int = 5500) -> bytes:
    """An Ethernet frame with a datagram."""
    datagram = struct.pack(">HHHH", 5500, port, 8 + len(content), 0) + content
    ip = (
        struct.pack(">BBHHHBBH", 0x45, 0, 20 + len(datagram), 1, 0, 1, 17, 0)
        + bytes([10, 10, 10, 10])
        + b"\xff" * 4
    )
    return b"\xff" * 6 + b"NEXMON" + b"\x08\x00" + ip + datagram


def gram(
    words: bytes,
    *,
    core: int = 0,
    stream: int = 0,
    sequence: int = 7,
    rssi: int | None = -60,
    source: int = 0xABC,
) -> bytes:
    """The content of a datagram of channel state; no RSSI: as older firmware has it."""
    head = (
        b"\x11\x11"
        + (b"\x11\x11" if rssi is None else struct.pack("<bB", rssi, 8))
        + source.to_bytes(6, "big")
    )
    return head + struct.pack("<HHHH", sequence << 4, core | stream << 3, 0xE29B, 0xDEAD) + words


def capture(*bodies: bytes, order: str = "<", nanoseconds: bool = False) -> bytes:
    magic = 0xA1B23C4D if nanoseconds else 0xA1B2C3D4
    out = struct.pack(f"{order}IHHIIII", magic, 2, 4, 0, 0, 1 << 18, 1)
    for k, body in enumerate(bodies):
        fraction = (k + 1) * 1000 * (1000 if nanoseconds else 1)
        out += struct.pack(f"{order}IIII", 100, fraction, len(body), len(body)) + body
    return out


def int16(n: int = 64, seed: int = 0) -> tuple[bytes, NDArray[np.complex64]]:
    parts = np.random.default_rng(seed).integers(-3000, 3000, (n, 2)).astype("<i2")
    return parts.tobytes(), (parts[:, 0] + 1j * parts[:, 1].astype(np.float32)).astype(np.complex64)


def written(tmp_path: Path, data: bytes) -> Path:
    path = tmp_path / "a.pcap"
    path.write_bytes(data)
    return path


@pytest.mark.parametrize(("order", "nanoseconds"), [("<", False), (">", False), ("<", True), (">", True)])
@pytest.mark.parametrize("n", [64, 128, 256])
def test_what_was_written_is_read(n: int, order: str, nanoseconds: bool, tmp_path: Path) -> None:
    words, csi = int16(n)
    path = written(
        tmp_path, capture(udp(b"other", 53), udp(gram(words)), order=order, nanoseconds=nanoseconds)
    )
    (packet,), _ = nexmon.read_packets(path, anchor=5)
    assert (packet.target, packet.sequence, packet.frame.anchor, packet.frame.rss) == (0xABC, 7, 5, -60.0)
    assert packet.frame.t == pytest.approx(100.002, abs=1e-7)
    assert (packet.frame.csi == csi[None, None]).all()
    assert sniff(path) == "nexmon"
    assert len(read(path).csi) == 1


@pytest.mark.parametrize(("part", "exponent"), [(9, 5), (12, 6)])
def test_packed_words_are_unpacked(part: int, exponent: int, tmp_path: Path) -> None:
    rng = np.random.default_rng(part)
    most = (1 << (part - 1)) - 1
    real, imaginary = rng.integers(-most, most + 1, (2, 256))
    power = rng.integers(-(1 << (exponent - 1)), 1 << (exponent - 1), 256)
    words = [
        (int(r < 0) << (part - 1) | abs(int(r))) << (exponent + part)
        | (int(i < 0) << (part - 1) | abs(int(i))) << exponent
        | int(e) & ((1 << exponent) - 1)
        for r, i, e in zip(real, imaginary, power, strict=True)
    ]
    data = b"".join(struct.pack("<I", w) for w in words)
    (frame,) = nexmon.read(written(tmp_path, capture(udp(gram(data))))).csi
    expected = (real + 1j * imaginary) * 2.0 ** power.astype(np.float64)
    assert frame.csi[0, 0] == pytest.approx(expected.astype(np.complex64))


def test_cores_and_streams_of_a_packet_are_one_frame(tmp_path: Path) -> None:
    made = {(core, stream): int16(seed=2 * core + stream) for core in (0, 1) for stream in (0, 1)}
    bodies = [udp(gram(made[at][0], core=at[0], stream=at[1])) for at in made if at != (1, 0)]
    after = udp(gram(made[0, 0][0], sequence=8, rssi=None))
    packets, report = nexmon.read_packets(written(tmp_path, capture(*bodies, after, after)))
    first = packets[0].frame.csi
    assert first.shape == (2, 2, 64)
    for (core, stream), (_, csi) in made.items():
        assert (first[core, stream] == (csi if (core, stream) != (1, 0) else 0)).all()
    assert [p.sequence for p in packets] == [7, 8, 8]  # heard twice: two packets, whatever the number
    assert np.isnan(packets[1].frame.rss)
    assert report.n_records == {"CSI": 3}


def test_damage_costs_its_datagram_and_is_counted(tmp_path: Path) -> None:
    good = udp(gram(int16()[0]))
    data = capture(good, udp(b"short"), udp(b"\0" * 274), udp(gram(b"\0" * 12)), b"\0" * 60, good, good)
    recording = nexmon.read(written(tmp_path, data[:-5]))
    assert len(recording.csi) == 2
    assert {kind: issue.lines for kind, issue in recording.report.issues.items()} == {
        "a datagram shorter than its head": [2],
        "a datagram of another magic": [3],
        "a datagram of no known bandwidth": [4],
        "a packet cut off by the end": [7],
    }


@pytest.mark.parametrize(
    "content", [b"", b"\xd4\xc3\xb2\xa1", capture(), capture(udp(b"query", 53)), b"a;b\n" * 50]
)
def test_other_files_are_refused(content: bytes, tmp_path: Path) -> None:
    path = written(tmp_path, content)
    with pytest.raises(FormatError, match="no channel state of Nexmon"):
        nexmon.read(path)
    with pytest.raises(FormatError, match="not a recording"):
        sniff(path)


def test_a_file_that_is_not_there_or_too_large(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(DataMissingError):
        nexmon.read(tmp_path / "none.pcap")
    monkeypatch.setattr(nexmon, "_MOST_BYTES", 100)
    with pytest.raises(FormatError, match="larger than"):
        nexmon.read(written(tmp_path, capture(udp(gram(int16()[0])))))


@settings(max_examples=80)
@given(data=st.binary(max_size=300), at=st.integers(0, 700), cut=st.integers(0, 700))
def test_no_bytes_break_the_reader(
    data: bytes, at: int, cut: int, tmp_path_factory: pytest.TempPathFactory
) -> None:
    good = capture(udp(gram(int16()[0])), udp(gram(int16()[0], sequence=9)))
    damaged = good[:at] + data + good[at:][cut:]
    path = written(tmp_path_factory.mktemp("csi"), damaged)
    try:
        recording = nexmon.read(path)
    except FormatError:
        assert nexmon.is_capture(damaged) is False
        return
    assert recording.csi
    assert all(frame.csi.ndim == 3 for frame in recording.csi)


@pytest.mark.real_data
def test_the_published_capture_is_read_as_by_csiread(data_root: Path) -> None:
    path = data_root / "csi" / "fixtures" / "nexmon_example.pcap"
    if not path.is_file():
        pytest.skip(f"REAL DATA ABSENT: no file {path}; fetch with `wayfuse datasets fetch csi`")
    (packet,), report = nexmon.read_packets(path)
    assert report.n_bad == 0
    assert (packet.target, packet.sequence, packet.frame.csi.shape) == (0x00123456789B, 11, (2, 2, 256))
    theirs = np.zeros((4, 256), dtype=np.complex64)
    for row, values in zip(theirs, packet.frame.csi.reshape(4, 256), strict=True):
        parts = values.astype(np.complex128).view(np.float64)
        shift = 10 - int(
            np.floor(np.log2(np.abs(parts).max()))
        )  # it scales each datagram to 10 bits and cuts
        cut = np.sign(parts) * np.floor(np.abs(parts) * 2.0**shift)
        row[:] = cut.view(np.complex128)
    theirs += 0.0  # no negative zero
    assert sha256(theirs.tobytes()).hexdigest() == ORACLE
