"""The reader of CSI Tool logs: against bits written here, and against another decoder on real logs."""

from __future__ import annotations

import struct
from hashlib import sha256
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from wayfuse.core.errors import FormatError
from wayfuse.formats import intel5300, reading
from wayfuse.formats.intel5300 import read
from wayfuse.formats.reading import sniff

# digests of the arrays (n, 30, 3, 3) complex64, antennas that are absent zero, and sums of the received powers (dBm),
# that csiread 1.4.1 gives for the published logs, in the order of their times
ORACLE = {
    "intel5300_log.all_csi.6.7.6.dat": (
        29,
        "476d549b2084a351428addfaae154b84a48f88f15d395c57b433fda20073d4b6",
        -1183.0365587443762,
    ),
    "intel5300_sample_0x1_ap.dat": (
        540,
        "63f6bdca0fe479b9381af412b782ccf534fb1cdb4a902746089e8f218ac39a64",
        -20080.25946221289,
    ),
    "los_100.dat": (
        1377,
        "dae40366af0e77a44510b3377d47f1586e07e379b57ba970fde9dc777e06fd8a",
        -98820.28458784413,
    ),
    "los_40.dat": (
        1119,
        "ba71569090c67ae1a51ea73d887fce7784cf7d90f42be0412a2776f38797f1d1",
        -69964.69174993092,
    ),
    "los_5.dat": (
        1006,
        "459e8f92d495530e7b81f73b6fc1a3b10ecd53179eef16f370cf5002f76d6a3e",
        -48165.945950965805,
    ),
}


def field(body: bytes, code: int = 0xBB) -> bytes:
    return struct.pack(">HB", len(body) + 1, code) + body


def record(
    csi: NDArray[np.int8],
    t: int = 1000,
    sel: int = 0b100100,
    rssi: tuple[int, int, int] = (30, 31, 32),
    n_rx: int | None = None,
) -> bytes:
    """A record of channel state (n_rx, n_tx, 30, 2), bit by bit."""
    rx, tx = csi.shape[:2]
    number, at = 0, 0
    for g in range(30):
        at += 3
        for i in range(rx):
            for j in range(tx):
                for part in csi[i, j, g]:
                    number |= (int(part) & 255) << at
                    at += 8
    payload = number.to_bytes((at + 7) // 8, "little")
    head = struct.pack(
        "<IHHBBBBBbBBHH", t, 1, 0, rx if n_rx is None else n_rx, tx, *rssi, -127, 40, sel, len(payload), 0x101
    )
    return field(head + payload)


def made_up(rx: int, tx: int, seed: int = 0) -> NDArray[np.int8]:
    return np.random.default_rng(seed).integers(-128, 128, (rx, tx, 30, 2)).astype(np.int8)


def complex_of(csi: NDArray[np.int8]) -> NDArray[np.complex64]:
    return (csi[..., 0].astype(np.float32) + 1j * csi[..., 1].astype(np.float32)).astype(np.complex64)


def written(tmp_path: Path, *parts: bytes) -> Path:
    path = tmp_path / "a.dat"
    path.write_bytes(b"".join(parts))
    return path


@settings(max_examples=25)
@given(rx=st.integers(1, 3), tx=st.integers(1, 3), seed=st.integers(0, 1000))
def test_what_was_written_is_read(
    rx: int, tx: int, seed: int, tmp_path_factory: pytest.TempPathFactory
) -> None:
    csi = made_up(rx, tx, seed)
    (frame,) = read(written(tmp_path_factory.mktemp("csi"), record(csi)), anchor=7).csi
    assert (frame.csi == complex_of(csi)).all()
    assert (frame.t, frame.anchor, frame.agc) == (1e-3, 7, 40.0)
    assert np.isnan(frame.noise)
    assert frame.rss == pytest.approx(10.0 * np.log10(1e3 + 10**3.1 + 10**3.2) - 84.0)


def test_a_log_is_known_by_its_content(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    good = record(made_up(3, 1))
    path = written(tmp_path, field(b"a frame", 0xC1), good, good)
    assert sniff(path) == "intel5300"
    assert len(reading.read(path).csi) == 2
    for other in (field(b"a frame", 0xC1) * 90 + good, record(made_up(3, 1), n_rx=9), good[:40], b""):
        with pytest.raises(FormatError, match="not a recording"):
            sniff(written(tmp_path, other))
    monkeypatch.setattr(intel5300, "_MOST_BYTES", 100)
    with pytest.raises(FormatError, match="larger than"):
        read(written(tmp_path, good))


def test_antennas_come_in_their_own_order(tmp_path: Path) -> None:
    csi = made_up(3, 2)
    (frame,) = read(written(tmp_path, record(csi, sel=0b010010))).csi  # rows are of antennas 2, 0, 1
    assert (frame.csi[[2, 0, 1]] == complex_of(csi)).all()
    (frame,) = read(written(tmp_path, record(csi, sel=0b000000))).csi  # names one antenna thrice: as stored
    assert (frame.csi == complex_of(csi)).all()


def test_two_antennas_keep_their_names(tmp_path: Path) -> None:
    csi = made_up(2, 1)
    (frame,) = read(written(tmp_path, record(csi, sel=0b011000, rssi=(30, 0, 32)))).csi  # A and C
    assert (frame.csi[[0, 2]] == complex_of(csi)).all()
    assert not frame.csi[1].any()
    assert frame.rss == pytest.approx(10.0 * np.log10(1e3 + 10**3.2) - 84.0)


def test_the_clock_wraps_and_a_step_back_is_counted(tmp_path: Path) -> None:
    csi = made_up(1, 1)
    times = [(1 << 32) - 500, 500, 1500, 1000]
    recording = read(written(tmp_path, *(record(csi, t=t, sel=0) for t in times)))
    assert [f.t for f in recording.csi] == pytest.approx(
        [1e-6 * ((1 << 32) + t) for t in (-500, 500, 1000, 1500)], abs=1e-9
    )
    assert {k: i.count for k, i in recording.report.issues.items()} == {"a clock that steps back": 1}


def test_damage_costs_its_record_and_is_counted(tmp_path: Path) -> None:
    csi = made_up(3, 1)
    good = record(csi)
    recording = read(
        written(
            tmp_path,
            good,
            field(b"a frame", 0xC1),
            field(b"short"),
            record(csi, n_rx=9),
            record(csi, n_rx=2),
            good,
            good[:-5],
        )
    )
    assert len(recording.csi) == 2
    assert recording.report.n_records == {"CSI": 2}
    assert {kind: issue.lines for kind, issue in recording.report.issues.items()} == {
        "a record shorter than its head": [3],
        "an impossible number of antennas": [4],
        "a length that does not go with the antennas": [5],
        "a record cut off by the end of the file": [7],
    }


@pytest.mark.parametrize("content", [b"", b"\0", b"\0\0\xbb" * 9, b"t;x;y;z\n1;2;3;4\n" * 40])
def test_other_files_are_refused(content: bytes, tmp_path: Path) -> None:
    with pytest.raises(FormatError, match="no record of channel state"):
        read(written(tmp_path, content))


@settings(max_examples=60)
@given(data=st.binary(max_size=400), cut=st.integers(0, 400))
def test_no_bytes_break_the_reader(data: bytes, cut: int, tmp_path_factory: pytest.TempPathFactory) -> None:
    good = record(made_up(2, 2))
    recording = read(written(tmp_path_factory.mktemp("csi"), good, good[:cut], data))
    assert len(recording.csi) >= 1
    assert all(np.isfinite(frame.csi).all() for frame in recording.csi)


@pytest.mark.real_data
@pytest.mark.parametrize("name", list(ORACLE))
def test_published_logs_are_read_as_by_csiread(name: str, data_root: Path) -> None:
    path = data_root / "csi" / "fixtures" / name
    if not path.is_file():
        pytest.skip(f"REAL DATA ABSENT: no file {path}; fetch with `wayfuse datasets fetch csi`")
    n, digest, total = ORACLE[name]
    frames = read(path).csi
    arrays = np.zeros((len(frames), 30, 3, 3), dtype=np.complex64)
    for array, frame in zip(arrays, frames, strict=True):
        array[:, : frame.csi.shape[0], : frame.csi.shape[1]] = frame.csi.transpose(2, 0, 1)
    assert len(frames) == n
    assert sha256(arrays.tobytes()).hexdigest() == digest
    assert sum(frame.rss for frame in frames) == pytest.approx(total, abs=1e-3)
