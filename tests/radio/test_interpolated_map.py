"""Histogram averages at training places, and what is read between scattered ones."""

from __future__ import annotations

import numpy as np
import pytest
from radio_map_contract import field, fingerprint, made_up_survey, queries

from wayfuse.core.errors import ConfigError, RadioMapError
from wayfuse.radio.interpolated_map import fit, training_places
from wayfuse.radio.survey import Survey


def survey_of(rssi: np.ndarray, xy: np.ndarray, floor: np.ndarray | None = None) -> Survey:
    floors = np.zeros(len(xy), np.int64) if floor is None else floor
    return Survey.from_dense(np.asarray(rssi, float), np.asarray(xy, float), floors, ("EG", "OG"))


def test_a_place_has_the_average_of_its_histogram_without_odd_samples() -> None:
    rssi = np.full((100, 1), -60.0)
    rssi[:40] = -62.0
    rssi[99] = -20.0  # one of a hundred
    places = training_places(survey_of(rssi, np.ones((100, 2))))
    assert places.levels[0, 0] == pytest.approx((40 * -62 + 59 * -60) / 99)
    assert places.n_samples.tolist() == [100]
    whole = training_places(survey_of(rssi, np.ones((100, 2))), outlier=0.0)
    assert whole.levels[0, 0] == pytest.approx(rssi.mean())


def test_the_average_is_that_of_a_loop_over_places_and_access_points() -> None:
    rng = np.random.default_rng(2)
    xy, floor = np.round(rng.uniform(0, 4, (300, 2))), rng.integers(0, 2, 300)
    rssi = np.round(rng.normal(-70.0, 4.0, (300, 3)), 1)
    rssi[rng.random((300, 3)) < 0.5] = np.nan
    places = training_places(survey_of(rssi, xy, floor), outlier=0.3, rare=0.4)
    for p in range(len(places.xy)):
        rows = rssi[(floor == places.floor[p]) & (xy == places.xy[p]).all(axis=1)]
        for a in range(3):
            heard = rows[np.isfinite(rows[:, a]), a]
            level = places.levels[p, a]
            if len(heard) < max(0.4 * len(rows), 1):
                assert np.isnan(level)
                continue
            bins = np.round(heard)
            share = np.array([np.mean(bins == b) for b in bins])
            kept = heard[(share >= 0.3) | (share == share.max())]
            assert level == pytest.approx(kept.mean())


def test_rows_of_one_cell_are_samples_of_one_place() -> None:
    xy = np.array([(0.1, 0.1), (1.5, 0.3), (2.1, 0.1)])
    places = training_places(survey_of(np.array([[-50.0], [-60.0], [-70.0]]), xy), cell=2.0)
    np.testing.assert_allclose(places.xy, [(0.8, 0.2), (2.1, 0.1)])
    np.testing.assert_allclose(places.levels[:, 0], [-55.0, -70.0])


def test_an_access_point_heard_rarely_is_unheard() -> None:
    rssi = np.full((20, 2), -60.0)
    rssi[1:, 1] = np.nan
    assert np.isnan(training_places(survey_of(rssi, np.zeros((20, 2)))).levels[0, 1])
    assert training_places(survey_of(rssi, np.zeros((20, 2))), rare=0.05).levels[0, 1] == -60.0


def test_a_plane_is_read_exactly_at_the_nodes_and_the_nearest_place_outside() -> None:
    rng = np.random.default_rng(6)
    xy = np.vstack([rng.uniform(0, 20, (60, 2)), [(0, 0), (20, 0), (0, 20), (20, 20)]])
    level = -50.0 - 0.7 * xy[:, :1] + 0.4 * xy[:, 1:]
    radio_map = fit(survey_of(level, xy), step=0.5)
    at = np.array([(3.0, 4.5), (10.0, 17.5), (11.5, 2.0)])
    none = np.zeros(3, int)
    np.testing.assert_allclose(
        radio_map.characteristic(at, none)[:, 0], -50.0 - 0.7 * at[:, 0] + 0.4 * at[:, 1], atol=1e-4
    )
    away = radio_map.characteristic(np.array([(-30.0, -30.0), (60.0, 21.0)]), none[:2])[:, 0]
    np.testing.assert_allclose(away, level[[60, 63], 0], atol=1e-4)


def test_places_on_a_line_and_single_places_do() -> None:
    line = np.column_stack([np.arange(5.0), np.zeros(5)])
    radio_map = fit(survey_of(-50.0 - np.arange(5.0)[:, None], line))
    assert radio_map.characteristic(np.array([(3.0, 1.0)]), np.zeros(1, int))[0, 0] == pytest.approx(-53.0)
    one = fit(survey_of(np.array([[-44.0]]), np.array([(7.0, 7.0)])))
    assert one.characteristic(np.array([(0.0, 0.0)]), np.zeros(1, int))[0, 0] == pytest.approx(-44.0)


def test_what_only_one_side_hears_counts_as_missing_and_what_neither_hears_as_nothing() -> None:
    level = np.array([[-50.0, -70.0, np.nan, np.nan]])
    radio_map = fit(survey_of(level, np.zeros((1, 2))), sigma=2.0, missing=-90.0)
    z = fingerprint(radio_map.bssid, np.array([-53.0, np.nan, -80.0, np.nan]))
    found = radio_map.log_likelihood(z, np.zeros((1, 2)), np.zeros(1, int))
    assert found[0] == pytest.approx(-(3.0**2 + 20.0**2 + 10.0**2) / (2 * 2.0**2))
    assert radio_map.at_places(z)[0] == pytest.approx(found[0])  # type: ignore[index]
    unknown = z._replace(bssid=z.bssid + np.uint64(1000))
    assert radio_map.at_places(unknown) is None
    assert radio_map.log_likelihood(unknown, np.zeros((1, 2)), np.zeros(1, int)).tolist() == [0.0]


def test_it_is_likelier_at_the_truth_and_on_its_floor() -> None:
    radio_map = fit(made_up_survey(), sigma=4.0)
    xy, floor, rssi = queries(40)
    far = xy + np.column_stack([np.where(xy[:, 0] > 10, -9.0, 9.0), np.zeros(40)])
    better = np.zeros(2)
    for i in range(40):
        log_p = radio_map.log_likelihood(
            fingerprint(radio_map.bssid, rssi[i]), np.stack([xy[i], far[i], xy[i]]),
            np.array([floor[i], floor[i], 1 - floor[i]]),
        )  # fmt: skip
        assert np.all(np.isfinite(log_p))
        better += log_p[0] > log_p[1:]
    assert better.min() >= 38
    off = radio_map.characteristic(xy, floor) - np.maximum(field(xy, floor), -100.0)
    assert np.abs(np.where(field(xy, floor) > -80.0, off, 0.0)).mean() < 1.5


def test_bad_parameters_and_empty_surveys_are_refused() -> None:
    for name, value in {
        "sigma": 0.0,
        "missing": 3.0,
        "step": 0.0,
        "cell": -1.0,
        "rare": 2.0,
        "outlier": 0.5,
    }.items():
        with pytest.raises(ConfigError, match=name):
            fit(made_up_survey(), **{name: value})
    with pytest.raises(RadioMapError, match="no readings"):
        fit(survey_of(np.full((3, 2), np.nan), np.zeros((3, 2))))
