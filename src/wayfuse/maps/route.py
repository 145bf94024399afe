"""The quickest way between two places of a building, over floors.

Dijkstra's search over the graph: its nodes are three points of each portal (near both ends, middle) and the landings
of connectors. (A* needs a distance that no way undercuts; floors have frames of their own and connectors move people
sideways, so there is none that holds.) On each floor the way found is then pulled taut through its portals
(`wayfuse.maps.funnel`).
"""

from __future__ import annotations

import heapq
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from wayfuse.core.errors import MapError
from wayfuse.core.types import Array
from wayfuse.maps.connectors import Connector, ConnectorKind
from wayfuse.maps.funnel import pull_taut
from wayfuse.maps.graph import BuildingGraph
from wayfuse.maps.site import Site

__all__ = ["Costs", "Leg", "Place", "Ride", "Route", "find_route"]

CLEARANCE = (
    0.25  # m, a way keeps this from the jambs of a portal, or a quarter of its width where it is narrow
)


class Place(NamedTuple):
    """A place: index of the floor and x, y (m) in its frame."""

    floor: int
    x: float
    y: float


@dataclass(frozen=True, slots=True)
class Costs:
    """How long people take; nominal values of planning handbooks, rounded.

    walking : m/s. step_up, step_down : s per stair (100 and 120 a minute). riser : m, height of a stair where their
    number is not known. lift_wait : s until the car is there and its doors have opened and closed again.
    lift_speed : m/s. escalator_rise : m/s upwards (0.5 m/s along 30 degrees). ramp_slope : rise over run.
    """

    walking: float = 1.3
    step_up: float = 0.6
    step_down: float = 0.5
    riser: float = 0.17
    lift_wait: float = 30.0
    lift_speed: float = 1.0
    escalator_rise: float = 0.25
    ramp_slope: float = 0.06

    def ride(self, connector: Connector, rise: float, steps: int = 0) -> float:
        """Seconds on a connector over a rise (m, negative down) with a number of stairs, 0 where not known."""
        height = abs(rise)
        match connector.kind:
            case ConnectorKind.STAIRS:
                return (steps or height / self.riser) * (self.step_up if rise > 0.0 else self.step_down)
            case ConnectorKind.LIFT:
                return self.lift_wait + height / self.lift_speed
            case ConnectorKind.ESCALATOR:
                return height / self.escalator_rise
            case _:
                return height / (self.ramp_slope * self.walking)


class Leg(NamedTuple):
    """A walk on one floor: path (k, 2) m of its frame, length (m) and time (s)."""

    floor: int
    path: Array
    length: float
    seconds: float


class Ride(NamedTuple):
    """A connector taken from one floor to another; steps is 0 where not known."""

    connector: Connector
    start: int
    end: int
    steps: int
    seconds: float


@dataclass(frozen=True, slots=True)
class Route:
    """Legs and rides in turn, a leg first and last."""

    parts: tuple[Leg | Ride, ...]

    @property
    def length(self) -> float:
        """Metres walked on floors."""
        return sum(part.length for part in self.parts if isinstance(part, Leg))

    @property
    def seconds(self) -> float:
        """Time of the whole way."""
        return sum(part.seconds for part in self.parts)


@dataclass(slots=True)
class _Nodes:
    """Points people pass: of portals (portal index), landings (-1), start and goal (-1)."""

    xy: list[tuple[float, float]] = field(default_factory=list)
    portal: list[int] = field(default_factory=list)
    landing: list[int] = field(default_factory=list)
    in_cell: dict[int, list[int]] = field(default_factory=lambda: defaultdict(list))
    cells: list[tuple[int, ...]] = field(default_factory=list)

    def add(self, x: float, y: float, cells: tuple[int, ...], portal: int = -1, landing: int = -1) -> int:
        number = len(self.xy)
        self.xy.append((x, y))
        self.portal.append(portal)
        self.landing.append(landing)
        self.cells.append(cells)
        for cell in cells:
            self.in_cell[cell].append(number)
        return number


def find_route(
    site: Site, graph: BuildingGraph, start: Place, goal: Place, costs: Costs | None = None
) -> Route:
    """Quickest way between two places.

    Raises
    ------
    MapError : a place is not walkable, or nothing leads from one to the other.
    """
    costs = costs or Costs()
    ends = [_cell(site, graph, place) for place in (start, goal)]
    nodes = _nodes(graph)
    first = nodes.add(start.x, start.y, (ends[0],))
    last = nodes.add(goal.x, goal.y, (ends[1],))
    before = _search(site, graph, nodes, first, last, costs)
    if last not in before:
        raise MapError(
            f"nothing leads from ({start.x:.1f}, {start.y:.1f}) on floor {site.floors[start.floor].name} to "
            f"({goal.x:.1f}, {goal.y:.1f}) on floor {site.floors[goal.floor].name}",
            where=site.name,
            remedy="look for doors or connectors the plan lacks: `wayfuse site validate`",
        )
    way = [last]
    while way[-1] != first:
        way.append(before[way[-1]])
    return Route(tuple(_parts(site, graph, nodes, way[::-1], start.floor, costs)))


def _cell(site: Site, graph: BuildingGraph, place: Place) -> int:
    cell = int(graph.cell_of(place.floor, [[place.x, place.y]])[0])
    if cell < 0:
        floor = site.floors[place.floor]
        centres = floor.walkable.centres()
        centres = centres[graph.cell_of(place.floor, centres) >= 0] if len(centres) else centres
        remedy = "the floor has nothing walkable"
        if len(centres):
            x, y = centres[np.argmin(np.hypot(centres[:, 0] - place.x, centres[:, 1] - place.y))]
            remedy = f"the nearest walkable place is {x:.1f},{y:.1f}"
        raise MapError(
            f"({place.x:.1f}, {place.y:.1f}) on floor {floor.name} is in a wall or outside",
            where=site.name,
            remedy=remedy,
        )
    return cell


def _nodes(graph: BuildingGraph) -> _Nodes:
    nodes = _Nodes()
    for k, (segment, (a, b)) in enumerate(
        zip(_inset(graph.portal_xy), graph.portal_cells.tolist(), strict=True)
    ):
        for share in (0.0, 0.5, 1.0):
            x, y = (segment[:2] + share * (segment[2:] - segment[:2])).tolist()
            nodes.add(x, y, (a, b), portal=k)
    for k, cell in enumerate(graph.landing_cell.tolist()):
        x, y = graph.landing_xy[k].tolist()
        nodes.add(x, y, (cell,) if cell >= 0 else (), landing=k)
    return nodes


def _inset(portals: Array) -> Array:
    """Portals (p, 4) m without what lies next to their jambs."""
    along = portals[:, 2:] - portals[:, :2]
    length = np.hypot(along[:, 0], along[:, 1])[:, None]
    step = along / length * np.minimum(CLEARANCE, 0.25 * length)
    return np.hstack([portals[:, :2] + step, portals[:, 2:] - step])


def _search(
    site: Site, graph: BuildingGraph, nodes: _Nodes, first: int, last: int, costs: Costs
) -> dict[int, int]:
    """Node before each node reached, quickest first, until the last."""
    rows = [np.nonzero(graph.landing_connector == c)[0].tolist() for c in range(len(graph.connectors))]
    landing_node = {k: n for n, k in enumerate(nodes.landing) if k >= 0}
    before: dict[int, int] = {}
    done: set[int] = set()
    least = {first: 0.0}
    queue = [(0.0, first)]
    while queue:
        time, node = heapq.heappop(queue)
        if node in done:
            continue
        done.add(node)
        if node == last:
            break
        steps = list(_walks(nodes, node, costs))
        if nodes.landing[node] >= 0:
            steps += [(landing_node[k], s) for k, s in _rides(site, graph, rows, nodes.landing[node], costs)]
        for other, seconds in steps:
            if time + seconds < least.get(other, np.inf):
                least[other] = time + seconds
                before[other] = node
                heapq.heappush(queue, (time + seconds, other))
    return before


def _walks(nodes: _Nodes, node: int, costs: Costs) -> Iterator[tuple[int, float]]:
    x, y = nodes.xy[node]
    for cell in nodes.cells[node]:
        for other in nodes.in_cell[cell]:
            if other != node:
                u, v = nodes.xy[other]
                yield other, float(np.hypot(u - x, v - y)) / costs.walking


def _rides(
    site: Site, graph: BuildingGraph, rows: list[list[int]], landing: int, costs: Costs
) -> Iterator[tuple[int, float]]:
    """Other landings of a connector and the seconds to each, where it goes that way."""
    number = int(graph.landing_connector[landing])
    connector = graph.connectors[number]
    here = int(graph.landing_floor[landing])
    for other in rows[number]:
        there = int(graph.landing_floor[other])
        if other != landing and connector.direction * (there - here) >= 0:
            yield other, _seconds(site, connector, here, there, costs)


def _steps(connector: Connector, here: int, there: int) -> int:
    """Stairs between two floors of a connector, 0 where not known."""
    low, high = sorted((connector.floors.index(here), connector.floors.index(there)))
    return sum(connector.n_steps[low:high]) if connector.n_steps else 0


def _seconds(site: Site, connector: Connector, here: int, there: int, costs: Costs) -> float:
    rise = site.floors[there].elevation - site.floors[here].elevation
    return costs.ride(connector, rise, _steps(connector, here, there))


def _parts(
    site: Site, graph: BuildingGraph, nodes: _Nodes, way: list[int], floor: int, costs: Costs
) -> Iterator[Leg | Ride]:
    """Legs and rides of a way of nodes: split where two landings follow one another."""
    start = 0
    for k, (a, b) in enumerate(pairwise(way)):
        one, other = nodes.landing[a], nodes.landing[b]
        if one < 0 or other < 0 or graph.landing_connector[one] != graph.landing_connector[other]:
            continue
        yield _leg(graph, nodes, way[start : k + 1], floor, costs)
        there = int(graph.landing_floor[other])
        connector = graph.connectors[int(graph.landing_connector[one])]
        yield Ride(
            connector,
            floor,
            there,
            _steps(connector, floor, there),
            _seconds(site, connector, floor, there, costs),
        )
        start, floor = k + 1, there
    yield _leg(graph, nodes, way[start:], floor, costs)


def _leg(graph: BuildingGraph, nodes: _Nodes, way: list[int], floor: int, costs: Costs) -> Leg:
    ends = np.array([nodes.xy[way[0]], nodes.xy[way[-1]]])
    portals = [nodes.portal[node] for node in way if nodes.portal[node] >= 0]
    channel = [p for k, p in enumerate(portals) if k == 0 or p != portals[k - 1]]
    path = pull_taut(ends[0], ends[1], list(_inset(graph.portal_xy[channel]))) if channel else ends
    length = float(np.sum(np.hypot(*np.diff(path, axis=0).T)))
    return Leg(floor, path, length, length / costs.walking)
