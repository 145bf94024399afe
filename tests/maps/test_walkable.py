"""The walkable mask and the geometry it comes from."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

from wayfuse.core.errors import MapError
from wayfuse.core.jit import kernel
from wayfuse.maps._kernels import is_inside
from wayfuse.maps.build import build_floor, nominal_elevation
from wayfuse.maps.geometry import clean_polygons, edges, free_space, normalise_walls, rasterise
from wayfuse.maps.site import Unit
from wayfuse.maps.walkable import Walkable


def polygon(*rings):
    (found,), fault = clean_polygons([np.asarray(ring, dtype=float) for ring in rings])
    assert fault == ""
    return found


def box(x0, y0, x1, y1):
    return [[x0, y0], [x1, y0], [x1, y1], [x0, y1]]


MASK = Walkable((1.0, 2.0), 0.5, np.array([[1, 0, 1], [0, 0, 1]], np.uint8))


def test_cells_contain_their_lower_edges():
    x = [1.0, 1.49, 1.5, 2.0, 2.49, 2.5, 0.99, 2.2, np.nan, 1e300]
    y = [2.0, 2.49, 2.0, 2.0, 2.99, 2.0, 2.0, 3.0, 2.0, 2.0]
    expected = [True, True, False, True, True, False, False, False, False, False]
    assert MASK.contains(x, y).tolist() == expected
    assert MASK.area == pytest.approx(0.75)


@kernel
def ask(x, y, origin_x, origin_y, inverse_cell, mask, out):
    for i in range(len(x)):
        out[i] = is_inside(x[i], y[i], origin_x, origin_y, inverse_cell, mask)


def test_kernel_says_the_same():
    rng = np.random.default_rng(0)
    x, y = rng.uniform(0, 4, (2, 2000))
    x[:3] = np.nan, np.inf, -np.inf
    out = np.empty(len(x), np.bool_)
    ask(x, y, *MASK.origin, 1 / MASK.cell, MASK.mask, out)
    assert np.array_equal(out, MASK.contains(x, y))


def test_random_points_fill_the_walkable_cells_evenly():
    points = MASK.random_points(np.random.default_rng(1), 9000)
    assert MASK.contains(*points.T).all()
    cells = np.floor((points - MASK.origin) / MASK.cell).astype(int)
    counts = np.unique(cells[:, 1] * 3 + cells[:, 0], return_counts=True)[1]
    assert len(counts) == 3
    assert np.all(np.abs(counts - 3000) < 5 * np.sqrt(3000 * 2 / 3))


def test_free_space_is_widened_into_units_but_not_out_of_the_house():
    space = free_space([polygon(box(0, 0, 20, 10))], [polygon(box(0, 0, 10, 10))])
    assert shapely.contains_xy(space, [9.75, 9.65, 19.9, 20.1], [5, 5, 5, 5]).tolist() == [
        True,
        False,
        True,
        False,
    ]


def test_a_slit_between_two_shops_is_no_passage():
    house = [polygon(box(0, 0, 20, 10))]
    slit = free_space(house, [polygon(box(0, 0, 10, 8)), polygon(box(10.1, 0, 20, 8))])
    alley = free_space(house, [polygon(box(0, 0, 9, 8)), polygon(box(10.1, 0, 20, 8))])
    assert not shapely.contains_xy(slit, 10.05, 4.0)
    assert shapely.contains_xy(alley, 9.5, 4.0)


def test_mask_follows_the_shape():
    shape = shapely.box(-3, 2, 4, 9).difference(shapely.Point(0, 5).buffer(2))
    mask = rasterise(shape)
    assert mask.area == pytest.approx(shape.area, rel=0.02)
    x, y = mask.centres().T
    assert shapely.contains_xy(shape, x, y).all()
    assert rasterise(shapely.Polygon()).area == 0.0


def test_edges_close_around_the_shape():
    segments = edges(shapely.box(0, 0, 4, 4).difference(shapely.box(1, 1, 2, 2)))
    assert len(segments) == 8
    assert np.hypot(*(segments[:, 2:] - segments[:, :2]).T).sum() == pytest.approx(20.0)


def test_walls_are_listed_once_whatever_their_direction():
    walls = [[0, 0, 1, 0], [1, 0, 0, 0], [2, 2, 2, 1], [3, 3, 3, 3]]
    assert normalise_walls(np.array(walls, float)).tolist() == [[0, 0, 1, 0], [2, 1, 2, 2]]


def test_polygons_that_enclose_nothing():
    assert clean_polygons([]) == ((), "fewer than three points, or coordinates that are not numbers")
    assert clean_polygons([np.array([[0.0, 0.0], [1.0, 1.0], [2.0, 2.0]])])[0] == ()


def test_a_floor_with_given_walls_keeps_only_those():
    walls = np.array([[5.0, 0.0, 5.0, 10.0]])
    shop = Unit("1", "", "shop", polygon(box(0, 0, 2, 2)))
    floor = build_floor("F1", 1, [polygon(box(0, 0, 20, 10))], [shop], walls=walls)
    assert floor.walls.tolist() == walls.tolist()
    assert (floor.width, floor.height) == (20.0, 10.0)
    with pytest.raises(MapError, match="no outline"):
        build_floor("F1", 1, [])


def test_nominal_elevation():
    assert [nominal_elevation(level) for level in (-2, -1, 1, 2)] == [-9.0, -4.5, 0.0, 4.5]
    assert [nominal_elevation(level, has_ground=True) for level in (-1, 0, 1)] == [-4.5, 0.0, 4.5]


def test_one_place_is_judged_as_many_are() -> None:
    rng = np.random.default_rng(3)
    mask = (rng.random((7, 11)) < 0.5).astype(np.uint8)
    walkable = Walkable((-1.3, 2.1), 0.5, mask)
    edges = [-1.3, -1.3 + 11 * 0.5, 2.1, 2.1 + 7 * 0.5, np.nan, np.inf, -np.inf, 1e300]
    x = np.concatenate([rng.uniform(-3.0, 6.0, 500), edges, np.zeros(8)])
    y = np.concatenate([rng.uniform(1.0, 7.0, 500), np.full(8, 3.0), edges])
    with np.errstate(invalid="ignore"):
        want = walkable.contains(x, y)
    assert 50 < np.count_nonzero(want) < 400
    assert [walkable.holds(*place) for place in zip(x.tolist(), y.tolist(), strict=True)] == want.tolist()
