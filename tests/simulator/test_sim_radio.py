"""Distance, walls and slabs attenuate; shadowing has its statistics; lists are those of a phone."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from wayfuse.simulator.building import shopping_centre
from wayfuse.simulator.fields import exponential_field, smooth_field
from wayfuse.simulator.radio_field import RadioField, RadioModel, radio_field
from wayfuse.simulator.routes import plan_route
from wayfuse.simulator.scanner import ScannerModel, scan
from wayfuse.simulator.walker import WalkerModel, draw_person, walk


@pytest.fixture(scope="module")
def building():
    return shopping_centre(np.random.default_rng(0))


@pytest.fixture(scope="module")
def flat(building) -> RadioField:
    """Without shadowing and with equal walls."""
    model = RadioModel(shadow_sigma=0.0, wall_sigma=0.0, power_sigma=0.0)
    return radio_field(building, model, np.random.default_rng(1))


def without_walls(field: RadioField) -> RadioField:
    storeys = tuple(replace(s, walls=np.array([(-9.0, -9.0, -8.0, -9.0)])) for s in field.storeys)
    return replace(field, storeys=storeys, wall_loss=tuple(np.zeros(1) for _ in storeys))


def places(building, n, seed=0):
    rng = np.random.default_rng(seed)
    return rng.uniform((0, 0), (building.width, building.height), (n, 2))


@pytest.mark.parametrize("band", [0, 1])
def test_in_the_open_rssi_falls_by_ten_n_per_decade(building, flat, band):
    field = without_walls(flat)
    radio = int(np.flatnonzero((field.band == band) & (field.ap_floor[field.ap] == 0))[0])
    xy = places(building, 300)
    distance = np.sqrt(np.sum((field.ap_xy[field.ap[radio]] - xy) ** 2, axis=1) + 1.8**2)
    slope, at_one_metre = np.polyfit(np.log10(distance), field.rssi(np.full(300, radio), xy, 0), 1)
    assert slope == pytest.approx(-10 * field.model.exponent[band])
    assert at_one_metre == pytest.approx(field.model.power_dbm[band])


def test_with_shadowing_rssi_still_falls_with_distance(building, sim_site):
    field = sim_site.radios
    xy = places(building, 200)
    near, far = [], []
    for radio in np.flatnonzero(field.ap_floor[field.ap] == 0):
        distance = np.hypot(*(field.ap_xy[field.ap[radio]] - xy).T)
        rssi = field.rssi(np.full(200, radio), xy, 0)
        near.append(rssi[distance < 8].mean())
        far.append(rssi[distance > 25].mean())
    assert np.nanmean(near) - np.nanmean(far) > 15.0


def test_each_wall_between_takes_its_share_up_to_the_cap(building, flat):
    radio = int(np.flatnonzero((flat.band == 0) & (flat.ap_floor[flat.ap] == 0))[0])
    xy = places(building, 300)
    loss = without_walls(flat).rssi(np.full(300, radio), xy, 0) - flat.rssi(np.full(300, radio), xy, 0)
    assert loss.min() >= 0.0
    assert loss.max() <= flat.model.wall_cap_db + 1e-9
    walls = loss[loss < 25.9] / flat.model.wall_db[0]
    np.testing.assert_allclose(walls, np.round(walls), atol=1e-6)
    assert (np.round(walls) > 2).any()


def test_a_slab_attenuates_except_through_the_atrium(building, flat):
    field = without_walls(flat)
    field = replace(field, ap_xy=field.ap_xy.copy())
    below = int(np.flatnonzero((field.band == 0) & (field.ap_floor[field.ap] == 0))[0])
    hole = building.storeys[1].voids[0].polygon.mean(axis=0)
    distance_only = replace(field, model=replace(field.model, slab_db=(0.0, 0.0)))
    for place, lost in ((hole, 0.0), (np.array([11.0, 11.0]), field.model.slab_db[0])):
        field.ap_xy[field.ap[below]] = place
        xy = place[None] + 0.1
        got = distance_only.rssi(np.array([below]), xy, 1) - field.rssi(np.array([below]), xy, 1)
        assert got[0] == pytest.approx(lost)
        same = distance_only.rssi(np.array([below]), xy, 0) - field.rssi(np.array([below]), xy, 0)
        assert same[0] == 0.0


@pytest.mark.parametrize(
    ("make", "at_distance"), [(exponential_field, np.exp(-1.0)), (smooth_field, np.exp(-0.5))]
)
def test_fields_have_their_covariance(make, at_distance):
    n = 3000
    field = make(n, 4.0, 5.0, np.random.default_rng(0))
    member = np.arange(n)
    here = field.at(member, np.tile([3.0, 4.0], (n, 1)))
    there = field.at(member, np.tile([6.0, 8.0], (n, 1)))  # 5 m on
    far = field.at(member, np.tile([70.0, 45.0], (n, 1)))
    assert here.mean() == pytest.approx(0.0, abs=5 * 4.0 / n**0.5)
    assert here.std() == pytest.approx(4.0, rel=0.08)
    assert np.corrcoef(here, there)[0, 1] == pytest.approx(at_distance, abs=0.07)
    assert np.corrcoef(here, far)[0, 1] == pytest.approx(0.0, abs=0.1)


def test_bands_of_one_access_point_share_part_of_the_shadow(building):
    field = radio_field(building, RadioModel(aps_per_floor=60), np.random.default_rng(3))
    plain = replace(field, model=field.model, ap_shadow=replace(field.ap_shadow, sigma=0.0))
    plain = replace(plain, radio_shadow=replace(field.radio_shadow, sigma=0.0))
    both = np.flatnonzero(field.band == 1)
    first = field.ap[both]  # radio i of 2.4 GHz is access point i's
    xy = places(building, len(both), 4)
    shadow = [field.rssi(r, xy, 0) - plain.rssi(r, xy, 0) for r in (first, both)]
    assert np.corrcoef(*shadow)[0, 1] == pytest.approx(field.model.shadow_shared, abs=0.25)


def test_networks_are_unique_and_twins_share_a_radio(sim_site):
    field = sim_site.radios
    assert len(np.unique(field.bssid)) == len(field.bssid) == len(field.ssid)
    per_radio = np.bincount(field.radio)
    assert set(per_radio) == {1, 2, 3}
    assert set(field.band.tolist()) == {0, 1}
    assert ((field.frequency < 3000) == (field.band == 0)).all()
    assert int(field.bssid.max()) < 1 << 48


@pytest.fixture(scope="module")
def sweeps(building, sim_site):
    def run(**changes):
        rng = np.random.default_rng(7)
        route = plan_route(building.storeys[0], 55.0, rng)
        w = walk(route, draw_person(WalkerModel(), rng), WalkerModel(), rng)
        return w, scan(w, 0, sim_site.radios, ScannerModel(**changes), np.random.default_rng(8))

    return run


def test_lists_repeat_what_was_heard_before(sweeps):
    w, lists = sweeps()
    assert len(lists) == pytest.approx(w.duration / 2.1, abs=2)
    age = np.concatenate([s.t - s.last_seen for s in lists])
    assert age.min() > 0.4
    assert age.max() <= 30.0
    assert 0.2 < np.mean(age > 2.5) < 0.7  # the public recordings: about half is stale
    seen = [set(zip(s.network.tolist(), s.last_seen.tolist(), strict=True)) for s in lists]
    assert all(a & b for a, b in pairwise(seen))


def test_the_first_list_has_a_past_before_the_walk(sweeps):
    _, lists = sweeps()
    assert 0.0 <= lists[0].t < 2.6
    assert lists[0].last_seen.min() < -5.0


def test_readings_are_whole_decibels_above_the_sensitivity_strongest_first(sweeps):
    _, lists = sweeps()
    rssi = np.concatenate([s.rssi for s in lists])
    np.testing.assert_array_equal(rssi, np.round(rssi))
    assert -93 <= rssi.min() < -88
    assert rssi.max() < -25
    assert all((np.diff(s.rssi) <= 0).all() for s in lists)


def test_a_weak_network_is_missed_more_often(sweeps):
    _, lists = sweeps()
    fresh = [(s.rssi[s.t - s.last_seen < 2.0], s.rssi[s.t - s.last_seen >= 2.0]) for s in lists]
    heard, stale = (np.concatenate(part) for part in zip(*fresh, strict=True))
    assert np.median(heard) - np.median(stale) > 3.0


def test_throttling_leaves_few_lists(sweeps):
    w, lists = sweeps(period_s=30.0, period_jitter_s=1.0)
    assert len(lists) <= np.ceil(w.duration / 29.0)


def test_a_device_offset_shifts_what_it_hears(sweeps):
    _, plain = sweeps(hit_rate=1.0, softness_db=0.01, sensitivity_dbm=-300.0, weakest_dbm=-300.0)
    _, deaf = sweeps(
        hit_rate=1.0,
        softness_db=0.01,
        sensitivity_dbm=-300.0,
        weakest_dbm=-300.0,
        device_offset_db=(-7.0, -7.0),
    )
    for a, b in zip(plain, deaf, strict=True):
        by_network = [s.rssi[np.argsort(s.network)] for s in (a, b)]
        np.testing.assert_array_equal(by_network[0] - by_network[1], 7.0)


def test_the_body_hides_what_is_behind(sweeps, sim_site):
    open_, hidden = (
        sweeps(body_db=db, hit_rate=1.0, softness_db=0.01, sensitivity_dbm=-300.0, weakest_dbm=-300.0)[1]
        for db in (0.0, 12.0)
    )
    loss = np.concatenate(
        [
            a.rssi[np.argsort(a.network)] - b.rssi[np.argsort(b.network)]
            for a, b in zip(open_, hidden, strict=True)
        ]
    )
    assert loss.min() >= 0.0
    assert loss.max() <= 12.0
    assert loss.std() > 2.0


def test_twins_differ_by_hardly_a_decibel(sweeps, sim_site):
    _, lists = sweeps()
    field = sim_site.radios
    differences = []
    for s in lists:
        fresh = s.t - s.last_seen < 2.2
        radio, rssi = field.radio[s.network[fresh]], s.rssi[fresh]
        order = np.argsort(radio, kind="stable")
        same = np.diff(radio[order]) == 0
        differences.append(np.abs(np.diff(rssi[order]))[same])
    pooled = np.concatenate(differences)
    assert len(pooled) > 100
    assert np.median(pooled) <= 2.0
