"""Scans over access points of known places: order, floors, and powers fitted to a survey."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from wayfuse.core.types import Array
from wayfuse.radio.ap_hearing import (
    fitted_levels,
    floor_log_shares,
    hear,
    is_5ghz,
    known_levels,
    loudest_floor,
)
from wayfuse.radio.ap_places import ApPlaces
from wayfuse.radio.path_loss import PathLoss
from wayfuse.radio.survey import Fingerprint, Survey

AP_XY = np.random.default_rng(3).uniform(0.0, 30.0, (12, 2))
FREQUENCY = np.where(np.arange(12) < 6, 2437, 5180).astype(np.int32)
POWER = np.linspace(-60.0, -30.0, 12)
TRUE = (PathLoss(0.0, 0.12, 2.0), PathLoss(0.0, 0.3, 2.0))
DEFAULT = (PathLoss(-35.0, 0.15, 3.5), PathLoss(-40.0, 0.25, 4.5))


def places(floor: Array | None = None) -> ApPlaces:
    n = len(AP_XY)
    of = np.zeros(n, np.int32) if floor is None else floor.astype(np.int32)
    return ApPlaces(np.arange(1, n + 1, dtype=np.uint64), *AP_XY.T, of, np.full(n, np.nan))


def scan(bssid: list[int], rssi: list[float]) -> Fingerprint:
    return Fingerprint(np.array(bssid, np.uint64), np.array(rssi, np.float32), np.zeros(len(rssi), np.int32))


def survey(noise: float, n: int = 200) -> Survey:
    rng = np.random.default_rng(0)
    xy = rng.uniform(0.0, 30.0, (n, 2))
    away = np.hypot(*(xy[:, None] - AP_XY).transpose(2, 0, 1))
    rssi = np.column_stack([TRUE[int(f > 5000)].at(away[:, k]) + POWER[k] for k, f in enumerate(FREQUENCY)])
    rssi += rng.normal(0.0, noise, rssi.shape)
    return Survey.from_dense(rssi, xy, np.zeros(n, np.int32), ("0", "1"), frequency=FREQUENCY)


def test_what_is_heard_comes_loudest_first_and_strangers_are_left_out() -> None:
    heard = hear(places(), scan([5, 99, 2, 7], [-70.0, -20.0, -50.0, -70.0]))
    assert heard.row.tolist() == [1, 4, 6]
    assert heard.rssi.tolist() == [-50.0, -70.0, -70.0]
    assert heard.on(places(), 0, 2).row.tolist() == [1, 4]
    assert not len(hear(places(), scan([99], [-20.0])).row)


def test_the_floor_of_the_loud_ones_speaks_and_shares_sum_to_one() -> None:
    mixed = places(np.arange(12) % 2)
    heard = hear(mixed, scan([1, 3, 2, 4, 6], [-50.0, -52.0, -70.0, -72.0, -75.0]))
    share = np.exp(floor_log_shares(mixed, heard, 3))
    assert share.sum() == pytest.approx(1.0)
    assert share[0] > share[1] > share[2]
    assert loudest_floor(mixed, heard, 3) == 0
    nothing = np.exp(floor_log_shares(mixed, hear(mixed, scan([], [])), 3))
    np.testing.assert_allclose(nothing, 1.0 / 3.0)


def test_bands_are_told_by_the_channel() -> None:
    assert is_5ghz(np.array([0, 2412, 2484, 5180, 5825], np.int32)).tolist() == [False] * 3 + [True] * 2


def test_powers_and_attenuations_of_a_survey_are_found() -> None:
    found = fitted_levels(survey(2.0), places(), DEFAULT)
    np.testing.assert_allclose(found.power, POWER, atol=1.0)
    for band, true in zip(found.bands, TRUE, strict=True):
        assert band.power == 0.0
        assert band.attenuation == pytest.approx(true.attenuation, abs=0.04)
        assert band.sigma == pytest.approx(2.0, rel=0.1)


def test_readings_from_other_floors_and_unplaced_access_points_do_not_count() -> None:
    below = places(np.ones(12))
    found = fitted_levels(survey(2.0), below, DEFAULT)
    assert [band.attenuation for band in found.bands] == [0.15, 0.25]
    assert np.ptp(found.power) == 0.0
    known = places().select(np.arange(6))  # no access point of 5 GHz
    partly = fitted_levels(survey(2.0), known, DEFAULT)
    assert partly.bands[1].attenuation == 0.25
    np.testing.assert_allclose(partly.power, POWER[:6], atol=1.0)


def test_a_survey_tells_powers_else_the_places_do_else_nobody() -> None:
    fitted = known_levels(survey(2.0), places(), DEFAULT)
    assert fitted is not None
    np.testing.assert_array_equal(fitted.power, fitted_levels(survey(2.0), places(), DEFAULT).power)
    told = known_levels(None, replace(places(), power=np.where(np.arange(12) == 3, np.nan, POWER)), DEFAULT)
    assert told is not None
    assert told.power[3] == pytest.approx(np.delete(POWER, 3).mean())
    np.testing.assert_array_equal(np.delete(told.power, 3), np.delete(POWER, 3))
    assert [(band.power, band.attenuation) for band in told.bands] == [(0.0, 0.15), (0.0, 0.25)]
    assert known_levels(None, places(), DEFAULT) is None
    assert known_levels(None, replace(places(), power=np.full(12, np.nan)), DEFAULT) is None
