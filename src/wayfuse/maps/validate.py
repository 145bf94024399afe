"""What is wrong with a site: parts nobody reaches, doors and connectors that lead nowhere, faulty polygons.

Every finding names a feature: the id of a unit or connector, or a door by its number on its floor. What importers
repaired or left out is part of the answer (`wayfuse.maps.problems`). Errors make a part of the building unusable;
warnings may be as the building is (a plant room without door, say).
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator

import numpy as np

from wayfuse.core.types import IntArray
from wayfuse.maps.connectors import Connector
from wayfuse.maps.graph import BuildingGraph, build_graph
from wayfuse.maps.partition import limits
from wayfuse.maps.problems import Problem, Severity, noted_problems
from wayfuse.maps.site import Floor, Polygon, Site

__all__ = ["KINDS", "components", "validate_site"]

# kind of problem -> what it means
KINDS = {
    "connector-in-no-cell": "a landing lies where nobody walks",
    "connector-to-nowhere": "stairs, a lift, an escalator or a ramp that serves one floor only",
    "door-on-no-wall": "a door that no wall ends at",
    "duplicate-id": "one id for several units that do not belong together",
    "faulty-connector": "a connector the importer could not read",
    "faulty-polygon": "a polygon the importer repaired or left out",
    "floor-without-connector": "a floor of several that nothing joins to the others",
    "overlapping-units": "two units that share ground",
    "self-crossing-polygon": "a polygon that crosses or touches itself",
    "unreachable-floor": "a floor that cannot be reached from the largest part of the building",
    "unreachable-unit": "a unit people walk in that cannot be reached from the largest part of the building",
}
ERRORS = frozenset(
    (
        "connector-in-no-cell",
        "duplicate-id",
        "self-crossing-polygon",
        "unreachable-floor",
    )
)  # as found in the site; importers say for themselves how bad what they met was
JAMB = 0.35  # m, a door ends this near a wall
MOSTLY = 0.5  # of a unit that is not reached: what is less are its edges, which walkable space may overlap
SMALLEST = 2.0  # m2 of an area of no unit that is named
SHARED = 0.05  # of the smaller of two units; more, and they overlap
SHARED_AREA = 0.25  # m2, less is a drawing error
LEVEL_CATEGORIES = frozenset(("elevator", "escalator", "ramp", "stairs", "steps", "movingwalkway"))
OVER_OTHERS = frozenset(("area", "corridor", "void", "furniture", "wall", "structure", "column"))


def validate_site(site: Site, graph: BuildingGraph | None = None) -> tuple[Problem, ...]:
    """Problems of a site, errors first, then by floor and feature.

    Parameters
    ----------
    graph : of the site, where there is one already.
    """
    graph = graph or build_graph(site)
    found = [*noted_problems(site)]
    for floor in site.floors:
        found += [*_polygons(floor), *_ids(floor), *_overlaps(floor), *_doors(floor)]
    found += [*_connectors(site, graph), *_reach(site, graph)]
    order = {name: k for k, name in enumerate(("", *site.floor_names))}
    unique = dict.fromkeys(found)
    return tuple(
        sorted(
            unique, key=lambda p: (p.severity is not Severity.ERROR, order.get(p.floor, 0), p.kind, p.feature)
        )
    )


def _problem(kind: str, feature: str, floor: str, text: str) -> Problem:
    return Problem(kind, feature, floor, text, Severity.ERROR if kind in ERRORS else Severity.WARNING)


def _polygons(floor: Floor) -> Iterator[Problem]:
    import shapely

    drawn: list[tuple[str, Polygon]] = [(f"unit {unit.id}", unit.polygon) for unit in floor.units]
    drawn += [(f"outline {k}", polygon) for k, polygon in enumerate(floor.outline, 1)]
    for feature, polygon in drawn:
        shape = shapely.Polygon(polygon.exterior, [*polygon.holes])
        if not shape.is_valid:
            reason = shapely.is_valid_reason(shape)
            yield _problem("self-crossing-polygon", feature, floor.name, reason)


def _ids(floor: Floor) -> Iterator[Problem]:
    """Ids of units that differ in name or category (parts of one unit share all three)."""
    kinds = Counter(ident for ident, _ in {(u.id, (u.name, u.category)) for u in floor.units})
    for ident, number in sorted(kinds.items()):
        if number > 1:
            yield _problem(
                "duplicate-id", f"unit {ident}", floor.name, f"{number} different units have this id"
            )


def _overlaps(floor: Floor) -> Iterator[Problem]:
    import shapely

    units = [u for u in floor.units if u.category not in LEVEL_CATEGORIES | OVER_OTHERS]
    shapes = [shapely.Polygon(u.polygon.exterior, [*u.polygon.holes]) for u in units]
    one, other = shapely.STRtree(shapes).query(shapes, predicate="intersects") if shapes else ([], [])
    for i, j in sorted({(min(a, b), max(a, b)) for a, b in zip(one, other, strict=True) if a != b}):
        if units[i].id == units[j].id or not (shapes[i].is_valid and shapes[j].is_valid):
            continue
        shared = float(shapes[i].intersection(shapes[j]).area)
        if shared > max(SHARED_AREA, SHARED * min(shapes[i].area, shapes[j].area)):
            text = f"shares {shared:.1f} m2 with unit {units[j].id}"
            yield _problem("overlapping-units", f"unit {units[i].id}", floor.name, text)


def _doors(floor: Floor) -> Iterator[Problem]:
    """Doors neither end of which a wall, or another door of a wide entrance, comes near."""
    import shapely

    lines = limits(floor)
    walls = shapely.union_all([shapely.LineString(line) for line in lines.reshape(-1, 2, 2)])
    edges = [shapely.LineString(ring) for u in floor.units for ring in u.polygon.rings]
    drawn = shapely.union_all([walls, *edges])
    for k, door in enumerate(floor.doors, 1):
        ends = shapely.points(door.reshape(2, 2))
        if min(shapely.distance(drawn, ends)) > JAMB:
            x, y = 0.5 * (door[:2] + door[2:])
            text = "no wall or edge of a unit ends at it"
            yield _problem("door-on-no-wall", f"door {k} at ({x:.1f}, {y:.1f})", floor.name, text)


def _connectors(site: Site, graph: BuildingGraph) -> Iterator[Problem]:
    for row, cell in enumerate(graph.landing_cell.tolist()):
        if cell < 0:
            connector = graph.connectors[int(graph.landing_connector[row])]
            x, y = graph.landing_xy[row]
            name = site.floors[int(graph.landing_floor[row])].name
            text = f"its landing ({x:.1f}, {y:.1f}) is not walkable"
            yield _problem("connector-in-no-cell", _named(connector), name, text)
    served = {k for connector in site.connectors for k in connector.floors}
    for k, floor in enumerate(site.floors):
        if len(site.floors) > 1 and k not in served:
            text = "no stairs, lift, escalator or ramp serves it"
            yield _problem("floor-without-connector", f"floor {floor.name}", floor.name, text)


def _named(connector: Connector) -> str:
    return f"{connector.kind} {connector.id}" + (f" ({connector.name})" if connector.name else "")


def components(graph: BuildingGraph) -> IntArray:
    """Number of the part (n,) each cell belongs to: cells of a part are joined by portals and connectors."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    pairs = [graph.portal_cells]
    for number in range(len(graph.connectors)):
        cells = graph.landing_cell[graph.landing_connector == number]
        cells = cells[cells >= 0]
        pairs.append(np.column_stack([cells[:-1], cells[1:]]))
    a, b = np.concatenate(pairs).T
    joined = coo_array((np.ones(len(a)), (a, b)), shape=(graph.n_cells, graph.n_cells))
    return np.asarray(connected_components(joined, directed=False)[1], dtype=np.int64)


def _reach(site: Site, graph: BuildingGraph) -> Iterator[Problem]:
    """Floors and units that cannot be reached from the largest part; a site without connectors, floor by floor."""
    if not graph.n_cells:
        return
    part = components(graph)
    areas = graph.areas
    largest = int(np.argmax(np.bincount(part, areas)))
    for k, floor in enumerate(site.floors):
        here = graph.cell_floor == k
        main = largest
        if np.any(here) and not np.any(part[here] == largest):
            if any(k in connector.floors for connector in site.connectors):
                text = "its connectors do not join it to the largest part of the building"
                yield _problem("unreachable-floor", f"floor {floor.name}", floor.name, text)
            main = int(np.argmax(np.bincount(part[here], areas[here])))
        yield from _cut_off(floor, graph, np.nonzero(here & (part != main))[0], part)


def _cut_off(floor: Floor, graph: BuildingGraph, lost: IntArray, part: IntArray) -> Iterator[Problem]:
    """Units mostly of cells that are not reached, and parts of such cells of no unit."""
    areas = graph.areas
    size: dict[str, float] = {}
    for unit in floor.units:
        size[unit.id] = size.get(unit.id, 0.0) + unit.polygon.area
    inside: dict[str, float] = {}
    for cell in lost.tolist():
        number = int(graph.cell_unit[cell])
        if number >= 0:
            ident = floor.units[number].id
            inside[ident] = inside.get(ident, 0.0) + float(areas[cell])
    nameless = lost[graph.cell_unit[lost] < 0]
    for number in np.unique(part[nameless]):
        own = nameless[part[nameless] == number]
        if areas[own].sum() >= SMALLEST:
            x, y = graph.polygon(int(own[np.argmax(areas[own])])).mean(axis=0)
            text = f"{areas[own].sum():.0f} m2 of no unit: no door or opening leads there"
            yield _problem("unreachable-unit", f"area at ({x:.1f}, {y:.1f})", floor.name, text)
    named = {unit.id: unit for unit in floor.units}
    for ident, area in sorted(inside.items()):
        if area > MOSTLY * size[ident]:
            unit = named[ident]
            text = f"{unit.category}{f' ({unit.name})' if unit.name else ''}: no door or opening leads to it"
            yield _problem("unreachable-unit", f"unit {ident}", floor.name, text)
