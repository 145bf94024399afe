"""Split the walkable space of a floor into convex units (chu2009 Section 2.3: partition units).

Walls, edges of the walkable space and doors divide a floor into faces; the walkable ones are triangulated with
their edges kept (constrained Delaunay), and triangles are merged across a shared edge, the longest first, while the
result stays convex (Hertel and Mehlhorn). A cell never reaches over a wall or a door. Walls that end in the middle
of a room are cut out of it with a slit of `SLIT`.

References
----------
.. [1] Hertel, Mehlhorn, Fast triangulation of simple polygons, FCT 1983: at most four times the fewest pieces.
"""

from __future__ import annotations

from collections import defaultdict
from typing import Any

import numpy as np

from wayfuse.core.types import Array
from wayfuse.maps.site import Floor

__all__ = ["convex_cells", "limits", "merge_triangles", "walkable_faces"]

GRID = 1e-3  # m, lines are snapped to this
FINE = 1e-4  # m, corners of slits are snapped to this: two corners nearer than rounding make no triangle
SLIT = 2e-3  # m, half the width cut out along a wall that ends in a room
NARROWEST = 0.1  # m, half the width of what nobody fits into: gaps between two walls drawn side by side
JAMB = 0.3  # m, a door is drawn up to walls this near its ends
DEGENERATE = 1e-7  # m2, a smaller triangle is a line
WALKED = 0.5  # of the mask cells in a face: more, and it is walkable


def limits(floor: Floor) -> Array:
    """Lines (w, 4) m nobody walks across: the edges of the walkable space, by its walls where they draw them.

    On a plan of thin walls the barriers are its walls and, less exactly, the same edges again: only what lies apart
    from every wall is taken of those (an edge of closed space that has an opening).
    """
    import shapely

    drawn, own = ({tuple(line) for line in lines.tolist()} for lines in (floor.barriers, floor.walls))
    if not own or not own <= drawn:
        return floor.barriers
    if own == drawn:
        return floor.walls
    walls = shapely.union_all([shapely.LineString(line) for line in floor.walls.reshape(-1, 2, 2)])
    edges = shapely.union_all([shapely.LineString([line[:2], line[2:]]) for line in sorted(drawn - own)])
    apart = shapely.get_parts(shapely.line_merge(edges.difference(walls.buffer(0.5 * JAMB))))
    closed = [_to_jambs(np.asarray(part.coords), walls) for part in apart if part.length > JAMB]
    more = [np.hstack([p[:-1], p[1:]]) for p in (np.asarray(line.coords) for line in closed)]
    return np.concatenate([floor.walls, *more])


def walkable_faces(floor: Floor, lines: Array) -> list[Any]:
    """Walkable areas between lines (w, 4) m (see `limits`) and doors: shapely polygons that share no area."""
    import shapely

    outline = [shapely.LineString(ring) for polygon in floor.outline for ring in polygon.rings]
    solid = shapely.union_all([*(shapely.LineString(line) for line in lines.reshape(-1, 2, 2)), *outline])
    doors = [_to_jambs(door, solid) for door in floor.doors.reshape(-1, 2, 2)]
    noded = shapely.union_all([solid, *doors], grid_size=GRID)
    areas, cuts, dangles, _ = shapely.polygonize_full(list(shapely.get_parts(noded)))
    loose = shapely.union_all([*shapely.get_parts(cuts), *shapely.get_parts(dangles)])
    loose = loose.difference(
        shapely.union_all(doors).buffer(2 * GRID)
    )  # a door that leads nowhere divides nothing
    whole = shapely.union_all([shapely.Polygon(p.exterior, [*p.holes]) for p in floor.outline])
    shapely.prepare(whole)
    found: list[Any] = []
    tree = shapely.STRtree(list(shapely.get_parts(loose)))
    for face in shapely.get_parts(areas):
        if not (whole.contains(face.representative_point()) and _is_walkable(floor, face)):
            continue
        inside = [tree.geometries[i] for i in tree.query(face, predicate="intersects")]
        if inside:
            slit = shapely.union_all(inside).buffer(SLIT, cap_style="square", join_style="mitre")
            face = face.difference(slit, grid_size=FINE)  # noqa: PLW2901 - the same face without its walls
        parts = shapely.get_parts(face)
        found += [part for part in parts if part.geom_type == "Polygon" and part.area > DEGENERATE]
    return found


def _to_jambs(line: Array, solid: Any) -> Any:
    """Line (k, 2) whose ends are moved onto the walls they nearly touch."""
    import shapely

    moved = line.copy()
    for k in (0, -1):
        foot = shapely.get_coordinates(shapely.shortest_line(shapely.Point(line[k]), solid))[1:]
        if len(foot) and np.hypot(*(foot[0] - line[k])) <= JAMB:
            moved[k] = foot[0]
    return shapely.LineString(moved)


def _is_walkable(floor: Floor, face: Any) -> bool:
    """Whether people can be in a face: wide enough, and most of its mask cells are walkable."""
    import shapely

    # area / perimeter never exceeds the radius of the largest circle inside, and is quick to get
    if face.area < NARROWEST * face.length and face.buffer(-NARROWEST).is_empty:
        return False
    mask = floor.walkable
    x0, y0, x1, y1 = face.bounds
    i = np.arange(*_span(x0 - mask.origin[0], x1 - mask.origin[0], mask.cell))
    j = np.arange(*_span(y0 - mask.origin[1], y1 - mask.origin[1], mask.cell))
    x, y = np.meshgrid(mask.origin[0] + (i + 0.5) * mask.cell, mask.origin[1] + (j + 0.5) * mask.cell)
    shapely.prepare(face)
    inside = shapely.contains_xy(face, x.ravel(), y.ravel())
    if not np.any(inside):
        spot = face.representative_point()
        return bool(mask.contains([spot.x], [spot.y])[0])
    return bool(np.mean(mask.contains(x.ravel()[inside], y.ravel()[inside])) > WALKED)


def _span(low: float, high: float, cell: float) -> tuple[int, int]:
    return int(np.floor(low / cell)), int(np.ceil(high / cell)) + 1


def convex_cells(face: Any) -> list[Array]:
    """Convex polygons (k, 2) m, counter-clockwise and open, that fill a shapely polygon."""
    import shapely

    parts = shapely.get_parts(shapely.constrained_delaunay_triangles(face))
    rings = np.array([shapely.get_coordinates(part)[:3] for part in parts]).reshape(-1, 3, 2)
    points, index = np.unique(rings.reshape(-1, 2), axis=0, return_inverse=True)
    return [points[ring] for ring in merge_triangles(points, index.reshape(-1, 3))]


def merge_triangles(points: Array, triangles: Any) -> list[list[int]]:
    """Rings of point indices of convex polygons, counter-clockwise, merged of triangles that share edges."""
    area = _doubled_area(points, triangles)
    rings = {i: _upright(t, a) for i, (t, a) in enumerate(zip(triangles.tolist(), area, strict=True))}
    owner = list(rings)

    def find(i: int) -> int:
        while owner[i] != i:
            owner[i] = owner[owner[i]]
            i = owner[i]
        return i

    sides: dict[tuple[int, int], list[int]] = defaultdict(list)
    for i, ring in rings.items():
        for a, b in zip(ring, [*ring[1:], ring[0]], strict=True):
            sides[min(a, b), max(a, b)].append(i)
    shared = [(edge, pair) for edge, pair in sides.items() if len(pair) == 2]
    length = [float(np.hypot(*(points[a] - points[b]))) for (a, b), _ in shared]
    thin = [min(abs(area[i]) for i in pair) < DEGENERATE for _, pair in shared]
    for k in sorted(range(len(shared)), key=lambda k: (not thin[k], -length[k])):
        (a, b), (i, j) = shared[k]
        i, j = find(i), find(j)
        merged = None if i == j else _merge(points, rings[i], rings[j], a, b)
        if merged is not None:
            rings[i] = merged
            owner[j] = i
            del rings[j]
    return [ring for ring in rings.values() if _ring_area(points, ring) > DEGENERATE]


def _upright(triangle: list[int], doubled: float) -> list[int]:
    return triangle if doubled >= 0.0 else triangle[::-1]


def _doubled_area(points: Array, triangles: Any) -> Array:
    a, b, c = (points[triangles[:, k]] for k in range(3))
    return np.asarray((b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0]))


def _ring_area(points: Array, ring: list[int]) -> float:
    x, y = (points[ring] - points[ring[0]]).T
    return float(0.5 * np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y))


def _merge(points: Array, one: list[int], other: list[int], a: int, b: int) -> list[int] | None:
    """Union of two rings along the edge a-b, None where it would not be convex."""
    if len(set(one) & set(other)) != 2:
        return None
    if one[one.index(a) - 1] == b:  # one ring runs along the edge from a to b, the other from b to a
        one, other = other, one
    i, j = one.index(b), other.index(a)
    ring = one[i:] + one[:i] + (other[j:] + other[:j])[1:-1]
    n = len(ring)
    for v in (ring.index(a), ring.index(b)):
        p, q, r = points[ring[v - 1]], points[ring[v]], points[ring[(v + 1) % n]]
        if (q[0] - p[0]) * (r[1] - q[1]) - (q[1] - p[1]) * (r[0] - q[0]) < 0.0:
            return None
    return ring
