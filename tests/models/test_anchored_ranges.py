"""Ranges to anchors: the Gaussian of the paper, the late tail, floors, and what says nothing."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from wayfuse.core.errors import ConfigError
from wayfuse.filters.cloud import Cloud
from wayfuse.models.observation.anchored_ranges import AnchoredRanges
from wayfuse.models.observation.ranges import Exponents, RangeLikelihood
from wayfuse.radio.ap_places import ApPlaces
from wayfuse.sensors.records import Range

NAN = float("nan")
SITE = {"offsets": np.array([[0.0, 0.0], [5.0, -2.0]]), "elevations": np.array([0.0, 4.0])}
PLACES = ApPlaces(
    np.array([7, 8, 9], np.uint64),
    np.array([0.0, 10.0, 0.0]),
    np.array([0.0, 0.0, 10.0]),
    np.array([0, 0, 1], np.int32),
    np.array([2.2, NAN, 2.2]),
)


def model(**parameters: Any) -> AnchoredRanges:
    return AnchoredRanges(places=PLACES, **SITE, **parameters)


def at(*places: tuple[float, float, int]) -> Cloud:
    x, y, floor = (np.array(c) for c in zip(*places, strict=True))
    zero = np.zeros(len(x), np.float32)
    return Cloud.on_floors(x.astype(np.float32), y.astype(np.float32), zero, zero + 1, floor.astype(np.int32))


def test_on_one_floor_it_is_the_gaussian_of_the_paper() -> None:
    cloud = at((3.0, 4.0, 0), (6.0, 1.0, 0))
    level = ApPlaces(PLACES.bssid[:2], PLACES.x[:2], PLACES.y[:2], PLACES.floor[:2], np.full(2, NAN))
    for kind in Exponents:
        ours, papers = np.zeros(2), np.zeros(2)
        mine = AnchoredRanges(places=level, **SITE, sigma=2.0, exponents=kind)
        assert mine.log_likelihood(cloud, [Range(0.0, 7, 5.5), Range(0.0, 8, 7.0)], ours)
        paper = RangeLikelihood(level.xy, 2.0, kind)
        paper.log_likelihood(cloud, np.array([5.5, 7.0]), papers)  # type: ignore[arg-type]
        np.testing.assert_allclose(ours, papers, rtol=1e-5)


def test_distances_are_in_space_and_over_floors() -> None:
    out = np.zeros(2)
    # the anchor hangs 2.2 m above floor 1 at (0, 10) there, (5, 8) below; the phone 1.2 m above its floor
    cloud = at((5.0, 8.0, 0), (0.0, 10.0, 1))
    model(sigma=1.0).log_likelihood(cloud, [Range(0.0, 9, 5.0)], out)
    np.testing.assert_allclose(out, [0.0, -8.0], atol=1e-6)


def test_late_ranges_are_believed_more_than_early_ones() -> None:
    robust = model(sigma=1.0, late=0.3, lateness=3.0)

    def of(distance: float) -> float:
        out = np.zeros(1)
        robust.log_likelihood(at((10.0, 5.0, 0)), [Range(0.0, 8, distance)], out)
        return float(out[0])

    assert of(5.0) > of(9.0) > of(1.0)
    assert of(1.0) > -25.0  # nothing is impossible
    grid = np.linspace(-20.0, 80.0, 20_001)
    total = np.trapezoid([np.exp(of(d)) for d in grid[::20]], grid[::20])
    assert total == pytest.approx(1.0, abs=0.01)


def test_a_stated_deviation_widens_and_the_gain_tempers() -> None:
    one, wide, half = np.zeros(1), np.zeros(1), np.zeros(1)
    cloud = at((10.0, 5.0, 0))
    model().log_likelihood(cloud, [Range(0.0, 8, 7.0)], one)
    model().log_likelihood(cloud, [Range(0.0, 8, 7.0, np.sqrt(3.0))], wide)
    model(gain=0.5).log_likelihood(cloud, [Range(0.0, 8, 7.0)], half)
    assert wide[0] == pytest.approx(one[0] / 4.0)
    assert half[0] == pytest.approx(one[0] / 2.0)


def test_unknown_anchors_say_nothing() -> None:
    out = np.zeros(1)
    assert not model().log_likelihood(at((0.0, 0.0, 0)), [Range(0.0, 99, 3.0)], out)
    assert out[0] == 0.0
    assert not model().log_likelihood(at((0.0, 0.0, 0)), [], out)


def test_it_takes_floors_from_a_site(world: Any) -> None:
    built = AnchoredRanges.build(world.site, PLACES, sigma=2.0)
    assert built.sigma == 2.0
    assert built.offsets.shape == (len(world.site.floors), 2)
    np.testing.assert_allclose(built.offsets[0], 0.0)


@pytest.mark.parametrize("bad", [{"sigma": 0.0}, {"late": 1.0}, {"lateness": 0.0}, {"gain": -1.0}])
def test_bad_parameters_are_named(bad: dict[str, float]) -> None:
    with pytest.raises(ConfigError, match="must be positive"):
        model(**bad)


def test_an_anchor_needs_its_floor() -> None:
    with pytest.raises(ConfigError, match="does not have"):
        AnchoredRanges(places=PLACES, offsets=np.zeros((1, 2)), elevations=np.zeros(1))
