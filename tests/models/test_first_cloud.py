"""The first cloud: at the scan's places, in walkable space where it can be, headings by what is known."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from wayfuse.core.errors import ConfigError
from wayfuse.core.philox import Noise
from wayfuse.maps.walkable import Walkable
from wayfuse.models.initial import Anywhere, FirstCloud
from wayfuse.models.observation.fingerprint import FingerprintLikelihood
from wayfuse.radio.sparse_knn import Neighbours

OBSERVATION = FingerprintLikelihood(sigma=4.0)


def near(x: float, y: float, floor: int = 0) -> Neighbours:
    one = np.ones(1, np.float32)
    return Neighbours(one * x, one * y, np.int32([floor]), one, 0.1, 9)


def test_without_a_map_it_is_the_mixture() -> None:
    cloud = FirstCloud(observation=OBSERVATION, bias_sigma=0.3, scale_sigma=0.1).draw(
        Noise.of(0, "x"), near(10.0, 20.0, 3), 20_000
    )
    for column, mean, sigma in (
        (cloud.x, 10.0, 4.0),
        (cloud.y, 20.0, 4.0),
        (cloud.heading_bias, 0.0, 0.3),
        (cloud.step_scale, 1.0, 0.1),
    ):
        assert column.dtype == np.float32
        assert np.mean(column) == pytest.approx(mean, abs=5.0 * sigma / np.sqrt(20_000))
        assert np.std(column) == pytest.approx(sigma, rel=0.03)
    np.testing.assert_array_equal(cloud.floor, 3)


def test_an_unknown_heading_is_drawn_over_the_whole_circle() -> None:
    first = FirstCloud(observation=OBSERVATION)
    bias = first.draw(Noise.of(0, "x"), near(0.0, 0.0), 20_000, heading_known=False).heading_bias
    counts = np.histogram(bias, 16, (-np.pi, np.pi))[0]
    assert counts.sum() == 20_000
    assert np.sum((counts - 1250.0) ** 2 / 1250.0) < 15.0 + 5.0 * np.sqrt(30.0)


def test_particles_start_where_people_can_walk(world: Any) -> None:
    walkable = tuple(f.walkable for f in world.site.floors)
    places = walkable[0].centres()
    at = places[len(places) // 2]
    free = FirstCloud(observation=OBSERVATION).draw(Noise.of(1, "x"), near(*at), 4000)
    kept = FirstCloud(observation=OBSERVATION, walkable=walkable).draw(Noise.of(1, "x"), near(*at), 4000)
    share = [np.mean(walkable[0].contains(c.x, c.y)) for c in (free, kept)]
    assert share[0] < 0.9
    assert share[1] > 1.0 - (1.0 - share[0]) ** 6


def test_no_walkable_space_nearby_does_not_stop_it(world: Any) -> None:
    walkable = tuple(f.walkable for f in world.site.floors)
    cloud = FirstCloud(observation=OBSERVATION, walkable=walkable).draw(
        Noise.of(1, "x"), near(-500.0, -500.0, 1), 100
    )
    assert np.mean(cloud.x) == pytest.approx(-500.0, abs=5.0 * 0.4)


def test_negative_spreads_are_refused() -> None:
    with pytest.raises(ConfigError, match="must not be negative"):
        FirstCloud(observation=OBSERVATION, bias_sigma=-0.1)


def test_anywhere_is_even_over_the_walkable_space_of_all_floors() -> None:
    small = Walkable((0.0, 0.0), 0.5, np.ones((4, 4), np.uint8))  # 4 m²
    mask = np.zeros((20, 20), np.uint8)
    mask[:, :12] = 1  # 60 m², x from 10 to 16
    large = Walkable((10.0, 0.0), 0.5, mask)
    cloud = Anywhere(walkable=(small, large), bias_sigma=0.2).draw(Noise.of(1, "a"), 20_000)
    assert set(cloud.floor.tolist()) == {0, 1}
    assert float(np.mean(cloud.floor == 0)) == pytest.approx(4.0 / 64.0, abs=0.006)
    up = cloud.floor == 1
    assert large.contains(cloud.x[up], cloud.y[up]).all()
    assert small.contains(cloud.x[~up], cloud.y[~up]).all()
    counts, _ = np.histogram(
        cloud.x[up], bins=np.linspace(10.0, 16.0, 25)
    )  # half cells: no place is a favourite
    assert counts.min() > 0.85 * counts.mean()
    assert float(np.std(cloud.heading_bias)) == pytest.approx(0.2, rel=0.05)
    turned = Anywhere(walkable=(small,)).draw(Noise.of(1, "a"), 5000, heading_known=False)
    assert float(np.abs(turned.heading_bias).max()) > 3.0


def test_anywhere_needs_somewhere() -> None:
    with pytest.raises(ConfigError, match="no floor has walkable space"):
        Anywhere(walkable=(Walkable((0.0, 0.0), 0.5, np.zeros((4, 4), np.uint8)),))
