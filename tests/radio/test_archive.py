"""Files of surveys and radio maps: whole or refused, never half believed."""

from __future__ import annotations

import json
import zipfile
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from wayfuse.core.errors import RadioMapError
from wayfuse.radio.archive import read_archive, write_archive
from wayfuse.radio.survey import Survey
from wayfuse.radio.survey_file import load_survey, save_survey


def _survey() -> Survey:
    rng = np.random.default_rng(3)
    rssi = rng.uniform(-95, -40, (12, 5))
    rssi[rng.random((12, 5)) < 0.3] = np.nan
    return Survey.from_dense(rssi, rng.uniform(0, 30, (12, 2)), np.arange(12) // 6, ("EG", "1. OG"))


def _header(path: Path) -> dict:  # type: ignore[type-arg]
    with zipfile.ZipFile(path) as archive:
        return json.loads(archive.read("header.json"))  # type: ignore[no-any-return]


def _rewrite(path: Path, change_header=None, drop: str = "") -> None:  # type: ignore[no-untyped-def]
    """Rewrite the zip with another header or without a member."""
    with zipfile.ZipFile(path) as archive:
        members = {name: archive.read(name) for name in archive.namelist() if name != drop}
    if change_header is not None:
        top = json.loads(members["header.json"])
        change_header(top)
        members["header.json"] = json.dumps(top).encode()
    with zipfile.ZipFile(path, "w") as archive:
        for name, data in members.items():
            archive.writestr(name, data)


def test_a_survey_comes_back_bit_for_bit(tmp_path: Path) -> None:
    survey = _survey()
    save_survey(survey, tmp_path / "s.npz")
    back = load_survey(tmp_path / "s.npz")
    for name in ("bssid", "frequency", "xy", "floor", "walk", "indptr", "indices", "rssi"):
        got, want = getattr(back, name), getattr(survey, name)
        assert got.dtype == want.dtype
        np.testing.assert_array_equal(got, want)
    assert (back.floors, back.walks) == (survey.floors, survey.walks)


def test_equal_content_gives_equal_bytes_and_numpy_reads_it(tmp_path: Path) -> None:
    save_survey(_survey(), tmp_path / "a.npz")
    save_survey(_survey(), tmp_path / "b.npz")
    assert (tmp_path / "a.npz").read_bytes() == (tmp_path / "b.npz").read_bytes()
    with np.load(tmp_path / "a.npz", allow_pickle=False) as members:
        assert members["xy"].shape == (12, 2)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a.npz", "b.npz"]


@settings(max_examples=25, deadline=None)
@given(
    st.dictionaries(st.from_regex(r"[a-z]{1,5}", fullmatch=True), st.lists(st.floats(width=32)), max_size=4)
)
def test_any_arrays_come_back(
    tmp_path_factory: pytest.TempPathFactory, content: dict[str, list[float]]
) -> None:
    path = tmp_path_factory.mktemp("archive") / "x.npz"
    arrays = {name: np.array(values, np.float32) for name, values in content.items()}
    write_archive(path, "thing", 2, {"a": [1, "b"]}, arrays)
    kind, header, back = read_archive(path)
    assert (kind, header) == ("thing", {"a": [1, "b"], "version": 2})
    assert back.keys() == arrays.keys()
    for name, array in arrays.items():
        assert back[name].tobytes() == array.tobytes()


def test_every_truncation_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "s.npz"
    save_survey(_survey(), path)
    data = path.read_bytes()
    for length in range(0, len(data), 37):
        path.write_bytes(data[:length])
        with pytest.raises(RadioMapError, match=r"s\.npz"):
            load_survey(path)


def test_a_flipped_byte_never_passes_unnoticed(tmp_path: Path) -> None:
    path = tmp_path / "s.npz"
    survey = _survey()
    save_survey(survey, path)
    data = path.read_bytes()
    refused = 0
    for place in range(0, len(data), 11):
        path.write_bytes(data[:place] + bytes([data[place] ^ 0x41]) + data[place + 1 :])
        try:
            back = load_survey(path)
        except RadioMapError:
            refused += 1
        else:  # a byte that carries no content, such as a date in the zip directory
            assert back.rssi.tobytes() == survey.rssi.tobytes()
            assert back.xy.tobytes() == survey.xy.tobytes()
            assert back.floors == survey.floors
    assert refused > 0.5 * len(data) / 11


@pytest.mark.parametrize("field", ["version", "format_version"])
def test_a_newer_file_says_update(tmp_path: Path, field: str) -> None:
    path = tmp_path / "s.npz"
    save_survey(_survey(), path)
    _rewrite(path, lambda top: top.update({field: 99}))
    with pytest.raises(RadioMapError, match=r"version 99 is newer than 1 \(update wayfuse\)"):
        load_survey(path)


def test_a_missing_member_is_named(tmp_path: Path) -> None:
    path = tmp_path / "s.npz"
    save_survey(_survey(), path)
    _rewrite(path, drop="rssi.npy")
    with pytest.raises(RadioMapError, match="'rssi' is missing"):
        load_survey(path)


def test_foreign_files_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "f.npz"
    np.savez(path, xy=np.zeros(3))
    with pytest.raises(RadioMapError, match="not a wayfuse archive"):
        read_archive(path)
    path.write_text("not a zip")
    with pytest.raises(RadioMapError, match="not a whole zip"):
        read_archive(path)
    with pytest.raises(RadioMapError, match="no such file"):
        read_archive(tmp_path / "absent.npz")
    write_archive(path, "thing", 1, {}, {})
    with pytest.raises(RadioMapError, match="holds 'thing', not 'survey'"):
        load_survey(path)


def test_a_declared_size_is_checked_before_it_is_allocated(tmp_path: Path) -> None:
    path = tmp_path / "s.npz"
    for shape, message in (([1 << 40], "declares"), ([1 << 20], "declared size"), ([-1], "damaged header")):
        save_survey(_survey(), path)
        _rewrite(path, lambda top, shape=shape: top["arrays"]["rssi"].update(shape=shape))
        with pytest.raises(RadioMapError, match=message):
            load_survey(path)


def test_a_compressed_member_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "z.npz"
    write_archive(path, "thing", 1, {}, {"a": np.zeros(10)})
    with zipfile.ZipFile(path) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("header.json", members["header.json"], zipfile.ZIP_STORED)
        archive.writestr("a.npy", members["a.npy"])
    with pytest.raises(RadioMapError, match="declared size"):
        read_archive(path)


def test_object_arrays_and_nan_headers_cannot_be_written(tmp_path: Path) -> None:
    with pytest.raises(RadioMapError, match="cannot be stored"):
        write_archive(tmp_path / "o.npz", "thing", 1, {}, {"a": np.array([{}])})
    with pytest.raises(RadioMapError, match="cannot be stored as JSON"):
        write_archive(tmp_path / "o.npz", "thing", 1, {"x": float("nan")}, {})
    assert not list(tmp_path.iterdir())


def test_a_survey_with_stray_indices_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "s.npz"
    save_survey(_survey(), path)
    _, header, arrays = read_archive(path)
    for name in ("indices", "floor", "indptr"):
        stray = {**arrays, name: arrays[name] + 100}
        write_archive(path, "survey", 1, {k: header[k] for k in ("floors", "walks")}, stray)
        with pytest.raises(RadioMapError, match="do not fit together"):
            load_survey(path)
