"""The reader of ESP32 logs: against lines written here, in all layouts, and a published log."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from wayfuse.core.errors import FormatError
from wayfuse.formats import esp32_csi
from wayfuse.formats.reading import read, sniff

HEADER = (
    "type,role,mac,rssi,rate,sig_mode,mcs,bandwidth,smoothing,not_sounding,aggregation,stbc,fec_coding,sgi,noise_floor,"
    "ampdu_cnt,channel,secondary_channel,local_timestamp,ant,sig_len,rx_state,real_time_set,real_timestamp,len,CSI_DATA"
)
VALUES = [1, -2, 3, -128, 127, 0]
CSI = np.array([-2 + 1j, -128 + 3j, 0 + 127j], dtype=np.complex64)  # imaginary first


def line(
    columns: int = 26,
    *,
    stamp: int | str = 2_000_000,
    rssi: int | str = -70,
    sequence: int = 4,
    values: str = "",
) -> str:
    fields = ["CSI_DATA", "STA" if columns == 26 else str(sequence), "1A:00:00:00:00:02", str(rssi), "11"]
    if columns == 15:
        fields += ["-92", "3", "17", "6", str(stamp), "100", "0", "128", "0"]
    else:
        fields += ["0"] * 9 + ["-92", "0", "6", "0", str(stamp), *["0"] * (columns - 20)]
    inside = values or (" ".join(map(str, VALUES)) + " " if columns == 26 else ",".join(map(str, VALUES)))
    return ",".join(fields) + (f",[{inside}]" if columns == 26 else f',"[{inside}]"')


def written(tmp_path: Path, *lines: str) -> Path:
    path = tmp_path / "a.csv"
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


@pytest.mark.parametrize(("columns", "sequence", "agc"), [(26, -1, np.nan), (25, 4, np.nan), (15, 4, 17.0)])
def test_all_layouts_are_read(columns: int, sequence: int, agc: float, tmp_path: Path) -> None:
    path = written(tmp_path, "I (57) wifi: noise of the console", line(columns))
    (packet,), report = esp32_csi.read_packets(path, anchor=3)
    assert (packet.target, packet.sequence) == (0x1A0000000002, sequence)
    frame = packet.frame
    assert (frame.t, frame.anchor, frame.rss, frame.noise) == (2.0, 3, -70.0, -92.0)
    assert frame.agc == pytest.approx(agc, nan_ok=True)
    assert (frame.csi == CSI[None, None]).all()
    assert report.n_bad == 0
    assert sniff(path) == "esp32-csi"
    assert len(read(path).csi) == 1


def test_a_header_names_the_columns(tmp_path: Path) -> None:
    names = HEADER.split(",")
    names[3], names[4] = names[4], names[3]  # RSSI a column later
    moved = line().split(",")
    moved[3], moved[4] = moved[4], moved[3]
    (frame,) = esp32_csi.read(written(tmp_path, ",".join(names), ",".join(moved))).csi
    assert frame.rss == -70.0


def test_the_clock_wraps_and_repeats_are_left_out(tmp_path: Path) -> None:
    late = (1 << 32) - 500_000
    path = written(tmp_path, line(stamp=late), line(stamp=late), line(stamp=500_000), line(stamp=400_000))
    recording = esp32_csi.read(path)
    assert [f.t for f in recording.csi] == pytest.approx([4294.467296, 4295.367296, 4295.467296])
    assert {kind: issue.lines for kind, issue in recording.report.issues.items()} == {
        "a line that repeats the packet before": [2],
        "a clock that steps back": [4],
    }


@pytest.mark.parametrize(
    ("bad", "fault"),
    [
        (line().replace("STA,", ""), "no address"),  # as many columns as another layout has
        (line().replace("STA,1A:", "1A:").replace(",11,", ","), "columns of none"),
        (line().split("[")[0], "columns of none"),
        (line(values="1 2 3 "), "no list of pairs"),
        (line(values="1 x "), "no list of pairs"),
        (line(values="1 300 "), "no list of pairs"),
        (line()[:-1], "no list of pairs"),
        (line(stamp="soon"), "no number"),
        (line(stamp=1 << 32), "no number"),
        (line(rssi="nan"), "no number"),
        (line(rssi=40), "out of range"),
        (line(values="1 " * 40000), "longer than a card"),
    ],
)
def test_a_bad_line_costs_itself_and_is_counted(bad: str, fault: str, tmp_path: Path) -> None:
    recording = esp32_csi.read(written(tmp_path, line(), bad, line(stamp=2_100_000)))
    assert len(recording.csi) == 2
    ((kind, issue),) = recording.report.issues.items()
    assert fault in kind
    assert issue.lines == [2]


def test_other_files_and_files_too_large_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(FormatError, match="no line of channel state"):
        esp32_csi.read(written(tmp_path, HEADER))
    monkeypatch.setattr(esp32_csi, "_MOST_BYTES", 10)
    with pytest.raises(FormatError, match="larger than"):
        esp32_csi.read(written(tmp_path, line()))


@settings(max_examples=80)
@given(data=st.binary(max_size=200), at=st.integers(0, 200))
def test_no_bytes_break_the_reader(data: bytes, at: int, tmp_path_factory: pytest.TempPathFactory) -> None:
    good = line().encode()
    path = tmp_path_factory.mktemp("csi") / "a.csv"
    path.write_bytes(good + b"\n" + good[:at] + data + good[at:] + b"\n" + data)
    recording = esp32_csi.read(path)
    assert len(recording.csi) >= 1
    assert all(np.isfinite(frame.csi).all() for frame in recording.csi)


@pytest.mark.real_data
def test_the_published_log_is_read_whole(data_root: Path) -> None:
    path = data_root / "csi" / "fixtures" / "esp32_example_data.csv"
    if not path.is_file():
        pytest.skip(f"REAL DATA ABSENT: no file {path}; fetch with `wayfuse datasets fetch csi`")
    packets, report = esp32_csi.read_packets(path)
    lines = path.read_text(encoding="utf-8").splitlines()[1:]
    assert len(packets) + report.n_bad == len(lines)
    assert list(report.issues) == ["a line that repeats the packet before"]
    stamps = sorted({int(text.split(",")[18]) for text in lines})
    assert [p.frame.t for p in packets] == pytest.approx([1e-6 * s for s in stamps])
    assert {p.frame.csi.shape for p in packets} == {(1, 1, 64)}
    inside = lines[-1].split("[")[1].split("]")[0].split()
    assert packets[-1].frame.csi[0, 0, 5] == complex(float(inside[11]), float(inside[10]))
    assert (packets[0].frame.csi[0, 0, 27:38] == 0).all()  # the unused subcarriers at the edges of the band
