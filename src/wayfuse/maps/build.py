"""Build a floor from its polygons: walls, walkable mask and wall index are derived here, once."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from wayfuse.core.errors import MapError
from wayfuse.core.frames import GeoAnchor
from wayfuse.core.types import Array
from wayfuse.maps.geometry import edges, free_space, normalise_walls, rasterise, ring_walls
from wayfuse.maps.site import STOREY_HEIGHT, Floor, Polygon, Unit
from wayfuse.maps.walls import WallIndex

__all__ = ["build_floor", "nominal_elevation"]


def nominal_elevation(level: int, *, has_ground: bool = False) -> float:
    """Elevation (m) of a level where the plan gives none: 0 for F1, or for level 0 where there is one."""
    return STOREY_HEIGHT * (level - 1 if level > 0 and not has_ground else level)


def build_floor(
    name: str,
    level: int,
    outline: Sequence[Polygon],
    units: Sequence[Unit] = (),
    *,
    walls: Array | None = None,
    closed: Sequence[Polygon] | None = None,
    width: float | None = None,
    height: float | None = None,
    elevation: float | None = None,
    anchor: GeoAnchor | None = None,
    doors: Array | None = None,
) -> Floor:
    """Floor of an outline and its units (m).

    Parameters
    ----------
    outline, units : valid polygons (see `wayfuse.maps.geometry.clean_polygons`).
    walls : (w, 4) m; without them every edge of the outline and of a unit is a wall.
    closed : areas nobody walks in; without them every unit is one, drawn so inexactly that walkable space is
        widened into it. With them the plan is one of thin walls: people walk in all other units, nothing is
        widened, and each wall is a barrier too.
    width, height : extent of the frame; without them the far corner of the outline.
    elevation : m; without it nominal by level.
    doors : (d, 4) m, clear widths of doors; without them none are known.

    Raises
    ------
    MapError : there is no outline.
    """
    if not outline:
        raise MapError(f"floor {name} has no outline", remedy="give at least one polygon")
    corner = np.max([p.exterior.max(axis=0) for p in outline], axis=0)
    shapes = [unit.polygon for unit in units]
    segments = ring_walls([*outline, *shapes]) if walls is None else normalise_walls(walls)
    if closed is None:
        free = free_space(outline, shapes)
        barriers = edges(free)
    else:
        free = free_space(outline, closed, widening=0.0)
        barriers = normalise_walls(np.concatenate([segments, edges(free)]))
    return Floor(
        name=name,
        level=level,
        width=float(corner[0]) if width is None else width,
        height=float(corner[1]) if height is None else height,
        elevation=nominal_elevation(level) if elevation is None else elevation,
        outline=tuple(outline),
        units=tuple(units),
        walls=segments,
        barriers=barriers,
        walkable=rasterise(free),
        wall_index=WallIndex.build(segments),
        barrier_index=WallIndex.build(barriers),
        anchor=anchor,
        doors=np.empty((0, 4)) if doors is None else normalise_walls(doors),
    )
