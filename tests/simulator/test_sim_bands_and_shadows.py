"""Shadowing and its bands have the statistics a scenario chooses; access points move and go."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from wayfuse.simulator.building import shopping_centre
from wayfuse.simulator.hall import hall
from wayfuse.simulator.he2014_world import Room, strength
from wayfuse.simulator.radio_field import AccessPoint, RadioField, RadioModel, changed, radio_field

AT = (AccessPoint(30.0, 20.0, "0"),)


def shadows(model: RadioModel, seed: int = 0) -> tuple[RadioField, RadioField]:
    """A field and the same without its shadows."""
    building = hall(60.0, 40.0, 0)
    field = radio_field(building, model, np.random.default_rng(seed))
    still = [replace(shadow, sigma=0.0) for shadow in (field.ap_shadow, field.radio_shadow)]
    return field, replace(field, ap_shadow=still[0], radio_shadow=still[1])


@pytest.mark.parametrize("shared", [0.0, 0.5, 1.0])
def test_the_bands_of_an_access_point_correlate_as_chosen(shared):
    n = 1500
    field, plain = shadows(RadioModel(access_points=AT * n, shadow_shared=shared, single_band_share=0.0))
    xy = np.tile([20.0, 20.0], (n, 1))
    low, high = (field.rssi(r, xy, 0) - plain.rssi(r, xy, 0) for r in (np.arange(n), n + np.arange(n)))
    assert np.corrcoef(low, high)[0, 1] == pytest.approx(shared, abs=4.0 / n**0.5)
    assert low.std() == pytest.approx(4.0, rel=0.08)


@pytest.mark.parametrize(("length", "sigma"), [(3.0, 4.0), (8.0, 6.0)])
def test_shadows_fade_over_the_length_chosen(length, sigma):
    n = 1500
    field, plain = shadows(RadioModel(access_points=AT * n, shadow_m=length, shadow_sigma=sigma))
    radio = np.arange(n)
    at = [
        field.rssi(radio, np.tile(xy, (n, 1)), 0) - plain.rssi(radio, np.tile(xy, (n, 1)), 0)
        for xy in ([20.0, 20.0], [20.0 + length, 20.0], [20.0, 20.0 + 2 * length])
    ]
    assert at[0].std() == pytest.approx(sigma, rel=0.08)
    assert np.corrcoef(at[0], at[1])[0, 1] == pytest.approx(np.exp(-1.0), abs=0.08)
    assert np.corrcoef(at[0], at[2])[0, 1] == pytest.approx(np.exp(-2.0), abs=0.08)


def test_access_points_hang_where_they_are_given():
    aps = (AccessPoint(3.0, 4.0, "F2"), AccessPoint(60.0, 20.0, "F1"))
    building = shopping_centre(np.random.default_rng(0))
    field = radio_field(building, RadioModel(access_points=aps), np.random.default_rng(1))
    np.testing.assert_array_equal(field.ap_xy, [(3.0, 4.0), (60.0, 20.0)])
    np.testing.assert_array_equal(field.ap_floor, [1, 0])
    assert len(set(field.bssid.tolist())) == len(field.bssid)


def test_some_move_on_their_floor_some_go_and_the_others_stay():
    building = shopping_centre(np.random.default_rng(0))
    before = radio_field(building, RadioModel(), np.random.default_rng(1))
    later = changed(before, building, 5, 4, np.random.default_rng(2))
    moved = np.any(before.ap_xy != later.ap_xy, axis=1)
    gone = np.setdiff1d(np.arange(len(moved)), later.ap[later.is_there])
    assert moved.sum() == 5
    assert len(gone) == 4
    assert not moved[gone].any()
    assert np.hypot(*(before.ap_xy - later.ap_xy)[moved].T).min() > 5.0
    np.testing.assert_array_equal(before.ap_floor, later.ap_floor)
    assert all(
        building.storeys[f].is_walkable(p[None])[0]
        for f, p in zip(later.ap_floor[moved], later.ap_xy[moved], strict=True)
    )
    same = ~moved[before.ap] & later.is_there
    radio = np.flatnonzero(same)
    xy = np.tile([11.0, 11.0], (len(radio), 1))
    np.testing.assert_array_equal(before.rssi(radio, xy, 0), later.rssi(radio, xy, 0))
    radio = np.flatnonzero(~later.is_there)
    assert later.rssi(radio, xy[: len(radio)], 0).max() < -500.0


def test_an_empty_room_is_that_of_the_images():
    aps = (AccessPoint(2.0, 2.0, "0"), AccessPoint(38.0, 38.0, "0"))
    model = RadioModel(
        model="images", access_points=aps, ap_height=2.5, ceiling=3.0, power_sigma=0.0, single_band_share=0.0
    )
    field = radio_field(hall(40.0, 40.0, 0), model, np.random.default_rng(0))
    xy = np.random.default_rng(1).uniform(1.0, 39.0, (50, 2))
    room = Room(ap_xy=((2.0, 2.0), (38.0, 38.0)))
    for a in range(2):
        got = field.rssi(np.full(50, a), xy, 0)
        difference = got - strength(room, xy)[:, a]  # but for the power
        np.testing.assert_allclose(difference, difference[0])
    near = field.rssi(np.array([0, 2]), np.tile([2.5, 2.0], (2, 1)), 0)
    assert near[0] - near[1] == pytest.approx(model.power_dbm[0] - model.power_dbm[1], abs=2.0)
