"""Plans with rooms people walk in: walls are drawn edges minus openings, the outline is what is drawn.

Shared by the importers of plans that know doors (OpenStreetMap, IMDF, traced images).
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from wayfuse.core.errors import MapError
from wayfuse.core.frames import GeoAnchor, metres_per_degree
from wayfuse.core.types import Array
from wayfuse.maps.geometry import clean_polygons, from_shapely, normalise_walls
from wayfuse.maps.importers.report import Notes
from wayfuse.maps.site import Polygon
from wayfuse.maps.walls import LARGEST

__all__ = [
    "DOOR_WIDTH",
    "anchor_residual",
    "chords",
    "cleaned",
    "cut_walls",
    "local_anchor",
    "outline_of",
    "to_shapely",
]

DOOR_WIDTH = 0.9  # m, clear width of a door where the plan does not say: a common single leaf
WALL_GAP = 0.5  # m, rooms drawn this far apart have a wall between them, not the open air
DETAIL = 1e-3  # m, walls are cut to this


def local_anchor(lonlat: Array, where: object) -> GeoAnchor:
    """Frame of a site drawn in degrees: x east, y north, origin at the south-west corner of its points.

    Raises
    ------
    MapError : the points are not on the earth, or span more than a building.
    """
    bad = lonlat.size == 0 or not np.all(np.isfinite(lonlat))
    if bad or np.any(np.abs(lonlat) > (180.0, 89.0)):
        raise MapError("coordinates are not degrees", where=where, remedy="use WGS84 longitude, latitude")
    anchor = GeoAnchor.from_origin(float(lonlat[:, 0].min()), float(lonlat[:, 1].min()))
    if float(np.max(anchor.to_xy(lonlat.max(axis=0)))) > LARGEST:
        raise MapError(f"spans more than {LARGEST:.0f} m", where=where, remedy="cut out one building")
    return anchor


def anchor_residual(anchor: GeoAnchor, size: Array) -> float:
    """How far (m) the frame is off the ellipsoid in its far corner ``size`` (m): degrees shrink northwards."""
    lon, lat = anchor.to_lonlat(size)
    east, north = metres_per_degree(float(lat))
    found = np.array([(lon - anchor.origin[0]) * east, (lat - anchor.origin[1]) * north])
    return float(np.max(np.abs(found - size)))


def cleaned(rings: Sequence[Array], what: str, notes: Notes) -> tuple[Polygon, ...]:
    """Valid polygons of drawn rings (m); what had to be repaired or left out is added to ``notes``."""
    polygons, fault = clean_polygons(rings)
    if fault:
        crossing = "intersection" in fault.casefold()
        kind = "self-crossing-polygon" if crossing else "faulty-polygon"
        notes.add(kind, what, f"{fault}, {'repaired' if polygons else 'left out'}")
    return polygons


def to_shapely(polygons: Iterable[Polygon]) -> Any:
    """Union of polygons as a shapely geometry."""
    import shapely

    return shapely.union_all([shapely.Polygon(p.exterior, [*p.holes]) for p in polygons])


def outline_of(polygons: Iterable[Polygon], gap: float = WALL_GAP) -> tuple[Polygon, ...]:
    """What some polygons cover together, with the walls between them (gaps up to ``gap`` m)."""
    half = 0.5 * gap
    whole = to_shapely(polygons)
    closed = whole.buffer(half, join_style="mitre").buffer(-half, join_style="mitre").union(whole)
    return from_shapely(_snapped(closed))


def cut_walls(polygons: Iterable[Polygon], lines: Iterable[Array], openings: Iterable[Any]) -> Array:
    """Walls (w, 4) m along the rings of polygons and along lines (k, 2), without the parts in openings.

    Parameters
    ----------
    openings : shapely areas; a door at a point is a disc of its width.
    """
    import shapely

    rings = [ring for polygon in polygons for ring in polygon.rings]
    drawn = [shapely.LineString(line) for line in [*rings, *lines] if len(line) > 1]
    if not drawn:
        return np.empty((0, 4))
    solid = shapely.union_all(drawn).difference(shapely.union_all(list(openings)))
    return normalise_walls(np.concatenate([_segments(part) for part in shapely.get_parts(_snapped(solid))]))


def chords(lines: Iterable[Array], openings: Sequence[Any]) -> list[Array | None]:
    """Chord (4,) m that each opening (a shapely area) cuts out of drawn lines (k, 2), None where it meets none."""
    import shapely

    drawn = [shapely.LineString(line) for line in lines if len(line) > 1]
    tree = shapely.STRtree(drawn)
    found: list[Array | None] = []
    for opening in openings:
        cut = [drawn[i].intersection(opening) for i in tree.query(opening, predicate="intersects")]
        parts = [p for p in shapely.get_parts(cut) if p.geom_type == "LineString" and p.length > DETAIL]
        merged: Any = shapely.get_parts(shapely.line_merge(shapely.union_all(parts))) if parts else []
        longest = max(merged, key=lambda part: float(part.length), default=None)
        ends = None if longest is None else np.asarray(longest.coords)[[0, -1], :2].ravel()
        found.append(ends if ends is not None and np.hypot(*(ends[2:] - ends[:2])) > DETAIL else None)
    return found


def _segments(line: Any) -> Array:
    points = np.asarray(line.coords)[:, :2].reshape(-1, 2)
    return np.hstack([points[:-1], points[1:]]).reshape(-1, 4)


def _snapped(shape: Any) -> Any:
    import shapely

    return shapely.set_precision(shape, DETAIL)
