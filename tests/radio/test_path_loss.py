"""Path loss of two bands: Eq. 1 by hand, its inverse and fit, the likelihood, and the least-squares fixes."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wayfuse.core.errors import ConfigError
from wayfuse.radio.path_loss import PathLoss, distances, fit_path_loss, log_likelihood
from wayfuse.radio.path_loss_trilateration import gauss_newton_fix, linearised_fix, ranges

BANDS = (PathLoss(-35.0, 0.15, 3.6), PathLoss(-40.0, 0.25, 4.8))
AP_XY = np.array([[0.0, 0.0], [40.0, 2.0], [38.0, 25.0], [3.0, 24.0], [20.0, 12.0]])


def test_readings_by_hand() -> None:
    # 10 m: 20 dB of free space and 1.5 dB of obstacles; in bels, as Eq. 1 is printed, it would be -20 log10 of a power
    np.testing.assert_allclose(BANDS[0].at(np.array([1.0, 10.0, 100.0])), [-35.15, -56.5, -90.0])
    assert BANDS[0].at(np.array([0.2]))[0] == BANDS[0].at(np.array([1.0]))[0]


@given(st.floats(1.0, 500.0), st.floats(0.0, 3.0), st.floats(-60.0, 0.0))
def test_distance_inverts_readings(d: float, attenuation: float, power: float) -> None:
    band = PathLoss(power, attenuation, 3.0)
    assert band.distance(band.at(np.array([d])))[0] == pytest.approx(d, rel=1e-6)


def test_a_reading_above_the_power_is_one_metre_and_none_is_none() -> None:
    found = BANDS[1].distance(np.array([-5.0, 20.0, np.nan, -40.25]))
    np.testing.assert_allclose(found, [1.0, 1.0, np.nan, 1.0], atol=1e-9)


def test_the_fit_finds_power_attenuation_and_noise() -> None:
    rng = np.random.default_rng(3)
    d = rng.uniform(1.0, 40.0, 4000)
    band = PathLoss(-37.0, 0.3, 4.0)
    rssi = band.at(d) + 4.0 * rng.standard_normal(len(d))
    rssi[::7] = np.nan
    found = fit_path_loss(d, rssi)
    # standard errors: 0.13 dB, 0.006 dB/m, 0.05 dB
    assert found.power == pytest.approx(-37.0, abs=0.6)
    assert found.attenuation == pytest.approx(0.3, abs=0.03)
    assert found.sigma == pytest.approx(4.0, abs=0.25)
    assert fit_path_loss(d, rssi, power=-37.0).attenuation == pytest.approx(0.3, abs=0.02)


def test_a_fit_at_one_distance_leaves_attenuation_out() -> None:
    found = fit_path_loss(np.full(5, 10.0), np.array([-60.0, -61.0, -59.0, -60.0, -60.0]))
    assert (found.attenuation, found.power) == (0.0, pytest.approx(-40.0))


def test_attenuation_is_never_negative() -> None:
    assert fit_path_loss(np.array([1.0, 10.0, 20.0]), np.array([-40.0, -50.0, -50.0])).attenuation == 0.0


@pytest.mark.parametrize("power", [None, -40.0])
def test_a_fit_needs_more_readings_than_unknowns(power: float | None) -> None:
    n = 2 if power is None else 1
    with pytest.raises(ConfigError, match="readings cannot fit"):
        fit_path_loss(np.full(5, 3.0), np.array([-50.0] * n + [np.nan] * (5 - n)), power=power)


@pytest.mark.parametrize("wrong", [(math.nan, 0.1, 1.0), (-40.0, -0.1, 1.0), (-40.0, 0.1, 0.0)])
def test_impossible_bands_are_refused(wrong: tuple[float, float, float]) -> None:
    with pytest.raises(ConfigError):
        PathLoss(*wrong)


def test_the_likelihood_is_the_product_of_all_densities() -> None:
    rng = np.random.default_rng(5)
    xy = rng.uniform(0.0, 40.0, (30, 2))
    rssi = rng.uniform(-80.0, -40.0, (2, len(AP_XY)))
    rssi[0, 1] = rssi[1, 2] = rssi[0, 4] = rssi[1, 4] = np.nan
    expected = np.zeros(len(xy))
    for i, place in enumerate(xy):
        for b, band in enumerate(BANDS):
            for a, ap in enumerate(AP_XY):
                if not math.isnan(rssi[b, a]):
                    d = max(1.0, math.dist(place, ap))
                    mean = band.power - 20.0 * math.log10(d) - band.attenuation * d
                    expected[i] += -((rssi[b, a] - mean) ** 2) / (2.0 * band.sigma**2)
    np.testing.assert_allclose(log_likelihood(BANDS, AP_XY, rssi, xy), expected, rtol=1e-12)


def test_the_likelihood_does_not_underflow_and_silence_says_nothing() -> None:
    xy = np.array([[0.0, 0.0], [1e4, 1e4]])
    far = log_likelihood(BANDS, AP_XY, np.full((2, len(AP_XY)), -30.0), xy)
    assert np.all(np.isfinite(far))
    assert far[1] < -1e5 < far[0]
    np.testing.assert_array_equal(log_likelihood(BANDS, AP_XY, np.full((2, len(AP_XY)), np.nan), xy), 0.0)


def exact(place: np.ndarray, silent: tuple[int, ...] = ()) -> np.ndarray:
    away = distances(place[None], AP_XY)[0]
    rssi = np.array([band.at(away) for band in BANDS])
    rssi[:, list(silent)] = np.nan
    return rssi


@pytest.mark.parametrize("place", [(10.0, 7.0), (33.0, 20.0), (50.0, -4.0)])
def test_exact_readings_give_the_exact_place(place: tuple[float, float]) -> None:
    truth = np.array(place)
    where, r, r_sigma = ranges(BANDS, AP_XY, exact(truth, (1,)))
    assert len(r) == 2 * (len(AP_XY) - 1)
    found = linearised_fix(where, r)
    assert found is not None
    np.testing.assert_allclose(found, truth, atol=1e-6)
    np.testing.assert_allclose(
        gauss_newton_fix(where, r, r_sigma, truth + np.array([6.0, -5.0])), truth, atol=1e-6
    )


def test_range_errors_are_those_of_the_readings() -> None:
    truth = np.array([12.0, 9.0])
    _, r, r_sigma = ranges(BANDS, AP_XY, exact(truth))
    _, shifted, _ = ranges(BANDS, AP_XY, exact(truth) - 1e-4 * np.array([[3.6], [4.8]]))
    np.testing.assert_allclose((shifted - r) / 1e-4, r_sigma, rtol=1e-3)


def test_there_is_no_fix_from_two_places_or_from_a_line() -> None:
    assert linearised_fix(np.array([[0.0, 0.0], [5.0, 0.0], [5.0, 0.0]]), np.array([3.0, 3.0, 4.0])) is None
    assert linearised_fix(np.array([[0.0, 0.0], [5.0, 0.0], [9.0, 0.0]]), np.array([3.0, 3.0, 7.0])) is None


def test_weighting_beats_the_linearised_fix_under_noise() -> None:
    rng = np.random.default_rng(11)
    plain, weighted = [], []
    for _ in range(200):
        truth = rng.uniform([0.0, 0.0], [40.0, 25.0])
        noisy = exact(truth) + np.array([[3.6], [4.8]]) * rng.standard_normal((2, len(AP_XY)))
        where, r, r_sigma = ranges(BANDS, AP_XY, noisy)
        first = linearised_fix(where, r)
        assert first is not None
        plain.append(math.dist(first, truth))
        weighted.append(math.dist(gauss_newton_fix(where, r, r_sigma, first), truth))
    assert np.mean(weighted) < 0.8 * np.mean(plain)


def test_an_offset_shared_by_a_scan_is_integrated_out() -> None:
    rng = np.random.default_rng(4)
    ap_xy, xy = rng.uniform(0.0, 20.0, (3, 2)), rng.uniform(0.0, 20.0, (6, 2))
    bands = (PathLoss(-35.0, 0.15, 3.0), PathLoss(-40.0, 0.25, 5.0))
    rssi = np.array([[-60.0, np.nan, -70.0], [-66.0, -72.0, np.nan]])
    heard = np.isfinite(rssi)
    sigma = np.concatenate([np.full(h.sum(), band.sigma) for h, band in zip(heard, bands, strict=True)])
    covariance = np.diag(sigma**2) + 6.0**2
    expected = []
    for place in xy:
        away = np.hypot(*(ap_xy - place).T)
        residual = np.concatenate([r[h] - b.at(away[h]) for r, h, b in zip(rssi, heard, bands, strict=True)])
        expected.append(-0.5 * residual @ np.linalg.solve(covariance, residual))
    np.testing.assert_allclose(log_likelihood(bands, ap_xy, rssi, xy, offset_sigma=6.0), expected)
    louder = log_likelihood(bands, ap_xy, rssi + 8.0, xy, offset_sigma=1e4)
    np.testing.assert_allclose(louder, log_likelihood(bands, ap_xy, rssi, xy, offset_sigma=1e4), atol=1e-3)
