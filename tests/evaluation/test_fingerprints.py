"""Scores on static fingerprints: the reader, the figures, and the bars on the official files."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from wayfuse.core.errors import DataMissingError, FormatError, UsageError
from wayfuse.evaluation import fingerprints
from wayfuse.evaluation.fingerprints import METHODS, SPLITS, score_map, score_static, survey_of, table_of
from wayfuse.evaluation.intervals import Bootstrap
from wayfuse.formats.sodindoorloc import read
from wayfuse.radio import knn

_TAIL = "ECoord,NCoord,FloorID,BuildingID,SceneID,UserID,PhoneID,SampleTimes"
_ROWS = ["-50,100,1,2.5,1,1,1,4,3,1", "-105,-70,1,2.5,1,1,1,4,3,2", "-80,-40,9,2,3,1,2,4,3,1"]


def _write(path: Path, rows: list[str], header: str = f"MAC7,MAC3,{_TAIL}") -> Path:
    path.write_text("\n".join([header, *rows]) + "\n")
    return path


def test_columns_are_sorted_and_unheard_is_nan(tmp_path: Path) -> None:
    table = read(_write(tmp_path / "t.csv", _ROWS))
    np.testing.assert_array_equal(table.bssid, [3, 7])
    np.testing.assert_array_equal(table.rssi, np.float32([[np.nan, -50], [-70, np.nan], [-40, -80]]))
    np.testing.assert_array_equal(table.xy, [[1, 2.5], [1, 2.5], [9, 2]])
    assert table.floor.tolist() == [1, 1, 3]
    assert table.scene.tolist() == [1, 1, 2]
    assert (table.report.n_bad, table.report.n_records) == (0, {"fingerprint": 3})


def test_damaged_lines_are_counted_and_left_out(tmp_path: Path) -> None:
    bad = ["-50,x,1,2,1,1,1,4,3,1", "-50,100", "", "nan,-60,1,2,1,1,1,4,3,1", "-50,1e300,1,2,1,1,1,4,3,1"]
    table = read(_write(tmp_path / "t.csv", [*_ROWS[:1], *bad, *_ROWS[1:]]))
    assert len(table.xy) == 3
    counts = {kind: issue.count for kind, issue in table.report.issues.items()}
    assert counts == {"not a number": 1, "wrong number of fields": 1, "not finite or out of range": 2}
    assert table.report.issues["not a number"].lines == [3]


@pytest.mark.parametrize("header", ["", "a,b", f"MAC1,WIFI2,{_TAIL}", f"MAC1,MAC1,{_TAIL}", _TAIL])
def test_another_header_is_refused(tmp_path: Path, header: str) -> None:
    with pytest.raises(FormatError, match=r"t\.csv:1"):
        read(_write(tmp_path / "t.csv", _ROWS, header))


def test_no_file_no_rows_no_folder(tmp_path: Path) -> None:
    with pytest.raises(FormatError, match="no line holds a whole fingerprint"):
        read(_write(tmp_path / "t.csv", ["", "x"]))
    with pytest.raises(DataMissingError, match="wayfuse datasets fetch sodindoorloc"):
        read(tmp_path / "absent.csv")
    with pytest.raises(DataMissingError, match="wayfuse datasets fetch sodindoorloc"):
        score_static(tmp_path / "absent")


def test_the_figures_are_those_of_the_errors(tmp_path: Path) -> None:
    table = read(_write(tmp_path / "t.csv", _ROWS))
    survey = survey_of(table, [1, 3])
    assert survey.floors == ("1", "3")
    figures, floor_accuracy = score_map(knn.fit(survey, k=1), table, [1, 3], Bootstrap(n=50))
    assert figures["mean"].value == 0.0
    assert floor_accuracy == 1.0
    moved = read(_write(tmp_path / "m.csv", [_ROWS[0].replace("1,2.5", "4,6.5"), _ROWS[2]]))
    figures, _ = score_map(knn.fit(survey, k=1), moved, [1, 3], Bootstrap(n=50))
    assert figures["mean"].value == pytest.approx(2.5)
    assert (figures["mean"].low, figures["mean"].high) == pytest.approx((0.0, 5.0))
    other = read(_write(tmp_path / "o.csv", _ROWS, f"MAC7,MAC4,{_TAIL}"))
    with pytest.raises(UsageError, match="other access points"):
        score_map(knn.fit(survey), other, [1, 3])


def test_intervals_draw_points_not_lines() -> None:
    """Ten equal lines per point must not narrow the interval."""
    rng = np.random.default_rng(0)
    error = rng.gamma(2.0, 1.0, 40)
    draw = Bootstrap(n=400)
    once = fingerprints._intervals(error, np.arange(40), draw)
    tenfold = fingerprints._intervals(np.repeat(error, 10), np.repeat(np.arange(40), 10), draw)
    assert tenfold["mean"].low == pytest.approx(once["mean"].low)
    assert tenfold["mean"].high == pytest.approx(once["mean"].high)


@pytest.mark.real_data
@pytest.mark.slow
def test_the_bars_on_the_official_files(data_root: Path) -> None:
    """CETC331: the published 2.817 m again, and each method at or below the best published of its kind."""
    root = data_root / "sodindoorloc"
    if not root.is_dir():
        pytest.skip(f"REAL DATA ABSENT: no folder {root}")
    scores = {s.method: s for s in score_static(root, splits=SPLITS[:1], bootstrap=Bootstrap(n=200))}
    assert scores.keys() == METHODS.keys()
    assert {(s.n, s.n_points) for s in scores.values()} == {(840, 84)}
    assert scores["knn raw euclid -104"].mean.value == pytest.approx(2.817, rel=0.005)
    assert scores["knn powed sorensen"].mean.value <= 2.46
    assert scores["horus"].mean.value <= 2.43
    assert scores["gaussian process"].mean.value < 2.42
    for s in scores.values():
        assert s.floor_accuracy == 1.0
        assert s.mean.low < s.mean.value < s.mean.high
    assert "| CETC331 | horus |" in table_of(list(scores.values()))
