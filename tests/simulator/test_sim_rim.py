"""The radio irregularity model: equations 4.1-4.5 of chu2009, by hand and against the world of the paper."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wayfuse.simulator.building import Building
from wayfuse.simulator.chu2009_world import AP_PLACES, FieldModel, draw_field, draw_pattern
from wayfuse.simulator.hall import hall
from wayfuse.simulator.radio_field import AccessPoint, RadioModel, radio_field
from wayfuse.simulator.rim import RimModel, pattern_at, rim_level


@given(st.integers(0, 50), st.sampled_from([0.0005, 0.004, 0.016]))
def test_a_pattern_starts_at_one_changes_a_little_each_degree_and_closes(seed, doi):
    pattern = draw_pattern(doi, np.random.default_rng(seed))
    assert pattern.shape == (360,)
    assert pattern[0] == 1.0
    assert abs(pattern[0] - pattern[359]) <= doi
    steps = np.abs(np.diff(pattern)) / doi  # W of shape 1 and scale 1: mean 1
    assert steps.mean() == pytest.approx(1.0, abs=0.35)


def test_without_irregularity_a_pattern_is_a_circle():
    np.testing.assert_array_equal(draw_pattern(0.0, np.random.default_rng(0)), 1.0)


def test_a_pattern_is_linear_between_degrees_and_closes_the_circle():
    pattern = np.tile(np.arange(360.0), (4, 1))
    k = pattern_at(pattern, np.deg2rad([10.0, 10.25, -1.0, 359.5]))
    np.testing.assert_allclose(k, [10.0, 10.25, 359.0, 0.5 * 359.0], atol=1e-9)


def test_the_equations_by_hand():
    model = RimModel(waf=5.0, max_walls=3)
    got = rim_level(
        np.array([15.0] * 3),
        np.array([10.0, 10.0, 0.2]),
        np.array([1.0, 1.1, 1.0]),
        np.array([2, 7, 0]),
        model,
    )
    loss = 37.3 + 33.0
    np.testing.assert_allclose(got, [15 - loss - 10, 15 - 1.1 * loss - 15, 15 - 37.3])


@pytest.fixture(scope="module")
def floor() -> Building:
    return hall(100.0, 100.0, 8)


def test_a_field_is_that_of_the_paper_where_heights_do_not_matter(floor):
    """Same powers, patterns and places: the world of chu2009, which is two-dimensional and has its own walls."""
    paper = draw_field(FieldModel(n_aps=4, grain=50.0), np.random.default_rng(3))
    aps = tuple(AccessPoint(float(x), float(y), "0") for x, y in AP_PLACES[:4])
    model = RadioModel(model="rim", access_points=aps, ap_height=1.2, single_band_share=0.0)
    mine = radio_field(floor, model, np.random.default_rng(1))
    xy = np.random.default_rng(2).uniform(2.0, 98.0, (200, 2))
    for a in range(4):
        to = xy - mine.ap_xy[a]
        k = pattern_at(np.tile(paper.pattern[a], (200, 1)), np.arctan2(to[:, 1], to[:, 0]))
        power = np.full(200, paper.power[a])
        open_level = rim_level(power, np.hypot(*to.T), k, np.zeros(200), RimModel())
        behind = open_level - paper.mean_levels(xy)[:, a]
        np.testing.assert_allclose(behind / 3.0, np.round(behind / 3.0), atol=1e-9)  # whole walls of 3 dB
        assert 0.0 <= behind.min() <= behind.max() <= 4 * 3.0 + 1e-9


def test_a_field_puts_the_equations_together(floor):
    model = RadioModel(model="rim", ap_height=4.0, aps_per_floor=6, rim=RimModel(waf=2.0, max_walls=2))
    field = radio_field(floor, model, np.random.default_rng(4))
    xy = np.random.default_rng(5).uniform(1.0, 99.0, (400, 2))
    radio = np.random.default_rng(6).integers(0, field.n_radios, 400)
    ap = field.ap[radio]
    to = xy - field.ap_xy[ap]
    k = pattern_at(field.pattern[ap], np.arctan2(to[:, 1], to[:, 0]))
    distance = np.sqrt((to**2).sum(axis=1) + (4.0 - 1.2) ** 2)
    walls = field.walls_between(ap, xy, 0).sum(axis=1)
    assert walls.max() > 2
    want = field.power[radio] - (37.3 + 33.0 * np.log10(distance)) * k - 2.0 * np.minimum(walls, 2)
    np.testing.assert_allclose(field.rssi(radio, xy, 0), want)


def test_powers_vary_by_vsp(floor):
    model = RadioModel(model="rim", aps_per_floor=400, rim=RimModel(doi=0.0, vsp=0.02))
    field = radio_field(floor, model, np.random.default_rng(0))
    for band, power in enumerate(model.rim.power_dbm):
        relative = field.power[field.band == band] / power - 1.0
        assert relative.std() == pytest.approx(0.02, rel=0.15)
        assert abs(relative.mean()) < 0.004
