"""Ranges: bias, noise, and the detour through walls."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from wayfuse.simulator.hall import hall
from wayfuse.simulator.radio_field import AccessPoint, RadioModel, radio_field
from wayfuse.simulator.round_trip import RangesModel, measure_ranges, range_errors
from wayfuse.simulator.walker import Climb, Walk


@pytest.mark.parametrize("n_walls", [0, 1, 4])
def test_walls_add_to_the_bias_and_to_the_spread(n_walls):
    model = RangesModel(bias_m=0.3, noise_m=0.5, wall_m=0.7)
    errors = range_errors(np.full(20_000, float(n_walls)), model, np.random.default_rng(0))
    assert errors.mean() == pytest.approx(0.3 + 0.7 * n_walls, abs=0.04)
    assert errors.std() == pytest.approx(np.hypot(0.5, 0.7 * n_walls**0.5), rel=0.03)


def standing_at(x: float, y: float, seconds: float) -> Walk:
    t = np.arange(0.0, seconds, 0.01)
    place, zero, none = np.tile([x, y], (len(t), 1)), np.zeros(len(t)), np.empty(0)
    return Walk(t, place, zero, zero, none, none, t[:2], zero[:2], np.empty((0, 3)))


@pytest.fixture(scope="module")
def radios():
    aps = (AccessPoint(2.0, 2.0, "0"), AccessPoint(30.0, 10.0, "0"))
    model = RadioModel(access_points=aps, single_band_share=0.0, ap_height=2.2)
    return radio_field(hall(40.0, 30.0, 3), model, np.random.default_rng(0))


def test_ranges_are_of_the_distance_in_space_and_walls(radios):
    model = RangesModel(period_s=0.1, bias_m=0.0, noise_m=0.1, wall_m=1.0, missed_share=0.0)
    ranges = measure_ranges(standing_at(12.0, 2.0, 200.0), radios, model, np.random.default_rng(1))
    near, far = (
        np.array([r.distance for r in ranges if r.anchor == a]) for a in sorted({r.anchor for r in ranges})
    )
    if near.mean() > far.mean():
        near, far = far, near
    assert near.mean() == pytest.approx(np.hypot(10.0, 1.0), abs=0.02)
    walls = radios.walls_between(np.array([1]), np.array([[12.0, 2.0]]), 0).sum()
    assert walls > 0
    assert far.mean() - np.sqrt(18.0**2 + 8.0**2 + 1.0) == pytest.approx(walls, rel=0.1)
    assert {r.sigma for r in ranges} == {0.5}
    assert [r.t for r in ranges] == sorted(r.t for r in ranges)
    assert all(r.rssi == round(r.rssi) for r in ranges)


def test_answers_are_missed_and_end_where_the_level_does(radios):
    walk = standing_at(12.0, 2.0, 400.0)
    all_of_them = RangesModel(period_s=0.5, missed_share=0.0, weakest_dbm=-200.0)
    some, none = replace(all_of_them, missed_share=0.25), replace(all_of_them, weakest_dbm=0.0)
    whole, part = (
        len(measure_ranges(walk, radios, m, np.random.default_rng(2))) for m in (all_of_them, some)
    )
    assert whole == pytest.approx(1600, abs=4)
    assert part / whole == pytest.approx(0.75, abs=0.05)
    assert measure_ranges(walk, radios, none, np.random.default_rng(2)) == ()
    assert measure_ranges(walk, radios, RangesModel(), np.random.default_rng(2)) == ()


def test_a_slab_counts_as_walls():
    from wayfuse.simulator.storeys import three_storeys

    building = three_storeys(np.random.default_rng(0))
    model = RadioModel(access_points=(AccessPoint(30.0, 9.75, "0"),), power_dbm=(0.0, 0.0))
    field = radio_field(building, model, np.random.default_rng(0))
    walk = standing_at(30.0, 9.75, 300.0)
    n = len(walk.t)
    z = building.storeys[1].elevation
    above = replace(
        walk,
        climb=Climb(
            np.full(n, z), np.ones(n, np.int64), np.zeros(n, np.int64), np.full(n, -1), np.empty(0, np.int64)
        ),
    )
    asked = RangesModel(period_s=0.2, bias_m=0.0, noise_m=0.0, wall_m=0.5, slab_walls=4.0, missed_share=0.0)
    got = np.array([r.distance for r in measure_ranges(above, field, asked, np.random.default_rng(1))])
    assert got.mean() == pytest.approx(abs(z + 1.2 - 3.0) + 2.0, abs=0.15)
