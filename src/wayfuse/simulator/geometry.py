"""Plane geometry of the simulator, brute force: insides, crossings, distances.

The estimator has faster versions of its own (`wayfuse.maps`); these share no line with them, so that a fault
in one shows against the other.
"""

from __future__ import annotations

import numpy as np

from wayfuse.core.types import Array, BoolArray

__all__ = ["clearance", "crossings", "inside", "polygon_walls"]


def inside(polygon: Array, xy: Array) -> BoolArray:
    """Whether points (m, 2) lie in a simple polygon (n, 2); a point on its edge may count as either."""
    x, y = xy[:, 0, None], xy[:, 1, None]
    x0, y0 = polygon[:, 0], polygon[:, 1]
    x1, y1 = np.roll(x0, -1), np.roll(y0, -1)
    spans = (y0 > y) != (y1 > y)
    rise = np.where(y1 == y0, 1.0, y1 - y0)  # level edges span nothing: any value serves
    left_of = x < x0 + (y - y0) * (x1 - x0) / rise
    return np.asarray(np.count_nonzero(spans & left_of, axis=1) % 2 == 1)


def crossings(start: Array, stop: Array, walls: Array) -> BoolArray:
    """Which of the walls (w, 4: x0, y0, x1, y1) each segment start -> stop (m, 2) crosses: (m, w)."""
    ax, ay, bx, by = walls.T
    px, py = start[:, 0, None], start[:, 1, None]
    qx, qy = stop[:, 0, None], stop[:, 1, None]
    side_p = (bx - ax) * (py - ay) - (by - ay) * (px - ax)
    side_q = (bx - ax) * (qy - ay) - (by - ay) * (qx - ax)
    side_a = (qx - px) * (ay - py) - (qy - py) * (ax - px)
    side_b = (qx - px) * (by - py) - (qy - py) * (bx - px)
    return np.asarray((side_p * side_q < 0.0) & (side_a * side_b < 0.0))


def clearance(xy: Array, walls: Array) -> Array:
    """Distance (m,) of points (m, 2) to the nearest wall (w, 4)."""
    a, d = walls[:, :2], walls[:, 2:] - walls[:, :2]
    offset = xy[:, None, :] - a
    along = np.clip(np.sum(offset * d, axis=2) / np.sum(d * d, axis=1), 0.0, 1.0)
    gap = offset - along[:, :, None] * d
    return np.asarray(np.sqrt(np.min(np.sum(gap * gap, axis=2), axis=1)))


def polygon_walls(polygons: list[Array]) -> Array:
    """Edges (w, 4) of polygons, an edge that two of them share taken once."""
    edges: dict[tuple[tuple[float, float], ...], tuple[float, float, float, float]] = {}
    for polygon in polygons:
        for p, q in zip(polygon.tolist(), np.roll(polygon, -1, axis=0).tolist(), strict=True):
            key = tuple(sorted(((round(p[0], 3), round(p[1], 3)), (round(q[0], 3), round(q[1], 3)))))
            edges.setdefault(key, (p[0], p[1], q[0], q[1]))
    return np.array(list(edges.values()), dtype=np.float64).reshape(-1, 4)
