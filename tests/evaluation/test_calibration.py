from __future__ import annotations

import numpy as np
import pytest
from made_up_walks import RHO68, RHO95, noisy_scores, recording, track

from wayfuse.evaluation.calibration import calibrate, coverage, nees, nominal_level, time_bins
from wayfuse.evaluation.errors import score


def test_coverage_by_hand() -> None:
    # Errors at 102 ... 110 of a standing estimate at 2 m are 0 ... 8 m.
    walk = track([102.0], [(2.0, 0.0)], r68=[3.0], r95=[6.5])
    points = score([walk], [recording()]).methods[0].points["1hz"].used()
    found = coverage(points)
    assert found.n == 9
    assert found.within68.value == pytest.approx(4 / 9)
    assert found.within95.value == pytest.approx(7 / 9)
    assert (found.mean_r68, found.mean_r95) == (3.0, 6.5)


def test_true_radii_are_found_calibrated() -> None:
    points = noisy_scores(40, {"m": 2.0}).methods[0].points["1hz"].used()
    found = calibrate(points)
    assert found is not None
    n = len(points)
    for share, nominal in ((found.overall.within68, 0.68), (found.overall.within95, 0.95)):
        assert abs(share.value - nominal) < 5 * np.sqrt(nominal * (1 - nominal) / n)
        assert share.low <= share.value <= share.high
    assert abs(found.mean_nees - 2.0) < 5 * 2.0 / np.sqrt(
        n
    )  # NEES in the plane: mean 2, standard deviation 2
    assert found.n_without == 0


def test_radii_too_small_are_found_out() -> None:
    points = noisy_scores(20, {"m": 2.0}).methods[0].points["1hz"].used()
    half = calibrate(points.select(points.r95 > 0))
    assert half is not None
    small = type(points)(**{f: getattr(points, f) for f in points.__dataclass_fields__} | {
        "r68": 0.5 * points.r68, "r95": 0.5 * points.r95, "cov": 0.25 * points.cov})  # fmt: skip
    found = calibrate(small)
    assert found is not None
    assert found.overall.within68.value < 0.5
    assert found.mean_nees == pytest.approx(4 * half.mean_nees)


def test_levels_are_uniform_for_a_circular_gaussian() -> None:
    rng = np.random.default_rng(4)
    sigma = rng.uniform(0.5, 5.0, 20_000)
    error = np.hypot(*rng.normal(size=(2, len(sigma)))) * sigma
    level = np.sort(nominal_level(error, RHO68 * sigma, RHO95 * sigma))
    distance = np.max(np.abs(level - np.arange(1, len(level) + 1) / len(level)))
    assert distance < 1.95 / np.sqrt(len(level))  # Kolmogorov-Smirnov at 0.1 %


def test_levels_at_the_radii_and_beyond() -> None:
    r68, r95 = np.full(5, 2.0), np.full(5, 7.0)
    found = nominal_level(np.array([0.0, 2.0, 4.0, 7.0, 100.0]), r68, r95)
    np.testing.assert_allclose(found[[0, 1, 3]], [0.0, 0.68, 0.95])
    assert np.all(np.diff(found) > 0)
    assert found[-1] <= 1.0
    degenerate = nominal_level(np.array([1.0, 3.0]), np.array([2.0, 2.0]), np.array([2.0, 2.0]))
    assert degenerate[0] < 0.68
    assert degenerate[1] == 1.0


def test_nees_of_a_correlated_covariance_and_of_none() -> None:
    cov = np.array([[4.0, 1.5], [1.5, 1.0]])
    walk = track(
        [102.0, 105.0], [(5.0, 2.0), (5.0, 2.0)], var_x=[4.0, 4.0], var_y=[1.0, 1.0], cov_xy=[1.5, 3.0]
    )
    points = score([walk], [recording()]).methods[0].points["1hz"].used()
    found = nees(points)
    d = np.array([3.0, 2.0])
    assert found[0] == pytest.approx(d @ np.linalg.solve(cov, d))
    assert np.all(np.isnan(found[3:]))  # not positive definite


def test_split_by_state_and_time() -> None:
    walk = track([102.0, 104.0], [(2.0, 0.0), (4.0, 0.0)], r68=[3.0, 3.0], r95=[6.5, 6.5])
    stated = type(walk)(walk.walk, walk.method, walk.t, walk.xy, walk.floor, walk.lonlat, walk.numbers,
                        np.array(["initialising", "tracking"]))  # fmt: skip
    points = score([stated], [recording(scans=(102.0,))]).methods[0].points["1hz"].used()
    found = calibrate(points)
    assert found is not None
    assert {s: c.n for s, c in found.by_state.items()} == {"initialising": 2, "tracking": 7}
    assert {s: c.n for s, c in found.by_time.items()} == {"0-5 s": 5, "5-10 s": 4}
    assert sum(int(rows.sum()) for _, rows in time_bins(points)) == len(points)


def test_without_radii_there_is_no_calibration() -> None:
    points = score([track([102.0], [(0, 0)])], [recording()]).methods[0].points["1hz"].used()
    assert calibrate(points) is None


def test_points_without_radii_are_counted() -> None:
    walk = track([102.0, 106.0], [(0, 0), (0, 0)], r68=[1.0, np.nan], r95=[2.0, np.nan])
    found = calibrate(score([walk], [recording()]).methods[0].points["1hz"].used())
    assert found is not None
    assert (found.overall.n, found.n_without) == (4, 5)
