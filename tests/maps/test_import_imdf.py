"""Importing and writing IMDF: levels, units, openings, relationships, round trips and hostile archives."""

from __future__ import annotations

import json
import zipfile

import numpy as np
import pytest
import shapely

from wayfuse.core.errors import MapError
from wayfuse.core.frames import GeoAnchor
from wayfuse.maps.build import build_floor
from wayfuse.maps.geometry import clean_polygons
from wayfuse.maps.importers import osm
from wayfuse.maps.importers.imdf import import_site
from wayfuse.maps.importers.imdf_write import write_archive
from wayfuse.maps.site import Site

ANCHOR = GeoAnchor.from_origin(13.0, 51.0)
CREATED = "2025-01-31T12:00:00Z"


def box(x0, y0, x1, y1):
    return [(x0, y0), (x1, y0), (x1, y1), (x0, y1), (x0, y0)]


def feature(kind, ident, ring=None, line=None, **properties):
    geometry = None
    if ring is not None:
        geometry = {"type": "Polygon", "coordinates": [ANCHOR.to_lonlat(ring).tolist()]}
    if line is not None:
        geometry = {"type": "LineString", "coordinates": ANCHOR.to_lonlat(line).tolist()}
    return {
        "id": ident,
        "type": "Feature",
        "feature_type": kind,
        "geometry": geometry,
        "properties": properties,
    }


def venue():
    """Two levels of 20 x 10 m: a room in the north with an opening on the ground, lifts, a column."""
    levels = [
        feature("level", f"l{k}", box(0, 0, 20, 10), ordinal=k, short_name={"de": f"E{k}"}) for k in (0, 1)
    ]
    units = []
    for k in (0, 1):
        units += [
            feature("unit", f"r{k}", box(0, 4, 18, 10), category="room", level_id=f"l{k}", name={"de": "A"}),
            feature("unit", f"w{k}", box(0, 0, 18, 4), category="walkway", level_id=f"l{k}", name=None),
            feature("unit", f"e{k}", box(18, 0, 20, 2), category="elevator", level_id=f"l{k}"),
        ]
    units.append(feature("unit", "c", box(10, 1, 11, 2), category="column", level_id="l0"))
    opening = feature("opening", "o", line=[(5, 4), (6, 4)], category="pedestrian", level_id="l0")
    joined = feature(
        "relationship",
        "x",
        category="elevator",
        origin={"id": "e0", "feature_type": "unit"},
        intermediary=None,
        destination={"id": "e1", "feature_type": "unit"},
    )
    collections = {"level": levels, "unit": units, "opening": [opening], "relationship": [joined]}
    collections["venue"] = [feature("venue", "v", box(0, 0, 20, 10), name={"en": "House", "de": "Haus"})]
    files = {"manifest.json": {"version": "1.0.0", "language": "de"}}
    for kind, features in collections.items():
        files[f"{kind}.geojson"] = {"type": "FeatureCollection", "features": features}
    return files


def write(path, files, folder=""):
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, document in files.items():
            archive.writestr(folder + name, document if isinstance(document, str) else json.dumps(document))
    return path


@pytest.mark.parametrize("folder", ["", "house/"])
def test_levels_units_openings_and_relationships(tmp_path, folder):
    site, report = import_site(write(tmp_path / "house.zip", venue(), folder))
    assert (site.name, site.floor_names) == ("Haus", ("E0", "E1"))
    assert report.warnings == ()
    ground, top = site.floors
    assert [u.category for u in ground.units] == ["room", "walkway", "elevator", "column"]
    assert ground.units[0].name == "A"
    assert (ground.width, ground.height) == pytest.approx((20.0, 10.0), abs=1e-3)
    inside = ground.walkable.contains([5.0, 5.0, 10.5, 19.0, 21.0], [7.0, 2.0, 1.5, 8.0, 5.0])
    assert inside.tolist() == [True, True, False, True, False]
    x = np.array([5.5, 8.0])
    paths = (x, np.full(2, 3.0), x, np.full(2, 5.0))
    assert ground.barrier_index.crosses(*paths).tolist() == [False, True]
    assert top.barrier_index.crosses(*paths).tolist() == [True, True]
    assert ground.barrier_index.crosses([17.5], [1.0], [19.0], [1.0]).tolist() == [False]
    (lift,) = site.connectors
    assert (lift.id, lift.kind, lift.floors) == ("e0", "lift", (0, 1))
    assert ground.doors.tolist() == [pytest.approx([5.0, 4.0, 6.0, 4.0], abs=2e-3)]
    np.testing.assert_allclose(ground.to_lonlat([5.0, 4.0]), ANCHOR.to_lonlat([5.0, 4.0]), atol=1e-8)


def test_what_cannot_be_drawn_is_left_out_and_named(tmp_path):
    files = venue()
    files["unit.geojson"]["features"] += [
        feature("unit", "lost", box(0, 0, 1, 1), category="room", level_id="none"),
        feature("unit", "flat", None, category="room", level_id="l0"),
        None,
    ]
    files["opening.geojson"]["features"].append(feature("opening", "nowhere", level_id="l0"))
    files["level.geojson"]["features"].append(feature("level", "half", box(0, 0, 1, 1), ordinal=0.5))
    site, report = import_site(write(tmp_path / "house.zip", files))
    assert len(site.floors[0].units) == 4
    for ident in ("lost", "flat", "nowhere", "half"):
        assert any(ident in warning and "left out" in warning for warning in report.warnings)


def damaged(**changes):
    return {k: v for k, v in {**venue(), **changes}.items() if v is not None}


@pytest.mark.parametrize(
    ("files", "named"),
    [
        (damaged(**{"manifest.json": None}), "no manifest.json"),
        (damaged(**{"manifest.json": {"version": "2.0.0"}}), "version '2.0.0'"),
        (damaged(**{"manifest.json": []}), "version None"),
        (damaged(**{"manifest.json": "{"}), "manifest.json: is not JSON"),
        (damaged(**{"level.geojson": None}), "no level"),
        (damaged(**{"level.geojson": {"features": [3]}}), "no level"),
        (damaged(**{"unit.geojson": {"features": 3}}), "unit.geojson: is not a FeatureCollection"),
        (damaged(**{"../evil.geojson": "{}"}), "outside itself"),
        (damaged(**{"/evil.geojson": "{}"}), "outside itself"),
        (damaged(**{"a\\..\\..\\evil.geojson": "{}"}), "outside itself"),
        (damaged(**{f"{i}.geojson": "{}" for i in range(101)}), "more than 100"),
        (damaged(**{"kiosk.geojson": "[" + " " * 70_000_000 + "]"}), "more than 64 MiB"),
    ],
)
def test_a_damaged_or_hostile_archive_is_refused(tmp_path, files, named):
    path = write(tmp_path / "house.zip", files)
    with pytest.raises(MapError, match=named) as caught:
        import_site(path)
    assert str(path) in str(caught.value)
    assert caught.value.remedy
    assert [p.name for p in tmp_path.parent.rglob("evil*")] == []


def test_what_is_no_archive_is_refused(tmp_path):
    with pytest.raises(MapError, match="cannot be read"):
        import_site(tmp_path / "none.zip")
    path = tmp_path / "bad.zip"
    path.write_bytes(b"PK\x03\x04 not an archive")
    with pytest.raises(MapError, match="not a sound ZIP"):
        import_site(path)


@pytest.mark.parametrize("seed", range(60))
def test_a_damaged_byte_is_read_or_refused_by_name(tmp_path, seed):
    rng = np.random.default_rng(seed)
    path = write(tmp_path / "house.zip", venue())
    content = bytearray(path.read_bytes())
    for at in rng.integers(len(content), size=3):
        content[at] = rng.integers(256)
    path.write_bytes(content)
    try:
        floors, refusal = import_site(path)[0].floors, None
    except MapError as error:
        floors, refusal = (), error
    assert floors or (str(path) in str(refusal) and refusal.remedy)


def lines(floor, to):
    """Walls of a floor as a shapely geometry in the frame of another."""
    ends = to.anchor.to_xy(floor.to_lonlat(floor.walls.reshape(-1, 2, 2)))
    return shapely.union_all(shapely.linestrings(ends))


def assert_same(one: Site, other: Site, free_walls=0.0):
    assert one.floor_names == other.floor_names
    for a, b in zip(one.floors, other.floors, strict=True):
        assert (a.level, a.elevation) == (b.level, b.elevation)
        assert [u[:3] for u in a.units] == [u[:3] for u in b.units]
        assert a.area == pytest.approx(b.area, rel=1e-4)
        assert a.walkable.area == pytest.approx(b.walkable.area, rel=2e-3, abs=2.0)  # masks are of 0.25 m2
        assert len(a.doors) == len(b.doors)
        assert lines(a, b).difference(lines(b, b).buffer(0.05)).length <= free_walls
        assert lines(b, b).difference(lines(a, b).buffer(0.05)).length < 0.1

    assert_same_connectors(one, other)


def assert_same_connectors(one: Site, other: Site):
    """Equal but for the frames, which the round trip may shift."""
    for a, b in zip(one.connectors, other.connectors, strict=True):
        assert (a.id, a.kind, a.n_steps, a.direction, a.name) == (
            b.id,
            b.kind,
            b.n_steps,
            b.direction,
            b.name,
        )
        assert a.floors == b.floors
        for p, q in zip(a.landings, b.landings, strict=True):
            same = one.floors[p.floor].to_lonlat([p.x, p.y])
            np.testing.assert_allclose(other.floors[q.floor].to_lonlat([q.x, q.y]), same, atol=2e-10)
        assert (a.footprint is None) == (b.footprint is None)
        if a.footprint is not None:
            lonlat = one.floors[a.floors[0]].to_lonlat(a.footprint)
            np.testing.assert_allclose(other.floors[b.floors[0]].to_lonlat(b.footprint), lonlat, atol=2e-10)


def test_round_trip(tmp_path):
    site, _ = import_site(write(tmp_path / "house.zip", venue()))
    write_archive(site, tmp_path / "again.zip", CREATED)
    again, report = import_site(tmp_path / "again.zip")
    assert_same(site, again)
    assert report.warnings == ()
    write_archive(site, tmp_path / "same.zip", CREATED)
    assert (tmp_path / "same.zip").read_bytes() == (tmp_path / "again.zip").read_bytes()


def test_every_reference_of_a_written_archive_is_in_it(tmp_path):
    site, _ = import_site(write(tmp_path / "house.zip", venue()))
    write_archive(site, tmp_path / "again.zip", CREATED)
    with zipfile.ZipFile(tmp_path / "again.zip") as archive:
        files = {name: json.loads(archive.read(name)) for name in archive.namelist()}
    assert files["manifest.json"]["version"] == "1.0.0"
    features = [f for name, d in files.items() if name != "manifest.json" for f in d["features"]]
    idents = [f["id"] for f in features]
    assert len(set(idents)) == len(idents)
    for f in features:
        held = f["properties"]
        wanted = [held.get("level_id"), held.get("address_id"), *held.get("building_ids", [])]
        assert {w for w in wanted if w} <= set(idents)
    kinds = ("address", "venue", "building", "footprint", "level", "unit", "opening", "relationship")
    assert set(files) == {"manifest.json", *(f"{kind}.geojson" for kind in kinds)}


def test_a_site_without_anchor_cannot_be_written(tmp_path):
    (outline,) = clean_polygons([np.array(box(0, 0, 5, 5), dtype=float)])[0]
    site = Site("flat", (build_floor("F1", 1, [outline]),))
    with pytest.raises(MapError, match="no WGS84 anchor"):
        write_archive(site, tmp_path / "flat.zip", CREATED)


@pytest.mark.real_data
@pytest.mark.parametrize(
    ("name", "free_walls"),
    [("APBorig", 13.0), pytest.param("berlin_hbf", 6.0, marks=pytest.mark.slow)],
)
def test_round_trip_of_a_real_building(data_root, tmp_path, name, free_walls):
    source = data_root / "maps" / "osm_apb" / "public" / "geojson" / f"{name}.osm"
    if not source.is_file():
        pytest.skip(f"REAL DATA ABSENT: no file {source}; fetch with `wayfuse datasets fetch maps`")
    site, _ = osm.import_site(source)
    write_archive(site, tmp_path / "house.zip", CREATED)
    again, report = import_site(tmp_path / "house.zip")
    assert report.warnings == ()
    assert_same(site, again, free_walls)
    assert len(site.connectors) > 5
