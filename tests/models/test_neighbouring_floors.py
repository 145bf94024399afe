"""Floors without a survey borrow the fingerprints of the floors next to them."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wayfuse.core.frames import GeoAnchor
from wayfuse.filters.cloud import Cloud
from wayfuse.maps.build import build_floor
from wayfuse.maps.site import Polygon, Site
from wayfuse.models.observation.fingerprint import FingerprintLikelihood
from wayfuse.models.observation.neighbouring import NeighbouringFloors
from wayfuse.radio.sparse_knn import Neighbours
from wayfuse.radio.survey import Survey

ELEVATION = (0.0, 3.0, 6.0, 16.0)
CORNER = ((0.0, 0.0), (5.0, -3.0), (-2.0, 4.0), (0.0, 0.0))  # m, of the floors' frames in that of the lowest


def site(shifted: bool = False) -> Site:
    ring = Polygon(np.array([(0.0, 0.0), (40.0, 0.0), (40.0, 20.0), (0.0, 20.0), (0.0, 0.0)]))
    ground = GeoAnchor.from_origin(10.0, 50.0)
    anchors = [GeoAnchor.from_origin(*ground.to_lonlat(corner).tolist()) for corner in CORNER]
    return Site(
        "house",
        tuple(
            build_floor(f"F{i}", i, [ring], elevation=z, anchor=anchors[i] if shifted else None)
            for i, z in enumerate(ELEVATION)
        ),
    )


def survey(*floors: int) -> Survey:
    rng = np.random.default_rng(2)
    floor = np.repeat(floors, 5)
    rssi = rng.uniform(-90.0, -40.0, (len(floor), 4))
    return Survey.from_dense(rssi, rng.uniform(0.0, 20.0, (len(floor), 2)), floor, ("F0", "F1", "F2", "F3"))


def near(*floors: int) -> Neighbours:
    n = len(floors)
    rng = np.random.default_rng(n)
    x, y = rng.uniform(5.0, 15.0, (2, n)).astype(np.float32)
    weight = np.full(n, 1.0 / n, np.float32)
    return Neighbours(x, y, np.array(floors, np.int32), weight, 0.1, 20)


def test_a_site_that_is_surveyed_whole_lends_nothing() -> None:
    assert NeighbouringFloors.build(site(), survey(0, 1, 2, 3)) is None


def test_the_weights_fall_with_the_height_between() -> None:
    lending = NeighbouringFloors.build(site(), survey(0, 2))
    assert lending is not None
    one = np.exp(-0.5)
    want = np.zeros((4, 4))
    want[[0, 2], 1] = one
    want[0, 3], want[2, 3] = np.exp(-0.5 * (16 / 3) ** 2), np.exp(-0.5 * (10 / 3) ** 2)
    np.testing.assert_allclose(lending.weight, want)
    wider = NeighbouringFloors.build(site(), survey(0, 2), sigma=6.0)
    assert wider is not None
    assert wider.weight[0, 1] > lending.weight[0, 1]


def test_neighbours_are_copied_to_floors_that_borrow_and_to_no_other() -> None:
    lending = NeighbouringFloors.build(site(), survey(0, 2))
    assert lending is not None
    found = near(0, 0, 2)
    kept = [np.copy(part) for part in found[:4]]
    lent = lending.lend(found)
    np.testing.assert_array_equal(lent.floor, [0, 0, 2, 1, 1, 1])  # the top floor is too far from both
    np.testing.assert_array_equal(lent.x, np.concatenate([found.x, found.x]))
    np.testing.assert_array_equal(lent.y, np.concatenate([found.y, found.y]))
    np.testing.assert_allclose(lent.weight[3:], found.weight * np.exp(-0.5), rtol=1e-6)
    np.testing.assert_array_equal(lent.weight[:3], found.weight)
    assert (lent.distance, lent.n_aps) == (found.distance, found.n_aps)
    for part, dtype in zip(lent[:4], (np.float32, np.float32, np.int32, np.float32), strict=True):
        assert part.dtype == dtype
    for now, then in zip(found[:4], kept, strict=True):
        np.testing.assert_array_equal(now, then)


def test_copies_stand_at_the_same_place_in_the_frame_of_their_floor() -> None:
    house = site(shifted=True)
    lending = NeighbouringFloors.build(house, survey(0, 2))
    assert lending is not None
    found = near(0, 2)
    lent = lending.lend(found)
    for source, copy in ((0, 2), (1, 3)):
        assert lent.floor[copy] == 1
        from_floor = house.floors[int(lent.floor[source])]
        there = from_floor.to_lonlat((float(lent.x[source]), float(lent.y[source])))
        here = house.floors[1].to_lonlat((float(lent.x[copy]), float(lent.y[copy])))
        np.testing.assert_allclose(here, there, atol=1e-8)  # degrees: a millimetre


@given(floors=st.lists(st.sampled_from([1, 3]), min_size=1, max_size=30))
def test_no_surveyed_floor_gains_and_weights_stay_in_bounds(floors: list[int]) -> None:
    lending = NeighbouringFloors.build(site(), survey(1, 3))
    assert lending is not None
    found = near(*floors)
    lent = lending.lend(found)
    own = np.isin(lent.floor, [1, 3])
    assert np.count_nonzero(own) == len(floors)
    assert np.all((lent.weight > 0.0) & (lent.weight <= 1.0))
    for f in (0, 2):
        assert lent.weight[lent.floor == f].sum() <= 1.0 + 1e-6


def test_particles_on_a_floor_that_borrows_are_likelier_where_the_neighbours_are() -> None:
    lending = NeighbouringFloors.build(site(), survey(0, 2))
    found = near(0, 2)
    x = np.array([found.x[0], 39.0, found.x[0], found.x[0]], np.float32)
    y = np.array([found.y[0], 19.0, found.y[0], found.y[0]], np.float32)
    zero = np.zeros(4, np.float32)
    cloud = Cloud.on_floors(x, y, zero, zero + 1, np.array([1, 1, 0, 3], np.int32))
    told = {}
    for name, lends in (("borrows", lending), ("alone", None)):
        out = np.zeros(4)
        FingerprintLikelihood(sigma=2.0, neighbouring=lends).log_likelihood(cloud, found, out)
        told[name] = out
    assert told["borrows"][0] > told["borrows"][1] + 1.0
    assert told["alone"][0] == pytest.approx(told["alone"][1])
    assert told["borrows"][2] > told["borrows"][0]  # its own floor is still the likelier
    np.testing.assert_array_equal(told["borrows"][2:], told["alone"][2:])
