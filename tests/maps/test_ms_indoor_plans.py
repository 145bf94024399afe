"""Importing ms-indoor: the frame, what is repaired, what is refused, and the real site."""

from __future__ import annotations

import json
import re

import numpy as np
import pytest
from made_up_plans import HEIGHT, WIDTH, box, degrees, outline, unit, write_floor

from wayfuse.core.errors import MapError
from wayfuse.maps.importers.ms_indoor import import_site


def floor_of(root, features, name="F1"):
    write_floor(root / name, features)
    site, report = import_site(root)
    return site.floors[0], report.floors[0]


def test_frame_is_the_outline_box(plans):
    site, report = import_site(plans)
    assert site.name == "mall"
    assert site.floor_names == ("B1", "F1")
    assert [floor.level for floor in site.floors] == [-1, 1]
    assert [floor.elevation for floor in site.floors] == [-4.5, 0.0]
    floor = site.floors[1]
    np.testing.assert_allclose(floor.outline[0].exterior.min(axis=0), 0.0, atol=1e-3)
    np.testing.assert_allclose(floor.outline[0].exterior.max(axis=0), (WIDTH, HEIGHT), atol=1e-3)
    np.testing.assert_allclose(floor.to_lonlat([[12.0, 7.0]]), degrees([[12.0, 7.0]]), atol=1e-9)
    assert max(floor_report.residual for floor_report in report.floors) < 1e-3
    assert [floor_report.warnings for floor_report in report.floors] == [(), ()]


def test_units_walls_and_walkable_space(plans):
    floor = import_site(plans)[0].floors[1]
    shop, void = floor.units
    assert (shop.name, shop.category, void.category) == ("Books & more", "unit", "void")
    assert shop.polygon.area == pytest.approx(300.0, abs=0.1)
    assert len(floor.walls) == 4 + 8 + 4
    assert floor.walkable.contains([2.0, 7.0, 15.0, 33.0], [2.0, 7.0, 15.0, 15.0]).tolist() == [
        True,
        False,
        True,
        False,
    ]
    assert floor.wall_index.crosses(
        [4.0, 4.8, 15.0], [15.0, 15.0, 15.0], [6.0, 5.2, 17.0], [15.0, 15.0, 15.0]
    ).tolist() == [True, True, False]
    assert floor.barrier_index.crosses([4.8, 4.8], [15.0, 15.0], [5.2, 5.6], [15.0, 15.0]).tolist() == [
        False,
        True,
    ]


def test_a_self_crossing_unit_is_repaired_and_named(tmp_path):
    bow = [[5, 5], [15, 15], [15, 5], [5, 15], [5, 5]]
    floor, report = floor_of(tmp_path / "mall", [outline(box(0, 0, WIDTH, HEIGHT)), unit("bow", bow)])
    assert [u.id for u in floor.units] == ["bow", "bow"]
    assert sum(u.polygon.area for u in floor.units) == pytest.approx(50.0, rel=0.01)
    assert any("bow" in warning and "repaired" in warning for warning in report.warnings)


@pytest.mark.parametrize(
    "feature",
    [
        {
            "type": "Feature",
            "properties": {"id": "odd"},
            "geometry": {"type": "Point", "coordinates": [10, 50]},
        },
        {"type": "Feature", "properties": {"id": "odd"}, "geometry": None},
        unit("odd", [[1, 1], [2, 2]]),
        unit("odd", [[1, 1], [2, 2], [3, 3], [1, 1]]),
        unit("odd", box(1e5, 1e5, 1e5 + 5, 1e5 + 5)),
        unit("odd", [[1, 1], [float("nan"), 2], [3, 3], [1, 1]]),
        {
            "type": "Feature",
            "properties": {"id": "odd"},
            "geometry": {"type": "Polygon", "coordinates": "far"},
        },
    ],
)
def test_a_unit_that_cannot_be_drawn_is_left_out_and_named(tmp_path, feature):
    floor, report = floor_of(tmp_path / "mall", [outline(box(0, 0, WIDTH, HEIGHT)), feature])
    assert floor.units == ()
    assert len(report.warnings) == 1
    assert "odd" in report.warnings[0]
    assert "left out" in report.warnings[0]


def test_web_mercator_metres_are_read_too(tmp_path):
    feature = outline(box(0, 0, WIDTH, HEIGHT))
    (ring,) = feature["geometry"]["coordinates"][0]
    lon, lat = np.deg2rad(ring).T
    mercator = 6378137.0 * np.column_stack([lon, np.arctanh(np.sin(lat))])
    feature["geometry"]["coordinates"][0] = [mercator.tolist()]
    floor, report = floor_of(tmp_path / "mall", [feature])
    assert report.residual < 1e-3
    np.testing.assert_allclose(floor.to_lonlat([0.0, 0.0]), (10.0, 50.0), atol=1e-9)


def test_a_floor_without_plan_is_a_rectangle(tmp_path):
    floor, report = floor_of(tmp_path / "mall", None)
    assert floor.area == pytest.approx(WIDTH * HEIGHT)
    assert floor.anchor is None
    assert report.residual is None
    assert "geojson_map.json" in report.warnings[0]
    with pytest.raises(MapError, match="no WGS84 anchor"):
        floor.to_lonlat([0.0, 0.0])


def test_a_picture_of_another_size_is_reported(tmp_path):
    write_floor(tmp_path / "mall" / "F1", [outline(box(0, 0, WIDTH, HEIGHT))], width=2 * WIDTH)
    report = import_site(tmp_path / "mall")[1].floors[0]
    assert report.residual == pytest.approx(WIDTH, abs=0.01)
    assert any("disagree" in warning for warning in report.warnings)


def test_nine_floors_and_odd_names(tmp_path):
    names = ["F8", "B1", "F1", "F10", "F2", "Roof", "F3", "G", "B2"]
    for name in names:
        write_floor(tmp_path / "mall" / name, None, 8.0, 6.0)
    (tmp_path / "mall" / "notes").mkdir()
    site, report = import_site(tmp_path / "mall")
    assert site.floor_names == ("B2", "B1", "G", "F1", "F2", "F3", "F8", "F10", "Roof")
    assert [floor.level for floor in site.floors] == [-2, -1, 0, 1, 2, 3, 8, 10, 11]
    assert len({floor.elevation for floor in site.floors}) == len(names)
    assert any("Roof" in warning for warning in report.warnings)


def test_units_over_the_whole_floor_leave_no_walkable_space_but_a_site(tmp_path):
    features = [outline(box(0, 0, WIDTH, HEIGHT)), unit("u", box(0, 0, WIDTH, HEIGHT))]
    floor, report = floor_of(tmp_path / "mall", features)
    assert floor.walkable_share == 0.0
    assert any("no walkable space" in warning for warning in report.warnings)
    with pytest.raises(MapError, match="no walkable space"):
        floor.walkable.random_points(np.random.default_rng(0), 1)


def break_info(text):
    return lambda root: (root / "F1" / "floor_info.json").write_text(text)


def break_plan(text):
    return lambda root: (root / "F1" / "geojson_map.json").write_text(text)


@pytest.mark.parametrize(
    ("damage", "named"),
    [
        (break_info("{"), "floor_info.json"),
        (break_info('{"map_info": {"width": 10}}'), "map_info"),
        (break_info('{"map_info": {"width": -1, "height": 5}}'), "impossible"),
        (break_info('{"map_info": {"width": NaN, "height": 5}}'), "impossible"),
        (break_info("[]"), "map_info"),
        (lambda root: (root / "F1" / "floor_info.json").unlink(), "floor_info.json"),
        (break_plan('{"features": []}'), "no features"),
        (break_plan("[1]"), "no features"),
        (break_plan('{"features": ['), "geojson_map.json"),
        (
            break_plan(json.dumps({"features": [{"geometry": {"type": "Point", "coordinates": [1, 2]}}]})),
            "outline",
        ),
        (break_plan(json.dumps({"features": [outline(box(1, 1, 1, 1))]})), "no extent"),
        (lambda root: (root / "F1" / "geojson_map.json").write_bytes(b"\xff\xfe\x00"), "cannot be read"),
    ],
)
def test_a_damaged_file_is_named_with_a_remedy(plans, damage, named):
    damage(plans)
    with pytest.raises(MapError, match=named) as caught:
        import_site(plans)
    assert str(plans / "F1") in str(caught.value)
    assert caught.value.remedy


def test_a_folder_without_floors_is_refused(tmp_path):
    with pytest.raises(MapError, match="no such folder"):
        import_site(tmp_path / "none")
    with pytest.raises(MapError, match="holds no floor"):
        import_site(tmp_path)


def places_in(node, path=()):
    """Paths to everything inside a JSON document."""
    inside = node.items() if isinstance(node, dict) else enumerate(node) if isinstance(node, list) else ()
    for key, value in inside:
        yield (*path, key)
        yield from places_in(value, (*path, key))


ODD = [None, -1, 1e308, float("nan"), "x", [], {}, [[]], True, 1e9, [1, 2], [1, 2, 3]]


@pytest.mark.parametrize("seed", range(120))
def test_whatever_a_plan_holds_it_is_imported_or_refused_by_name(plans, seed):
    rng = np.random.default_rng(seed)
    path = plans / "F1" / "geojson_map.json"
    document = json.loads(path.read_text())
    for _ in range(rng.integers(1, 4)):
        choices = list(places_in(document))
        *way, key = choices[rng.integers(len(choices))]
        node = document
        for step in way:
            node = node[step]
        if rng.random() < 0.3:
            del node[key]
        else:
            node[key] = json.loads(json.dumps(ODD[rng.integers(len(ODD))]))
    path.write_text(json.dumps(document))
    try:
        floor, refusal = import_site(plans)[0].floors[1], None
    except MapError as error:
        floor, refusal = None, error
    if floor is not None:
        assert floor.area > 0
    else:
        assert refusal.where == str(path)
        assert refusal.remedy


def waypoints(folder):
    """(n, 2) m of every TYPE_WAYPOINT line below a floor's folder: a reader of the test's own."""
    pattern = re.compile(r"TYPE_WAYPOINT\t([-\d.]+)\t([-\d.]+)")
    texts = (path.read_text(encoding="utf-8", errors="replace") for path in sorted(folder.rglob("*.txt")))
    return np.array([[float(x), float(y)] for text in texts for x, y in pattern.findall(text)])


@pytest.mark.real_data
def test_surveyed_waypoints_lie_on_the_real_plans(ms_indoor):
    import shapely

    site, report = import_site(ms_indoor)
    assert site.floor_names == ("B1", "F1", "F2", "F3", "F4")
    assert all(note.warnings == () and note.residual < 0.01 for note in report.floors)
    for floor in site.floors:
        assert 0.17 <= floor.walkable_share <= 0.37
        x, y = waypoints(ms_indoor / floor.name).T
        assert len(x) > 500
        outside = shapely.union_all([shapely.Polygon(p.exterior, p.holes) for p in floor.outline])
        units = shapely.union_all([shapely.Polygon(u.polygon.exterior, u.polygon.holes) for u in floor.units])
        assert shapely.contains_xy(outside, x, y).all()
        assert np.mean(shapely.contains_xy(units, x, y)) < 0.02
        assert np.mean(floor.walkable.contains(x, y)) > 0.985
