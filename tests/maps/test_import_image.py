"""Importing pictures: scale, control points, traced walls, and what is refused by name."""

from __future__ import annotations

import json
import struct

import numpy as np
import pytest
from PIL import Image

from wayfuse.core.errors import MapError
from wayfuse.core.frames import GeoAnchor
from wayfuse.maps.importers.image import image_size, import_site
from wayfuse.maps.site import Site

PIXELS = (400, 200)
WALLS = [[[200, 0], [200, 80]], [[200, 120], [200, 200]]]  # a door of 40 pixels in the middle


def picture(path, size=PIXELS):
    Image.new("L", size, 255).save(path)
    return path


def describe(tmp_path, **changes):
    """A JSON description of one floor of 40 x 20 m; a value of None drops its field."""
    picture(tmp_path / "f1.png")
    entry = {"name": "F1", "image": "f1.png", "width_m": 40.0, "walls": WALLS, **changes}
    path = tmp_path / "office.json"
    path.write_text(json.dumps({"floors": [{k: v for k, v in entry.items() if v is not None}]}))
    return path


@pytest.mark.parametrize(("name", "form"), [("a.png", "PNG"), ("a.jpg", "JPEG")])
def test_the_size_of_a_picture_is_in_its_header(tmp_path, name, form):
    Image.new("RGB", (321, 123)).save(tmp_path / name, form)
    assert image_size(tmp_path / name) == (321, 123)


def test_scale_and_walls(tmp_path):
    site, report = import_site(describe(tmp_path))
    (floor,) = site.floors
    assert (site.name, floor.name, floor.level) == ("office", "F1", 1)
    assert (floor.width, floor.height, floor.area) == (40.0, 20.0, 800.0)
    assert floor.anchor is None
    assert report.floors[0].residual is None
    y = np.array([10.0, 13.0, 7.0, 19.0])
    left, right = np.full(4, 19.0), np.full(4, 21.0)
    assert floor.barrier_index.crosses(left, y, right, y).tolist() == [False, True, True, True]
    site.save(tmp_path / "SITE")
    np.testing.assert_array_equal(Site.load(tmp_path / "SITE").floors[0].walls, floor.walls)


def test_pixels_count_down_and_the_frame_up(tmp_path):
    outline = [[0, 0], [400, 0], [400, 100], [100, 100], [100, 200], [0, 200]]
    (floor,) = import_site(describe(tmp_path, outline=outline, walls=None))[0].floors
    assert floor.walkable.contains([5.0, 30.0, 30.0], [5.0, 15.0, 5.0]).tolist() == [True, True, False]


@pytest.mark.parametrize("turn", [0.0, 0.7, -2.5])
def test_control_points_fix_scale_turn_and_place(tmp_path, turn):
    truth = GeoAnchor.from_origin(13.4, 52.5, turn)
    metres = np.array([[0.0, 0.0], [40.0, 0.0], [40.0, 20.0]])
    pixels = np.column_stack([metres[:, 0] * 10, 200 - metres[:, 1] * 10])
    control = [
        {"pixel": p.tolist(), "lonlat": truth.to_lonlat(m).tolist()}
        for p, m in zip(pixels, metres, strict=True)
    ]
    site, report = import_site(describe(tmp_path, width_m=None, control=control))
    (floor,) = site.floors
    assert floor.width == pytest.approx(40.0, abs=1e-3)
    assert report.floors[0].residual < 1e-3
    assert floor.anchor.rotation == pytest.approx(turn, abs=1e-4)
    spot = truth.to_lonlat([12.0, 7.0])
    np.testing.assert_allclose(truth.to_xy(floor.to_lonlat([12.0, 7.0])), truth.to_xy(spot), atol=2e-3)


def test_control_points_that_disagree_are_reported(tmp_path):
    truth = GeoAnchor.from_origin(13.4, 52.5)
    places = [((0, 200), (0, 0)), ((400, 200), (40, 0)), ((400, 0), (50, 20))]
    control = [{"pixel": list(p), "lonlat": truth.to_lonlat(m).tolist()} for p, m in places]
    _, report = import_site(describe(tmp_path, width_m=80.0, control=control))
    assert report.floors[0].residual > 1.0
    assert any("off by up to" in warning for warning in report.floors[0].warnings)
    assert any("width_m says 80 m" in warning for warning in report.floors[0].warnings)


def test_toml_and_floors_in_any_order(tmp_path):
    picture(tmp_path / "a.png")
    text = 'name = "works"\n' + "".join(
        f'[[floors]]\nname = "{name}"\nimage = "a.png"\nwidth_m = 40\n{more}'
        for name, more in (("F2", ""), ("Roof", "level = 3\n"), ("B1", ""))
    )
    path = tmp_path / "works.toml"
    path.write_text(text)
    site, _ = import_site(path)
    assert (site.name, site.floor_names) == ("works", ("B1", "F2", "Roof"))


@pytest.mark.parametrize(
    ("changes", "named"),
    [
        ({"name": None}, "no name"),
        ({"name": "Attic"}, "level is not known"),
        ({"level": 1.5}, "level is not known"),
        ({"image": None}, "no file name"),
        ({"image": "../f1.png"}, "no file name"),
        ({"image": "none.png"}, "cannot be read"),
        ({"image": "office.json"}, "no PNG or JPEG"),
        ({"width_m": None}, "neither width_m nor control"),
        ({"width_m": 0}, "no width"),
        ({"width_m": "40"}, "no width"),
        ({"width_m": float("nan")}, "no width"),
        ({"width_m": 1e5}, "wider than"),
        ({"width_m": 10**400}, "no width"),
        ({"control": []}, "two or more points"),
        ({"control": [{"pixel": [0, 0], "lonlat": [13, 52]}]}, "two or more points"),
        ({"control": [{"pixel": [0, 0], "lonlat": [13, 52]}] * 2}, "coincide"),
        ({"control": [{"pixel": [0, 0], "lonlat": [1e400, 52]}, 3]}, "two or more points"),
        ({"outline": [[0, 0], [1, 1]]}, "outline encloses nothing"),
        ({"outline": "round"}, "outline holds no points"),
        ({"outline": [[0, 0], [999, 0], [0, 99]]}, "outline leaves the picture"),
        ({"walls": 3}, "walls is no list"),
        ({"walls": [[[0, 0], [1, "x"]]]}, "wall 1 holds no points"),
        ({"walls": [[[0, 0], [10, 10]], [[0, 0], [10, 900]]]}, "wall 2 leaves the picture"),
    ],
)
def test_a_wrong_field_is_named_with_a_remedy(tmp_path, changes, named):
    path = describe(tmp_path, **changes)
    with pytest.raises(MapError, match=named) as caught:
        import_site(path)
    assert str(tmp_path) in str(caught.value)
    assert caught.value.remedy


@pytest.mark.parametrize(
    ("name", "text", "named"),
    [
        ("a.toml", "floors = [", "not TOML"),
        ("a.toml", "", "no floors"),
        ("a.json", "[]", "no floors"),
        ("a.json", '{"floors": [1]}', "no floors"),
        ("a.yaml", "floors:", "neither .toml nor .json"),
    ],
)
def test_a_wrong_description_is_refused(tmp_path, name, text, named):
    (tmp_path / name).write_text(text)
    with pytest.raises(MapError, match=named) as caught:
        import_site(tmp_path / name)
    assert caught.value.where == str(tmp_path / name)


@pytest.mark.parametrize("cut", [4, 9, 16, 20, 23])
@pytest.mark.parametrize("name", ["a.png", "a.jpg"])
def test_a_cut_picture_is_refused(tmp_path, name, cut):
    path = picture(tmp_path / name)
    path.write_bytes(path.read_bytes()[:cut])
    with pytest.raises(MapError, match="no PNG or JPEG"):
        image_size(path)


def test_a_picture_without_extent_is_refused(tmp_path):
    path = tmp_path / "a.png"
    path.write_bytes(b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR" + struct.pack(">II", 0, 5))
    with pytest.raises(MapError, match="no PNG or JPEG"):
        image_size(path)


@pytest.mark.real_data
def test_a_real_floor_picture(ms_indoor, tmp_path):
    found = sorted(ms_indoor.glob("*/floor_image.png"))
    if not found:
        pytest.skip(f"REAL DATA ABSENT: no floor_image.png in {ms_indoor}")
    info = json.loads((found[0].parent / "floor_info.json").read_text())["map_info"]
    (tmp_path / "plan.png").write_bytes(found[0].read_bytes())
    path = tmp_path / "mall.json"
    entry = {"name": found[0].parent.name, "image": "plan.png", "width_m": info["width"]}
    path.write_text(json.dumps({"floors": [entry]}))
    (floor,) = import_site(path)[0].floors
    assert floor.height == pytest.approx(info["height"], rel=0.01)


CONNECTOR = {
    "id": "main",
    "kind": "stairs",
    "landings": [{"floor": "F2", "pixel": [310, 60]}, {"floor": "F1", "pixel": [300, 50]}],
    "n_steps": [24],
    "footprint": [[290, 40], [330, 40], [330, 80]],
}


def two_floors(tmp_path, **connector):
    picture(tmp_path / "f1.png")
    floors = [
        {"name": name, "image": "f1.png", "width_m": 40.0, "walls": [[[200, 0], [200, 200]]], "doors": doors}
        for name, doors in (("F1", [[[200, 90], [200, 110]]]), ("F2", [[[100, 90], [100, 110]]]))
    ]
    path = tmp_path / "office.json"
    path.write_text(json.dumps({"floors": floors, "connectors": [{**CONNECTOR, **connector}]}))
    return path


def test_connectors_and_doors_in_pixels(tmp_path):
    site, report = import_site(two_floors(tmp_path))
    (stairs,) = site.connectors
    assert (stairs.id, stairs.kind, stairs.n_steps) == ("main", "stairs", (24,))
    np.testing.assert_allclose(stairs.landings, [(0, 30.0, 15.0), (1, 31.0, 14.0)])
    np.testing.assert_allclose(stairs.footprint, [(29, 16), (33, 16), (33, 12), (29, 16)])
    np.testing.assert_allclose(site.floors[0].doors, [[20.0, 9.0, 20.0, 11.0]])
    assert site.floors[0].wall_index.crosses([19, 19], [10, 12], [21, 21], [10, 12]).tolist() == [False, True]
    assert len(site.floors[1].doors) == 0
    assert report.floors[1].warnings == ("door 1: a door on no wall: it opens nothing",)


@pytest.mark.parametrize(
    ("changes", "named"),
    [
        ({"kind": "rope"}, "connector main: kind 'rope'"),
        ({"landings": [{"floor": "F9", "pixel": [1, 1]}]}, "connector main"),
        ({"landings": [{"floor": "F1", "pixel": [1, 1]}]}, "connector main joins floors 0"),
        ({"landings": 3}, "connector main"),
        ({"id": 7}, "no id"),
    ],
)
def test_a_wrong_connector_is_named(tmp_path, changes, named):
    path = two_floors(tmp_path, **changes)
    with pytest.raises(MapError, match=named) as caught:
        import_site(path)
    assert str(path) in str(caught.value)
