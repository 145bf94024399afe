"""Import a site of the Indoor Location Competition 2.0 sample ("ms-indoor"): one folder per floor.

``DIR/F1/floor_info.json`` gives the size of the floor's picture in metres, ``DIR/F1/geojson_map.json`` its
outline (first feature) and its units in WGS84 degrees; waypoints of the recordings are metres of that
picture, origin at the lower left corner, y up. The picture is exactly the bounding box of the outline, which
fixes the frame: x and y are linear in longitude and latitude, and the outline's box is (0, 0)-(width,
height). The size agrees with the box on a sphere of 6378137 m (Web-Mercator metres times cos(latitude))
within a millimetre; that difference is reported as the residual of each floor. Against the WGS84 ellipsoid
such metres are 0.1 % short in x and 0.4 % long in y.

What the plan does not hold: doors, stairs, lifts. Every edge of a unit is a wall.
"""

from __future__ import annotations

import html
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from wayfuse.core.errors import MapError
from wayfuse.core.frames import GeoAnchor
from wayfuse.core.types import Array
from wayfuse.maps.build import build_floor, nominal_elevation
from wayfuse.maps.importers.report import FloorReport, ImportReport, Notes
from wayfuse.maps.importers.rooms import cleaned
from wayfuse.maps.levels import parse_level, sort_key
from wayfuse.maps.problems import KEY, Problem, problems_text
from wayfuse.maps.site import Floor, Polygon, Site, Unit
from wayfuse.maps.walls import LARGEST

__all__ = ["import_site"]

SPHERE_RADIUS = 6378137.0  # m, of Web-Mercator
RESIDUAL_LIMIT = 1.0  # m, a larger disagreement of picture and outline is reported
OUTLINE_MARGIN = 20.0  # m a unit may reach over the outline's box; beyond, its coordinates are wrong

# Categories are opaque ids; these are read off the names of the units that carry them. The last wins.
CATEGORIES = {
    "5d3578421e5fc90682d9fa2c": "closed area",
    "5d357b7f0c02a37d6cc84c8a": "void",
    "5d357b54fe24ed7880f1303a": "toilet",
    "5d357a28ccd5d652c76d8793": "vacant",
    "5d3577c8b7271665f903b6e4": "auxiliary",
    "5d357bc00d3c1514c7107b6b": "parking bay",
    "5d3579f37ea32247d2a96083": "rest area",
    "5d35733bdb07255e495599ac": "food",
    "5d35733edb07255e495599ed": "shop",
    "5d357344db07255e49559a75": "leisure",
    "5d357342db07255e49559a41": "service",
    "5d35734bdb07255e49559b0b": "education",
}


@dataclass(frozen=True, slots=True)
class _Frame:
    """Bounding box of the outline in degrees against the picture in metres."""

    west: float
    south: float
    east: float
    north: float
    width: float
    height: float

    def to_xy(self, lonlat: Array) -> Array:
        size = np.array([self.width, self.height])
        span = np.array([self.east - self.west, self.north - self.south])
        return np.asarray((lonlat - (self.west, self.south)) / span * size)

    @property
    def anchor(self) -> GeoAnchor:
        x, y = (self.east - self.west) / self.width, (self.north - self.south) / self.height
        return GeoAnchor((self.west, self.south), ((x, 0.0), (0.0, y)))

    @property
    def residual(self) -> float:
        """Larger of the differences between picture and outline (m)."""
        metre = np.deg2rad(SPHERE_RADIUS)
        across = (self.east - self.west) * metre * np.cos(np.deg2rad(0.5 * (self.south + self.north)))
        along = (self.north - self.south) * metre
        return float(max(abs(across - self.width), abs(along - self.height)))


def import_site(folder: Path) -> tuple[Site, ImportReport]:
    """Site of a folder that holds one folder per floor (B1, F1, ...), and what was met on the way.

    A floor without a plan becomes a rectangle without units or anchor; a unit that cannot be drawn is
    repaired or left out; both are warnings.

    Raises
    ------
    MapError : there is no floor, or a floor's size or plan cannot be read; names the file and the remedy.
    """
    folder = Path(folder)
    if not folder.is_dir():
        raise MapError("no such folder", where=folder, remedy="name the folder that holds B1, F1, ...")
    folders = [p for p in folder.iterdir() if p.is_dir() and (p / "floor_info.json").exists()]
    planned = {p.parent for p in folder.glob("*/geojson_map.json")} - set(folders)
    if planned:
        raise MapError(
            "missing", where=min(planned) / "floor_info.json", remedy="it holds width and height in metres"
        )
    if not folders:
        raise MapError(
            "holds no floor: no */floor_info.json",
            where=folder,
            remedy="name the folder that holds B1, F1, ...",
        )
    folders.sort(key=lambda p: sort_key(p.name))
    levels, warnings = _levels([p.name for p in folders])
    elevations = [nominal_elevation(level, has_ground=0 in levels) for level in levels]
    built = [_import_floor(*floor) for floor in zip(folders, levels, elevations, strict=True)]
    site = Site(
        name=folder.resolve().name,
        floors=tuple(floor for floor, _, _ in built),
        provenance={
            "importer": "ms-indoor",
            "source": folder.resolve().name,
            "frame": "outline box to picture size",
            KEY: problems_text(problem for _, _, noted in built for problem in noted),
        },
    )
    return site, ImportReport(tuple(report for _, report, _ in built), tuple(warnings))


def _levels(names: list[str]) -> tuple[list[int], list[str]]:
    """Level of each floor in order; a name that does not say continues above the highest."""
    levels: list[int] = []
    warnings = []
    for name in names:
        level = parse_level(name)
        if level is None:
            level = max([0, *levels]) + 1
            warnings.append(f"floor name {name!r} does not say its level: taken as {level}")
        levels.append(level)
    return levels, warnings


def _import_floor(folder: Path, level: int, elevation: float) -> tuple[Floor, FloorReport, list[Problem]]:
    notes = Notes(folder.name)
    width, height = _size(folder / "floor_info.json")
    plan = folder / "geojson_map.json"
    if not plan.exists():
        notes.append("no geojson_map.json: the outline is the whole picture, without units and WGS84 anchor")
        corners = np.array([[0.0, 0.0], [width, 0.0], [width, height], [0.0, height]])
        outline, frame = cleaned([corners], "outline", notes), None
        units: list[Unit] = []
    else:
        outline, units, frame = _plan(plan, width, height, notes)
    floor = build_floor(
        folder.name,
        level,
        outline,
        units,
        width=width,
        height=height,
        elevation=elevation,
        anchor=None if frame is None else frame.anchor,
    )
    if not floor.walkable.mask.any():
        notes.append("no walkable space: units cover the whole outline")
    report = FloorReport(folder.name, None if frame is None else frame.residual, tuple(notes))
    return floor, report, notes.problems


def _size(path: Path) -> tuple[float, float]:
    info = _read_json(path)
    try:
        width, height = float(info["map_info"]["width"]), float(info["map_info"]["height"])
    except (KeyError, TypeError, ValueError) as error:
        raise MapError(
            "has no map_info.width and map_info.height", where=path, remedy="metres, as numbers"
        ) from error
    if not (0.0 < width < LARGEST and 0.0 < height < LARGEST):
        raise MapError(
            f"size {width} x {height} m is impossible", where=path, remedy=f"metres, up to {LARGEST:.0f}"
        )
    return width, height


def _plan(
    path: Path, width: float, height: float, notes: Notes
) -> tuple[tuple[Polygon, ...], list[Unit], _Frame]:
    collection = _read_json(path)
    features = collection.get("features") if isinstance(collection, dict) else None
    if not isinstance(features, list) or not features:
        raise MapError(
            "has no features", where=path, remedy="fetch the plan anew, or remove it to import a rectangle"
        )
    drawn = _polygons(features[0])
    if not drawn:
        raise MapError(
            "its first feature is not the polygon of the floor's outline",
            where=path,
            remedy="fetch the plan anew",
        )
    points = np.concatenate([rings[0] for rings in drawn])
    (west, south), (east, north) = points.min(axis=0), points.max(axis=0)
    if not (east > west and north > south):
        raise MapError("the outline has no extent", where=path, remedy="fetch the plan anew")
    frame = _Frame(float(west), float(south), float(east), float(north), width, height)
    if frame.residual > RESIDUAL_LIMIT:
        notes.append(
            f"picture and outline disagree by {frame.residual:.1f} m: the frame is stretched to the picture"
        )
    outline: list[Polygon] = []
    for rings in drawn:
        outline += cleaned([frame.to_xy(ring) for ring in rings], "outline", notes)
    if not outline:
        raise MapError("the outline encloses no area", where=path, remedy="fetch the plan anew")
    units = [unit for i, feature in enumerate(features[1:], 1) for unit in _units(feature, i, frame, notes)]
    return tuple(outline), units, frame


def _units(feature: Any, number: int, frame: _Frame, notes: Notes) -> list[Unit]:
    table = feature if isinstance(feature, dict) else {}
    held = table.get("properties")
    properties = held if isinstance(held, dict) else {}
    ident = str(properties.get("id") or table.get("id") or number)
    drawn = _polygons(feature)
    if not drawn:
        notes.add("faulty-polygon", f"unit {ident}", "no polygon with coordinates on the earth, left out")
    units = []
    for rings in drawn:
        for polygon in cleaned([frame.to_xy(ring) for ring in rings], f"unit {ident}", notes):
            low, high = polygon.exterior.min(axis=0), polygon.exterior.max(axis=0)
            if np.any(low < -OUTLINE_MARGIN) or np.any(
                high > np.add((frame.width, frame.height), OUTLINE_MARGIN)
            ):
                notes.add("faulty-polygon", f"unit {ident}", "lies off the floor, left out")
                continue
            units.append(
                Unit(ident, html.unescape(str(properties.get("name") or "")), _category(properties), polygon)
            )
    return units


def _category(properties: dict[str, Any]) -> str:
    ids = properties.get("category")
    if not isinstance(ids, list):
        return "unit"
    return next((CATEGORIES[i] for i in reversed(ids) if isinstance(i, str) and i in CATEGORIES), "unit")


def _polygons(feature: Any) -> list[list[Array]]:
    """Rings in degrees of each polygon of a feature; empty where it is none, or not a place on the earth."""
    try:
        geometry = feature["geometry"]
        parts = {"Polygon": [geometry["coordinates"]], "MultiPolygon": geometry["coordinates"]}[
            geometry["type"]
        ]
        rings = [[np.array([p[:2] for p in ring], dtype=np.float64) for ring in part] for part in parts]
    except (KeyError, TypeError, ValueError, IndexError):
        return []
    sound = all(part and all(_on_earth(ring) for ring in part) for part in rings)
    return [[_degrees(ring) for ring in part] for part in rings] if sound else []


def _on_earth(ring: Array) -> bool:
    """Whether a ring has points whose coordinates could be degrees or Web-Mercator metres."""
    half = np.pi * SPHERE_RADIUS
    return ring.ndim == 2 and ring.shape[1] == 2 and len(ring) > 0 and bool(np.all(np.abs(ring) <= half))


def _degrees(points: Array) -> Array:
    """Degrees of coordinates that may be Web-Mercator metres (the plans declare them, but hold degrees)."""
    if np.abs(points[:, 0]).max() <= 180.0 and np.abs(points[:, 1]).max() <= 90.0:
        return points
    lat = np.arctan(np.sinh(points[:, 1] / SPHERE_RADIUS))
    return np.asarray(np.rad2deg(np.column_stack([points[:, 0] / SPHERE_RADIUS, lat])))


def _read_json(path: Path) -> Any:
    try:
        return json.loads(path.read_text(encoding="utf-8-sig"))
    except (OSError, ValueError) as error:
        raise MapError(f"cannot be read: {error}", where=path, remedy="fetch the data anew") from error
