"""Gaussian-process map: the regression against plain formulas, censoring, mean, grid."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from radio_map_contract import field, fingerprint, made_up_survey, queries
from scipy.stats import norm

from wayfuse.core.errors import ConfigError, RadioMapError
from wayfuse.radio import gaussian_process
from wayfuse.radio._grid_kernels import field_log_likelihood
from wayfuse.radio.censoring import expected_when_silent, log_silence
from wayfuse.radio.gaussian_process import Noise
from wayfuse.radio.gp_fit import fit_fields
from wayfuse.radio.gp_regression import Kernel, factorise, fit_kernel, log_marginal
from wayfuse.radio.log_distance import fit_log_distance
from wayfuse.radio.survey import Survey

_KERNEL = Kernel(5.0, 6.0, 3.0, 1.2, 2.0)


def _places(n: int = 40) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(8)
    return rng.uniform(0, 15, (n, 2)), rng.normal(0, 5, (n, 3))


def _covariance(a: np.ndarray, b: np.ndarray, k: Kernel) -> np.ndarray:
    """The kernel written out, pair by pair."""
    out = np.empty((len(a), len(b)))
    for i, p in enumerate(a):
        for j, q in enumerate(b):
            d = np.sqrt(3.0) * np.hypot(*(p - q))
            far = k.far_sigma**2 * (1 + d / k.far_length) * np.exp(-d / k.far_length)
            out[i, j] = far + k.near_sigma**2 * (1 + d / k.near_length) * np.exp(-d / k.near_length)
    return out


def test_prediction_equals_the_plain_formulas_for_every_output() -> None:
    xy, y = _places()
    new = np.random.default_rng(1).uniform(-3, 18, (7, 2))
    factor = factorise(xy, _KERNEL)
    mean, sigma = factor.predict(factor.solve(y), new)
    inverse = np.linalg.inv(_covariance(xy, xy, _KERNEL) + _KERNEL.noise**2 * np.eye(40))
    cross = _covariance(new, xy, _KERNEL)
    np.testing.assert_allclose(mean, cross @ inverse @ y, atol=1e-8)
    variance = np.diag(_covariance(new, new, _KERNEL) - cross @ inverse @ cross.T)
    np.testing.assert_allclose(sigma**2, variance, rtol=1e-7)


def test_leave_one_out_equals_leaving_out() -> None:
    xy, y = _places(15)
    mean, sigma = factorise(xy, _KERNEL).leave_one_out(y)
    for i in range(15):
        others = np.arange(15) != i
        rest = factorise(xy[others], _KERNEL)
        want, spread = rest.predict(rest.solve(y[others]), xy[i : i + 1])
        np.testing.assert_allclose(mean[i], want[0], atol=1e-8)
        assert sigma[i] == pytest.approx(np.hypot(spread[0], _KERNEL.noise))


def test_the_marginal_likelihood_and_its_gradient() -> None:
    xy, y = _places()
    distance = np.hypot(*(xy[:, None] - xy[None]).transpose(2, 0, 1))
    value, gradient = log_marginal(distance, y, _KERNEL)
    whole = _covariance(xy, xy, _KERNEL) + _KERNEL.noise**2 * np.eye(40)
    sign, log_det = np.linalg.slogdet(whole)
    assert sign > 0
    assert value == pytest.approx(-0.5 * np.trace(y.T @ np.linalg.solve(whole, y)) - 1.5 * log_det)
    for i in range(5):
        step = np.zeros(5)
        step[i] = 1e-5
        up, down = (log_marginal(distance, y, Kernel(*np.exp(np.log(_KERNEL) + s)))[0] for s in (step, -step))
        assert gradient[i] == pytest.approx((up - down) / 2e-5, rel=1e-4)


def test_the_kernel_is_found_again() -> None:
    rng = np.random.default_rng(3)
    xy = rng.uniform(0, 24, (150, 2))
    true = Kernel(6.0, 10.0, 3.0, 1.5, 2.0)
    lower = np.linalg.cholesky(_covariance(xy, xy, true) + true.noise**2 * np.eye(150))
    found = fit_kernel([(xy, lower @ rng.normal(size=(150, 30)))], Kernel(3.0, 5.0, 2.0, 1.0, 4.0))
    np.testing.assert_allclose(found, true, rtol=0.25)


def test_log_distance_finds_access_points_and_exponents() -> None:
    rng = np.random.default_rng(6)
    xy = rng.uniform((0, 0), (30, 20), (200, 2))
    aps, exponent = np.array([[5.0, 5.0], [25.0, 15.0], [36.0, 10.0]]), np.array([2.0, 3.0, 4.0])
    distance = np.hypot(*(xy[:, None] - aps[None]).transpose(2, 0, 1))
    rssi = -40.0 - 10.0 * exponent * np.log10(np.hypot(distance, 2.0)) + rng.normal(0, 1, (200, 3))
    found = fit_log_distance(xy, rssi, np.ones_like(rssi))
    apart = np.hypot(*(found.xy - aps).T)
    assert apart[:2].max() < 1.5  # about the spacing of the candidates
    assert apart[2] < 4.0  # outside the survey, exponent and distance trade against each other
    np.testing.assert_allclose(found.exponent, exponent, rtol=0.2)
    assert np.std(found.at(xy) - rssi) < 1.5


@given(st.floats(-120, -40), st.floats(0.5, 15), st.floats(0.01, 0.6))
def test_silence_lowers_the_expectation_and_never_says_nan(mean: float, sigma: float, dropout: float) -> None:
    m, s = np.array([mean]), np.array([sigma])
    expected = expected_when_silent(m, s, -90.0, dropout)
    assert np.isfinite(expected[0])
    assert expected[0] <= mean + 1e-9
    assert np.log(dropout) - 1e-9 <= log_silence(m, s, -90.0, dropout)[0] <= 1e-12


def test_the_truncated_mean_equals_a_simulation() -> None:
    rng = np.random.default_rng(2)
    latent = rng.normal(-88.0, 5.0, 400_000)
    silent = (latent > -90.0) & (rng.random(400_000) < 0.2) | (latent <= -90.0)
    expected = expected_when_silent(np.array([-88.0]), np.array([5.0]), -90.0, 0.2)[0]
    error = latent[silent].std() / np.sqrt(silent.sum())
    assert abs(latent[silent].mean() - expected) < 5 * error
    share = log_silence(np.array([-88.0]), np.array([5.0]), -90.0, 0.2)[0]
    assert np.exp(share) == pytest.approx(0.2 + 0.8 * norm.cdf(-0.4))


def test_the_grid_is_the_field_at_its_nodes_and_near_it_between() -> None:
    survey = made_up_survey()
    fitted = gaussian_process.fit(survey, step=0.5, limit=-85.0)
    fields, _ = fit_fields(survey, -85.0, fitted.noise.dropout, 2000, fitted.kernel)
    inside = np.random.default_rng(0).uniform((0, 0), (20, 12), (50, 2))
    for level, floor in enumerate(fields):
        assert floor is not None
        exact, spread = floor.predict(inside)
        mean, sigma = fitted.predict(inside, level)
        assert np.abs(mean[:, floor.columns] - exact).max() < 0.5
        whole = np.sqrt(spread**2 + fitted.kernel.noise**2 + fitted.noise.session_sigma**2)
        np.testing.assert_allclose(sigma[:, floor.columns[0]], whole, rtol=0.03)
        grid = fitted.grids[level]
        assert grid is not None
        at_nodes, _ = fitted.predict(grid.nodes()[:9], level)
        np.testing.assert_allclose(at_nodes[:, grid.columns], grid.mean[:9], rtol=1e-5)


def test_the_field_follows_the_truth_where_readings_were_censored() -> None:
    survey = made_up_survey(noise=1.0)
    fitted = gaussian_process.fit(survey)
    inside = np.random.default_rng(0).uniform((1, 1), (19, 11), (200, 2))
    for level in (0, 1):
        truth = field(inside, np.full(200, level))
        mean, _ = fitted.predict(inside, level)
        heard = truth > -80.0
        assert np.sqrt(np.mean((mean - truth)[heard] ** 2)) < 3.0
        assert mean[truth < -95.0].max(initial=-200.0) < -80.0


def test_the_likelihood_is_student_t_plus_silence() -> None:
    survey = made_up_survey()
    noise = Noise(session_sigma=3.0, dof=5.0, dropout=0.2, exponent=0.5)
    fitted = gaussian_process.fit(survey, noise=noise)
    _, _, rssi = queries(1)
    grid = fitted.grids[1]
    assert grid is not None
    nodes = np.arange(0, len(grid.near), 97)
    got = fitted.log_likelihood(
        fingerprint(survey.bssid, rssi[0]), grid.nodes()[nodes], np.ones(len(nodes), int)
    )
    want = []
    for node in nodes:
        total = 0.0
        assert len(grid.columns) == 8
        sigma = grid.sigma[node]
        for z, mean in zip(rssi[0].astype(np.float32), grid.mean[node], strict=True):
            if np.isnan(z):
                total += np.log(0.2 + 0.8 * norm.cdf((fitted.limit - mean) / sigma))
            else:
                total += -3.0 * np.log1p(((z - mean) / sigma) ** 2 / 5.0) - np.log(sigma)
        want.append(0.5 * total)
    np.testing.assert_allclose(got, want, rtol=1e-4)


@pytest.mark.parametrize("n_aps", [1, 300])
def test_the_kernel_equals_its_plain_twin(n_aps: int) -> None:
    rng = np.random.default_rng(5)
    mean, silence = rng.uniform(-100, -40, (30, n_aps)), rng.uniform(-3, 0, (30, n_aps))
    sigma = rng.uniform(2, 9, 30)
    node, weight = rng.integers(0, 30, (11, 4)), rng.dirichlet(np.ones(4), 11)
    heard = np.flatnonzero(rng.random(n_aps) < 0.7) if n_aps > 1 else np.array([0])
    z = rng.uniform(-100, 100_000, len(heard))  # also absurd readings: no overflow
    tables = [t.astype(np.float32) for t in (mean, sigma, silence)]
    total = tables[2].sum(axis=1, dtype=np.float64)
    got = np.empty(11)
    field_log_likelihood(node, weight, *tables, total, heard, z, 3.0, got)
    m, q = (
        np.einsum("nk,nkh->nh", weight, t[node[:, :, None], heard[None, None]])
        for t in (tables[0], tables[2])
    )
    s = (weight * tables[1][node]).sum(axis=1)[:, None]
    tail = -2.0 * np.log1p(((z - m) / s) ** 2 / 3.0) - np.log(s)
    want = tail.sum(axis=1) + (weight * total[node]).sum(axis=1) - q.sum(axis=1)
    np.testing.assert_allclose(got, want, rtol=1e-5)


def test_a_rare_access_point_counts_as_weak() -> None:
    survey = made_up_survey()
    rare = np.full((len(survey), 1), np.nan)
    rare[0] = -60.0  # heard at one place: no field of its own
    rssi = np.hstack([survey.dense(), rare])
    more = Survey.from_dense(rssi, survey.xy, survey.floor, survey.floors)
    noise = Noise(exponent=1.0)
    fitted = gaussian_process.fit(more, limit=-85.0, noise=noise)
    assert all(g is not None and 8 not in g.columns for g in fitted.grids)
    query = queries(1)[2][0]
    with_it, without = (
        fitted.log_likelihood(fingerprint(more.bssid, np.append(query, z)), survey.xy[:5], survey.floor[:5])
        for z in (-90.0, np.nan)
    )
    student = -2.0 * np.log1p((5.0 / 6.0) ** 2 / 3.0) - np.log(6.0)
    silent = np.log(0.4 + 0.6 * norm.cdf(10.0 / 6.0))
    np.testing.assert_allclose(with_it - without, student - silent, rtol=1e-6)


def test_large_floors_are_thinned_and_wide_ones_get_a_coarser_grid() -> None:
    survey = made_up_survey(repeats=4)
    fitted = gaussian_process.fit(survey, max_points=40, max_nodes=300)
    for grid in fitted.grids:
        assert grid is not None
        assert len(grid.near) < 400
        assert grid.step > 1.0
    xy, floor, rssi = queries(40)
    found, level = fitted.locate_all(rssi)
    assert np.mean(level == floor) > 0.9
    assert np.mean(np.hypot(*(found - xy).T)) < 4.0


def test_a_survey_that_nowhere_hears_anything_thrice_is_refused() -> None:
    rssi = np.full((5, 5), np.nan)
    np.fill_diagonal(rssi, -50.0)
    survey = Survey.from_dense(rssi, np.arange(10.0).reshape(5, 2), np.zeros(5, np.int32), ("a",))
    with pytest.raises(RadioMapError, match="survey more places"):
        gaussian_process.fit(survey)


@pytest.mark.parametrize(
    "wrong", [{"step": 0.0}, {"reach": -1.0}, {"max_points": 1}, {"max_nodes": 2}, {"limit": 3.0}]
)
def test_parameters_out_of_range_are_refused(wrong: dict) -> None:  # type: ignore[type-arg]
    with pytest.raises(ConfigError):
        gaussian_process.fit(made_up_survey(), **wrong)


@pytest.mark.parametrize(
    "wrong", [{"session_sigma": -1.0}, {"dof": 0.0}, {"dropout": 0.0}, {"dropout": 1.0}, {"exponent": 2.0}]
)
def test_noise_out_of_range_is_refused(wrong: dict) -> None:  # type: ignore[type-arg]
    with pytest.raises(ConfigError):
        Noise(**wrong)
