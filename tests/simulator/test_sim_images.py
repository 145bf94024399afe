"""The ray-traced room of he2014: images against mirrors, energy, symmetry, Fresnel's limits."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from wayfuse.core.errors import ConfigError
from wayfuse.simulator.he2014_world import (
    Room,
    _images,
    _reflection,
    sense,
    strength,
    survey_places,
    true_walk,
)

ROOM = Room()


def test_without_walls_the_strength_is_that_of_free_space() -> None:
    open_room = replace(ROOM, reflections=0, ap_xy=((2.0, 2.0),))
    xy = np.array([[5.0, 6.0], [30.0, 20.0]])
    d = np.sqrt(((xy - [2.0, 2.0]) ** 2).sum(axis=1) + 1.3**2)
    friis = 15.0 - 20 * np.log10(4 * np.pi * d * ROOM.frequency / 299_792_458.0)
    assert strength(open_room, xy)[:, 0] == pytest.approx(friis)
    coherent = replace(open_room, coherent=True)
    assert strength(coherent, xy)[:, 0] == pytest.approx(friis)  # one ray: no interference


def test_images_are_those_of_mirroring_again_and_again() -> None:
    source, size = np.array([2.0, 7.0, 1.5]), np.array([10.0, 9.0, 3.0])
    found, count = _images(source, size, 2)
    mirrored = {tuple(source): 0}
    for order in (1, 2):  # mirror everything in every wall; an image keeps the least number of mirrors
        for image in [i for i, n in mirrored.items() if n == order - 1]:
            for axis in range(3):
                for wall in (0.0, size[axis]):
                    other = list(image)
                    other[axis] = 2 * wall - other[axis]
                    mirrored.setdefault(tuple(other), order)
    assert {tuple(i): n for i, n in zip(found.tolist(), count.sum(axis=1), strict=True)} == mirrored


def test_a_denser_wall_reflects_more_and_a_wall_of_air_nothing() -> None:
    cosine = np.linspace(0.05, 1.0, 20)
    for in_plane in (False, True):
        assert np.allclose(_reflection(cosine, 1.0, in_plane=in_plane), 0.0)
        assert np.all(np.abs(_reflection(cosine, 5.0, in_plane=in_plane)) < 1.0)
    # straight on: (1 - n) / (1 + n), in both polarisations of opposite sign by convention
    n = np.sqrt(5.0)
    assert _reflection(np.ones(1), 5.0, in_plane=False)[0] == pytest.approx((1 - n) / (1 + n))
    assert _reflection(np.ones(1), 5.0, in_plane=True)[0] == pytest.approx((n - 1) / (n + 1))
    brewster = np.cos(np.arctan(n))
    assert _reflection(np.array([brewster]), 5.0, in_plane=True)[0] == pytest.approx(0.0, abs=1e-12)
    weak, dense = (strength(replace(ROOM, permittivity=e), np.array([[20.0, 20.0]])) for e in (2.0, 8.0))
    assert np.all(dense > weak)


def test_more_reflections_only_add_power() -> None:
    xy = survey_places(ROOM)[::7]
    levels = [strength(replace(ROOM, reflections=k), xy) for k in range(4)]
    for fewer, more in pairwise(levels):
        assert np.all(more > fewer)
    assert np.max(levels[3] - levels[2]) < np.max(levels[1] - levels[0])


def test_the_room_is_symmetric_and_the_sum_of_waves_fades_where_that_of_powers_does_not() -> None:
    xy = np.array([[7.0, 11.0], [33.0, 29.0]])  # one place and its image through the middle
    level = strength(ROOM, xy)
    assert level[0, 0] == pytest.approx(level[1, 1])
    assert level[0, 2] == pytest.approx(level[1, 3])
    line = np.column_stack([np.linspace(18.0, 19.0, 400), np.full(400, 20.0)])
    coherent = strength(replace(ROOM, coherent=True), line)
    assert np.ptp(strength(ROOM, line)[:, 0]) < 1.0
    assert np.ptp(coherent[:, 0]) > 6.0


def test_the_walk_starts_and_ends_where_the_paper_says() -> None:
    walk = true_walk(ROOM)
    assert walk.xy[0].tolist() == [4.5, 4.5]
    assert walk.xy[-1].tolist() == [25.5, 10.5]
    assert len(walk.xy) == 28
    assert len(walk.length) == len(walk.heading) == 27
    moved = walk.xy[:-1] + walk.length[:, None] * np.column_stack(
        [np.cos(walk.heading), np.sin(walk.heading)]
    )
    assert moved == pytest.approx(walk.xy[1:])
    assert survey_places(ROOM).shape == (169, 2)


def test_every_sensor_has_its_own_noise_and_a_seed_gives_the_same() -> None:
    walk, places = true_walk(ROOM), survey_places(ROOM)
    survey, on_walk = strength(ROOM, places), strength(ROOM, walk.xy)
    runs = [sense(ROOM, survey, on_walk, walk, np.random.default_rng(k)) for k in range(60)]
    again = sense(ROOM, survey, on_walk, walk, np.random.default_rng(0))
    assert np.array_equal(again.rssi, runs[0].rssi)
    assert np.array_equal(runs[0].survey, survey)  # free of noise unless told
    assert np.std([r.rssi - on_walk for r in runs]) == pytest.approx(2.2, rel=0.05)
    assert np.std([r.length - walk.length for r in runs]) == pytest.approx(0.1, rel=0.1)
    assert np.std([r.compass - walk.heading[0] for r in runs]) == pytest.approx(0.1, rel=0.35)
    assert np.std([r.yaw - walk.heading + walk.heading[0] for r in runs]) == pytest.approx(0.02, rel=0.1)
    noisy = replace(ROOM, survey_noise_db=3.0)
    found = sense(noisy, survey, on_walk, walk, np.random.default_rng(1)).survey - survey
    assert np.std(found) == pytest.approx(3.0, rel=0.1)


def test_an_impossible_room_is_refused() -> None:
    for wrong in ({"ap_height": 3.5}, {"ap_xy": ((41.0, 2.0),)}, {"permittivity": 0.5}, {"noise_db": -1.0}):
        with pytest.raises(ConfigError, match="Room"):
            Room(**wrong)
