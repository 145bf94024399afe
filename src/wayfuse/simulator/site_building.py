"""Any site as a building to walk in: its walls, a net of ways over its walkable space, its stairs and lifts.

The net has a node about every 4 m of walkable space that keeps off the edges, and an edge between neighbours where
nothing is in the way; what the net does not join to its largest part is left out. All floors are brought into the
frame of the site's reference floor. A plan rarely says how stairs run: they go straight from landing to landing, or
out and back where the landings lie above each other. Escalators that go down are left out.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from wayfuse.core.errors import MapError
from wayfuse.core.frames import GeoAnchor
from wayfuse.core.types import Array, BoolArray, IntArray
from wayfuse.maps.connectors import Connector, ConnectorKind, Landing
from wayfuse.maps.site import Floor, Site
from wayfuse.simulator.building import Building, Room, Storey, box
from wayfuse.simulator.geometry import crossings, inside
from wayfuse.simulator.passages import RISER, TREAD, Activity, Passage, Stretch, escalator, lift, stairway

__all__ = ["building_of"]

_SPACING, _REACH = 4.0, 6.2  # m between nodes, and between two that an edge may join: diagonals included
_KEEP_OFF = 0.6  # m from what is not walkable
_CHECK = 0.25  # m, a way is checked this often
_CHUNK = 400  # ways whose crossings with all walls are checked at once
_CABIN = 1.0  # m, half a lift's cabin where the plan has no footprint
_TRIED, _CLOSED = (
    12,
    0.3,
)  # places tried per axis of a unit, and the share that may be walkable in a closed one
_COMBS = 0.05, 0.95  # of an escalator's way: where one steps on and off
_ALIKE = 0.5  # landings nearer than this share of a flight lie above each other


def building_of(site: Site) -> tuple[Building, Array]:
    """The building, and the offsets (f, 2) m that take its places into each floor's own frame.

    Raises
    ------
    MapError : a floor has no walkable space to walk in.
    """
    reference = site.reference
    shift = np.array([site.shift(reference, k) for k in range(len(site.floors))])
    joined = [
        [landing for connector in site.connectors if (landing := connector.landing(k)) is not None]
        for k in range(len(site.floors))
    ]
    base = min(floor.elevation for floor in site.floors)
    storeys = tuple(
        _storey(floor, floor.elevation - base, -shift[k], joined[k]) for k, floor in enumerate(site.floors)
    )
    passages = tuple(
        passage for connector in site.connectors for passage in _passage(connector, storeys, shift)
    )
    extent = site.floors[reference]
    anchor = site.anchor or GeoAnchor.from_origin(0.0, 0.0)
    building = Building(site.name, storeys, extent.width, extent.height, anchor, passages)
    return building, shift


def _storey(floor: Floor, elevation: float, to_site: Array, landings: list[Landing]) -> Storey:
    nodes, edges = _net(floor, np.array([(one.x, one.y) for one in landings]).reshape(-1, 2))
    outline = max(floor.outline, key=lambda polygon: polygon.area).exterior[:-1]
    voids = tuple(
        Room(u.name, u.polygon.exterior[:-1] + to_site) for u in floor.units if u.category == "void"
    )
    return Storey(
        name=floor.name,
        elevation=elevation,
        outline=outline + to_site,
        rooms=tuple(
            Room(u.name, u.polygon.exterior[:-1] + to_site)
            for u in floor.units
            if u.category != "void" and _is_closed(floor, u.polygon.exterior[:-1])
        ),
        voids=voids,
        walls=floor.walls + np.tile(to_site, 2),
        nodes=nodes + to_site,
        edges=edges,
    )


def _is_closed(floor: Floor, polygon: Array) -> bool:
    """Whether a unit is closed to walkers: hardly any of it is walkable."""
    low, high = polygon.min(axis=0), polygon.max(axis=0)
    step = np.linspace(0.05, 0.95, _TRIED)
    places = np.stack(np.meshgrid(*(low + step[:, None] * (high - low)).T), axis=-1).reshape(-1, 2)
    places = places[inside(polygon, places)]
    return bool(len(places)) and bool(floor.walkable.contains(*places.T).mean() < _CLOSED)


def _net(floor: Floor, landings: Array) -> tuple[Array, IntArray]:
    """Nodes (n, 2) m of the floor's frame, landings last, and edges (e, 2)."""
    size = np.array([floor.width, floor.height])
    across = [np.arange(0.5 * _CHECK, s, _SPACING) for s in size]
    lattice = np.stack(np.meshgrid(*across), axis=-1).reshape(-1, 2)
    tried = np.concatenate([lattice, lattice + 0.25 * _SPACING, lattice + 0.5 * _SPACING])
    good = tried[_free(floor, tried, _KEEP_OFF)]
    kept: list[int] = []
    for i in range(len(good)):  # one node per neighbourhood
        if not kept or np.hypot(*(good[kept] - good[i]).T).min() >= 0.6 * _SPACING:
            kept.append(i)
    nodes = np.concatenate([good[kept].reshape(-1, 2), landings])
    a, b = np.triu_indices(len(nodes), 1)
    near = np.hypot(*(nodes[a] - nodes[b]).T) <= _REACH
    pairs = np.column_stack([a[near], b[near]])
    clear = [_is_open(floor, nodes, pairs[k : k + _CHUNK]) for k in range(0, len(pairs), _CHUNK)]
    edges = pairs[np.concatenate(clear)] if len(pairs) else pairs
    if not len(edges):
        raise MapError(f"floor {floor.name} has no walkable space to walk in", remedy="check its plan")
    return _largest(nodes, edges)


def _free(floor: Floor, xy: Array, margin: float) -> BoolArray:
    """Whether places (m, 2) and what is ``margin`` m around them are walkable."""
    free = np.ones(len(xy), dtype=bool)
    for dx, dy in ((0, 0), (1, 0), (-1, 0), (0, 1), (0, -1)):
        free &= floor.walkable.contains(xy[:, 0] + margin * dx, xy[:, 1] + margin * dy)
    return free


def _is_open(floor: Floor, nodes: Array, pairs: IntArray) -> BoolArray:
    """Which ways (p, 2) between nodes stay on walkable space and cross no barrier."""
    start, stop = nodes[pairs[:, 0]], nodes[pairs[:, 1]]
    n = round(_REACH / _CHECK)
    places = start[:, None] + np.linspace(0.05, 0.95, n)[:, None] * (stop - start)[:, None]
    walkable = floor.walkable.contains(places[..., 0], places[..., 1]).mean(axis=1) > 0.9
    return np.asarray(walkable & ~crossings(start, stop, floor.barriers).any(axis=1))


def _largest(nodes: Array, edges: IntArray) -> tuple[Array, IntArray]:
    """The largest joined part of a net."""
    part = np.arange(len(nodes))
    while True:
        low = np.minimum(part[edges[:, 0]], part[edges[:, 1]])
        before = part.copy()
        np.minimum.at(part, edges[:, 0], low)
        np.minimum.at(part, edges[:, 1], low)
        if np.array_equal(before, part):
            break
    keep = part == np.bincount(part).argmax()
    number = np.cumsum(keep) - 1
    return nodes[keep], number[edges[keep[edges[:, 0]]]]


def _passage(connector: Connector, storeys: tuple[Storey, ...], shift: Array) -> Iterator[Passage]:
    """A connector's ways, nothing where a landing is on no way of its floor."""
    landings = tuple(
        Landing(p.floor, *(np.array([p.x, p.y]) - shift[p.floor]).tolist()) for p in connector.landings
    )
    if any(np.hypot(*(storeys[p.floor].nodes - (p.x, p.y)).T).min() > 0.01 for p in landings):
        return
    heights = tuple(storeys[p.floor].elevation - storeys[landings[0].floor].elevation for p in landings)
    middle = np.array([landings[0].x, landings[0].y])
    ring = box(*(middle[0] + (-_CABIN, _CABIN)), *(middle[1] + (-_CABIN, _CABIN)))
    if connector.footprint is not None:
        ring = connector.footprint[:-1] - shift[landings[0].floor]
    edges = (0,) * len(landings)
    if connector.kind is ConnectorKind.LIFT:
        yield lift(connector.id, landings, heights, ring, 0)
        return
    rises = np.diff(heights).tolist()
    if connector.kind is ConnectorKind.ESCALATOR and len(landings) == 2 and connector.direction > 0:
        low, high = landings[0], landings[1]
        on, off = ((low.x + s * (high.x - low.x), low.y + s * (high.y - low.y)) for s in _COMBS)
        way = (
            Stretch(*on, Activity.WALKING),
            Stretch(*off, Activity.ESCALATOR, rises[0]),
            Stretch(high.x, high.y, Activity.WALKING),
        )
        yield escalator(connector.id, (low, high), way, ring, (0, 0))
    elif connector.kind in {ConnectorKind.STAIRS, ConnectorKind.RAMP}:
        counts = connector.n_steps or tuple(max(1, round(rise / RISER)) for rise in rises)
        ways = tuple(
            _stairs(landings[k], landings[k + 1], rises[k], counts[k], ring) for k in range(len(rises))
        )
        yield stairway(connector.id, landings, ways, ring, edges)


def _stairs(low: Landing, high: Landing, rise: float, n_steps: int, ring: Array) -> tuple[Stretch, ...]:
    """Up from one landing to the next."""
    top = Stretch(high.x, high.y, Activity.STAIRS, rise, n_steps)
    if np.hypot(high.x - low.x, high.y - low.y) >= _ALIKE * n_steps * TREAD:
        return (top,)
    first = n_steps // 2
    aim = ring[int(np.argmax(np.hypot(*(ring - (low.x, low.y)).T)))] - (low.x, low.y)
    turn = np.array([low.x, low.y]) + aim / np.hypot(*aim) * first * TREAD
    half = Stretch(float(turn[0]), float(turn[1]), Activity.STAIRS, rise * first / n_steps, first)
    return (half, top._replace(rise=rise - half.rise, n_steps=n_steps - first)) if first else (top,)
