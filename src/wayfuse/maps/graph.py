"""The building as a graph (chu2009 Section 2.3): convex units of its floors, and what joins them.

Vertices are *cells* (convex, a partition unit each) and connectors. An edge between two cells is a *portal*, the
passable segment of their common edge: a door, or open space that was only cut to be convex. An edge between a cell
and a connector is a landing, one per floor a connector serves; connectors bring their own descriptors (number of
stairs, floors served, footprint: `wayfuse.maps.connectors`).

Built once with a geometry library, held as flat arrays: polygons packed one after another, edges as index pairs.

>>> graph = build_graph(site)                                    # doctest: +SKIP
>>> graph.neighbours(int(graph.cell_of(0, [[3.0, 4.0]])[0]))     # doctest: +SKIP
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from wayfuse.core.types import Array, BoolArray, IntArray
from wayfuse.maps.connectors import Connector
from wayfuse.maps.partition import convex_cells, limits, walkable_faces
from wayfuse.maps.portals import find_portals
from wayfuse.maps.site import Floor, Site

__all__ = ["BuildingGraph", "build_graph"]

AT_EDGE = 0.3  # m, a landing this far outside a cell opens into it
ON_EDGE = 1e-6  # m, a place this far outside a cell still is in it


@dataclass(frozen=True, slots=True, eq=False)
class BuildingGraph:
    """Cells, portals and landings of a site.

    cell_start (n + 1,), cell_xy (m, 2) m : corners of cell i are cell_xy[cell_start[i]:cell_start[i + 1]],
    counter-clockwise, in the frame of its floor. cell_floor (n,) : cells of a floor follow one another.
    cell_unit (n,) : index into `Floor.units`, -1 where the plan names none.
    portal_xy (p, 4) m, portal_cells (p, 2), portal_door (p,) : passable segments, the cells on both sides, and
    whether it is a door.
    landing_cell (k,), landing_connector (k,), landing_floor (k,), landing_xy (k, 2) m : the cell each landing
    opens into, -1 where it lies in none; one at the edge of a cell (0.3 m) is moved into it.
    connectors : of the site, as `landing_connector` counts them.
    """

    cell_start: IntArray
    cell_xy: Array
    cell_floor: IntArray
    cell_unit: IntArray
    portal_xy: Array
    portal_cells: IntArray
    portal_door: BoolArray
    landing_cell: IntArray
    landing_connector: IntArray
    landing_floor: IntArray
    landing_xy: Array
    connectors: tuple[Connector, ...] = ()

    @property
    def n_cells(self) -> int:
        """Number of cells."""
        return len(self.cell_floor)

    def polygon(self, cell: int) -> Array:
        """Corners (k, 2) m of a cell, counter-clockwise."""
        return self.cell_xy[self.cell_start[cell] : self.cell_start[cell + 1]]

    @property
    def areas(self) -> Array:
        """Area (n,) m2 of each cell."""
        x, y = self.cell_xy.T
        following = _next_corner(self.cell_start)
        cross = x * y[following] - x[following] * y
        return np.asarray(0.5 * np.add.reduceat(cross, self.cell_start[:-1])) if self.n_cells else np.empty(0)

    def neighbours(self, cell: int) -> IntArray:
        """Cells that share a portal with a cell, ascending."""
        one, other = self.portal_cells.T
        return np.unique(np.concatenate([other[one == cell], one[other == cell]]))

    def landings_in(self, cell: int) -> IntArray:
        """Rows of the landings that open into a cell."""
        return np.nonzero(self.landing_cell == cell)[0]

    def cell_of(self, floor: int, xy: ArrayLike) -> IntArray:
        """Cell of each place (n, 2) m of a floor, -1 where there is none; on an edge, the first of its cells."""
        places = np.asarray(xy, dtype=np.float64).reshape(-1, 2)
        low, high = (int(v) for v in np.searchsorted(self.cell_floor, [floor, floor + 1]))
        found = np.full(len(places), -1, dtype=np.int64)
        if low == high:
            return found
        start = self.cell_start[low : high + 1] - self.cell_start[low]
        corners = self.cell_xy[self.cell_start[low] : self.cell_start[high]]
        side = corners[_next_corner(start)] - corners
        length = np.hypot(side[:, 0], side[:, 1])
        least, most = (
            np.stack([f.reduceat(corners[:, k], start[:-1]) for k in (0, 1)])
            for f in (np.minimum, np.maximum)
        )
        for rows in np.array_split(np.arange(len(places)), 1 + len(places) * (high - low) // 2_000_000):
            at = places[rows]
            boxed = np.all(
                (at.T[:, :, None] >= least[:, None] - ON_EDGE)
                & (at.T[:, :, None] <= most[:, None] + ON_EDGE),
                axis=0,
            )
            row, cell = np.nonzero(boxed)
            if not len(row):
                continue
            counts = np.diff(start)[cell]
            first = np.concatenate([[0], np.cumsum(counts)])
            edge = np.arange(first[-1]) - np.repeat(first[:-1] - start[cell], counts)
            offset = at[np.repeat(row, counts)] - corners[edge]
            left = side[edge, 0] * offset[:, 1] - side[edge, 1] * offset[:, 0] >= -ON_EDGE * length[edge]
            inside = np.logical_and.reduceat(left, first[:-1])
            hit, at_row = cell[inside][::-1] + low, rows[row[inside]][::-1]
            found[at_row] = hit  # written last to first: the lowest cell stays
        return found


def _next_corner(start: IntArray) -> IntArray:
    """Index of the corner after each, around its own polygon."""
    following = np.arange(1, start[-1] + 1)
    following[start[1:] - 1] = start[:-1]
    return following


def build_graph(site: Site) -> BuildingGraph:
    """Graph of a site: cells of every floor, portals between them, and where connectors land."""
    cells: list[Array] = []
    floors: list[int] = []
    units: list[int] = []
    segments: list[Array] = []
    pairs: list[Any] = []
    doors: list[Any] = []
    for k, floor in enumerate(site.floors):
        lines = limits(floor)
        faces = walkable_faces(floor, lines)
        here = [(i, cell) for i, face in enumerate(faces) for cell in convex_cells(face)]
        polygons = [cell for _, cell in here]
        drawn, owners, is_door = find_portals(polygons, [i for i, _ in here], lines, floor.doors)
        segments.append(drawn)
        pairs.append(owners + len(cells))
        doors.append(is_door)
        units += _units_of(floor, polygons)
        cells += polygons
        floors += [k] * len(polygons)
    start = np.concatenate([[0], np.cumsum([len(cell) for cell in cells])]).astype(np.int64)
    landings = [(c, at) for c, connector in enumerate(site.connectors) for at in connector.landings]
    graph = BuildingGraph(
        cell_start=start,
        cell_xy=np.concatenate(cells) if cells else np.empty((0, 2)),
        cell_floor=np.array(floors, dtype=np.int64),
        cell_unit=np.array(units, dtype=np.int64),
        portal_xy=np.concatenate(segments),
        portal_cells=np.concatenate(pairs),
        portal_door=np.concatenate(doors),
        landing_cell=np.full(len(landings), -1, dtype=np.int64),
        landing_connector=np.array([c for c, _ in landings], dtype=np.int64),
        landing_floor=np.array([at.floor for _, at in landings], dtype=np.int64),
        landing_xy=np.array([[at.x, at.y] for _, at in landings]).reshape(-1, 2),
        connectors=site.connectors,
    )
    for k in range(len(site.floors)):
        rows = graph.landing_floor == k
        graph.landing_cell[rows] = graph.cell_of(k, graph.landing_xy[rows])
    _move_into_cells(graph)
    return graph


def _move_into_cells(graph: BuildingGraph) -> None:
    """Move landings that lie in no cell, but at the edge of one (where stairs are drawn to end), into that cell."""
    import shapely

    for row in np.nonzero(graph.landing_cell < 0)[0]:
        cells = np.nonzero(graph.cell_floor == graph.landing_floor[row])[0]
        shapes = [shapely.Polygon(graph.polygon(int(i))) for i in cells]
        at = shapely.Point(graph.landing_xy[row])
        away = shapely.distance(shapes, at) if shapes else np.array([np.inf])
        best = int(np.argmin(away))
        if away[best] <= AT_EDGE:
            graph.landing_cell[row] = cells[best]
            graph.landing_xy[row] = shapely.get_coordinates(shapely.shortest_line(shapes[best], at))[0]


def _units_of(floor: Floor, cells: Sequence[Array]) -> list[int]:
    """Index of the smallest unit that each cell lies in by its middle, -1 where there is none."""
    import shapely

    shapes = [shapely.Polygon(u.polygon.exterior, [*u.polygon.holes]) for u in floor.units]
    if not shapes or not cells:
        return [-1] * len(cells)
    middles = shapely.points([cell.mean(axis=0) for cell in cells])
    cell, unit = shapely.STRtree(shapes).query(middles, predicate="intersects")
    area = shapely.area(shapes)
    found = np.full(len(cells), -1, dtype=np.int64)
    order = np.argsort(-area[unit], kind="stable")  # the smallest is written last
    found[cell[order]] = unit[order]
    return [int(unit) for unit in found]
