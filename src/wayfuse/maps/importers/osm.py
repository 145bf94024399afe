"""Import a building of OpenStreetMap drawn with Simple Indoor Tagging.

Rooms (`indoor=room`), corridors and areas are units people walk in. A room has walls along its edge, open where
a `door=*` or `entrance=*` node lies on it; the edge of a corridor or area is a wall only where nothing adjoins,
for its neighbours carry the walls. `indoor=wall` ways are walls, closed ones solid units `wall`. `level` and
`repeat_on` take lists and ranges ("0;1", "-1-3"); an object drawn for several levels is a unit of each. Parts of
levels ("0.5") have no floor of their own and are left out. A level that only stairs or lifts reach is a floor of
nothing but those, for people get there and leave again.

Connectors (stairs, escalators, lifts) are units of every level they serve and are joined across levels (`joining`).
Steps drawn as a line get their `width`, else `STAIRS_WIDTH`, and land at its ends where `incline` tells which is up;
a lift drawn as a point is a square of `LIFT_SIZE`. Nothing encloses them but `indoor=room` with a door: most are
drawn without.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from wayfuse.core.errors import MapError
from wayfuse.core.frames import GeoAnchor
from wayfuse.core.types import Array
from wayfuse.maps.build import build_floor, nominal_elevation
from wayfuse.maps.importers.joining import KINDS, Piece, join_pieces
from wayfuse.maps.importers.osm_connectors import piece_of
from wayfuse.maps.importers.osm_elements import Element, read_elements
from wayfuse.maps.importers.report import FloorReport, ImportReport, Notes
from wayfuse.maps.importers.rooms import (
    DOOR_WIDTH,
    anchor_residual,
    chords,
    cleaned,
    cut_walls,
    local_anchor,
    outline_of,
    to_shapely,
)
from wayfuse.maps.problems import KEY, problems_text
from wayfuse.maps.site import Floor, Polygon, Site, Unit

__all__ = ["import_site", "parse_levels"]

STAIRS_WIDTH = 1.5  # m, of steps drawn as a line without width
LIFT_SIZE = 2.0  # m, side of a lift drawn as a point
WIDEST = 20.0  # m, a wider door or flight of stairs is a mistake
MOST_LEVELS = 200  # a range of more levels is a mistake
AREAS = ("room", "corridor", "area")
CONNECTORS = ("stairs", "escalator", "elevator")
_NUMBER = r"-?\d+(?:[.,]\d+)?"
_RANGE = re.compile(rf"({_NUMBER})\s*-\s*({_NUMBER})")


@dataclass(slots=True)
class _Level:
    """What is drawn of one level (m)."""

    units: list[Unit] = field(default_factory=list)
    rooms: list[Unit] = field(default_factory=list)
    solid: list[Polygon] = field(default_factory=list)
    lines: list[Array] = field(default_factory=list)
    doors: list[tuple[str, Any]] = field(default_factory=list)
    notes: Notes = field(default_factory=Notes)


def parse_levels(text: str) -> tuple[int, ...]:
    """Whole levels of a `level` or `repeat_on` tag, ascending.

    >>> parse_levels("0;1"), parse_levels("-1-3"), parse_levels("0;0,5"), parse_levels("mezzanine")
    ((0, 1), (-1, 0, 1, 2, 3), (0,), ())
    """
    levels: set[int] = set()
    for part in (p.strip() for p in text.split(";")):
        if span := _RANGE.fullmatch(part):
            low, high = sorted(float(g.replace(",", ".")) for g in span.groups())
            if high - low <= MOST_LEVELS:
                levels |= set(range(int(np.ceil(low)), int(np.floor(high)) + 1))
        elif re.fullmatch(_NUMBER, part) and float(part.replace(",", ".")).is_integer():
            levels.add(int(float(part.replace(",", "."))))
    return tuple(sorted(level for level in levels if abs(level) <= MOST_LEVELS))


def import_site(path: Path) -> tuple[Site, ImportReport]:
    """Site of an `.osm` or `.geojson` file, all floors in one frame, and what was met on the way.

    Raises
    ------
    MapError : the file cannot be read, or holds no room, corridor or area with a level.
    """
    path = Path(path)
    notes = Notes()
    elements = read_elements(path, notes)
    drawn = [e for e in elements if _category(e) in (*AREAS, *CONNECTORS) or _is_wall(e)]
    areas = [e for e in drawn if e.polygons and _levels(e)]
    if not any(_category(e) in AREAS for e in areas):
        raise MapError(
            "holds no indoor=room, corridor or area with a level",
            where=path,
            remedy="export a building drawn with Simple Indoor Tagging",
        )
    points = np.concatenate([rings[0] for e in areas for rings in e.polygons])
    anchor = local_anchor(points, path)
    size = anchor.to_xy(points.max(axis=0))
    levels: dict[int, _Level] = {}
    for e in drawn:
        for k in _levels(e) if _category(e) else ():
            levels.setdefault(k, _Level(notes=Notes(str(k))))
    bare = levels.keys() - {k for e in areas if _category(e) in AREAS for k in _levels(e)}
    notes += [f"level {k} has only stairs or lifts: a floor of nothing but them" for k in sorted(bare)]
    missed = sum(not _draw(element, anchor, levels) for element in drawn)
    if missed:
        notes.append(f"{missed} indoor objects without a whole level: left out")
    for element in elements:
        _add_door(element, anchor, levels)
    built = [_build(level, levels[level], size, anchor, 0 in levels) for level in sorted(levels)]
    floors = [item for item in built if item is not None]
    if not floors:
        raise MapError("no room encloses an area", where=path, remedy="mend the drawing")
    storeys = tuple(floor for floor, _ in floors)
    connectors = join_pieces(storeys, _pieces(drawn, storeys, anchor), notes)
    problems = [p for k in sorted(levels) for p in levels[k].notes.problems] + notes.problems
    provenance = {
        "importer": "osm",
        "source": path.name,
        "frame": "metres east and north of the south-west corner of all floors",
        "licence": "Open Database License, (c) OpenStreetMap contributors",
        KEY: problems_text(problems),
    }
    site = Site(path.stem, storeys, provenance, connectors)
    return site, ImportReport(tuple(report for _, report in floors), tuple(notes))


def _pieces(drawn: list[Element], floors: tuple[Floor, ...], anchor: GeoAnchor) -> list[Piece]:
    """Pieces of connectors, as drawn on the floors there are."""
    index = {floor.level: i for i, floor in enumerate(floors)}
    found: list[Piece] = []
    for element in drawn:
        category = _category(element)
        served = tuple(index[k] for k in _levels(element) if k in index)
        shape = to_shapely(_polygons(element, anchor, Notes())) if category in CONNECTORS and served else None
        if shape is not None and not shape.is_empty:
            found.append(piece_of(element, KINDS[category], shape, served, anchor))
    return found


def _category(element: Element) -> str:
    """Kind of a unit by its tags, empty where it is none."""
    tags = element.tags
    indoor = tags.get("indoor", "")
    if tags.get("conveying", "no") != "no":
        return "escalator"
    if "elevator" in (tags.get("highway"), tags.get("building:part"), tags.get("room")):
        return "elevator"
    is_stairs = tags.get("stairs", "no") != "no" or "stairwell" in tags or tags.get("room") == "stairs"
    if is_stairs or tags.get("highway") == "steps":
        return "stairs"
    if indoor in AREAS:
        return indoor
    is_area = tags.get("area") == "yes" or "building:part" in tags or "room" in tags
    return "area" if indoor == "yes" and is_area and element.polygons else ""


def _is_wall(element: Element) -> bool:
    return element.tags.get("indoor") == "wall" and element.line is not None


def _levels(element: Element) -> tuple[int, ...]:
    both = parse_levels(element.tags.get("level", "")) + parse_levels(element.tags.get("repeat_on", ""))
    return tuple(sorted(set(both)))


def _draw(element: Element, anchor: GeoAnchor, levels: Mapping[int, _Level]) -> bool:
    """Add an object to each level it is drawn for; False where there is none."""
    category = _category(element)
    where = [levels[k] for k in _levels(element) if k in levels]
    if not where:
        return False
    if not category and element.line is not None and not element.polygons:
        for level in where:
            level.lines.append(anchor.to_xy(element.line))
        return True
    for i, level in enumerate(where):
        for polygon in _polygons(element, anchor, level.notes if i == 0 else Notes()):
            unit = Unit(element.id, _name(element.tags), _kind(element, category), polygon)
            level.units.append(unit)
            if not category:
                level.solid.append(polygon)
            if element.tags.get("indoor") == "room":
                level.rooms.append(unit)
    return True


def _name(tags: Mapping[str, str]) -> str:
    return tags.get("name") or tags.get("ref") or ""


def _kind(element: Element, category: str) -> str:
    """Category of a unit: that of a room says what it is for where the tags do."""
    tags = element.tags
    if category != "room":
        return category or "wall"
    if "toilets" in (tags.get("room"), tags.get("amenity")):
        return "toilet"
    if "shop" in tags:
        return "shop"
    use = tags.get("room", "room")
    return use if use not in ("yes", "") else "room"


def _polygons(element: Element, anchor: GeoAnchor, notes: Notes) -> list[Polygon]:
    import shapely

    if element.polygons:
        return [
            polygon
            for rings in element.polygons
            for polygon in cleaned([anchor.to_xy(ring) for ring in rings], element.id, notes)
        ]
    if element.line is not None:
        half = 0.5 * _width(element.tags, STAIRS_WIDTH)
        line = shapely.LineString(anchor.to_xy(element.line))
        shape = line.buffer(half, cap_style="flat", join_style="mitre")
    elif element.point is not None:
        shape = shapely.Point(anchor.to_xy(element.point)).buffer(0.5 * LIFT_SIZE, cap_style="square")
    else:
        return []
    parts = [part for part in shapely.get_parts(shape) if part.geom_type == "Polygon"]
    return [p for part in parts for p in cleaned([np.asarray(part.exterior.coords)], element.id, notes)]


def _width(tags: Mapping[str, str], default: float) -> float:
    found = re.match(r"\s*(\d+(?:[.,]\d+)?)", tags.get("width", ""))
    width = float(found[1].replace(",", ".")) if found else default
    return width if 0.3 <= width <= WIDEST else default


def _add_door(element: Element, anchor: GeoAnchor, levels: Mapping[int, _Level]) -> None:
    """Open the walls at a door; one without a level opens those of every level."""
    import shapely

    tags = element.tags
    if element.point is None or not {"door", "entrance"} & tags.keys():
        return
    disc = shapely.Point(anchor.to_xy(element.point)).buffer(0.5 * _width(tags, DOOR_WIDTH))
    for level in _levels(element) if "level" in tags else levels:
        if level in levels:
            levels[level].doors.append((element.id if "level" in tags else "", disc))


def _build(
    level: int, drawn: _Level, size: Array, anchor: GeoAnchor, has_ground: bool
) -> tuple[Floor, FloorReport] | None:
    import shapely

    outline = outline_of(unit.polygon for unit in drawn.units if unit.category != "wall")
    if not outline:
        return None
    discs = [disc for _, disc in drawn.doors]
    doors = shapely.union_all(discs)
    shapely.prepare(doors)
    walled, shut = [], 0
    for unit in drawn.rooms:
        has_door = to_shapely([unit.polygon]).boundary.intersects(doors)
        if has_door or unit.category not in CONNECTORS:
            walled.append(unit.polygon)
            shut += not has_door
    if shut:
        drawn.notes.append(f"{shut} of {len(drawn.rooms)} rooms have no door: nobody gets in or out")
    closed = [*outline, *walled, *drawn.solid]
    edges = [ring for polygon in closed for ring in polygon.rings] + drawn.lines
    edges += [ring for unit in drawn.units for ring in unit.polygon.rings]  # a door between two corridors
    openings = chords(edges, discs)
    for (ident, _), chord in zip(drawn.doors, openings, strict=True):
        if chord is None and ident:  # one without a level lies on some level's walls only
            drawn.notes.add("door-on-no-wall", ident, "a door on no wall: it opens nothing")
    floor = build_floor(
        str(level),
        level,
        outline,
        drawn.units,
        walls=cut_walls(closed, drawn.lines, discs),
        closed=drawn.solid,
        width=float(size[0]),
        height=float(size[1]),
        elevation=nominal_elevation(level, has_ground=has_ground),
        anchor=anchor,
        doors=np.array([chord for chord in openings if chord is not None]).reshape(-1, 4),
    )
    return floor, FloorReport(floor.name, anchor_residual(anchor, size), tuple(drawn.notes))
