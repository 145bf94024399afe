"""Routes: short, in the cells, over the right connectors, and clear about what is in the way."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from test_graph import HEIGHT, WIDTH, box, floors, ring

from wayfuse.core.errors import MapError
from wayfuse.maps.build import build_floor
from wayfuse.maps.connectors import Connector, ConnectorKind, Landing
from wayfuse.maps.funnel import pull_taut
from wayfuse.maps.graph import build_graph
from wayfuse.maps.importers.rooms import cut_walls
from wayfuse.maps.partition import limits
from wayfuse.maps.route import Costs, Leg, Place, Ride, find_route
from wayfuse.maps.site import Site
from wayfuse.maps.walls import WallIndex


def length(path):
    return float(np.hypot(*np.diff(path, axis=0).T).sum())


@given(floors(), st.integers(0, 2**32))
@settings(max_examples=25)
def test_a_route_crosses_no_wall_and_is_no_longer_than_the_way_back_or_over_a_third_place(made, seed):
    floor, _ = made
    site = Site("hall", (floor,))
    graph = build_graph(site)
    rng = np.random.default_rng(seed)
    cells = rng.integers(graph.n_cells, size=3)
    a, b, c = (Place(0, *graph.polygon(int(i)).mean(axis=0).tolist()) for i in cells)
    try:
        route = find_route(site, graph, a, b)
    except MapError:
        with pytest.raises(MapError, match="nothing leads"):
            find_route(site, graph, b, a)
        return
    (leg,) = route.parts
    np.testing.assert_allclose(leg.path[[0, -1]], [a[1:], b[1:]], atol=1e-9)
    index = WallIndex.build(limits(floor))
    assert not np.any(index.crosses(*leg.path[:-1].T, *leg.path[1:].T))
    straight = float(np.hypot(a.x - b.x, a.y - b.y))
    assert straight - 1e-9 <= leg.length == pytest.approx(length(leg.path))
    assert route.seconds == pytest.approx(leg.length / Costs().walking)
    if not index.crosses([a.x], [a.y], [b.x], [b.y])[0]:
        assert leg.length <= straight + 1.5  # what keeping clear of jambs may cost
    assert find_route(site, graph, b, a).length == pytest.approx(leg.length, rel=0.05, abs=0.5)
    try:
        detour = find_route(site, graph, a, c).length + find_route(site, graph, c, b).length
    except MapError:
        return
    assert leg.length <= 1.05 * detour + 0.5


def test_a_path_is_pulled_around_a_corner():
    portals = [np.array([4.0, 0.0, 4.0, 1.0]), np.array([5.0, 1.0, 4.0, 1.0])]
    path = pull_taut(ring([0.0, 0.5]), ring([4.5, 5.0]), portals)
    np.testing.assert_allclose(path, [[0.0, 0.5], [4.0, 1.0], [4.5, 5.0]])
    straight = pull_taut(ring([0.0, 0.5]), ring([9.0, 0.5]), portals[:1])
    np.testing.assert_allclose(straight, [[0.0, 0.5], [9.0, 0.5]])
    flipped = pull_taut(ring([0.0, 0.5]), ring([4.5, 5.0]), [p[[2, 3, 0, 1]] for p in portals])
    np.testing.assert_allclose(flipped, path)


def house(*connectors):
    """Three floors 4 m apart, an open hall each."""
    hall = [box(0, 0, WIDTH, HEIGHT)]
    built = [
        build_floor(f"F{k}", k, hall, walls=cut_walls(hall, [], []), closed=[], elevation=4.0 * k)
        for k in range(3)
    ]
    site = Site("house", tuple(built), connectors=connectors)
    return site, build_graph(site)


def at(floor, x):
    return Landing(floor, x, 4.0)


LIFT = Connector("lift", ConnectorKind.LIFT, (at(0, 2.0), at(2, 2.0)))
STAIRS = Connector("stairs", ConnectorKind.STAIRS, (at(0, 6.0), at(1, 6.0), at(2, 7.0)), (20, 22))
DOWN = Connector("down", ConnectorKind.ESCALATOR, (at(0, 9.0), at(1, 9.0)), direction=-1)


def test_the_quickest_connector_is_taken_and_told():
    site, graph = house(LIFT, STAIRS, DOWN)
    route = find_route(site, graph, Place(0, 6.0, 1.0), Place(2, 7.0, 1.0))
    first, ride, last = route.parts
    assert isinstance(first, Leg)
    assert isinstance(ride, Ride)
    assert (ride.connector.id, ride.start, ride.end, ride.steps) == ("stairs", 0, 2, 42)
    assert ride.seconds == pytest.approx(42 * 0.6)
    assert (first.length, last.length) == pytest.approx((3.0, 3.0))
    assert route.length == pytest.approx(6.0)
    assert route.seconds == pytest.approx(6.0 / 1.3 + 42 * 0.6)
    tired = Costs(step_up=3.0)
    assert (
        find_route(site, graph, Place(0, 6.0, 1.0), Place(2, 7.0, 1.0), tired).parts[1].connector.id == "lift"
    )


def test_an_escalator_goes_one_way_and_a_lift_does_not_stop_everywhere():
    site, graph = house(LIFT, DOWN)
    ride = find_route(site, graph, Place(1, 9.0, 1.0), Place(0, 9.0, 1.0)).parts[1]
    assert (ride.connector.id, ride.steps, ride.seconds) == ("down", 0, pytest.approx(4.0 / 0.25))
    with pytest.raises(MapError, match=r"nothing leads from .* on floor F0 to .* on floor F1"):
        find_route(site, graph, Place(0, 9.0, 1.0), Place(1, 9.0, 1.0))
    up = find_route(site, graph, Place(0, 9.0, 1.0), Place(2, 9.0, 1.0))
    assert [p.connector.id for p in up.parts if isinstance(p, Ride)] == ["lift"]


def test_a_place_in_a_wall_is_named_with_the_nearest_that_is_not():
    site, graph = house()
    with pytest.raises(MapError, match=r"\(-3\.0, 4\.0\) on floor F1 is in a wall .* is 0\.2,"):
        find_route(site, graph, Place(1, -3.0, 4.0), Place(1, 2.0, 2.0))


def test_ramps_and_stairs_of_unknown_number():
    ramp = Connector("r", ConnectorKind.RAMP, (at(0, 1.0), at(1, 1.0)))
    assert Costs().ride(ramp, 1.2) == pytest.approx(20.0 / 1.3)
    assert Costs().ride(STAIRS, -3.4) == pytest.approx(20 * 0.5)
    assert Costs().ride(LIFT, -10.0) == pytest.approx(40.0)
