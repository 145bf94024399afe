"""The range filter of li2015 on walks written here and on the published ones."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from wayfuse.core.errors import RadioMapError
from wayfuse.evaluation.results_folds import in_turn
from wayfuse.papers.li2015_real import RangeWalk, captures, errors_of, range_tables, read_walks
from wayfuse.radio.range_correction import AS_MEASURED, RangeLine, fit_range_line

ANCHORS = np.array([[0.0, 0.0], [12.0, 0.0], [12.0, 8.0], [0.0, 8.0]])
CENTROID, LEAST, EQUATION_8, EQUATION_12 = (
    "weighted centroid",
    "WC-CWLS",
    "R-PF, exponents 1 (Eq. 8)",
    "R-PF, exponents 1/d (Eq. 12)",
)


def walk(line: RangeLine = AS_MEASURED, sigma: float = 0.0) -> RangeWalk:
    """Slowly along a line through a room, with ranges that ``line`` would correct."""
    t = np.arange(0.0, 120.0, 0.5)
    xy = np.column_stack([2.0 + 0.06 * t, 3.0 + 0.01 * t])
    true = np.hypot(*(xy[:, None] - ANCHORS).transpose(2, 0, 1))
    measured = (true - line.offset) / line.slope + np.random.default_rng(0).normal(0.0, sigma, true.shape)
    return RangeWalk("Laboratory", "213", ANCHORS, t, measured, xy)


def test_exact_ranges_give_the_walk_back() -> None:
    assert errors_of(walk(), LEAST, (2.0,)).max() < 1e-3
    for method in (EQUATION_8, EQUATION_12):
        assert errors_of(walk(), method, (0.3, 0.03))[20:].mean() < 0.25


def test_the_filter_is_better_than_fixes_of_noisy_ranges() -> None:
    noisy = walk(sigma=1.5)
    assert errors_of(noisy, EQUATION_8, (1.5, 0.03)).mean() < 0.8 * errors_of(noisy, LEAST, (2.0,)).mean()


def test_a_moment_without_a_fix_keeps_the_one_before() -> None:
    broken = walk()
    broken.ranges[100:103, 1:] = np.nan
    error = errors_of(broken, LEAST, (2.0,))
    assert error[100:103] == pytest.approx(np.hypot(*(broken.xy[100:103] - broken.xy[99]).T), abs=1e-3)
    broken.ranges[0] = np.nan
    assert errors_of(broken, CENTROID, (1.0,))[0] == pytest.approx(np.hypot(*(broken.xy[0] - [6.0, 4.0])))


def test_a_line_takes_the_bias_off() -> None:
    line = RangeLine(-0.4, 0.8)
    long = walk(line)
    fitted = fit_range_line(long.ranges.ravel(), long.distances.ravel())
    assert fitted == pytest.approx(line)
    assert errors_of(long, LEAST, (2.0,)).mean() > 1.0
    assert errors_of(long.corrected(fitted), LEAST, (2.0,)).mean() < 1e-3
    assert np.isnan(line.distance(np.nan))
    with pytest.raises(RadioMapError, match="two different ranges"):
        fit_range_line([1.0, 1.0, np.nan], [1.0, 2.0, 3.0])


def test_absent_data_say_so(tmp_path: Path) -> None:
    (table,) = range_tables(tmp_path, in_turn)
    assert "ABSENT" in str(table.rows)
    table, bars = captures(tmp_path)
    assert bars == []
    assert table.rows == ()
    assert "ABSENT" in table.note


@pytest.mark.real_data
def test_exponents_help_under_the_errors_of_real_ranges(data_root: Path) -> None:
    walks = read_walks(data_root / "wifi-rtt")
    if not walks:
        pytest.skip("REAL DATA ABSENT: no wifi-rtt; fetch with `wayfuse datasets fetch wifi-rtt`")
    assert len(walks) == 20
    assert sum(w.is_development for w in walks) == 4
    lab = [w for w in walks if w.room == "Laboratory"]
    line = fit_range_line(*(np.concatenate([getattr(w, n).ravel() for w in lab if w.is_development])
                            for n in ("ranges", "distances")))  # fmt: skip
    assert 0.6 < line.slope < 1.0
    means = {}
    for method in (EQUATION_8, EQUATION_12):
        for name, correction in (("raw", AS_MEASURED), ("line", line)):
            errors = [errors_of(w.corrected(correction), method, (2.0, 0.1)).mean() for w in lab[2:6]]
            means[method, name] = float(np.mean(errors))
    for method in (EQUATION_8, EQUATION_12):
        assert means[method, "line"] < 0.6 * means[method, "raw"]
    for name in ("raw", "line"):
        assert means[EQUATION_12, name] < means[EQUATION_8, name]
