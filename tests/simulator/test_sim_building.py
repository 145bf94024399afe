"""The building is whole: corridors are passable and connected, and its geometry agrees with shapely's."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

from wayfuse.core.errors import ConfigError
from wayfuse.simulator.building import shopping_centre
from wayfuse.simulator.geometry import clearance, crossings, inside, polygon_walls
from wayfuse.simulator.routes import Manner, plan_route


@pytest.mark.parametrize("seed", range(5))
def test_corridors_keep_off_the_walls(seed):
    for storey in shopping_centre(np.random.default_rng(seed)).storeys:
        assert storey.is_walkable(storey.nodes).all()
        for a, b in storey.edges:
            assert storey.is_clear(storey.nodes[a], storey.nodes[b], 0.7), (storey.name, storey.nodes[[a, b]])


def test_every_node_is_reached_from_every_other():
    for storey in shopping_centre(np.random.default_rng(0)).storeys:
        reached = {0}
        for _ in storey.nodes:
            reached |= {int(b) for e in storey.edges for a, b in (e, e[::-1]) if int(a) in reached}
        assert len(reached) == len(storey.nodes)


@pytest.mark.parametrize("seed", range(5))
def test_rooms_lie_inside_the_outline_and_do_not_overlap(seed):
    building = shopping_centre(np.random.default_rng(seed))
    for storey in building.storeys:
        outline = shapely.Polygon(storey.outline)
        assert outline.bounds == (0.0, 0.0, building.width, building.height)
        shapes = [shapely.Polygon(room.polygon) for room in (*storey.rooms, *storey.voids)]
        assert all(shape.is_valid and outline.covers(shape) for shape in shapes)
        assert shapely.union_all(shapes).area == pytest.approx(sum(shape.area for shape in shapes))
        assert 0.25 < 1.0 - sum(shape.area for shape in shapes) / outline.area < 0.5


def test_only_the_upper_floor_has_the_hole():
    lower, upper = shopping_centre(np.random.default_rng(0)).storeys
    assert not lower.voids
    assert len(upper.voids) == 1
    assert not upper.is_walkable(upper.voids[0].polygon.mean(axis=0)[None]).any()


def test_an_unknown_floor_is_an_error_that_lists_the_floors():
    building = shopping_centre(np.random.default_rng(0))
    assert building.floor_index("F2") == 1
    with pytest.raises(ConfigError, match="F1, F2"):
        building.floor_index("B1")


def test_inside_agrees_with_shapely():
    rng = np.random.default_rng(1)
    star = np.array([(0, 0), (4, 1), (8, 0), (6, 4), (8, 8), (4, 6), (0, 8), (2, 4)], dtype=float)
    xy = rng.uniform(-1, 9, (500, 2))
    np.testing.assert_array_equal(inside(star, xy), shapely.contains_xy(shapely.Polygon(star), xy))


def test_crossings_and_clearance_agree_with_shapely():
    rng = np.random.default_rng(2)
    start, stop, walls = rng.uniform(0, 10, (40, 2)), rng.uniform(0, 10, (40, 2)), rng.uniform(0, 10, (30, 4))
    lines = shapely.linestrings(walls.reshape(-1, 2, 2))
    for i, way in enumerate(shapely.linestrings(np.stack([start, stop], axis=1))):
        np.testing.assert_array_equal(
            crossings(start[i : i + 1], stop[i : i + 1], walls)[0], way.crosses(lines)
        )
    expected = shapely.distance(shapely.points(start)[:, None], lines).min(axis=1)
    np.testing.assert_allclose(clearance(start, walls), expected)


def test_shared_edges_are_one_wall():
    a = np.array([(0, 0), (1, 0), (1, 1), (0, 1)], dtype=float)
    assert len(polygon_walls([a, a + np.array([1.0, 0.0])])) == 7


def test_a_survey_passes_every_corridor():
    storey = shopping_centre(np.random.default_rng(0)).storeys[0]
    visits = np.zeros(len(storey.edges), dtype=np.int64)
    rng = np.random.default_rng(3)
    for _ in range(12):
        plan_route(storey, 50.0, rng, visits=visits)
    assert visits.min() >= 1


def test_routes_are_as_long_as_asked_and_stand_only_on_the_way():
    storey = shopping_centre(np.random.default_rng(0)).storeys[1]
    for seed in range(20):
        route = plan_route(storey, 60.0, np.random.default_rng(seed), manner=Manner(pause_share=1.0))
        assert 50.0 < np.hypot(*np.diff(route.xy, axis=0).T).sum() < 80.0
        assert route.pause[0] == route.pause[-1] == 0.0
        assert (route.pause[1:-1] >= 2.0).all()
        for a, b in zip(route.xy[:-1], route.xy[1:], strict=True):
            assert storey.is_clear(a, b, 0.5)
