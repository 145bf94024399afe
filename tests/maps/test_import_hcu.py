"""Importing the HCU floors: UTM to degrees, walls that are areas, what is refused, and the real building."""

from __future__ import annotations

import json

import numpy as np
import pytest

from wayfuse.core.errors import MapError
from wayfuse.core.frames import metres_per_degree
from wayfuse.core.utm import utm_to_lonlat
from wayfuse.maps.importers.hcu import import_site, level_of

EAST, NORTH = 566500.0, 5932800.0
CRS = {"type": "name", "properties": {"name": "urn:ogc:def:crs:EPSG::32632"}}


def area(kind, *rings):
    coordinates = [[[EAST + x, NORTH + y] for x, y in ring] for ring in rings]
    return {"properties": {"Type": kind}, "geometry": {"type": "Polygon", "coordinates": coordinates}}


def box(x0, y0, x1, y1):
    return [(x0, y0), (x1, y0), (x1, y1), (x0, y1), (x0, y0)]


def features():
    """20 x 10 m: a wall of 0.2 m across with a door of 1 m, a room south, a corridor north, a table."""
    return [
        area("Wall", box(0, 5, 9, 5.2)),
        area("wall", box(10, 5, 20, 5.2)),
        area("Door", box(9, 5, 10, 5.2)),
        area("Room", box(0, 0, 20, 5)),
        area("Corridor", box(0, 5.2, 18, 10)),
        area("Stairscase", box(18, 5.2, 20, 10)),
        area("Furnitures", box(4, 1, 6, 3)),
    ]


def write(folder, name="EG", found=None, crs=CRS):
    folder.mkdir(exist_ok=True)
    document = {"type": "FeatureCollection", "crs": crs, "features": features() if found is None else found}
    (folder / f"Plan{name}.geojson").write_text(json.dumps(document))
    return folder


def test_levels_of_german_floor_names():
    names = ("EG", "1OG", "12OG", "UG", "2UG", "Eg", "3EG", "Dach", "")
    assert [level_of(name) for name in names] == [0, 1, 12, -1, -2, 0, None, None, None]


def test_utm_on_its_central_meridian_and_off_it():
    np.testing.assert_allclose(utm_to_lonlat(np.array([5e5, 0.0]), 32), (9.0, 0.0), atol=1e-12)
    south = utm_to_lonlat(np.array([5e5, 1e7]), 32, south=True)
    np.testing.assert_allclose(south, (9.0, 0.0), atol=1e-12)
    # On the central meridian 100 km of grid are 100 / 0.9996 km of ellipsoid, here summed up in pieces.
    _, lat = utm_to_lonlat(np.array([5e5, 1e5]), 32)
    pieces = (np.arange(1000) + 0.5) * lat / 1000
    arc = sum(metres_per_degree(p)[1] for p in pieces) * lat / 1000
    assert arc * 0.9996 == pytest.approx(1e5, abs=0.01)


def test_a_grid_metre_has_the_length_of_the_projection():
    at = np.array([EAST, NORTH])
    lonlat = utm_to_lonlat(at + np.array([[0.0, 0.0], [100.0, 0.0], [0.0, 100.0]]), 32)
    steps = (lonlat[1:] - lonlat[0]) * metres_per_degree(float(lonlat[0, 1]))
    scale = 0.9996 * (1.0 + (EAST - 5e5) ** 2 / (2 * 6.382e6**2))  # of UTM, to second order
    np.testing.assert_allclose(np.hypot(*steps.T) * scale, 100.0, atol=2e-3)
    assert steps[0] @ steps[1] == pytest.approx(0.0, abs=0.2)


def test_walls_are_areas_with_doors_between_them(tmp_path):
    site, report = import_site(write(tmp_path / "hcu"))
    (floor,) = site.floors
    assert (floor.name, floor.level, floor.elevation) == ("EG", 0, 0.0)
    assert (floor.width, floor.height) == pytest.approx((20.0, 10.0))
    assert [u.category for u in floor.units] == ["room", "corridor", "stairs", "furniture"]
    assert site.provenance["origin"] == "566500.000 5932800.000"
    assert report.floors[0].warnings == ()
    assert report.floors[0].residual < 0.001
    x = np.array([9.5, 8.5, 15.0])
    crossed = floor.barrier_index.crosses(x, np.full(3, 4.5), x, np.full(3, 5.7))
    assert crossed.tolist() == [False, True, True]
    assert floor.walkable.contains([5.0, 10.0], [2.0, 2.0]).tolist() == [False, True]
    place = utm_to_lonlat(np.array([EAST + 12.0, NORTH + 7.0]), 32)
    np.testing.assert_allclose(floor.to_lonlat([12.0, 7.0]), place, atol=1e-9)


def test_rooms_without_a_door_are_counted(tmp_path):
    found = [area("Wall", box(9, 5, 10, 5.2)) if f["properties"]["Type"] == "Door" else f for f in features()]
    _, report = import_site(write(tmp_path / "hcu", found=found))
    assert report.floors[0].warnings == ("1 parts (96 m2) have no door to the largest",)


def test_floors_share_a_frame_and_stand_in_order(tmp_path):
    write(tmp_path / "hcu", "2OG", [area("Room", box(-5, 0, 5, 5))])
    write(tmp_path / "hcu", "UG", [area("Room", box(0, -5, 5, 5))])
    site, _ = import_site(write(tmp_path / "hcu"))
    assert site.floor_names == ("UG", "EG", "2OG")
    assert len({floor.anchor for floor in site.floors}) == 1
    assert site.floors[1].walkable.contains([5.5], [5.5]).tolist() == [True]
    assert site.floors[1].walkable.contains([4.5], [5.5]).tolist() == [False]


def test_what_has_no_type_or_shape_is_left_out_and_counted(tmp_path):
    odd = [area("Pond", box(0, 0, 1, 1)), {"properties": {"Type": "Wall"}, "geometry": None}, None]
    bow = area("Room", [(30, 0), (34, 4), (34, 0), (30, 4), (30, 0)])
    _, report = import_site(write(tmp_path / "hcu", found=[*features(), *odd, bow]))
    text = "\n".join(report.floors[0].warnings)
    assert "1 areas left out: type Pond" in text
    assert "2 areas left out: no polygon" in text
    assert "repaired" in text


@pytest.mark.parametrize(
    ("damage", "named"),
    [
        (lambda f: write(f, crs=None), "not UTM"),
        (lambda f: write(f, crs={"properties": {"name": "EPSG::4326"}}), "not UTM"),
        (lambda f: write(f, crs={"properties": {"name": "EPSG::32699"}}), "not UTM"),
        (lambda f: write(f, found=[]), "no area of a known Type"),
        (lambda f: write(f, found=[area("Room", box(0, 0, 0, 5))]), "enclose nothing"),
        (lambda f: write(f, found=[area("Room", box(0, 0, 9000, 5))]), "spans more than"),
        (lambda f: write(f, "Dach"), "does not say its level"),
        (lambda f: (write(f) / "PlanEG.geojson").write_text("{"), "is not JSON"),
        (lambda f: (write(f) / "PlanEG.geojson").write_text("[]"), "FeatureCollection"),
        (lambda f: f.mkdir(), "holds no Plan"),
    ],
)
def test_a_damaged_plan_is_named_with_a_remedy(tmp_path, damage, named):
    folder = tmp_path / "hcu"
    damage(folder)
    with pytest.raises(MapError, match=named) as caught:
        import_site(folder)
    assert str(folder) in str(caught.value)
    assert caught.value.remedy


@pytest.mark.real_data
def test_the_real_building_holds_its_walks(data_root):
    folder = data_root / "maps" / "hcu_ipin21"
    if not folder.is_dir():
        pytest.skip(f"REAL DATA ABSENT: no folder {folder}; fetch with `wayfuse datasets fetch maps`")
    site, report = import_site(folder)
    assert site.floor_names == ("EG", "1OG", "4OG")
    assert all(note.residual < 0.01 for note in report.floors)
    origin = np.array([float(v) for v in site.provenance["origin"].split()])
    floor_at = {1.3: 0, 7.6: 1, 19.6: 2}  # m, heights of the set's waypoints
    walks = [np.loadtxt(path) for path in sorted(folder.glob("*Waypoints.csv"))]
    assert [len(walk) for walk in walks] == [15, 10]
    for *place, height in np.concatenate(walks)[:, 1:]:
        floor = site.floors[floor_at[round(height, 1)]]
        x, y = np.array(place) - origin
        assert floor.walkable.contains([x], [y])[0]
    truth = np.loadtxt(folder / "GroundTruthEight.csv")[:, 1:3] - origin  # steps of a walk on the 4th floor
    floor = site.floors[2]
    assert np.mean(floor.walkable.contains(*truth.T)) > 0.95
    crossed = floor.barrier_index.crosses(*truth[:-1].T, *truth[1:].T)
    assert np.mean(crossed) < 0.05
