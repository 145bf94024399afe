"""The plan of a floor for the map in the browser: GeoJSON features, and the frame that puts metres on the map.

A floor without a place on earth is drawn about longitude and latitude 0: the map needs degrees, people need shapes.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from wayfuse.core.frames import GeoAnchor
from wayfuse.core.types import Array
from wayfuse.maps.site import Floor, Polygon, Site
from wayfuse.service.zones import Zone

__all__ = ["floor_features", "floor_frame", "frame_of", "zone_features"]

_DECIMALS = 8  # of degrees: about 1 mm
_NOWHERE = GeoAnchor.from_origin(0.0, 0.0)
Json = dict[str, Any]


def frame_of(floor: Floor) -> GeoAnchor:
    """The anchor of a floor, or one that draws it about (0, 0)."""
    return _NOWHERE if floor.anchor is None else floor.anchor


def floor_frame(site: Site, index: int) -> Json:
    """What the browser needs to put metres of a floor on the map.

    ``origin`` (lon, lat) degrees and ``matrix`` (2, 2) degrees per metre are those of `GeoAnchor`.
    """
    floor = site.floors[index]
    frame = frame_of(floor)
    return {
        "floor": index,
        "level": floor.name,
        "elevation_m": floor.elevation,
        "width_m": floor.width,
        "height_m": floor.height,
        "is_on_earth": floor.anchor is not None,
        "origin": list(frame.origin),
        "matrix": [list(row) for row in frame.matrix],
    }


def floor_features(site: Site, index: int) -> Json:
    """A GeoJSON FeatureCollection of a floor: ``kind`` is outline, unit, wall, door, connector or landing."""
    floor = site.floors[index]
    frame = frame_of(floor)
    features = [_feature("outline", _polygon(frame, p), {}) for p in floor.outline]
    for unit in floor.units:
        said = {"id": unit.id, "name": unit.name, "category": unit.category}
        features.append(_feature("unit", _polygon(frame, unit.polygon), said))
    features += _lines("wall", frame, floor.walls) + _lines("door", frame, floor.doors)
    features += _connectors(site, index, frame)
    return {"type": "FeatureCollection", "features": features}


def zone_features(site: Site, zones: Iterable[Zone]) -> Json:
    """A GeoJSON FeatureCollection of rooms and geofences; ``kind`` is room or geofence."""
    features = []
    for zone in zones:
        rings = _rings(frame_of(site.floors[zone.floor]), zone.rings)
        said = {"id": zone.id, "name": zone.name, "floor": zone.floor, "level": site.floors[zone.floor].name}
        kind = "geofence" if zone.is_fence else "room"
        features.append(_feature(kind, {"type": "Polygon", "coordinates": rings}, said))
    return {"type": "FeatureCollection", "features": features}


def _connectors(site: Site, index: int, frame: GeoAnchor) -> list[Json]:
    found = []
    for connector in site.connectors:
        landing = connector.landing(index)
        if landing is None:
            continue
        levels = [site.floors[i].name for i in connector.floors]
        said = {
            "id": connector.id,
            "name": connector.name,
            "category": connector.kind.value,
            "levels": levels,
        }
        if connector.footprint is not None:
            ring = connector.footprint + site.shift(connector.floors[0], index)
            found.append(_feature("connector", _polygon(frame, Polygon(ring)), said))
        place = _degrees(frame, (landing.x, landing.y))
        found.append(_feature("landing", {"type": "Point", "coordinates": place.tolist()}, said))
    return found


def _lines(kind: str, frame: GeoAnchor, segments: Array) -> list[Json]:
    """Segments (n, 4) m as one feature."""
    if not len(segments):
        return []
    lines = _degrees(frame, np.asarray(segments).reshape(-1, 2, 2)).tolist()
    return [_feature(kind, {"type": "MultiLineString", "coordinates": lines}, {})]


def _polygon(frame: GeoAnchor, polygon: Polygon) -> Json:
    return {"type": "Polygon", "coordinates": _rings(frame, polygon.rings)}


def _rings(frame: GeoAnchor, rings: Iterable[Array]) -> list[Any]:
    return [_degrees(frame, ring).tolist() for ring in rings]


def _degrees(frame: GeoAnchor, xy: ArrayLike) -> Array:
    return np.round(frame.to_lonlat(xy), _DECIMALS)


def _feature(kind: str, geometry: Json, said: Json) -> Json:
    return {"type": "Feature", "geometry": geometry, "properties": {"kind": kind, **said}}
