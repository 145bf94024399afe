"""Horus: the Gaussians of places and the centre of the likely ones."""

from __future__ import annotations

import numpy as np
import pytest
from radio_map_contract import made_up_survey, queries

from wayfuse.core.errors import ConfigError
from wayfuse.radio import horus
from wayfuse.radio.survey import Survey


def test_mean_spread_and_rate_of_a_place_by_hand() -> None:
    rssi = np.array([[-50.0, np.nan], [-60.0, np.nan], [-70.0, -80.0]])
    survey = Survey.from_dense(rssi, np.zeros((3, 2)), np.zeros(3, np.int32), ("a",))
    fitted = horus.fit(survey, sigma=4.0, prior_count=2.0)
    np.testing.assert_allclose(fitted.mean, [[-60, -80]])
    np.testing.assert_allclose(fitted.sigma, [[np.sqrt((2 * 16 + 200) / 5), np.sqrt(2 * 16 / 3)]])
    np.testing.assert_allclose(fitted.heard, [[3.5 / 4, 1.5 / 4]])


def test_the_matrix_form_equals_the_plain_sum() -> None:
    survey = made_up_survey(repeats=3)
    fitted = horus.fit(survey)
    _, _, rssi = queries(4)
    got = fitted.log_probability(rssi)
    for q in range(4):
        for p in range(0, len(fitted.xy), 13):
            want = 0.0
            for z, mean, sigma, heard in zip(
                rssi[q], fitted.mean[p], fitted.sigma[p], fitted.heard[p], strict=True
            ):
                if np.isnan(z):
                    want += np.log(1 - heard)
                else:
                    want += np.log(heard) - np.log(sigma) - (z - mean) ** 2 / (2 * sigma**2)
            assert got[q, p] == pytest.approx(want, rel=1e-9)


def test_one_candidate_is_the_most_likely_place() -> None:
    survey = made_up_survey(repeats=2)
    fitted = horus.fit(survey, n_candidates=1)
    _, _, rssi = queries(20)
    best = fitted.log_probability(rssi).argmax(axis=1)
    np.testing.assert_allclose(fitted.locate_all(rssi)[0], fitted.xy[best])


def test_tempering_widens_the_answer() -> None:
    survey = made_up_survey()
    _, _, rssi = queries(20)
    sharp, _ = horus.fit(survey, exponent=1.0).candidates(rssi)
    soft, _ = horus.fit(survey, exponent=0.1).candidates(rssi)
    assert np.all(soft[:, 0] <= sharp[:, 0])
    assert np.mean(soft[:, 0]) < np.mean(sharp[:, 0]) - 0.1


@pytest.mark.parametrize(
    "wrong",
    [{"sigma": 0.0}, {"prior_count": 0.0}, {"n_candidates": 0}, {"exponent": 0.0}, {"bandwidth": -1.0}],
)
def test_parameters_out_of_range_are_refused(wrong: dict) -> None:  # type: ignore[type-arg]
    with pytest.raises(ConfigError):
        horus.fit(made_up_survey(), **wrong)
