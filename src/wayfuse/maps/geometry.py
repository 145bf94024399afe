"""Polygons in, walls and walkable space out: the part of building a site that needs a geometry library.

Only importers come here; a saved site is loaded without it.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from wayfuse.core.types import Array
from wayfuse.maps.site import Polygon
from wayfuse.maps.walkable import CELL, WIDENING, Walkable

__all__ = [
    "RESOLUTION",
    "clean_polygons",
    "edges",
    "free_space",
    "from_shapely",
    "normalise_walls",
    "rasterise",
    "ring_walls",
]

RESOLUTION = 1e-3  # m, coordinates are rounded to this: finer than any plan, and readable in a file
SMOOTHNESS = 0.05  # m, rounded corners of the walkable space are drawn to this
NARROWEST = 0.2  # m, a gap between two units narrower than this is a drawing error, not a passage


def clean_polygons(rings: Sequence[Array]) -> tuple[tuple[Polygon, ...], str]:
    """Valid polygons of one drawn polygon (exterior ring first, then holes), and what had to be repaired.

    Parameters
    ----------
    rings : (k, 2) m each, closed or not.

    Returns
    -------
    polygons : none where the rings enclose nothing; several where a self-crossing ring falls apart.
    fault : empty, or why the polygon was not valid as drawn.
    """
    import shapely

    rings = [_rounded(ring) for ring in rings]
    if not rings or any(len(ring) < 3 or not np.all(np.isfinite(ring)) for ring in rings):
        return (), "fewer than three points, or coordinates that are not numbers"
    drawn = shapely.Polygon(rings[0], [*rings[1:]])
    fault = "" if drawn.is_valid else str(shapely.is_valid_reason(drawn))
    sound = drawn if drawn.is_valid else shapely.make_valid(drawn)
    polygons = from_shapely(sound)
    return polygons, fault or ("" if polygons else "encloses no area")


def from_shapely(shape: Any) -> tuple[Polygon, ...]:
    """The polygons in a shapely geometry; lines and points are dropped."""
    from shapely import get_parts
    from shapely.geometry.polygon import orient

    found: list[Polygon] = []
    for part in get_parts(shape, return_index=False):
        if part.geom_type == "GeometryCollection" or part.geom_type.startswith("Multi"):
            found += from_shapely(part)
        elif part.geom_type == "Polygon" and part.area > RESOLUTION:
            ring = orient(part)
            holes = tuple(np.asarray(hole.coords)[:, :2] for hole in ring.interiors)
            found.append(Polygon(np.asarray(ring.exterior.coords)[:, :2], holes))
    return tuple(found)


def _union(polygons: Iterable[Polygon]) -> Any:
    import shapely

    return shapely.union_all([shapely.Polygon(p.exterior, [*p.holes]) for p in polygons])


def free_space(outline: Iterable[Polygon], units: Iterable[Polygon], *, widening: float = WIDENING) -> Any:
    """Outline minus units, without slits, widened (m) inside the outline: shapely geometry (m)."""
    whole: Any = _union(outline)
    free = whole.difference(_union(units))
    opened = free.buffer(-0.5 * NARROWEST, join_style="mitre").buffer(0.5 * NARROWEST + widening)
    return opened.intersection(whole)


def rasterise(shape: Any, cell: float = CELL) -> Walkable:
    """Mask of the cells whose centre lies in a shapely geometry (m)."""
    import shapely

    if shape.is_empty:
        return Walkable((0.0, 0.0), cell, np.zeros((1, 1), np.uint8))
    x0, y0, x1, y1 = shape.bounds
    i0, j0 = int(np.floor(x0 / cell)), int(np.floor(y0 / cell))
    nx, ny = int(np.ceil(x1 / cell)) - i0, int(np.ceil(y1 / cell)) - j0
    shapely.prepare(shape)
    x, y = np.meshgrid((i0 + np.arange(nx) + 0.5) * cell, (j0 + np.arange(ny) + 0.5) * cell)
    mask = np.asarray(shapely.contains_xy(shape, x, y), dtype=np.uint8)
    return Walkable((i0 * cell, j0 * cell), cell, mask)


def edges(shape: Any) -> Array:
    """Edges (w, 4) m of a shapely geometry, drawn with as few as `SMOOTHNESS` allows."""
    parts = from_shapely(shape.simplify(SMOOTHNESS))
    return ring_walls([Polygon(*(_rounded(p.exterior), tuple(_rounded(h) for h in p.holes))) for p in parts])


def _rounded(ring: Array) -> Array:
    return np.asarray(np.round(ring / RESOLUTION) * RESOLUTION)


def ring_walls(polygons: Iterable[Polygon]) -> Array:
    """Walls along every ring of some polygons: (w, 4) m, each once, its lower (x, y) end first."""
    segments = [np.hstack([ring[:-1], ring[1:]]) for p in polygons for ring in p.rings]
    if not segments:
        return np.empty((0, 4))
    return normalise_walls(np.concatenate(segments))


def normalise_walls(walls: Array) -> Array:
    """(w, 4) m without points and repeats, each with its lower (x, then y) end first, in ascending order."""
    walls = np.asarray(walls, dtype=np.float64).reshape(-1, 4)
    swap = (walls[:, 0] > walls[:, 2]) | ((walls[:, 0] == walls[:, 2]) & (walls[:, 1] > walls[:, 3]))
    ordered = np.where(swap[:, None], walls[:, [2, 3, 0, 1]], walls)
    long = np.hypot(ordered[:, 2] - ordered[:, 0], ordered[:, 3] - ordered[:, 1]) >= 0.5 * RESOLUTION
    return np.unique(ordered[long], axis=0) if np.any(long) else np.empty((0, 4))
