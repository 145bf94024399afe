"""Gaussian kernel map: Eq. 3.6-3.7 and its interpolation."""

from __future__ import annotations

import numpy as np
import pytest
from radio_map_contract import fingerprint, made_up_survey, queries

from wayfuse.core.errors import ConfigError
from wayfuse.radio import gaussian_kernel


def test_the_likelihood_is_the_product_of_kernels_in_the_log_domain() -> None:
    survey = made_up_survey()
    fitted = gaussian_kernel.fit(survey, sigma=30.0, exponent=1.0)
    _, _, rssi = queries(1)
    xy, floor = np.array([[3.3, 4.1], [15.0, 9.0]]), np.array([0, 1])
    z = np.nan_to_num(rssi[0].astype(np.float32).astype(float), nan=fitted.missing)
    r = fitted.characteristic(xy, floor)
    kernels = np.exp(-((z - r) ** 2) / (2 * 30.0**2))  # Eq. 3.7 without its constant
    got = fitted.log_likelihood(fingerprint(survey.bssid, rssi[0]), xy, floor)
    np.testing.assert_allclose(np.exp(got), kernels.prod(axis=1))


def test_interpolation_gives_back_a_surveyed_place_and_stays_between() -> None:
    survey = made_up_survey()
    fitted = gaussian_kernel.fit(survey, n_neighbours=4)
    at = fitted.characteristic(survey.xy, survey.floor)
    assert np.abs(at - survey.dense(fitted.missing)).max() < 0.3
    between = fitted.characteristic(np.array([[5.0, 5.0]]), np.array([0]))[0]
    corners = [
        survey.dense(fitted.missing)[(survey.xy == c).all(axis=1) & (survey.floor == 0)][0]
        for c in ((4, 4), (6, 4), (4, 6), (6, 6))
    ]
    np.testing.assert_allclose(between, np.mean(corners, axis=0), rtol=1e-6)


def test_a_far_query_does_not_underflow() -> None:
    survey = made_up_survey()
    fitted = gaussian_kernel.fit(survey, sigma=0.5)
    query = fingerprint(survey.bssid, np.full(8, -1.0))
    log_p = fitted.log_likelihood(query, survey.xy, survey.floor)
    assert np.all(np.isfinite(log_p))
    assert np.ptp(log_p) > 100


@pytest.mark.parametrize("wrong", [{"sigma": 0.0}, {"missing": 5.0}, {"n_neighbours": 0}, {"exponent": 1.5}])
def test_parameters_out_of_range_are_refused(wrong: dict) -> None:  # type: ignore[type-arg]
    with pytest.raises(ConfigError):
        gaussian_kernel.fit(made_up_survey(), **wrong)
