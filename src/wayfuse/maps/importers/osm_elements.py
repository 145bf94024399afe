"""Tagged shapes of OpenStreetMap, from its XML (`.osm`) or from GeoJSON with flat tags.

A closed way is a polygon and, where it stands for a wall, its ring is a line: the reader does not decide.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple
from xml.etree.ElementTree import Element as Node

import numpy as np

from wayfuse.core.errors import MapError
from wayfuse.core.types import Array
from wayfuse.maps.importers import geojson
from wayfuse.maps.importers.plan_file import parse_json, parse_xml, read_limited

__all__ = ["Element", "read_elements"]


class Element(NamedTuple):
    """A tagged shape: ``point`` (2,), ``line`` (k, 2) or ``polygons`` (rings of each), degrees."""

    id: str
    tags: Mapping[str, str]
    point: Array | None = None
    line: Array | None = None
    polygons: tuple[tuple[Array, ...], ...] = ()


def read_elements(path: Path, warnings: list[str]) -> list[Element]:
    """Tagged elements of an `.osm` or `.geojson` file, by id; what cannot be drawn is left out and named.

    Raises
    ------
    MapError : the file cannot be read, or is of another format.
    """
    suffix = path.suffix.casefold()
    if suffix in (".osm", ".xml"):
        found = _from_xml(parse_xml(read_limited(path), path), path, warnings)
    elif suffix in (".geojson", ".json"):
        found = _from_geojson(parse_json(read_limited(path), path), path, warnings)
    else:
        raise MapError(
            "neither .osm nor .geojson", where=path, remedy="convert it: `osmium cat FILE -o FILE.osm`"
        )
    return sorted(found, key=lambda element: element.id)


def _from_xml(root: Node, path: Path, warnings: list[str]) -> list[Element]:
    if root.tag != "osm":
        raise MapError(f"its root is <{root.tag}>, not <osm>", where=path, remedy="export OpenStreetMap XML")
    places = _places(root, warnings)
    ways = {way.get("id", ""): _points(way, places) for way in root.iter("way")}
    found = []
    for node in root:
        tags = {tag.get("k", ""): tag.get("v", "") for tag in node.iter("tag")}
        ident = f"{node.tag}/{node.get('id', '')}"
        if not tags:
            continue
        element = None
        if node.tag == "node" and node.get("id", "") in places:
            element = Element(ident, tags, point=places[node.get("id", "")])
        elif node.tag == "way":
            element = _way(ident, tags, ways[node.get("id", "")])
        elif node.tag == "relation" and tags.get("type") == "multipolygon":
            element = _relation(ident, tags, node, ways)
        if element is not None:
            found.append(element)
        elif {"indoor", "building:part"} & tags.keys():
            warnings.append(f"{ident}: not a whole shape in this file, left out")
    return found


def _places(root: Node, warnings: list[str]) -> dict[str, Array]:
    places = {}
    for node in root.iter("node"):
        try:
            place = np.array([float(node.get("lon", "")), float(node.get("lat", ""))])
        except ValueError:
            place = np.array([np.nan, np.nan])
        if np.all(np.abs(place) <= (180.0, 90.0)):
            places[node.get("id", "")] = place
        else:
            warnings.append(f"node/{node.get('id', '')}: not a place on the earth, left out")
    return places


def _points(way: Node, places: Mapping[str, Array]) -> Array | None:
    """Points of a way, None where one is not in the file (a way without a corner has another shape)."""
    refs = [nd.get("ref", "") for nd in way.iter("nd")]
    if len(refs) < 2 or any(ref not in places for ref in refs):
        return None
    return np.array([places[ref] for ref in refs])


def _way(ident: str, tags: Mapping[str, str], points: Array | None) -> Element | None:
    if points is None:
        return None
    if len(points) > 3 and np.array_equal(points[0], points[-1]):
        return Element(ident, tags, line=points, polygons=((points,),))
    return Element(ident, tags, line=points)


def _relation(
    ident: str, tags: Mapping[str, str], node: Node, ways: Mapping[str, Array | None]
) -> Element | None:
    import shapely

    lines: dict[str, list[Any]] = {"outer": [], "inner": []}
    for member in node.iter("member"):
        points = ways.get(member.get("ref", "")) if member.get("type") == "way" else None
        if points is None:
            return None
        role = "inner" if member.get("role") == "inner" else "outer"
        lines[role].append(shapely.LineString(points))
    outer, inner = (shapely.union_all(shapely.get_parts(_areas(lines[r]))) for r in ("outer", "inner"))
    parts = [p for p in shapely.get_parts(outer.difference(inner)) if p.geom_type == "Polygon"]
    if not parts:
        return None
    rings = tuple(tuple(np.asarray(r.coords) for r in (p.exterior, *p.interiors)) for p in parts)
    return Element(ident, tags, polygons=rings)


def _areas(lines: list[Any]) -> Any:
    import shapely

    return shapely.polygonize([shapely.union_all(lines)] if lines else [])


def _from_geojson(document: Any, path: Path, warnings: list[str]) -> list[Element]:
    features = document.get("features") if isinstance(document, dict) else None
    if not isinstance(features, list):
        raise MapError("is not a FeatureCollection", where=path, remedy="export GeoJSON from Overpass")
    found = []
    for number, feature in enumerate(features):
        held = feature.get("properties") if isinstance(feature, dict) else None
        tags = {str(k): str(v) for k, v in held.items()} if isinstance(held, dict) else {}
        ident = str((feature.get("id") if isinstance(feature, dict) else None) or tags.get("@id") or number)
        element = _shape(ident, tags, feature)
        if element is not None:
            found.append(element)
        elif "indoor" in tags:
            warnings.append(f"{ident}: no shape with coordinates on the earth, left out")
    return found


def _shape(ident: str, tags: Mapping[str, str], feature: Any) -> Element | None:
    if parts := geojson.polygons(feature):
        return Element(ident, tags, line=parts[0][0], polygons=parts)
    if (points := geojson.line(feature)) is not None:
        return Element(ident, tags, line=points)
    try:
        if feature["geometry"]["type"] == "Point":
            return Element(ident, tags, point=geojson.lonlat([feature["geometry"]["coordinates"]])[0])
    except (KeyError, TypeError, ValueError, IndexError):
        return None
    return None
