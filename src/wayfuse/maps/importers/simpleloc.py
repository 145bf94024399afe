"""Import a building of the simpleLoc floor-plan XML (`building.xml`): outlines, walls with doors, stairs, lifts.

The outline of a floor is its polygons of method 0 less those of method 1. `wall` and `line` (a handrail) are walls;
a `door` of a wall is an opening of its `width` from the share `x01` of the wall, towards its start where `lr` is
true (so all 116 doors of the public file lie on their walls). Each `stair` is a unit of its floor and, where its
last `z2` reaches it, of the one above; it lands where its first part begins and its last one ends. Floors are
sorted by `atHeight`, their elevation. Rooms are not drawn as areas, so connectors are the only units. The file
names no place on the earth; x is taken as right and y as up.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element

import numpy as np

from wayfuse.core.errors import MapError
from wayfuse.core.types import Array
from wayfuse.maps.build import build_floor
from wayfuse.maps.geometry import from_shapely
from wayfuse.maps.importers.joining import KINDS, Piece, join_pieces
from wayfuse.maps.importers.plan_file import parse_xml, read_limited
from wayfuse.maps.importers.report import FloorReport, ImportReport, Notes
from wayfuse.maps.importers.rooms import chords, cleaned, cut_walls, outline_of, to_shapely
from wayfuse.maps.levels import parse_level
from wayfuse.maps.problems import KEY, problems_text
from wayfuse.maps.site import Floor, Polygon, Site, Unit
from wayfuse.maps.walls import LARGEST

__all__ = ["import_site"]

REACH = 0.3  # m, stairs that end this near the floor above serve it
DOOR_DEPTH = 0.1  # m, a door opens walls this near: those of two rooms may be drawn side by side
SLIT = 0.2  # m, stairs drawn this near the edge of their cut-out reach it
_STOREY = re.compile(r"(\d{1,3})\. ?(?:stock|og|obergeschoss|etage|floor)", re.IGNORECASE)
_GROUND = re.compile(r"eg|erdgeschoss", re.IGNORECASE)


@dataclass(slots=True)
class _Storey:
    """A floor element and what it was found to hold."""

    node: Element
    name: str
    elevation: float
    level: int = 0
    units: list[Unit] = field(default_factory=list)
    notes: Notes = field(default_factory=Notes)


def import_site(path: Path) -> tuple[Site, ImportReport]:
    """Site of a building file, all floors in one frame, and what was met on the way.

    Raises
    ------
    MapError : the file cannot be read, has no floor, or a floor has no outline or a number is missing.
    """
    path = Path(path)
    root = parse_xml(read_limited(path), path)
    nodes = root.findall("floors/floor")
    if root.tag != "map" or not nodes:
        raise MapError("is no <map> with <floors>", where=path, remedy="name the building.xml of simpleLoc")
    storeys = [
        _Storey(node, node.get("name") or f"floor {i}", _number(path, node, "atHeight"))
        for i, node in enumerate(nodes)
    ]
    storeys.sort(key=lambda storey: storey.elevation)
    for storey in storeys:
        storey.notes.floor = storey.name
    _set_levels(storeys)
    pieces = _add_connectors(path, storeys)
    outlines = [_outline(path, storey) for storey in storeys]
    corners = np.concatenate([p.exterior for outline in outlines for p in outline])
    if float(np.max(np.abs(corners))) > LARGEST:
        raise MapError(f"spans more than {LARGEST:.0f} m", where=path, remedy="mend the outline")
    size = corners.max(axis=0)
    floors = [_floor(path, s, outline, size) for s, outline in zip(storeys, outlines, strict=True)]
    notes = Notes()
    connectors = join_pieces(floors, pieces, notes)
    problems = [problem for storey in storeys for problem in storey.notes.problems] + notes.problems
    provenance = {
        "importer": "simpleloc",
        "source": path.name,
        "frame": "metres of the file, y taken as up",
        KEY: problems_text(problems),
    }
    reports = [FloorReport(s.name, None, tuple(s.notes)) for s in storeys]
    name = path.resolve().parent.name if path.stem == "building" else path.stem
    site = Site(name, tuple(floors), provenance, connectors)
    return site, ImportReport(tuple(reports), tuple(notes))


def _number(path: Path, node: Element, key: str) -> float:
    text = node.get(key)
    try:
        value = float("" if text is None else text)
    except ValueError:
        value = np.nan
    if not abs(value) < 1e6:
        name = node.get("name") or node.get("id") or ""
        raise MapError(
            f"<{node.tag}> {name}: {key} is {text!r}, not a number", where=path, remedy="mend the file"
        )
    return value


def _set_levels(storeys: list[_Storey]) -> None:
    """Level of each floor by its name; one that does not say comes after the one below."""
    for i, storey in enumerate(storeys):
        found = _STOREY.fullmatch(storey.name.strip())
        level = int(found[1]) if found else parse_level(storey.name)
        if _GROUND.fullmatch(storey.name.strip()):
            level = 0
        if level is None:
            level = storeys[i - 1].level + 1 if i else 0
            storey.notes.append(f"name {storey.name!r} does not say its level: taken as {level}")
        storey.level = level


def _add_connectors(path: Path, storeys: list[_Storey]) -> list[Piece]:
    """Add stairs and lifts to the units of the floors they serve, and give them as pieces of connectors."""
    pieces: list[Piece] = []
    for i, storey in enumerate(storeys):
        above = storeys[i + 1 : i + 2]
        for kind, tag in (("stairs", "stairs/stair"), ("elevator", "elevators/elevator")):
            for number, node in enumerate(storey.node.findall(tag)):
                ident = f"{kind} {storey.level}/{number}"
                shape = _stairs(path, node) if kind == "stairs" else _lift(path, node)
                ends = [_number(path, part, "z2") for part in node.findall("part")]
                rise = max(ends) if ends else _number(path, node, "height")
                reached = [s for s in above if rise > s.elevation - storey.elevation - REACH]
                for polygon in from_shapely(shape):
                    for other in (storey, *reached):
                        other.units.append(Unit(ident, "", kind, polygon))
                floors = (i, i + 1) if reached else (i,)
                pieces.append(Piece(ident, KINDS[kind], shape, floors, places=_places(path, node, floors)))
    return pieces


def _places(path: Path, node: Element, floors: tuple[int, ...]) -> dict[int, tuple[float, float]]:
    """Where stairs begin on their lowest floor and end on their highest."""
    parts = node.findall("part")
    if not parts or len(floors) < 2:
        return {}
    first = min(parts, key=lambda part: _number(path, part, "z1"))
    last = max(parts, key=lambda part: _number(path, part, "z2"))
    (x0, y0), (x1, y1) = _ends(path, first)[0].tolist(), _ends(path, last)[1].tolist()
    return {floors[0]: (x0, y0), floors[-1]: (x1, y1)}


def _stairs(path: Path, node: Element) -> Any:
    """Union of the flights and landings of stairs, each a line with a width."""
    import shapely

    parts = []
    for part in node.findall("part"):
        line = shapely.LineString(_ends(path, part))
        parts.append(line.buffer(0.5 * _number(path, part, "w"), cap_style="flat"))
    return shapely.union_all(parts)


def _lift(path: Path, node: Element) -> Any:
    import shapely
    from shapely.affinity import rotate

    x, y, width, depth, turn = (
        _number(path, node, key) for key in ("cx", "cy", "width", "depth", "rotation")
    )
    box = shapely.box(x - 0.5 * width, y - 0.5 * depth, x + 0.5 * width, y + 0.5 * depth)
    return rotate(box, turn, use_radians=True)


def _ends(path: Path, node: Element) -> Array:
    values = [_number(path, node, key) for key in ("x1", "y1", "x2", "y2")]
    return np.array(values).reshape(2, 2)


def _outline(path: Path, storey: _Storey) -> tuple[Polygon, ...]:
    """What is drawn less what is cut out, and the connectors, which stand in the cut-outs."""
    added: list[Polygon] = []
    removed: list[Polygon] = []
    for node in storey.node.findall("outline/polygon"):
        points = [[_number(path, p, "x"), _number(path, p, "y")] for p in node.findall("point")]
        ring = np.array(points, dtype=np.float64).reshape(-1, 2)
        polygons = cleaned([ring], f"outline {node.get('name', '')}", storey.notes)
        (removed if node.get("method") == "1" else added).extend(polygons)
    connectors = to_shapely(unit.polygon for unit in storey.units)
    whole = to_shapely(added).difference(to_shapely(removed)).union(connectors)
    outline = outline_of(from_shapely(whole), SLIT)
    if not added or not outline:
        raise MapError(f"floor {storey.name} has no outline", where=path, remedy="draw one of method 0")
    return outline


def _floor(path: Path, storey: _Storey, outline: tuple[Polygon, ...], size: Array) -> Floor:
    lines: list[Array] = []
    doors: list[Any] = []
    for node in storey.node.findall("obstacles/*"):
        if node.tag not in ("wall", "line"):
            continue
        ends = _ends(path, node)
        lines.append(ends)
        doors += [_door(path, door, ends, storey) for door in node.findall("door")]
    rings = [ring for polygon in outline for ring in polygon.rings]
    openings = [chord for chord in chords([*lines, *rings], doors) if chord is not None]
    return build_floor(
        storey.name,
        storey.level,
        outline,
        storey.units,
        walls=cut_walls(outline, lines, doors),
        closed=[],
        width=float(size[0]),
        height=float(size[1]),
        elevation=storey.elevation,
        doors=np.array(openings).reshape(-1, 4),
    )


def _door(path: Path, node: Element, ends: Array, storey: _Storey) -> Any:
    """Area a door opens in its wall."""
    import shapely

    length = float(np.hypot(*(ends[1] - ends[0])))
    start, width = _number(path, node, "x01") * length, _number(path, node, "width")
    low, high = (start - width, start) if node.get("lr") == "true" else (start, start + width)
    if low < -DOOR_DEPTH or high > length + DOOR_DEPTH:
        feature = f"door of the wall from {ends[0].tolist()} to {ends[1].tolist()}"
        fault = f"a door of {width:g} m at {start:.2f} m leaves its wall of {length:.2f} m"
        storey.notes.add("door-on-no-wall", feature, fault)
    low, high = max(low, 0.0), min(high, length)
    if high <= low:
        return shapely.Polygon()
    along = (ends[1] - ends[0]) / length
    line = shapely.LineString([ends[0] + low * along, ends[0] + high * along])
    return line.buffer(DOOR_DEPTH, cap_style="flat")
