"""The oxford-steps reader and the step-count error on its validation walks (none set a parameter)."""

from __future__ import annotations

from pathlib import Path

import pytest

from wayfuse.core.errors import DataMissingError, FormatError
from wayfuse.evaluation.step_counts import StepCount, StepCountTable, score
from wayfuse.formats.oxford_steps import read

COUNTED = "1000000000,0.1,0.2,9.8,0,0,0\n1010000000,0.1,0.2,9.9,1,2,3\n1020000000,0.1,0.2,9.7,4,5,6\n"


def test_reads_both_layouts(tmp_path: Path):
    counted = tmp_path / "user3_hand_12.csv"
    counted.write_text(COUNTED)
    walk = read(counted)
    assert (walk.user, walk.position, walk.algorithm_steps, walk.steps, walk.phone_steps) == (
        "user3",
        "hand",
        4,
        5,
        6,
    )
    assert walk.recording.acceleration.t.tolist() == pytest.approx([1.0, 1.01, 1.02])
    assert walk.recording.acceleration.values[1].tolist() == [0.1, 0.2, 9.9]
    plain = tmp_path / "Phone_InHand_1" / "accelerometer.csv"
    plain.parent.mkdir()
    plain.write_text("1000000000,3,0.1,0.2,9.8\n")
    walk = read(plain)
    assert (walk.recording.name, walk.steps) == ("Phone_InHand_1", 0)
    assert walk.recording.acceleration.values.tolist() == [[0.1, 0.2, 9.8]]


def test_bad_lines_cost_themselves_and_are_counted(tmp_path: Path):
    path = tmp_path / "user3_hand_12.csv"
    path.write_text(COUNTED + "1030000000,0.1\nrubbish\n1015000000,0,0,9,4,5,6\n1040000000,nan,0,9,4,5,6\n")
    report = read(path).recording.report
    assert report.n_records == {"acceleration": 3}
    assert report.n_bad == 4
    assert report.issues["time before the line above"].lines == [6]


def test_missing_and_foreign_files_are_named(tmp_path: Path):
    with pytest.raises(DataMissingError, match=r"gone\.csv"):
        read(tmp_path / "gone.csv")
    (tmp_path / "other.csv").write_text("a,b,c\n")
    with pytest.raises(FormatError, match=r"other\.csv"):
        read(tmp_path / "other.csv")
    with pytest.raises(DataMissingError, match="validation"):
        score(tmp_path)


def test_table_means_errors_without_regard_to_sign():
    table = StepCountTable(
        (StepCount("a", "u", "hand", 100, 90, 0, 0), StepCount("b", "v", "hand", 100, 110, 0, 0))
    )
    assert table.mean_error("hand") == table.mean_error() == pytest.approx(0.1)
    assert "-10.0%" in table.describe()[1]


@pytest.mark.real_data
def test_step_counts_of_the_validation_walks(data_root: Path):
    folder = data_root / "oxford-steps"
    if not folder.is_dir():
        pytest.skip(f"REAL DATA ABSENT: no folder {folder}; fetch with `wayfuse datasets fetch oxford-steps`")
    table = score(folder)
    assert len(table.counts) == 12
    assert table.positions == ("armband", "backpocket", "bag", "frontpocket", "hand", "neckpouch")
    assert table.mean_error("hand") <= 0.04
    assert table.mean_error() <= 0.08
    assert max(abs(c.error) for c in table.counts) <= 0.08
