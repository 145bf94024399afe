from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from made_up_walks import track

from wayfuse.core.errors import FormatError, UsageError
from wayfuse.core.frames import GeoAnchor
from wayfuse.evaluation.estimates_file import (
    COLUMNS,
    REQUIRED,
    Sidecar,
    from_track,
    is_estimates_file,
    open_writer,
    read_estimates,
    read_sidecar,
    sidecar_path,
    write_estimates,
)
from wayfuse.tracking.estimate import Estimate, State

HEAD = ",".join(REQUIRED)


def written(folder: Path, *lines: str, head: str = HEAD, end: str = "\n", name: str = "est.csv") -> Path:
    path = folder / name
    path.write_bytes((end.join([head, *lines]) + end).encode())
    return path


def test_the_first_columns_are_the_contract() -> None:
    assert COLUMNS[:7] == ("walk", "t_ms", "x", "y", "floor", "lat", "lon")
    sure = ("var_x", "var_y", "cov_xy", "r68", "r95")
    assert COLUMNS[7:13] == ("method", *sure)
    assert COLUMNS[13:] == ("state", "n_steps", "n_aps", "share_blocked", "ess", "survey_distance")


positions = st.lists(st.tuples(st.floats(-1e4, 1e4), st.floats(-1e4, 1e4)), min_size=1, max_size=6)
names = st.text(st.characters(codec="utf-8", exclude_categories=("C", "Z")), min_size=1, max_size=8)


@given(positions, names, names, names, st.floats(0, 2e9))
def test_what_is_written_is_read_again(
    tmp_path_factory: pytest.TempPathFactory,
    xy: list[tuple[float, float]],
    walk: str,
    floor: str,
    method: str,
    start: float,
) -> None:
    path = tmp_path_factory.mktemp("est") / "est.csv"
    t = start + 0.7 * np.arange(len(xy))
    r95 = np.where(np.arange(len(xy)) % 2, np.nan, 4.25)
    assert write_estimates(path, [track(t, xy, floor, walk=walk, method=method, r95=r95)]) == len(xy)
    (again,) = read_estimates(path).tracks
    assert (again.walk, again.method, again.floor.tolist()) == (walk, method, [floor] * len(xy))
    np.testing.assert_allclose(again.t, t, atol=1e-6)
    np.testing.assert_allclose(again.xy, np.array(xy), atol=5.1e-4)
    np.testing.assert_allclose(again.number("r95"), r95)
    assert np.all(np.isnan(again.lonlat))


def test_a_track_of_the_tracker_is_written_whole(tmp_path: Path) -> None:
    def estimate(t: float, x: float, state: State) -> Estimate:
        return Estimate(t, x, 2.0, 1, 1.5, 0.25, 2.5, 3.0, 6.0, state, 2, 40, 0.125, 0.5)

    rows = [
        estimate(1.0, 0.0, State.INITIALISING),
        estimate(2.0, 1.0, State.LOST),
        estimate(2.0, 9.0, State.TRACKING),
    ]
    anchor = GeoAnchor.from_origin(11.11, 49.46)
    path = tmp_path / "est.csv"
    write_estimates(
        path, [from_track("w", "fused", rows, ("B1", "F1"), [anchor, anchor], np.array([0.5, 1.0, 1.5]))]
    )
    (again,) = read_estimates(path).tracks
    assert again.t.tolist() == [1.0, 2.0]  # of two at one time the later one
    assert again.xy.tolist() == [[0.0, 2.0], [9.0, 2.0]]
    assert again.states().tolist() == ["initialising", "tracking"]
    assert again.floor.tolist() == ["F1", "F1"]
    np.testing.assert_allclose(anchor.to_xy(again.lonlat), again.xy, atol=2e-3)
    expected = {"var_x": 1.5, "cov_xy": 0.25, "var_y": 2.5, "r68": 3, "r95": 6, "n_steps": 2, "n_aps": 40,
                "share_blocked": 0.125, "ess": 0.5}  # fmt: skip
    for name, value in expected.items():
        assert again.number(name).tolist() == [value, value], name
    assert again.number("survey_distance").tolist() == [0.5, 1.5]


def test_files_of_other_programs(tmp_path: Path) -> None:
    lines = ("a,1000.5,1,2,F1,,", '"b, c",1e3,1,2,F1,49.5,11.25', "a,2000,2,2,F2,,")
    path = written(tmp_path, *lines, end="\r\n", name="knn.csv", head="﻿" + HEAD)
    first, second = read_estimates(path).tracks
    assert (first.walk, first.method, first.t.tolist()) == ("a", "knn", [1.0005, 2.0])
    assert (second.walk, second.lonlat.tolist()) == ("b, c", [[11.25, 49.5]])
    assert np.all(np.isnan(first.number("r95")))
    assert first.states().tolist() == ["", ""]


def test_unknown_columns_are_passed_over(tmp_path: Path) -> None:
    path = written(tmp_path, "a,1,1,2,F1,,,7.5,m,hello", head=HEAD + ",r95,method,remark")
    (found,) = read_estimates(path).tracks
    assert (found.method, found.number("r95").tolist()) == ("m", [7.5])


GOOD = "a,1000,1,2,F1,,"


@pytest.mark.parametrize(
    ("line", "fault"),
    [
        ("a,2000,1,2,F1,", "6 fields of 7"),
        ("a,2000,1,2,F1,,,9", "8 fields of 7"),
        ("a,soon,1,2,F1,,", "t_ms = 'soon' is no number"),
        ("a,2000,one,2,F1,,", "x = 'one' is no number"),
        ("a,2000,nan,2,F1,,", "x is not a finite number"),
        ("a,2000,,2,F1,,", "x is not a finite number"),
        ("a,2000,1,inf,F1,,", "y is not a finite number"),
        ("a,2000,1,2,,,", "the floor is empty"),
        (",2000,1,2,F1,,", "the walk is empty"),
        ("a,2000,1,2,F1,north,", "lat = 'north' is no number"),
        ("a,999,1,2,F1,,", "t_ms does not ascend"),
        ("a,1000,1,3,F1,,", "a second, different estimate"),
    ],
)
def test_a_damaged_line_is_named(tmp_path: Path, line: str, fault: str) -> None:
    path = written(tmp_path, GOOD, "b,1,1,1,F1,,", line)
    with pytest.raises(FormatError, match=fault) as caught:
        read_estimates(path)
    assert caught.value.where == f"{path}:4"
    assert caught.value.remedy


def test_a_negative_radius_is_refused(tmp_path: Path) -> None:
    path = written(tmp_path, GOOD + ",3", "a,1001,1,1,F1,,,-1", head=HEAD + ",r68")
    with pytest.raises(FormatError, match="r68 is negative"):
        read_estimates(path)


def test_a_repeated_row_is_dropped_and_said(tmp_path: Path) -> None:
    file = read_estimates(written(tmp_path, GOOD, GOOD, "a,2000,1,2,F1,,", "a,2000,1,2,F1,,"))
    assert len(file.tracks[0]) == 2
    assert "2 rows repeat" in file.notes[0]


@pytest.mark.parametrize(
    "head", ["", "walk,t_ms,y,x,floor,lat,lon", "walk,t_ms,x,y", "hello", HEAD + ",r68,r68"]
)
def test_a_wrong_header_is_refused(tmp_path: Path, head: str) -> None:
    with pytest.raises(FormatError, match="header"):
        read_estimates(written(tmp_path, GOOD, head=head))


def test_no_text_and_no_file(tmp_path: Path) -> None:
    binary = tmp_path / "x.csv"
    binary.write_bytes(bytes(range(256)))
    with pytest.raises(FormatError, match="no text"):
        read_estimates(binary)
    with pytest.raises(UsageError, match="no such file"):
        read_estimates(tmp_path / "absent.csv")


def test_an_empty_file_has_no_tracks(tmp_path: Path) -> None:
    assert read_estimates(written(tmp_path)).tracks == ()


def test_recognition(tmp_path: Path) -> None:
    assert is_estimates_file(written(tmp_path, GOOD))
    assert is_estimates_file(written(tmp_path, GOOD, head="﻿" + HEAD, name="bom.csv"))
    assert not is_estimates_file(written(tmp_path, GOOD, name="est.txt"))
    assert not is_estimates_file(written(tmp_path, GOOD, head="time,x,y", name="sensor.csv"))
    assert not is_estimates_file(tmp_path / "absent.csv")


def test_the_writer_refuses_what_could_not_be_read(tmp_path: Path) -> None:
    path = tmp_path / "est.csv"
    with pytest.raises(UsageError, match="ascend"):
        write_estimates(path, [track([1.0, 1.0], [(0, 0), (1, 1)])])
    with pytest.raises(UsageError, match="finite"):
        write_estimates(path, [track([1.0], [(0, float("nan"))])])
    assert list(tmp_path.iterdir()) == []
    with pytest.raises(UsageError, match="no folder"):
        write_estimates(tmp_path / "absent" / "est.csv", [])


def test_a_stopped_writer_leaves_the_old_file(tmp_path: Path) -> None:
    path = written(tmp_path, GOOD)
    before = path.read_bytes()

    def stopped() -> None:
        with open_writer(path) as writer:
            writer.add(track([1.0], [(5, 5)]))
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        stopped()
    assert path.read_bytes() == before
    assert [p.name for p in tmp_path.iterdir()] == ["est.csv"]


def test_sidecar(tmp_path: Path) -> None:
    path = tmp_path / "est.csv"
    sidecar = Sidecar("site", "map.npz", 7, 2.5, {"n_particles": 1000}, "0.1.0")
    write_estimates(path, [track([1.0], [(0, 0)])], sidecar)
    assert read_estimates(path).sidecar == sidecar
    assert json.loads(sidecar_path(path).read_text())["site"] == "site"
    write_estimates(path, [track([1.0], [(0, 0)])])
    assert read_sidecar(path) is None  # the old one would tell of another run


@pytest.mark.parametrize("text", ["{", "[]", '{"lag": "soon"}', '{"parameters": 3}'])
def test_a_damaged_sidecar_is_named(tmp_path: Path, text: str) -> None:
    path = written(tmp_path, GOOD)
    sidecar_path(path).write_text(text)
    with pytest.raises(FormatError, match="sidecar") as caught:
        read_estimates(path)
    assert caught.value.where.endswith("est.csv.json")
