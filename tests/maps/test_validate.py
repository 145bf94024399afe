"""Validation names each made-up problem by its feature, and nothing in a sound building."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from test_graph import box, real_floors, ring

from wayfuse.core.errors import MapError
from wayfuse.maps.build import build_floor
from wayfuse.maps.connectors import Connector, ConnectorKind, Landing
from wayfuse.maps.importers.rooms import cut_walls
from wayfuse.maps.problems import KEY, Problem, Severity, noted_problems, problems_text
from wayfuse.maps.site import Polygon, Site, Unit
from wayfuse.maps.validate import ERRORS, KINDS, validate_site

DOOR = np.array([[10.0, 4.5, 10.0, 5.5]])
ROOM = Unit("r", "Room", "room", box(10, 0, 20, 10))
HALL = Unit("h", "Hall", "corridor", box(0, 0, 10, 10))


def hall(name, units=(HALL, ROOM), doors=DOOR, gaps=DOOR):
    """A floor of 20 x 10 m: a hall in the west, a room in the east, a door between them."""
    import shapely

    outline = [box(0, 0, 20, 10)]
    openings = [shapely.LineString(gap.reshape(2, 2)).buffer(0.1, cap_style="flat") for gap in gaps]
    walls = cut_walls(outline, [ring([(10, 0), (10, 10)])], openings)
    return build_floor(name, int(name[1:]), outline, units, walls=walls, closed=[], doors=doors)


def house(*floors, connectors=None):
    if connectors is None:
        stops = tuple(Landing(k, 2.0, 2.0) for k in range(len(floors)))
        connectors = (Connector("L", ConnectorKind.LIFT, stops),) if len(floors) > 1 else ()
    return Site("house", floors, connectors=connectors)


def found(site):
    return [(p.kind, p.feature, p.floor) for p in validate_site(site)]


def test_a_sound_building_has_no_problems():
    assert validate_site(house(hall("F1"), hall("F2"))) == ()


def test_every_error_kind_is_explained():
    assert KINDS.keys() >= ERRORS


BOW = Polygon(ring([(1, 1), (3, 3), (3, 1), (1, 3), (1, 1)]))


@pytest.mark.parametrize(
    ("site", "expected"),
    [
        (house(hall("F1", doors=np.empty((0, 4)), gaps=[])), ("unreachable-unit", "unit r", "F1")),
        (
            house(hall("F1", doors=np.vstack([DOOR, [[4.0, 4.5, 4.0, 5.5]]]))),
            ("door-on-no-wall", "door 1 at (4.0, 5.0)", "F1"),
        ),
        (
            house(hall("F1", [HALL, ROOM, Unit("x", "", "area", BOW)])),
            ("self-crossing-polygon", "unit x", "F1"),
        ),
        (
            house(hall("F1", [HALL, ROOM, Unit("r", "Other", "room", box(1, 1, 3, 3))])),
            ("duplicate-id", "unit r", "F1"),
        ),
        (
            house(hall("F1", [ROOM, Unit("y", "", "room", box(15, 2, 22, 5))])),
            ("overlapping-units", "unit r", "F1"),
        ),
        (house(hall("F1"), hall("F2"), connectors=()), ("floor-without-connector", "floor F2", "F2")),
        (
            house(
                hall("F1"),
                hall("F2"),
                connectors=(
                    Connector("S", ConnectorKind.STAIRS, (Landing(0, 2.0, 2.0), Landing(1, 2.0, 12.0))),
                ),
            ),
            ("connector-in-no-cell", "stairs S", "F2"),
        ),
        (
            house(
                hall("F1"),
                hall("F2"),
                connectors=(
                    Connector("S", ConnectorKind.STAIRS, (Landing(0, 2.0, 2.0), Landing(1, 2.0, 12.0))),
                ),
            ),
            ("unreachable-floor", "floor F2", "F2"),
        ),
    ],
)
def test_each_problem_is_named(site, expected):
    assert expected in found(site)


def test_what_the_importer_noted_is_told_again_and_errors_come_first():
    noted = [Problem("connector-to-nowhere", "stairs 7", "F1", "on floor F1 only")]
    site = dataclasses.replace(
        house(hall("F1", [HALL, ROOM, Unit("x", "", "area", BOW)])), provenance={KEY: problems_text(noted)}
    )
    problems = validate_site(site)
    assert noted[0] in problems
    assert noted_problems(site) == tuple(noted)
    assert [p.severity for p in problems] == sorted((p.severity for p in problems), key=list(Severity).index)
    damaged = dataclasses.replace(site, provenance={KEY: "[3]"})
    with pytest.raises(MapError, match="import the site anew"):
        validate_site(damaged)


@pytest.mark.real_data
@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("osm", {"door-on-no-wall": 3, "unreachable-unit": 1}),
        ("simpleloc", {"connector-to-nowhere": 1, "unreachable-unit": 2}),
        (
            "hcu",
            {
                "connector-to-nowhere": 6,
                "self-crossing-polygon": 8,
                "faulty-polygon": 1,
                "unreachable-unit": 1,
            },
        ),
    ],
)
def test_real_buildings(data_root, name, expected):
    """What is known of the plans given; all repaired or harmless, so no errors."""
    problems = validate_site(real_floors(data_root, name))
    kinds = [p.kind for p in problems]
    assert {kind: kinds.count(kind) for kind in sorted(set(kinds))} == expected
    assert all(p.severity is Severity.WARNING for p in problems)
