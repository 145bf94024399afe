"""The wall test: equal to its definition for every move, and a definition without leaks."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from wayfuse.core.errors import MapError
from wayfuse.core.jit import kernel
from wayfuse.maps._kernels import brute_one, crosses_many, crosses_one
from wayfuse.maps.walls import LONGEST_MOVE, WallIndex


def in_order(x0, y0, x1, y1):
    swap = (x0 > x1) | ((x0 == x1) & (y0 > y1))
    return (np.where(swap, b, a) for a, b in ((x0, x1), (y0, y1), (x1, x0), (y1, y0)))


def brute(walls, x0, y0, x1, y1, chunk=2000):
    """The definition, move by wall, in NumPy: the same float64 arithmetic in the same order."""
    ax, ay, bx, by = in_order(*np.asarray(walls, dtype=np.float64).reshape(-1, 4).T)
    out = np.zeros(len(x0), bool)
    for i in range(0, len(x0), chunk):
        part = (np.asarray(a[i : i + chunk], dtype=np.float64)[:, None] for a in (x0, y0, x1, y1))
        px, py, qx, qy = in_order(*part)
        boxes = (px <= bx) & (ax <= qx)
        boxes &= (np.minimum(py, qy) <= np.maximum(ay, by)) & (np.minimum(ay, by) <= np.maximum(py, qy))
        wx, wy, mx, my = bx - ax, by - ay, qx - px, qy - py
        sides = (wx * (py - ay) - wy * (px - ax) > 0) != (wx * (qy - ay) - wy * (qx - ax) > 0)
        ends = (mx * (ay - py) - my * (ax - px) > 0) != (mx * (by - py) - my * (bx - px) > 0)
        out[i : i + chunk] = (boxes & sides & ends).any(axis=1)
    return out


def random_walls(rng, n, size=40.0, grid=0.0):
    start = rng.uniform(0, size, (n, 2))
    walls = np.hstack([start, start + rng.normal(0, 4, (n, 2))])
    return np.round(walls / grid) * grid if grid else walls


def random_moves(rng, n, walls, longest=LONGEST_MOVE, grid=0.0):
    low, high = walls.min() - 6, walls.max() + 6
    start = rng.uniform(low, high, (n, 2))
    angle, length = rng.uniform(0, 2 * np.pi, n), longest * rng.uniform(0, 1, n) ** 2
    moves = np.hstack([start, start + (length * [np.cos(angle), np.sin(angle)]).T])
    return (np.round(moves / grid) * grid if grid else moves).T


def disagreements(walls, moves):
    return int(np.sum(WallIndex.build(walls).crosses(*moves) != brute(walls, *moves)))


@pytest.mark.parametrize("grid", [0.0, 0.25, 1.0], ids=["free", "quarter metre", "metre"])
def test_index_equals_brute_force_on_random_maps(grid):
    rng = np.random.default_rng(1)
    for n in (1, 30, 300):
        walls = random_walls(rng, n, grid=grid)
        moves = random_moves(rng, 40_000, walls, grid=grid)
        assert disagreements(walls, moves) == 0
        assert brute(walls, *moves).any()


def test_long_moves_are_exact_too():
    rng = np.random.default_rng(2)
    walls = random_walls(rng, 50)
    moves = random_moves(rng, 20_000, walls, longest=30.0)
    assert disagreements(walls, moves) == 0


def test_moves_along_real_directions_of_walls_are_exact():
    """Moves on, along and from the ends of walls: the cases that rounding decides."""
    rng = np.random.default_rng(3)
    walls = random_walls(rng, 60)
    a, b = walls[:, :2], walls[:, 2:]
    t = rng.uniform(-0.5, 1.5, (2, 500, 60, 1))
    ends = a + t * (b - a)
    moves = np.concatenate([ends[0], ends[1]], axis=-1).reshape(-1, 4)
    short = moves[np.hypot(moves[:, 2] - moves[:, 0], moves[:, 3] - moves[:, 1]) < LONGEST_MOVE]
    assert len(short) > 5000
    assert disagreements(walls, short.T) == 0
    corners = np.repeat(a, 200, axis=0)
    steps = rng.normal(0, 0.5, corners.shape)
    assert disagreements(walls, np.hstack([corners, corners + steps]).T) == 0
    assert disagreements(walls, np.hstack([corners - steps, corners + steps]).T) == 0


coordinate = st.integers(-3, 3).map(float)
place = st.tuples(coordinate, coordinate)


@settings(max_examples=300, deadline=None)
@given(place, place, place, place)
def test_direction_of_move_and_wall_does_not_matter(p, q, a, b):
    answers = {
        bool(WallIndex.build([[*w[0], *w[1]]]).crosses(*m[0], *m[1])[0])
        for w in ((a, b), (b, a))
        for m in ((p, q), (q, p))
    }
    assert len(answers) == 1


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_nobody_leaves_a_closed_room_unseen(seed):
    """On a lattice, where moves go through corners and along walls all the time, the rule has no leak."""
    import shapely

    rng = np.random.default_rng(seed)
    hull = shapely.convex_hull(shapely.multipoints(rng.integers(-4, 5, (7, 2)).astype(float)))
    notch = shapely.box(*np.sort(rng.integers(-4, 5, (2, 2)).astype(float), axis=0).ravel())
    room = max(shapely.get_parts(hull.difference(notch)), key=shapely.area)
    if room.geom_type != "Polygon" or room.area < 2:
        return
    rings = [np.asarray(ring.coords) for ring in (room.exterior, *room.interiors)]
    walls = np.concatenate([np.hstack([ring[:-1], ring[1:]]) for ring in rings])
    x, y = np.meshgrid(np.arange(-6.0, 7.0), np.arange(-6.0, 7.0))
    points = np.column_stack([x.ravel(), y.ravel()])
    inside = points[shapely.contains_xy(room, *points.T)]
    outside = points[~shapely.intersects_xy(room, *points.T)]
    pairs = np.hstack([np.repeat(inside, len(outside), 0), np.tile(outside, (len(inside), 1))])
    whole = np.all(rings[0] == np.round(rings[0]))  # a corner off the lattice is a rounded one
    if whole and len(pairs):
        assert WallIndex.build(walls).crosses(*pairs.T).all()


def test_the_rule_for_touching():
    index = WallIndex.build([[0.0, 0.0, 2.0, 0.0], [2.0, 0.0, 2.0, 2.0]])

    def crosses(*move):
        return bool(index.crosses(*move)[0])

    assert crosses(1, -0.5, 1, 0.5)
    assert not crosses(0.5, 0, 1.5, 0), "sliding along a wall"
    assert not crosses(1, 0.5, 1, 0.5), "standing"
    assert crosses(1, 0, 1, 0.5) != crosses(1, 0, 1, -0.5), "on the wall one is on one side of it"
    assert crosses(1.5, 0.5, 2.5, -0.5), "no way through the common corner"
    assert not crosses(2.5, 0.5, 3.0, 1.0)


@kernel
def inside_another_kernel(x0, y0, x1, y1, grid, clearance, start, packed, walls, out):
    for i in range(len(x0)):
        out[i] = crosses_one(x0[i], y0[i], x1[i], y1[i], grid, clearance, start, packed, walls)


def test_float32_moves_mean_their_float64_values():
    rng = np.random.default_rng(5)
    walls = random_walls(rng, 100)
    moves = [m.astype(np.float32) for m in random_moves(rng, 20_000, walls)]
    arrays = WallIndex.build(walls).arrays

    for run in (inside_another_kernel, crosses_many):
        out = np.empty(len(moves[0]), np.bool_)
        run(*moves, *arrays, out)
        assert np.array_equal(out, brute(walls, *moves))


def test_numbers_that_are_none_cross_nothing():
    index = WallIndex.build([[0.0, 0.0, 2.0, 0.0]])
    bad = [np.nan, np.inf, -np.inf, 1e300]
    with np.errstate(all="ignore"):  # the kernels warn where they are interpreted
        assert not index.crosses(bad, 0.0, bad, 1.0)[[0, 1, 2]].any()
        assert not index.crosses(1.0, bad, 1.0, np.nan).any()


def test_no_walls_and_points_instead_of_walls():
    assert not WallIndex.build(np.empty((0, 4))).crosses([0.0], [0.0], [1.0], [1.0]).any()
    assert not WallIndex.build([[1.0, 1.0, 1.0, 1.0]]).crosses([0.0], [0.0], [2.0], [2.0]).any()


def test_bad_walls_are_refused():
    with pytest.raises(MapError, match="finite"):
        WallIndex.build([[0.0, 0.0, np.nan, 1.0]])
    with pytest.raises(MapError, match="shape"):
        WallIndex.build([[0.0, 0.0, 1.0]])
    with pytest.raises(MapError, match="span"):
        WallIndex.build([[0.0, 0.0, 1e6, 1.0]])
    index = WallIndex.build([[0.0, 0.0, 2.0, 0.0]])
    with pytest.raises(MapError, match="do not belong"):
        WallIndex.from_tables([[0.0, 0.0, 9.0, 0.0]], *index.tables)


@pytest.mark.slow
def test_ten_million_moves_on_random_maps():
    rng = np.random.default_rng(7)
    for k in range(20):
        walls = random_walls(rng, 40, size=15.0, grid=(0.0, 0.25)[k % 2])
        moves = random_moves(rng, 500_000, walls, grid=(0.0, 0.0, 0.25)[k % 3])
        assert disagreements(walls, moves) == 0


@kernel
def compiled_brute(x0, y0, x1, y1, walls, out):
    for i in range(len(x0)):
        out[i] = brute_one(x0[i], y0[i], x1[i], y1[i], walls)


@pytest.mark.slow
@pytest.mark.real_data
def test_ten_million_moves_on_real_floors(ms_indoor):
    """The index against the compiled definition, and that against NumPy on a part."""
    from wayfuse.maps.importers.ms_indoor import import_site

    site, _ = import_site(ms_indoor)
    rng = np.random.default_rng(8)
    for floor in site.floors:
        for index in (floor.wall_index, floor.barrier_index):
            moves = random_moves(rng, 1_000_000, index.arrays.walls)
            expected = np.empty(moves.shape[1], np.bool_)
            compiled_brute(*moves, index.arrays.walls, expected)
            assert expected.any()
            assert np.array_equal(index.crosses(*moves), expected)
            part = moves[:, :20_000]
            assert np.array_equal(brute(index.arrays.walls, *part), expected[:20_000])
