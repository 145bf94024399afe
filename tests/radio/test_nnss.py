"""Nearest neighbour in signal space."""

from __future__ import annotations

import numpy as np
from radio_map_contract import made_up_survey, queries

from wayfuse.radio import nnss
from wayfuse.radio.survey import Survey


def test_means_are_over_the_readings_of_a_place() -> None:
    rssi = np.array([[-50.0, np.nan], [-60.0, -80.0], [-70.0, np.nan], [-40.0, np.nan]])
    xy = np.array([[1.0, 2.0], [1.0, 2.0], [1.0, 2.0], [0.0, 5.0]])
    survey = Survey.from_dense(rssi, xy, np.array([0, 0, 1, 0]), ("a", "b"))
    means = nnss.position_means(survey)
    np.testing.assert_array_equal(means.xy, [[0, 5], [1, 2], [1, 2]])
    np.testing.assert_array_equal(means.floor, [0, 0, 1])
    np.testing.assert_array_equal(means.dense(), [[-40, np.nan], [-55, -80], [-70, np.nan]])


def test_the_answer_is_the_place_of_the_smallest_distance() -> None:
    survey = made_up_survey(repeats=3)
    fitted = nnss.fit(survey, missing=-95.0)
    means = nnss.position_means(survey)
    _, _, rssi = queries(30)
    xy, floor = fitted.locate_all(rssi)
    z, r = np.nan_to_num(rssi, nan=-95.0), means.dense(-95.0).astype(float)
    nearest = ((z[:, None] - r[None]) ** 2).sum(axis=2).argmin(axis=1)
    np.testing.assert_allclose(xy, means.xy[nearest], atol=1e-12)
    np.testing.assert_array_equal(floor, means.floor[nearest])


def test_likelihood_falls_with_distance_from_the_answer() -> None:
    survey = made_up_survey()
    fitted = nnss.fit(survey, bandwidth=2.0)
    place = fitted.locate_all(queries(1)[2])[0][0]
    from radio_map_contract import fingerprint

    query = fingerprint(survey.bssid, queries(1)[2][0])
    floor = np.full(4, fitted.locate(query).floor)
    away = place + np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 3.0], [5.0, 0.0]])
    assert np.all(np.diff(fitted.log_likelihood(query, away, floor)) < 0)
