"""Relationships of IMDF as connectors, and connectors as relationships.

A relationship refers to the units of a connector, from the lowest floor to the highest (the other way where people
are only moved down). What it has no word for (landings, steps, footprint) is kept in the property
"wayfuse:connector", in degrees.
"""

from __future__ import annotations

import uuid
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from wayfuse.core.errors import MapError
from wayfuse.core.frames import GeoAnchor
from wayfuse.core.types import Array
from wayfuse.maps.connector_entries import connector_entry, read_connector
from wayfuse.maps.connectors import Connector, ConnectorKind
from wayfuse.maps.importers.joining import KINDS, Piece, join_pieces
from wayfuse.maps.importers.report import Notes
from wayfuse.maps.importers.rooms import to_shapely
from wayfuse.maps.site import Floor, Site, Unit

__all__ = ["read_connectors", "write_connectors"]

EXTRA = "wayfuse:connector"
CATEGORIES = {
    ConnectorKind.STAIRS: "stairs",
    ConnectorKind.LIFT: "elevator",
    ConnectorKind.ESCALATOR: "escalator",
    ConnectorKind.RAMP: "ramp",
}
NEAR = 1.0  # m, a landing lies this near the unit of its connector
DIGITS = 10  # of degrees: 0.01 mm


def read_connectors(
    floors: Sequence[Floor],
    relationships: Sequence[Mapping[str, Any]],
    sources: Mapping[str, tuple[int, str, str]],
    anchor: GeoAnchor,
    notes: Notes,
    *,
    own: bool,
) -> tuple[Connector, ...]:
    """Connectors of an archive.

    Parameters
    ----------
    relationships : properties of each. sources : ordinal, id and category of each unit, by its id in the archive.
    anchor : frame of all floors. own : written by wayfuse: what no relationship joins is joined by nothing.
    """
    names = [floor.name for floor in floors]
    found: list[Connector] = []
    groups: list[tuple[set[str], int]] = []
    for held in relationships:
        units = _references(held, sources)
        extra = held.get(EXTRA)
        if own and isinstance(extra, Mapping):
            try:
                found.append(read_connector(_moved(extra, anchor.to_xy), names))
            except (MapError, KeyError, TypeError, ValueError) as error:
                notes.add("faulty-connector", str(extra.get("id", "?")), f"{error}, left out")
        elif any(sources[unit][2] in KINDS for unit in units):
            groups = _merged(groups, set(units), _direction(held, units, sources))
    if own:
        return tuple(found)
    return join_pieces(floors, _pieces(floors, groups, sources), notes)


def _references(held: Mapping[str, Any], sources: Mapping[str, Any]) -> list[str]:
    """Units of a relationship in its order, origin first."""
    middle = held.get("intermediary")
    refs = [held.get("origin"), *(middle if isinstance(middle, list) else []), held.get("destination")]
    units = [str(ref.get("id")) for ref in refs if isinstance(ref, dict)]
    return [unit for unit in units if unit in sources]


def _direction(held: Mapping[str, Any], units: list[str], sources: Mapping[str, tuple[int, str, str]]) -> int:
    if held.get("direction") != "directed" or len(units) < 2:
        return 0
    return int(np.sign(sources[units[-1]][0] - sources[units[0]][0]))


def _merged(
    groups: list[tuple[set[str], int]], units: set[str], direction: int
) -> list[tuple[set[str], int]]:
    """Groups with one more; a relationship per pair of floors shares units with the next."""
    apart = [group for group in groups if not group[0] & units or group[1] != direction]
    same = [members for members, way in groups if members & units and way == direction]
    return [*apart, (units.union(*same), direction)]


def _pieces(
    floors: Sequence[Floor],
    groups: Sequence[tuple[set[str], int]],
    sources: Mapping[str, tuple[int, str, str]],
) -> list[Piece]:
    joined = {}
    for units, direction in groups:
        lowest = min(units, key=lambda unit: sources[unit])
        for member in units:
            ordinal, ident, _ = sources[member]
            joined[ordinal, ident] = (sources[lowest][1], direction)
    found = []
    for k, floor in enumerate(floors):
        for unit in floor.units:
            if unit.category in KINDS:
                ident, direction = joined.get((floor.level, unit.id), (unit.id, 0))
                shape = to_shapely([unit.polygon])
                found.append(Piece(ident, KINDS[unit.category], shape, (k,), unit.name, direction=direction))
    return found


def write_connectors(site: Site, unit_id: Callable[[Site, Floor, Unit, int], str]) -> list[dict[str, Any]]:
    """A relationship for each connector; ``unit_id`` names a unit of a floor by its number."""
    found = []
    for connector in site.connectors:
        stops = [_unit_of(site, connector, at.floor, at.x, at.y, unit_id) for at in connector.landings]
        refs = [{"id": unit, "feature_type": "unit"} for unit in stops if unit]
        refs = refs[::-1] if connector.direction < 0 else refs
        ident = str(uuid.uuid5(uuid.NAMESPACE_OID, f"wayfuse/{site.name}/relationship/{connector.id}"))
        properties = {
            "category": CATEGORIES[connector.kind],
            "direction": "directed" if connector.direction else "undirected",
            "origin": refs[0] if refs else None,
            "intermediary": refs[1:-1] or None,
            "destination": refs[-1] if len(refs) > 1 else None,
            "hours": None,
            EXTRA: _degrees(site, connector),
        }
        found.append(
            {
                "id": ident,
                "type": "Feature",
                "feature_type": "relationship",
                "geometry": None,
                "properties": properties,
            }
        )
    return found


def _unit_of(
    site: Site,
    connector: Connector,
    floor: int,
    x: float,
    y: float,
    unit_id: Callable[[Site, Floor, Unit, int], str],
) -> str:
    """Id of the unit of a connector on a floor: that of its own id, else the nearest of its kind, or none."""
    import shapely

    storey, place = site.floors[floor], shapely.Point(x, y)
    kind = [(i, u) for i, u in enumerate(storey.units) if KINDS.get(u.category) is connector.kind]
    named = [(i, u) for i, u in kind if u.id == connector.id]
    near = [(float(to_shapely([u.polygon]).distance(place)), i, u) for i, u in kind]
    close = [(i, u) for distance, i, u in sorted(near, key=lambda item: item[:2]) if distance <= NEAR]
    for i, unit in [*named, *close]:
        return unit_id(site, storey, unit, i)
    return ""


def _degrees(site: Site, connector: Connector) -> dict[str, Any]:
    """Entry of a connector in degrees."""
    entry = connector_entry(connector, site.floor_names)
    for at, landing in zip(entry["landings"], connector.landings, strict=True):
        lonlat = site.floors[landing.floor].to_lonlat([landing.x, landing.y])
        at["x"], at["y"] = np.round(lonlat, DIGITS).tolist()
    if connector.footprint is not None:
        lowest = site.floors[connector.floors[0]]
        entry["footprint"] = np.round(lowest.to_lonlat(connector.footprint), DIGITS).tolist()
    return entry


def _moved(entry: Mapping[str, Any], to_xy: Callable[[Any], Array]) -> dict[str, Any]:
    """Entry with its degrees as metres."""
    landings = [
        {"floor": at["floor"], **dict(zip(("x", "y"), to_xy([at["x"], at["y"]]).tolist(), strict=True))}
        for at in entry["landings"]
    ]
    ring = entry.get("footprint")
    return {
        **entry,
        "landings": landings,
        "footprint": None if ring is None else to_xy(np.array(ring, dtype=np.float64)).tolist(),
    }
