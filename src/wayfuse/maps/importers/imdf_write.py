"""Write a site as an Indoor Mapping Data Format 1.0.0 archive (OGC 20-094).

Written: manifest, address, venue, building, footprint, level, unit, opening and relationship. An opening is a door,
or any stretch of a unit's edge without wall (a door lies on one too); a relationship is a connector and joins its
units on the floors it serves. What IMDF has no word for goes into properties of our own ("wayfuse:id",
"wayfuse:category", ...), which other readers ignore.
Free-standing walls (`indoor=wall`) have no place in IMDF and are left out.
"""

from __future__ import annotations

import json
import uuid
import zipfile
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from wayfuse.core.errors import MapError
from wayfuse.core.types import Array
from wayfuse.maps.importers.imdf import CONNECTORS
from wayfuse.maps.importers.imdf_relationships import write_connectors
from wayfuse.maps.importers.rooms import outline_of, to_shapely
from wayfuse.maps.site import Floor, Polygon, Site, Unit

__all__ = ["write_archive"]

CATEGORIES = {
    "area": "unenclosedarea",
    "corridor": "walkway",
    "food": "foodservice",
    "toilet": "restroom",
    "void": "opentobelow",
    "wall": "structure",
}  # of our own; names IMDF knows are kept
KNOWN = CONNECTORS | {
    *(
        "auditorium",
        "classroom",
        "column",
        "conferenceroom",
        "foodservice",
        "kitchen",
        "laboratory",
        "library",
    ),
    *("lobby", "office", "opentobelow", "platform", "restroom", "room", "storage", "structure", "theater"),
    *("unenclosedarea", "walkway"),
}
DIGITS = 9  # of degrees: 0.1 mm
OPENED = 0.03  # m, an edge with no wall this near is open
NARROWEST = 0.1  # m, a shorter stretch without wall is no opening


def write_archive(site: Site, path: Path, created: str) -> None:
    """Write a site; the same site and date give the same bytes.

    Parameters
    ----------
    created : date and time of the archive, ISO 8601 ("2025-01-31T12:00:00Z").

    Raises
    ------
    MapError : a floor has no WGS84 anchor, or the file cannot be written.
    """
    venue, building, address = (_id(site.name, kind) for kind in ("venue", "building", "address"))
    label, belongs = {"en": site.name}, {"address_id": address, "building_ids": [building]}
    plain = {"restriction": None, "alt_name": None, "display_point": None}
    levels, units, openings = [], [], []
    for floor in site.floors:
        level = _id(site.name, "level", floor.name)
        levels.append(_level(floor, level, belongs))
        units += _units(site, floor, level)
        openings += _openings(site, floor, level)
    ground = site.floors[site.reference]
    spot = {"type": "Point", "coordinates": _degrees(ground, _middle(ground)[None])[0]}
    venue_properties = {"category": "unspecified", "name": label, **plain, "display_point": spot}
    unset = {"hours": None, "phone": None, "website": None, "address_id": address}
    footprint = {"category": "ground", "name": label, "building_ids": [building]}
    files: dict[str, list[dict[str, Any]]] = {
        "address": [_feature(address, "address", None, _address(site.name))],
        "venue": [_feature(venue, "venue", _area(ground, ground.outline), {**venue_properties, **unset})],
        "building": [
            _feature(
                building,
                "building",
                None,
                {"category": "unspecified", "name": label, **plain, "address_id": address},
            )
        ],
        "footprint": [
            _feature(
                _id(site.name, "footprint"),
                "footprint",
                _area(ground, outline_of(ground.outline)),
                footprint,
            )
        ],
        "level": levels,
        "unit": units,
        "opening": openings,
        "relationship": write_connectors(site, _unit_id),
    }
    manifest = {"version": "1.0.0", "created": created, "language": "en", "generated_by": "wayfuse"}
    documents: dict[str, Any] = {"manifest.json": manifest}
    for kind, features in files.items():
        documents[f"{kind}.geojson"] = {"type": "FeatureCollection", "name": kind, "features": features}
    _zip(Path(path), documents)


def _zip(path: Path, documents: dict[str, Any]) -> None:
    try:
        with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
            for name, document in documents.items():
                member = zipfile.ZipInfo(name, (1980, 1, 1, 0, 0, 0))  # no clock: same site, same bytes
                member.compress_type = zipfile.ZIP_DEFLATED
                archive.writestr(member, json.dumps(document, ensure_ascii=False))
    except OSError as error:
        raise MapError(f"cannot write: {error.strerror}", where=path, remedy="name another file") from error


def _id(*parts: str) -> str:
    """A UUID that says the same for the same thing."""
    return str(uuid.uuid5(uuid.NAMESPACE_OID, "/".join(["wayfuse", *parts])))


def _unit_id(site: Site, floor: Floor, unit: Unit, number: int) -> str:
    return _id(site.name, "unit", floor.name, unit.id, str(number))


def _feature(
    ident: str, kind: str, geometry: dict[str, Any] | None, properties: dict[str, Any]
) -> dict[str, Any]:
    return {
        "id": ident,
        "type": "Feature",
        "feature_type": kind,
        "geometry": geometry,
        "properties": properties,
    }


def _address(name: str) -> dict[str, Any]:
    # address, locality and country are required; a site knows none of them
    return {"address": name, "unit": None, "locality": "unknown", "province": None, "country": "ZZ"}


def _level(floor: Floor, ident: str, belongs: dict[str, Any]) -> dict[str, Any]:
    label = {"en": floor.name}
    properties = {
        "category": "unspecified",
        "restriction": None,
        "outdoor": False,
        "ordinal": floor.level,
        "name": label,
        "short_name": label,
        "display_point": None,
        **belongs,
        "wayfuse:elevation": float(floor.elevation),
    }
    return _feature(ident, "level", _area(floor, floor.outline), properties)


def _units(site: Site, floor: Floor, level: str) -> list[dict[str, Any]]:
    found = []
    walls = _drawn(floor).buffer(OPENED)
    for number, unit in enumerate(floor.units):
        own = CATEGORIES.get(unit.category, unit.category)
        properties = {
            "category": own if own in KNOWN else "unspecified",
            "restriction": None,
            "accessibility": None,
            "name": {"en": unit.name} if unit.name else None,
            "alt_name": None,
            "level_id": level,
            "display_point": None,
            "wayfuse:id": unit.id,
            "wayfuse:category": unit.category,
            "wayfuse:closed": not _is_walked(floor, unit),
            "wayfuse:enclosed": _is_enclosed(floor, unit, walls),
        }
        ident = _unit_id(site, floor, unit, number)
        found.append(_feature(ident, "unit", _area(floor, [unit.polygon]), properties))
    return found


def _drawn(floor: Floor) -> Any:
    import shapely

    return shapely.union_all(shapely.linestrings(floor.walls.reshape(-1, 2, 2)))


def _is_walked(floor: Floor, unit: Unit) -> bool:
    """Whether the middle of a unit is walkable."""
    spot = to_shapely([unit.polygon]).representative_point()
    return bool(floor.walkable.contains([spot.x], [spot.y])[0])


def _is_enclosed(floor: Floor, unit: Unit, walls: Any) -> bool:
    """Whether most of a unit's edge inside the outline (which is a wall anyhow) is wall."""
    outside = to_shapely(floor.outline).boundary.buffer(OPENED)
    inside = to_shapely([unit.polygon]).boundary.difference(outside)
    return bool(inside.intersection(walls).length > 0.5 * inside.length)


def _openings(site: Site, floor: Floor, level: str) -> list[dict[str, Any]]:
    import shapely

    walls = _drawn(floor).buffer(OPENED)
    edges = [to_shapely([u.polygon]).boundary for u in floor.units if _is_enclosed(floor, u, walls)]
    doors = [shapely.LineString(door) for door in floor.doors.reshape(-1, 2, 2)]
    bare = shapely.line_merge(shapely.union_all(edges).difference(walls))
    parts = [part for part in shapely.get_parts(bare) if part.length >= NARROWEST]
    found: list[dict[str, Any]] = []
    for number, part in enumerate([*doors, *parts]):
        points = np.asarray(part.coords)
        properties = {
            "category": "pedestrian",
            "accessibility": None,
            "access_control": None,
            "door": None,
            "name": None,
            "alt_name": None,
            "display_point": None,
            "level_id": level,
            "wayfuse:door": number < len(doors),
        }
        geometry = {"type": "LineString", "coordinates": _degrees(floor, points)}
        ident = _id(site.name, "opening", floor.name, str(len(found)))
        found.append(_feature(ident, "opening", geometry, properties))
    return found


def _area(floor: Floor, polygons: Iterable[Polygon]) -> dict[str, Any]:
    parts = [[_degrees(floor, ring) for ring in polygon.rings] for polygon in polygons]
    if len(parts) == 1:
        return {"type": "Polygon", "coordinates": parts[0]}
    return {"type": "MultiPolygon", "coordinates": parts}


def _degrees(floor: Floor, points: Array) -> list[Any]:
    found: list[Any] = np.round(floor.to_lonlat(points), DIGITS).tolist()
    return found


def _middle(floor: Floor) -> Array:
    spot = to_shapely(floor.outline).representative_point()
    return np.array([spot.x, spot.y])
