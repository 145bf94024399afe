"""Distance to the survey as a raster, against brute force."""

from __future__ import annotations

import numpy as np
import pytest

from wayfuse.models.observation.coverage import SurveyDistance
from wayfuse.radio.survey import Survey


def survey_at(xy: np.ndarray, floor: np.ndarray, n_floors: int = 2) -> Survey:
    return Survey.from_dense(np.full((len(xy), 1), -60.0), xy, floor, tuple(f"F{k}" for k in range(n_floors)))


@pytest.mark.parametrize("cell", [0.5, 1.0, 2.0])
@pytest.mark.parametrize("n", [1, 2, 60])
def test_it_is_the_distance_to_the_nearest_fingerprint(cell: float, n: int) -> None:
    rng = np.random.default_rng(n)
    xy = rng.uniform((-20.0, 5.0), (60.0, 40.0), (n, 2))
    distance = SurveyDistance.build(survey_at(xy, np.zeros(n, int)), cell)
    places = np.concatenate([rng.uniform((-70.0, -50.0), (110.0, 90.0), (800, 2)), xy])
    got = distance.at(places[:, 0], places[:, 1], np.zeros(len(places), int))
    want = np.minimum(np.min(np.linalg.norm(places[:, None] - xy[None], axis=2), axis=1), 60.0)
    # both ends are moved to the middles of their cells
    assert np.max(np.abs(got - want)) <= cell * np.sqrt(2.0) + 1e-4
    assert np.all(got[-n:] == 0.0)


def test_floors_are_apart_and_the_unknown_is_far() -> None:
    distance = SurveyDistance.build(survey_at(np.array([[10.0, 10.0]]), np.array([1]), 3))
    x, y = np.float32([10.0, 10.0, 1e5, -1e5]), np.float32([10.0, 10.0, 10.0, 1e5])
    np.testing.assert_array_equal(distance.at(x, y, np.int32([1, 0, 1, 1])), [0.0, 60.0, 60.0, 60.0])
    np.testing.assert_array_equal(distance.at(x, y, np.int32([2, 2, 2, 2])), 60.0)
    assert distance.at(x[:0], y[:0], np.int32([])).shape == (0,)
