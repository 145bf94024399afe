"""Pieces of stairs and lifts become connectors: joined over floors, landing before their doors."""

from __future__ import annotations

import json

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from test_graph import box, ring
from test_import_hcu import area, features
from test_import_hcu import write as write_hcu
from test_import_imdf import CREATED, assert_same_connectors, venue
from test_import_imdf import write as write_imdf
from test_import_osm import house as osm_house

from wayfuse.core.frames import GeoAnchor
from wayfuse.maps.build import build_floor
from wayfuse.maps.connectors import Connector, ConnectorKind, Landing
from wayfuse.maps.importers import hcu, imdf, osm
from wayfuse.maps.importers.imdf_write import write_archive
from wayfuse.maps.importers.joining import Piece, join_pieces
from wayfuse.maps.importers.report import Notes
from wayfuse.maps.importers.rooms import cut_walls
from wayfuse.maps.site import Site


def hall(number, rings=(), doors=()):
    outline = [box(0, 0, 20, 10)]
    gaps = [shapely.LineString(door).buffer(0.1, cap_style="flat") for door in doors]
    walls = cut_walls([*outline, *rings], [], gaps)
    drawn = np.array(doors, dtype=np.float64).reshape(-1, 4)
    return build_floor(f"F{number}", number, outline, walls=walls, closed=[], doors=drawn)


def piece(ident, floors, corners, kind=ConnectorKind.STAIRS, **more):
    return Piece(ident, kind, shapely.box(*corners), floors, **more)


FLOORS = [hall(1), hall(2), hall(3)]


def joined(*pieces, floors=FLOORS):
    notes = Notes()
    found = join_pieces(floors, pieces, notes)
    return [(c.id, c.floors) for c in found], [p.feature for p in notes.problems]


def test_single_pieces_are_joined_where_they_overlap():
    flights = [piece(f"s{k}", (k,), (2, 2, 4, 6)) for k in range(3)]
    assert joined(*flights) == ([("s0", (0, 1, 2))], [])
    assert joined(flights[0], flights[2]) == ([], ["s0", "s2"])  # two floors apart: nothing says they are one
    beside = piece("t1", (1,), (3.9, 2, 6, 6))
    assert joined(flights[0], beside) == ([], ["s0", "t1"])
    lift = piece("l1", (1,), (2, 2, 4, 6), ConnectorKind.LIFT)
    assert joined(flights[0], lift) == ([], ["s0", "l1"])


def test_parts_of_one_stairwell_are_one_and_neighbouring_lifts_are_two():
    near = [
        piece("a", (0,), (2, 2, 4, 6)),
        piece("b", (0,), (4.2, 2, 6, 6)),
        piece("c", (1,), (4.2, 2, 6, 6)),
    ]
    assert joined(*near) == ([("a", (0, 1))], [])
    lifts = [
        piece(i, (k,), (x, 2, x + 2, 4), ConnectorKind.LIFT)
        for i, x in (("p", 2), ("q", 4.1))
        for k in (0, 1)
    ]
    assert joined(*lifts) == ([("p", (0, 1)), ("q", (0, 1))], [])


def test_a_part_joins_one_of_two_stairways_not_both():
    one, other = piece("one", (0, 1), (2, 2, 4, 6)), piece("other", (0, 1), (4.1, 2, 6, 6))
    part = piece("part", (2,), (3.5, 2, 4.6, 6))
    assert joined(one, other, part) == ([("one", (0, 1)), ("other", (0, 1, 2))], [])


def test_steps_direction_and_footprint_are_kept():
    (found,) = join_pieces(
        FLOORS, [piece("e", (1, 2), (2, 2, 4, 6), n_steps=21, direction=1, name="E")], Notes()
    )
    assert (found.n_steps, found.direction, found.name) == ((21,), 1, "E")
    assert shapely.Polygon(found.footprint).equals(shapely.box(2, 2, 4, 6))


def test_a_landing_lies_before_the_door_that_leads_to_the_floor():
    lift = box(0, 4, 2, 6)
    floors = [hall(k, [lift], [[(0, 4.5), (0, 5.5)], [(2, 4.6), (2, 5.4)]]) for k in (1, 2)]
    (found,) = join_pieces(floors, [piece("l", (0, 1), (0, 4, 2, 6), ConnectorKind.LIFT)], Notes())
    for at in found.landings:
        assert at[1:] == pytest.approx((2.4, 5.0), abs=1e-6)  # not outside, though that door is wider
    closed = [hall(k, [lift]) for k in (1, 2)]
    (found,) = join_pieces(closed, [piece("l", (0, 1), (0, 4, 2, 6), ConnectorKind.LIFT)], Notes())
    assert found.landings[0][1:] == pytest.approx((1.0, 5.0))
    known = piece("k", (0, 1), (5, 4, 9, 5), places={0: (5.0, 4.5), 1: (9.0, 4.5)})
    (found,) = join_pieces(FLOORS, [known], Notes())
    assert found.landings == (Landing(0, 5.0, 4.5), Landing(1, 9.0, 4.5))


def test_tags_of_openstreetmap_tell_ends_steps_and_direction(tmp_path):
    drawing = osm_house()
    drawing.way([(10, 1), (16, 1)], highway="steps", level="0;1", incline="down", step_count="18")
    drawing.way([(10, 3), (16, 3)], highway="steps", level="0;1", incline="up", conveying="backward")
    site, _ = osm.import_site(drawing.write(tmp_path / "house.osm"))
    stairs, escalator = site.connectors
    assert (stairs.kind, stairs.n_steps, stairs.direction) == ("stairs", (18,), 0)
    ends = [at[1:] for at in stairs.landings]
    np.testing.assert_allclose(ends, [(16, 1), (10, 1)], atol=0.3)
    assert (escalator.kind, escalator.direction) == ("escalator", -1)
    np.testing.assert_allclose([at[1:] for at in escalator.landings], [(10, 3), (16, 3)], atol=0.3)


def test_a_lift_shaft_of_the_hcu_is_plumb_whatever_it_is_called(tmp_path):
    shaft = box(2, 2, 4, 4)
    ring_of = [list(map(float, p)) for p in shaft.exterior.tolist()]
    for name, kind in (("EG", "Room"), ("1OG", "Lift"), ("4OG", "Room")):
        write_hcu(tmp_path / "hcu", name, [*features(), area(kind, ring_of)])
    site, _ = hcu.import_site(tmp_path / "hcu")
    (lift,) = [c for c in site.connectors if c.kind is ConnectorKind.LIFT]
    assert lift.floors == (0, 1, 2)


@pytest.mark.real_data
def test_the_walk_through_the_hcu_finds_its_stairs_and_lift(data_root):
    """The walk goes by stairs from EG (92, 51) to 1OG (105, 54) and by lift from there to 4OG at (87, 58)."""
    folder = data_root / "maps" / "hcu_ipin21"
    if not folder.is_dir():
        pytest.skip(f"REAL DATA ABSENT: no folder {folder}; fetch with `wayfuse datasets fetch maps`")
    site, _ = hcu.import_site(folder)
    stairs = [c for c in site.connectors if c.kind is ConnectorKind.STAIRS and c.landing(0) and c.landing(1)]
    assert min(np.hypot(c.landing(0).x - 92.3, c.landing(0).y - 50.9) for c in stairs) < 7.0
    assert min(np.hypot(c.landing(1).x - 105.3, c.landing(1).y - 53.8) for c in stairs) < 8.0
    lifts = [c for c in site.connectors if c.kind is ConnectorKind.LIFT and c.landing(1) and c.landing(2)]
    for floor in (1, 2):
        assert min(np.hypot(c.landing(floor).x - 87.3, c.landing(floor).y - 58.2) for c in lifts) < 2.0


places = st.tuples(st.floats(0, 20), st.floats(0, 10))


@st.composite
def connectors(draw):
    floors = sorted(draw(st.sets(st.integers(0, 2), min_size=2)))
    landings = tuple(Landing(k, *draw(places)) for k in floors)
    steps = draw(st.just(()) | st.tuples(*[st.integers(0, 60)] * (len(floors) - 1)))
    corners = draw(st.none() | st.lists(places, min_size=3, max_size=5))
    footprint = None if corners is None else ring([*corners, corners[0]])
    kind, direction = draw(st.sampled_from(ConnectorKind)), draw(st.sampled_from([-1, 0, 1]))
    return landings, steps, footprint, kind, direction


@given(st.lists(connectors(), max_size=4))
@settings(max_examples=25)
def test_connectors_survive_imdf(tmp_path_factory, drawn):
    floors = tuple(
        build_floor(f"F{k}", k, [box(0, 0, 20, 10)], closed=[], anchor=GeoAnchor.from_origin(13.0, 51.0))
        for k in range(3)
    )
    made = tuple(
        Connector(f"c{i}", kind, landings, steps, direction, footprint, f"name {i}")
        for i, (landings, steps, footprint, kind, direction) in enumerate(drawn)
    )
    site = Site("house", floors, connectors=made)
    path = tmp_path_factory.mktemp("imdf") / "house.zip"
    write_archive(site, path, CREATED)
    assert_same_connectors(site, imdf.import_site(path)[0])


def test_imdf_of_others_joins_by_relationship_or_by_overlap(tmp_path):
    files = venue()
    files["relationship.geojson"]["features"][0]["properties"]["direction"] = "directed"
    site, _ = imdf.import_site(write_imdf(tmp_path / "directed.zip", files))
    assert [(c.id, c.floors, c.direction) for c in site.connectors] == [("e0", (0, 1), 1)]
    files["relationship.geojson"]["features"] = []
    site, _ = imdf.import_site(write_imdf(tmp_path / "none.zip", json.loads(json.dumps(files))))
    assert [(c.id, c.floors, c.direction) for c in site.connectors] == [("e0", (0, 1), 0)]
