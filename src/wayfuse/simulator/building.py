"""A small shopping centre to walk in: outlines, shops, an atrium, and the corridors between them.

Two storeys of 70 m x 45 m: a ring of corridors, an outer row of shops, an inner block, a court with kiosks on
the ground floor that is an open atrium (a hole) one floor up. Shops are closed to walkers, as in the public
recordings whose layout the demo writes: there walkable space is the outline without the shops. Only the cuts
between shops are drawn at random.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from wayfuse.core.errors import ConfigError
from wayfuse.core.frames import GeoAnchor
from wayfuse.core.types import Array, BoolArray, IntArray
from wayfuse.simulator.geometry import clearance, crossings, inside, polygon_walls
from wayfuse.simulator.passages import Passage

__all__ = ["Building", "Room", "Storey", "box", "corridor_graph", "cuts", "shopping_centre"]

_WIDTH, _HEIGHT = 70.0, 45.0  # m
_STOREY_HEIGHT = 4.5  # m, slab to slab: usual for shops; the layout does not state it
_LON, _LAT = 11.0, 48.0  # degrees: a made-up place, far enough north to show a forgotten cos(latitude)
_METRES_PER_DEGREE = float(np.deg2rad(6378137.0))  # on the sphere by which the public plans measure
_NODE_SPACING = 8.0  # m, largest gap between way-points: the public recordings state one about every 7 m


@dataclass(frozen=True, slots=True, eq=False)
class Room:
    """A closed polygon on a floor, (n, 2) m, not repeated at its end: a shop, a kiosk or a hole."""

    name: str
    polygon: Array


@dataclass(frozen=True, slots=True, eq=False)
class Storey:
    """One floor: outline (n, 2) m, what is closed to walkers, walls (w, 4) m, and the corridor graph.

    ``nodes`` (k, 2) m and ``edges`` (e, 2) into them; ``voids`` are the rooms that are holes in the slab.
    """

    name: str
    elevation: float
    outline: Array
    rooms: tuple[Room, ...]
    voids: tuple[Room, ...]
    walls: Array
    nodes: Array
    edges: IntArray

    def is_walkable(self, xy: Array) -> BoolArray:
        """Whether points (m, 2) lie on the floor and in no room or hole."""
        free = inside(self.outline, xy)
        for room in (*self.rooms, *self.voids):
            free &= ~inside(room.polygon, xy)
        return free

    def is_clear(self, start: Array, stop: Array, margin: float) -> bool:
        """Whether the straight way between two walkable places (2,) keeps ``margin`` m from every wall."""
        n = max(2, int(np.ceil(np.linalg.norm(stop - start) / 0.25)) + 1)
        places = start + np.linspace(0.0, 1.0, n)[:, None] * (stop - start)
        return bool(
            not np.any(crossings(start[None], stop[None], self.walls))
            and np.all(clearance(places, self.walls) >= margin)
        )


@dataclass(frozen=True, slots=True, eq=False)
class Building:
    """The site: storeys bottom up, its size (m), and where on the earth x = y = 0 lies (x east, y north).

    ``passages`` are its stairways and lifts: none where walkers stay on their floor.
    """

    name: str
    storeys: tuple[Storey, ...]
    width: float
    height: float
    anchor: GeoAnchor
    passages: tuple[Passage, ...] = ()

    def floor_index(self, name: str) -> int:
        """Ordinal of the storey of a name."""
        for i, storey in enumerate(self.storeys):
            if storey.name == name:
                return i
        raise ConfigError(f"no floor {name!r}", remedy="one of " + ", ".join(s.name for s in self.storeys))


def shopping_centre(rng: np.random.Generator) -> Building:
    """Draw the two-storey shopping centre of the demo."""
    storeys = (_ground_floor(rng), _upper_floor(rng))
    middle = np.deg2rad(_LAT + 0.5 * _HEIGHT / _METRES_PER_DEGREE)
    x, y = 1.0 / (_METRES_PER_DEGREE * float(np.cos(middle))), 1.0 / _METRES_PER_DEGREE
    anchor = GeoAnchor((_LON, _LAT), ((x, 0.0), (0.0, y)))
    return Building("Wayfuse Demo Centre", storeys, _WIDTH, _HEIGHT, anchor)


def _ground_floor(rng: np.random.Generator) -> Storey:
    rooms = _outer_rooms(rng, south_gap=(33.0, 37.0), north_gap=(20.0, 24.0))
    inner = cuts(13.0, 33.0, rng)
    rooms += [box(a, b, 13.0, 22.5) for a, b in pairwise(inner)]
    rooms += [box(a, b, 22.5, 32.0) for a, b in pairwise(inner)]
    rooms += [
        box(45.0, 51.0, 19.5, 25.5),
        box(40.0, 42.5, 14.0, 16.5),
        box(53.0, 55.5, 28.5, 31.0),
    ]  # kiosks
    points = {
        "sw": (11.0, 11.0), "s": (35.2, 11.0), "se": (59.0, 11.0), "e": (59.0, 22.5), "ne": (59.0, 34.0),
        "n": (35.2, 34.0), "nx": (22.0, 34.0), "nw": (11.0, 34.0), "door": (35.0, 2.0), "exit": (22.0, 43.0),
        "w": (35.2, 22.5), "cs": (47.5, 15.5), "cn": (47.5, 29.5),
    }  # fmt: skip
    ways = "sw-s s-se se-e e-ne ne-n n-nx nx-nw nw-sw door-s exit-nx s-w w-n w-cs cs-e w-cn cn-e cs-se cn-n"
    return _storey("F1", 0.0, rooms, [], points, ways)


def _upper_floor(rng: np.random.Generator) -> Storey:
    rooms = _outer_rooms(rng, south_gap=None, north_gap=None)
    for low, high in ((13.0, 21.0), (24.0, 32.0)):
        rooms += [box(a, b, low, high) for a, b in pairwise(cuts(13.0, 33.0, rng))]
    rooms += [box(37.0, 39.5, 17.0, 19.5), box(56.0, 58.0, 25.0, 27.5)]  # kiosks
    atrium = box(42.0, 54.0, 16.0, 29.0)
    points = {
        "sw": (11.0, 11.0), "s": (35.2, 11.5), "se": (58.5, 11.5), "ne": (58.8, 33.5), "n": (35.2, 33.5),
        "nw": (11.0, 34.0), "west": (11.0, 22.5), "w": (35.2, 22.5), "gs": (47.5, 13.0), "gn": (47.5, 32.0),
        "e": (59.5, 21.5),
    }  # fmt: skip
    ways = "sw-s s-gs gs-se se-e e-ne ne-gn gn-n n-nw nw-west west-sw west-w s-w w-n"
    return _storey("F2", _STOREY_HEIGHT, rooms, [atrium], points, ways)


def _outer_rooms(
    rng: np.random.Generator, south_gap: tuple[float, float] | None, north_gap: tuple[float, float] | None
) -> list[Array]:
    """The shops along the outline, depth 9 m; a gap in a row is a passage to a door."""
    rooms = [box(a, b, 0.0, 9.0) for a, b in pairwise(cuts(9.0, 61.0, rng, south_gap)) if (a, b) != south_gap]
    rooms += [
        box(a, b, 36.0, 45.0) for a, b in pairwise(cuts(9.0, 61.0, rng, north_gap)) if (a, b) != north_gap
    ]
    rooms += [box(0.0, 9.0, a, b) for a, b in pairwise(cuts(9.0, 36.0, rng))]
    rooms += [box(61.0, 70.0, a, b) for a, b in pairwise(cuts(9.0, 36.0, rng))]
    rooms += [box(0.0, 9.0, 0.0, 9.0), box(61.0, 70.0, 0.0, 9.0), box(0.0, 9.0, 36.0, 45.0)]
    rooms.append(np.array([(61.0, 36.0), (70.0, 36.0), (70.0, 38.0), (63.0, 45.0), (61.0, 45.0)]))
    return rooms


def cuts(
    start: float, stop: float, rng: np.random.Generator, gap: tuple[float, float] | None = None
) -> list[float]:
    """Cuts of a row of shops 4.5 to 8 m wide, with a gap kept as one piece where given."""
    if gap is not None:
        return cuts(start, gap[0], rng) + cuts(gap[1], stop, rng)
    n = max(1, round((stop - start) / rng.uniform(5.0, 7.5)))
    shares = np.cumsum(rng.uniform(0.8, 1.2, n))
    return [start, *np.round(start + (stop - start) * shares[:-1] / shares[-1], 2).tolist(), stop]


def box(x0: float, x1: float, y0: float, y1: float) -> Array:
    """Corners (4, 2) of a rectangle."""
    return np.array([(x0, y0), (x1, y0), (x1, y1), (x0, y1)])


def _storey(
    name: str,
    elevation: float,
    rooms: list[Array],
    voids: list[Array],
    points: dict[str, tuple[float, float]],
    ways: str,
) -> Storey:
    outline = np.array([(0.0, 0.0), (_WIDTH, 0.0), (_WIDTH, 38.0), (63.0, _HEIGHT), (0.0, _HEIGHT)])
    nodes, edges = corridor_graph(points, ways)
    return Storey(
        name=name,
        elevation=elevation,
        outline=outline,
        rooms=tuple(Room(f"{name} unit {i + 1}", polygon) for i, polygon in enumerate(rooms)),
        voids=tuple(Room(f"{name} atrium", polygon) for polygon in voids),
        walls=polygon_walls([outline, *rooms, *voids]),
        nodes=nodes,
        edges=edges,
    )


def corridor_graph(points: dict[str, tuple[float, float]], ways: str) -> tuple[Array, IntArray]:
    """Corridor graph of named points (m) and the ways "a-b c-d" between them.

    Each way is cut into pieces of at most the node spacing; the points come first, in their order.
    """
    nodes = list(points.values())
    index = {name: i for i, name in enumerate(points)}
    edges: list[tuple[int, int]] = []
    for a, b in (way.split("-") for way in ways.split()):
        p, q = np.array(points[a]), np.array(points[b])
        pieces = int(np.ceil(np.linalg.norm(q - p) / _NODE_SPACING))
        chain = [index[a]]
        for k in range(1, pieces):
            x, y = p + (q - p) * k / pieces
            chain.append(len(nodes))
            nodes.append((float(x), float(y)))
        chain.append(index[b])
        edges.extend(pairwise(chain))
    return np.array(nodes), np.array(edges, dtype=np.int64)
