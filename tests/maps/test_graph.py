"""The building graph: convex cells that fill the walkable space, portals between them, landings of connectors."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from wayfuse.maps.build import build_floor
from wayfuse.maps.connectors import Connector, ConnectorKind, Landing
from wayfuse.maps.geometry import clean_polygons, free_space
from wayfuse.maps.graph import build_graph
from wayfuse.maps.importers import hcu, ms_indoor, osm, simpleloc
from wayfuse.maps.importers.rooms import cut_walls, to_shapely
from wayfuse.maps.partition import convex_cells, limits, merge_triangles, walkable_faces
from wayfuse.maps.site import Site, Unit
from wayfuse.maps.walls import WallIndex

WIDTH, HEIGHT = 12.0, 8.0
WIDE = 0.36  # m, a disc of this radius holds the middle of a mask cell


def ring(points):
    return np.array(points, dtype=np.float64)


def box(x0, y0, x1, y1):
    return clean_polygons([ring([(x0, y0), (x1, y0), (x1, y1), (x0, y1)])])[0][0]


xs, ys = st.integers(0, 24).map(lambda k: 0.5 * k), st.integers(0, 16).map(lambda k: 0.5 * k)
walls = st.lists(st.tuples(xs, ys, xs, ys).filter(lambda w: w[:2] != w[2:]), max_size=7)
blocks = st.lists(st.tuples(xs, ys, st.integers(1, 6), st.integers(1, 6)), max_size=3)


@st.composite
def floors(draw):
    """A hall with walls any way, doors in some of them, and solid blocks."""
    drawn = np.array(draw(walls)).reshape(-1, 2, 2)
    doors = [wall[0] + (wall[1] - wall[0]) * draw(st.sampled_from([0.25, 0.5])) for wall in drawn]
    doors = [at for at in doors if draw(st.booleans())]
    solid = [box(x, y, x + 0.5 * w, y + 0.5 * h) for x, y, w, h in draw(blocks)]
    shut = to_shapely(solid).buffer(0.01)
    gaps = [shapely.Point(at).buffer(0.45).difference(shut) for at in doors]
    outline = [box(0, 0, WIDTH, HEIGHT)]
    segments = cut_walls([*outline, *solid], list(drawn), gaps)
    return build_floor("F1", 1, outline, walls=segments, closed=solid), solid


def check_cells(floor, graph):
    """Cells are convex, share no area, and no straight move in one crosses a barrier."""
    rng = np.random.default_rng(1)
    index = WallIndex.build(limits(floor))
    shapes = [shapely.Polygon(graph.polygon(i)) for i in range(graph.n_cells)]
    for i in range(graph.n_cells):
        corners = graph.polygon(i)
        side = np.roll(corners, -1, axis=0) - corners
        turn = side[:, 0] * np.roll(side, -1, axis=0)[:, 1] - side[:, 1] * np.roll(side, -1, axis=0)[:, 0]
        assert np.all(turn >= -1e-9)
        ends = rng.dirichlet(np.ones(len(corners)), 40) @ corners
        ends = ends[
            shapely.distance(shapes[i].boundary, shapely.points(ends)) > 2e-3
        ]  # walls are snapped to 1 mm
        half = len(ends) // 2
        assert not np.any(index.crosses(*ends[:half].T, *ends[half : 2 * half].T))
    assert shapely.union_all(shapes).area == pytest.approx(sum(s.area for s in shapes), abs=1e-3)
    assert graph.areas.sum() == pytest.approx(sum(s.area for s in shapes))
    return shapes


def check_portals(floor, graph, shapes):
    """A portal lies on the edges of both its cells, and nothing bars the way through it."""
    for (a, b), segment in zip(graph.portal_cells, graph.portal_xy, strict=True):
        assert a < b
        points = shapely.points(segment[:2] + np.linspace(0, 1, 5)[:, None] * (segment[2:] - segment[:2]))
        for i in (a, b):
            assert np.all(shapely.distance(shapes[i].boundary, points) < 6e-3)
        assert b in graph.neighbours(a)
        assert a in graph.neighbours(b)
    index = WallIndex.build(limits(floor))
    along = graph.portal_xy[:, 2:] - graph.portal_xy[:, :2]
    middle = 0.5 * (graph.portal_xy[:, :2] + graph.portal_xy[:, 2:])
    step = 1e-3 * np.column_stack([-along[:, 1], along[:, 0]]) / np.hypot(*along.T)[:, None]
    assert not np.any(index.crosses(*(middle - step).T, *(middle + step).T))


def components(graph):
    part = np.arange(graph.n_cells)
    for _ in range(graph.n_cells):
        low = np.minimum(part[graph.portal_cells[:, 0]], part[graph.portal_cells[:, 1]])
        before = part.copy()
        for column in (0, 1):
            np.minimum.at(part, graph.portal_cells[:, column], low)
        if np.array_equal(part, before):
            break
    return part


@given(floors())
@settings(max_examples=25)
def test_cells_fill_the_walkable_space_and_portals_join_them(made):
    floor, solid = made
    graph = build_graph(Site("hall", (floor,)))
    shapes = check_cells(floor, graph)
    check_portals(floor, graph, shapes)
    free = free_space(floor.outline, solid, widening=0.0)
    filled = shapely.union_all(shapes)
    assert free.difference(filled).buffer(-WIDE).is_empty
    assert filled.difference(free).buffer(-WIDE).is_empty
    faces = walkable_faces(floor, limits(floor))
    assert graph.areas.sum() == pytest.approx(sum(face.area for face in faces), abs=1e-4)


@given(floors())
@settings(max_examples=15)
def test_cells_are_joined_where_one_can_walk(made):
    """Cells of one component, and only those, lie in one part of the free space without its walls."""
    floor, solid = made
    graph = build_graph(Site("hall", (floor,)))
    part = components(graph)
    free = free_space(floor.outline, solid, widening=0.0)
    solid_walls = shapely.union_all(shapely.linestrings(limits(floor).reshape(-1, 2, 2)))
    middles = np.array([graph.polygon(i).mean(axis=0) for i in range(graph.n_cells)]).reshape(-1, 2)
    rooms = shapely.get_parts(free.difference(solid_walls.buffer(0.03)))
    for room in rooms:
        if not room.buffer(-WIDE).is_empty:
            inside = shapely.contains_xy(
                room, *np.array([graph.polygon(i).mean(axis=0) for i in range(graph.n_cells)]).T
            )
            assert len(set(part[inside])) <= 1
    wider = shapely.get_parts(free.difference(solid_walls.buffer(1e-3)))
    for k in set(part):
        touched = [room for room in wider if np.any(shapely.contains_xy(room, *middles[part == k].T))]
        assert len(touched) <= 1


@given(floors(), st.integers(0, 2**32))
@settings(max_examples=15)
def test_a_place_is_found_in_its_cell(made, seed):
    floor, _ = made
    graph = build_graph(Site("hall", (floor,)))
    places = np.random.default_rng(seed).uniform((-1, -1), (WIDTH + 1, HEIGHT + 1), (300, 2))
    shapes = [shapely.Polygon(graph.polygon(i)) for i in range(graph.n_cells)]
    inside = np.array([shapely.contains_xy(shape, *places.T) for shape in shapes]).reshape(-1, len(places))
    expected = np.where(inside.any(axis=0), inside.argmax(axis=0) if len(inside) else -1, -1)
    assert np.array_equal(graph.cell_of(0, places), expected)
    assert np.all(graph.cell_of(0, [[np.nan, 1.0]]) == -1)
    assert np.all(graph.cell_of(3, places) == -1)


def test_doors_are_portals_and_landings_open_into_cells():
    doors = np.array([[6.0, 3.5, 6.0, 4.5]])
    gap = shapely.LineString(doors.reshape(2, 2)).buffer(0.1, cap_style="flat")
    hall = [box(0, 0, WIDTH, HEIGHT)]
    segments = cut_walls(hall, [ring([(6, 0), (6, 8)])], [gap])
    units = [Unit("a", "Left", "room", box(0, 0, 6, 8)), Unit("b", "Desk", "area", box(1, 1, 3, 3))]
    floor = build_floor("F1", 1, hall, units, walls=segments, closed=[], doors=doors)
    upper = build_floor("F2", 2, hall, walls=cut_walls(hall, [], []), closed=[])
    lift = Connector("L", ConnectorKind.LIFT, (Landing(0, 11.0, 1.0), Landing(1, 11.0, 1.0)))
    lost = Connector("X", ConnectorKind.STAIRS, (Landing(0, 11.0, 9.0), Landing(1, 1.0, 1.0)))
    graph = build_graph(Site("hall", (floor, upper), connectors=(lift, lost)))
    assert graph.cell_floor.tolist() == [0, 0, 1]
    assert graph.portal_door.tolist() == [True]
    np.testing.assert_allclose(
        np.sort(graph.portal_xy[0].reshape(2, 2), axis=0), [[6, 3.5], [6, 4.5]], atol=1e-3
    )
    left, right = graph.cell_of(0, [[2.0, 6.0], [10.0, 6.0]])
    assert graph.neighbours(left).tolist() == [right]
    assert graph.cell_unit[left] == 0
    assert graph.cell_unit[right] == -1
    assert graph.landing_cell.tolist() == [right, 2, -1, 2]
    assert graph.landings_in(2).tolist() == [1, 3]
    assert graph.areas.tolist() == pytest.approx([48.0, 48.0, 96.0], abs=0.02)


def test_few_pieces():
    """A square hole in a square needs four convex pieces; the merge may make twice as many, not more."""
    face = shapely.box(0, 0, 9, 9).difference(shapely.box(3, 3, 6, 6))
    cells = convex_cells(face)
    assert 4 <= len(cells) <= 8
    assert sum(shapely.Polygon(cell).area for cell in cells) == pytest.approx(72.0)
    assert len(convex_cells(shapely.Point(0, 0).buffer(5.0))) == 1


def test_merging_keeps_an_l_shape_apart():
    points = ring([(0, 0), (2, 0), (2, 1), (1, 1), (1, 2), (0, 2)])
    triangles = np.array([[0, 1, 2], [0, 2, 3], [0, 3, 5], [3, 4, 5]])
    rings = merge_triangles(points, triangles)
    assert len(rings) == 2
    assert sorted(v for r in rings for v in set(r)) == sorted([0, 1, 2, 3, 0, 3, 4, 5])


def real_floors(data_root, name):
    maps = data_root / "maps"
    path, importer = {
        "ms-indoor": (data_root / "ms-indoor" / "site1", ms_indoor),
        "osm": (maps / "osm_apb" / "public" / "geojson" / "APBorig.osm", osm),
        "simpleloc": (maps / "simpleloc_ipin2024" / "building.xml", simpleloc),
        "hcu": (maps / "hcu_ipin21", hcu),
    }[name]
    if not path.exists():
        pytest.skip(f"REAL DATA ABSENT: no {path}; fetch with `wayfuse datasets fetch`")
    return importer.import_site(path)[0]


@pytest.mark.real_data
@pytest.mark.parametrize(
    ("name", "chosen"), [("ms-indoor", "F1"), ("osm", "0"), ("simpleloc", "2. Stock"), ("hcu", "1OG")]
)
def test_real_floors(data_root, name, chosen):
    site = real_floors(data_root, name)
    floor = site.floors[site.floor_index(chosen)]
    graph = build_graph(Site("one", (floor,)))
    shapes = check_cells(floor, graph)
    check_portals(floor, graph, shapes)
    assert graph.areas.sum() == pytest.approx(floor.walkable.area, rel=5e-3)
    assert to_shapely(floor.outline).buffer(0.1).covers(shapely.union_all(shapes))
    assert np.mean(graph.portal_door) > 0.1 or not len(floor.doors)
