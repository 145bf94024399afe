"""A building as surfaces that waves meet: its walls drawn up to the next slab, and its slabs with their holes."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from wayfuse.core.types import Array, IntArray
from wayfuse.simulator.building import Building, Storey
from wayfuse.simulator.geometry import polygon_walls

__all__ = ["Surfaces", "slab_surfaces", "wall_surfaces"]


class Surfaces(NamedTuple):
    """Triangles (t, 3) of corners (v, 3) m."""

    corners: Array
    triangles: IntArray


def wall_surfaces(building: Building, ceiling: float) -> Surfaces:
    """All walls, from their storey's floor to the next one; those of the top storey are ``ceiling`` m high.

    The edges of a hole in the slab are railings, not walls.
    """
    tops = _tops(building, ceiling)
    parts = [_upright(_solid(s), s.elevation, top) for s, top in zip(building.storeys, tops, strict=True)]
    corners = np.concatenate(parts)
    return Surfaces(corners, np.arange(len(corners)).reshape(-1, 3))


def slab_surfaces(building: Building, ceiling: float) -> Surfaces:
    """Each storey's floor, without its holes, and the roof."""
    parts = [_level(s, s.elevation, [room.polygon for room in s.voids]) for s in building.storeys]
    parts.append(_level(building.storeys[-1], _tops(building, ceiling)[-1], []))
    corners = np.concatenate(parts)
    return Surfaces(corners, np.arange(len(corners)).reshape(-1, 3))


def _tops(building: Building, ceiling: float) -> list[float]:
    elevations = [storey.elevation for storey in building.storeys]
    return [*elevations[1:], elevations[-1] + ceiling]


def _solid(storey: Storey) -> Array:
    """Walls (w, 4) m that are no edge of a hole."""
    if not storey.voids:
        return storey.walls
    edges = polygon_walls([room.polygon for room in storey.voids])
    is_railing = (storey.walls[:, None] == edges[None]).all(axis=2).any(axis=1)
    return np.asarray(storey.walls[~is_railing])


def _upright(walls: Array, bottom: float, top: float) -> Array:
    """Corners (6 w, 3) m of two triangles for each wall."""
    start, stop = walls[:, :2], walls[:, 2:]
    ends = (start, bottom), (stop, bottom), (stop, top), (start, bottom), (stop, top), (start, top)
    corners = [np.column_stack([xy, np.full(len(walls), z)]) for xy, z in ends]
    return np.asarray(np.stack(corners, axis=1).reshape(-1, 3))


def _level(storey: Storey, z: float, holes: list[Array]) -> Array:
    """Corners (3 t, 3) m of the triangles of a storey's outline less holes."""
    plan: BaseGeometry = shapely.Polygon(storey.outline).buffer(0.0)
    for hole in holes:
        plan = plan.difference(shapely.Polygon(hole).buffer(0.0))
    triangles = shapely.get_parts(shapely.constrained_delaunay_triangles(plan))
    xy = np.concatenate([np.asarray(triangle.exterior.coords)[:3, :2] for triangle in triangles])
    return np.asarray(np.column_stack([xy, np.full(len(xy), z)]))
