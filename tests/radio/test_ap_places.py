"""Places of access points: what is written is read back; damaged files are told by file and line."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wayfuse.core.errors import ConfigError, DataMissingError, FormatError, UsageError
from wayfuse.radio.ap_places import ApPlaces, read_ap_places, write_ap_places
from wayfuse.sensors.records import bssid_id

FLOORS = ("B1", "F1", "Mezzanine, west")
HEADER = "bssid,x,y,floor,height\n"


def places(n: int = 3, *, is_estimated: bool = False) -> ApPlaces:
    step = np.arange(n, dtype=np.float64)
    return ApPlaces(
        np.array([bssid_id(f"0a:00:00:00:00:{i:02x}") for i in range(n)], np.uint64),
        1.25 * step, -2.5 * step, (np.arange(n) % 3).astype(np.int32),
        np.where(step == 1, np.nan, 2.4), is_estimated, 0.5 + step if is_estimated else None,
    )  # fmt: skip


def same(one: ApPlaces, other: ApPlaces) -> None:
    np.testing.assert_array_equal(one.bssid, other.bssid)
    for name in ("x", "y", "floor", "height"):
        np.testing.assert_allclose(getattr(one, name), getattr(other, name), atol=5.1e-3)
    assert one.is_estimated == other.is_estimated


@pytest.mark.parametrize("is_estimated", [False, True])
def test_what_is_written_is_read(tmp_path: Path, is_estimated: bool) -> None:
    one = places(is_estimated=is_estimated)
    write_ap_places(tmp_path / "aps.csv", one, FLOORS)
    other = read_ap_places(tmp_path / "aps.csv", FLOORS)
    same(one, other)
    assert (other.sigma is not None) == is_estimated
    assert other.power is None
    powered = replace(one, power=np.array([-40.0, np.nan, -51.25]))
    write_ap_places(tmp_path / "aps.csv", powered, FLOORS)
    np.testing.assert_allclose(read_ap_places(tmp_path / "aps.csv", FLOORS).power, powered.power)
    np.testing.assert_allclose(powered.select(np.array([2])).power, [-51.25])
    if is_estimated:
        assert one.sigma is not None
        np.testing.assert_allclose(other.sigma, one.sigma)


@given(
    st.lists(
        st.tuples(
            st.integers(0, 2**48 - 1).map(np.uint64) | st.integers(2**63, 2**64 - 1).map(np.uint64),
            st.floats(-1e4, 1e4), st.floats(-1e4, 1e4), st.integers(0, 2), st.floats(0.0, 9.0) | st.just(np.nan),
        ),
        unique_by=lambda row: int(row[0]),
    )
)  # fmt: skip
def test_every_place_survives_the_file(
    tmp_path_factory: pytest.TempPathFactory, rows: list[tuple[np.uint64, float, float, int, float]]
) -> None:
    path = tmp_path_factory.getbasetemp() / "every.csv"
    columns = list(zip(*rows, strict=True)) if rows else [()] * 5
    bssid, x, y, floor, height = (
        np.array(column, dtype=kind)
        for column, kind in zip(columns, (np.uint64, float, float, np.int32, float), strict=True)
    )
    one = ApPlaces(bssid, x, y, floor, height)
    write_ap_places(path, one, FLOORS)
    same(one, read_ap_places(path, FLOORS))


def test_a_file_made_by_hand(tmp_path: Path) -> None:
    path = tmp_path / "hand.csv"
    path.write_text(
        '\ufefffloor , BSSID,x,y\nF1, 0A-00-00-00-00-07 ,3,4\n\n,,,\n"Mezzanine, west",token-9, 1e1,-2\n',
        encoding="utf-8",
    )
    read = read_ap_places(path, FLOORS)
    assert read.bssid.tolist() == [0x0A0000000007, bssid_id("token-9")]
    assert read.xy.tolist() == [[3.0, 4.0], [10.0, -2.0]]
    assert read.floor.tolist() == [1, 2]
    assert np.isnan(read.height).all()
    assert not read.is_estimated


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", ":1: the header lacks a column"),
        ("bssid,x,y\n", ":1: the header lacks a column"),
        (HEADER + "0a:00:00:00:00:01,1,2,F9,\n", ":2: floor 'F9' is none of the site's"),
        (HEADER + "0a:00:00:00:00:01,1,2,F1,\n0a:00:00:00:00:02,,2,F1,\n", ":3: x '' is no such number"),
        (HEADER + "0a:00:00:00:00:01,1,nan,F1,\n", ":2: y 'nan' is no such number"),
        (HEADER + "0a:00:00:00:00:01,1,1e9,F1,\n", ":2: y '1e9' is no such number"),
        (HEADER + "0a:00:00:00:00:01,1,2,F1,high\n", ":2: height 'high' is no such number"),
        (HEADER + "0a:00:00:00:00:01,1,2,F1\n", ":2: 4 fields, the header has 5"),
        (HEADER + ",1,2,F1,\n", ":2: bssid is empty"),
        (
            HEADER + "0a:00:00:00:00:01,1,2,F1,\n0A-00-00-00-00-01,3,4,F1,\n",
            ":3: bssid .* is in line 2 already",
        ),
        ("bssid,x,y,floor,height,sigma\n0a:00:00:00:00:01,1,2,F1,,-1\n", ":2: sigma -1.0 is negative"),
        pytest.param(HEADER + "x" * 140_000 + ",1,2,F1,\n", ":2: field larger than", id="a field too long"),
    ],
)
def test_damaged_lines_are_named(tmp_path: Path, text: str, said: str) -> None:
    path = tmp_path / "bad.csv"
    path.write_text(text)
    with pytest.raises(FormatError, match=said):
        read_ap_places(path, FLOORS)


def test_what_only_looks_like_a_digest_is_a_name(tmp_path: Path) -> None:
    (tmp_path / "aps.csv").write_text(HEADER + "#-00000000000000f,1,2,F1,\n#00000000000000_1,1,2,F1,\n")
    read = read_ap_places(tmp_path / "aps.csv", FLOORS)  # the minus used to end in an error of Python's own
    assert read.bssid.tolist() == [bssid_id("#-00000000000000f"), bssid_id("#00000000000000_1")]


def test_absent_and_binary_files_are_told(tmp_path: Path) -> None:
    with pytest.raises(DataMissingError, match=r"gone\.csv"):
        read_ap_places(tmp_path / "gone.csv", FLOORS)
    (tmp_path / "binary.csv").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(FormatError, match="UTF-8"):
        read_ap_places(tmp_path / "binary.csv", FLOORS)
    with pytest.raises(UsageError, match="create it first"):
        write_ap_places(tmp_path / "no" / "aps.csv", places(), FLOORS)
    with pytest.raises(UsageError, match="another site"):
        write_ap_places(tmp_path / "aps.csv", places(), FLOORS[:1])


def test_rows_of_identifiers() -> None:
    known = places(4)
    asked = np.array([known.bssid[2], 99, known.bssid[0]], np.uint64)
    assert known.rows(asked).tolist() == [2, -1, 0]
    assert known.select(np.array([3, 2])).rows(asked).tolist() == [1, -1, -1]
    assert places(0).rows(asked).tolist() == [-1, -1, -1]


@pytest.mark.parametrize(
    "wrong",
    [
        {"x": np.zeros(2)},
        {"x": np.array([0.0, np.nan, 1.0])},
        {"bssid": np.ones(3, np.uint64)},
        {"floor": np.array([0, -1, 0], np.int32)},
        {"sigma": np.zeros(1)},
        {"power": np.zeros(1)},
    ],
)
def test_columns_that_do_not_go_together_are_refused(wrong: dict[str, np.ndarray]) -> None:
    one = places(3)
    columns = {name: getattr(one, name) for name in ("bssid", "x", "y", "floor", "height")}
    with pytest.raises(ConfigError):
        ApPlaces(**(columns | wrong))
