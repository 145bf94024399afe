"""Journeys over floors: level ways between the connectors of a building, and the ways through them.

A visitor comes from somewhere on a floor, wanders, takes stairs or lift to another floor, and so on. The surveyor
of a journey states a place at every turn, at both landings of a connector, on a half landing (first with the floor
left, then with the floor ahead), and in a lift's cabin on entering and when it has stopped.
"""

from __future__ import annotations

import heapq
from dataclasses import dataclass

import numpy as np

from wayfuse.core.types import Array, IntArray
from wayfuse.simulator.building import Building, Storey
from wayfuse.simulator.passages import Activity, Passage, Stretch
from wayfuse.simulator.rides import LiftModel
from wayfuse.simulator.routes import AT_EASE, Manner, beside, plan_route
from wayfuse.simulator.travel import Leg

__all__ = [
    "Journey",
    "Trip",
    "draw_trips",
    "landing_node",
    "plan_journey",
    "shortest",
    "stay",
    "through",
    "trips_from",
]

_TURN_BACK = 15.0  # m more or less than wanted are better than to turn on the spot
_NEAR = 0.5  # m, a node this near to a landing is the landing's


@dataclass(frozen=True, slots=True)
class Trip:
    """A change of floors: through which passage (index), to which floor."""

    passage: int
    floor: int


@dataclass(frozen=True, slots=True, eq=False)
class Journey:
    """Where a journey starts (x, y m, floor) and its legs."""

    start: tuple[float, float, int]
    legs: tuple[Leg, ...]


def draw_trips(
    building: Building,
    n: int,
    rng: np.random.Generator,
    *,
    lift_first: bool = False,
    connectors: str = "both",
) -> tuple[int, list[Trip]]:
    """A start floor and ``n`` changes of floors, fewer where no way leads on.

    Parameters
    ----------
    connectors : ``stairs`` (and escalators), ``lift``, or ``both`` in turn, where the floor has both.
    """
    floor = start = int(rng.integers(len(building.storeys)))
    trips: list[Trip] = []
    for k in range(n):
        by_lift = (k % 2 == 0) == lift_first if connectors == "both" else connectors == "lift"
        choices = trips_from(building, floor, by_lift=by_lift)
        if not choices and connectors == "both":
            choices = trips_from(building, floor, by_lift=not by_lift)
        if not choices:
            break
        trips.append(choices[int(rng.integers(len(choices)))])
        floor = trips[-1].floor
    return start, trips


def trips_from(building: Building, floor: int, *, by_lift: bool) -> list[Trip]:
    """The changes of floor that a lift, or stairs and escalators, allow from a floor."""
    return [
        Trip(index, other)
        for index, passage in enumerate(building.passages)
        if passage.is_lift == by_lift and floor in passage.connector.floors
        for other in passage.connector.floors
        if other != floor and (by_lift or _leads(passage, floor, other))
    ]


def _leads(passage: Passage, a: int, b: int) -> bool:
    """Whether stairs or an escalator lead from floor a to b without another landing between."""
    floors, direction = passage.connector.floors, passage.connector.direction
    step = floors.index(b) - floors.index(a)
    return abs(step) == 1 and step * direction >= 0


def plan_journey(
    building: Building,
    start: int,
    trips: list[Trip],
    rng: np.random.Generator,
    *,
    lifts: LiftModel,
    visit: tuple[float, float] = (14.0, 34.0),
    manner: Manner = AT_EASE,
) -> Journey:
    """A journey from a place on floor ``start`` through the trips, and on to a place on the last floor.

    Parameters
    ----------
    visit : shortest and longest way on each floor, m, where the floor has one.
    manner : how one walks.
    """
    storey = building.storeys[start]
    node = int(rng.choice(_inner(building, start)))
    place = beside(storey, node, None, manner.wander, rng)
    origin = (float(place[0]), float(place[1]), start)
    legs: list[Leg] = []
    floor = start
    for trip in [*trips, None]:
        passage = None if trip is None else building.passages[trip.passage]
        goal = None if passage is None else landing_node(building, floor, passage)
        ways = _wander(building, floor, node, goal, visit, rng)
        legs += _level_legs(
            building.storeys[floor], floor, ways, place, manner.wander, passage is not None, rng
        )
        _pause(legs, len(ways) - 1, manner, rng)
        if trip is None or passage is None:
            break
        legs += through(passage, trip, floor, legs, lifts, rng)
        floor = trip.floor
        node = landing_node(building, floor, passage)
        place = np.array(legs[-1].stretch[:2])
    return Journey(origin, tuple(legs))


def landing_node(building: Building, floor: int, passage: Passage) -> int:
    """The node of a floor that is a passage's landing."""
    landing = passage.connector.landing(floor)
    if landing is None:
        raise ValueError(f"{passage.connector.id} does not stop on floor {floor}")
    return int(np.argmin(np.hypot(*(building.storeys[floor].nodes - (landing.x, landing.y)).T)))


def _inner(building: Building, floor: int) -> list[int]:
    """Nodes of a floor that are no landings."""
    nodes = building.storeys[floor].nodes
    landings = [p.connector.landing(floor) for p in building.passages]
    taken = [
        int(i)
        for landing in landings
        if landing is not None
        for i in np.flatnonzero(np.hypot(*(nodes - (landing.x, landing.y)).T) < _NEAR)
    ]
    return [i for i in range(len(nodes)) if i not in taken]


def _wander(
    building: Building,
    floor: int,
    node: int,
    goal: int | None,
    visit: tuple[float, float],
    rng: np.random.Generator,
) -> list[int]:
    """Nodes to pass after ``node``: to a place of interest, then to the goal (the place is the goal where None)."""
    storey, inner = building.storeys[floor], _inner(building, floor)
    best: list[int] = []
    least = np.inf
    for _ in range(24):
        middle = int(rng.choice(inner))
        first = shortest(storey, node, middle)
        second = [] if goal is None else shortest(storey, middle, goal)
        turns_back = bool(first and second) and second[0] == [node, *first][-2]
        length = _length(storey, [node, *first, *second])
        off = max(visit[0] - length, length - visit[1], 0.0) + _TURN_BACK * turns_back
        if off < least:
            best, least = [*first, *second], off
        if off == 0.0:
            break
    if best:
        return best
    edge = int(rng.choice(np.flatnonzero(np.any(storey.edges == node, axis=1))))  # to one side
    return [int(storey.edges[edge].sum() - node)]


def _length(storey: Storey, nodes: list[int]) -> float:
    return float(np.hypot(*np.diff(storey.nodes[nodes], axis=0).T).sum())


def shortest(storey: Storey, start: int, goal: int) -> list[int]:
    """Nodes of the shortest way, the start left out."""
    around: dict[int, list[tuple[int, float]]] = {}
    lengths = np.hypot(*(storey.nodes[storey.edges[:, 1]] - storey.nodes[storey.edges[:, 0]]).T)
    for (a, b), length in zip(storey.edges.tolist(), lengths.tolist(), strict=True):
        around.setdefault(a, []).append((b, length))
        around.setdefault(b, []).append((a, length))
    queue: list[tuple[float, int, int]] = [(0.0, start, -1)]
    came: dict[int, int] = {}
    while queue and goal not in came:
        far, node, before = heapq.heappop(queue)
        if node not in came:
            came[node] = before
            for other, gap in around[node]:
                heapq.heappush(queue, (far + gap, other, node))
    way = [goal]
    while came[way[-1]] >= 0:
        way.append(came[way[-1]])
    return way[-2::-1]


def _level_legs(
    storey: Storey,
    floor: int,
    nodes: list[int],
    place: Array,
    wander: float,
    to_landing: bool,
    rng: np.random.Generator,
) -> list[Leg]:
    legs = []
    for i, node in enumerate(nodes):
        exact = to_landing and i == len(nodes) - 1
        place = storey.nodes[node] if exact else beside(storey, node, place, wander, rng)
        legs.append(Leg(Stretch(float(place[0]), float(place[1]), Activity.WALKING), stated=floor))
    return legs


def _pause(legs: list[Leg], n: int, manner: Manner, rng: np.random.Generator) -> None:
    """Stand at some of the last legs' ends but the very last."""
    for k in range(max(len(legs) - n - 1, 0), len(legs) - 1):
        if legs[k].passage < 0 and rng.random() < manner.pause_share:
            legs[k] = legs[k]._replace(pause=float(rng.uniform(*manner.pause_range)), left=legs[k].stated)


def through(
    passage: Passage, trip: Trip, floor: int, legs: list[Leg], lifts: LiftModel, rng: np.random.Generator
) -> list[Leg]:
    """Legs from landing to landing."""
    way = passage.way(floor, trip.floor)
    inside = [Leg(piece, passage=trip.passage) for piece in way]
    if passage.is_lift:
        if legs:  # stand before the door until the lift comes
            legs[-1] = legs[-1]._replace(pause=float(rng.uniform(*lifts.wait_s)), left=floor)
        enter, move = (float(rng.uniform(*lifts.doors_s)) for _ in range(2))
        inside[0] = inside[0]._replace(pause=enter, stated=floor)
        inside[1] = inside[1]._replace(pause=move, stated=trip.floor)
    elif passage.connector.direction:
        inside[0] = inside[0]._replace(stated=floor)
        inside[1] = inside[1]._replace(stated=trip.floor)
    else:
        flights = [k for k, piece in enumerate(way) if piece.activity is Activity.STAIRS]
        for k in range(flights[0], flights[-1]):  # on half landings: arriving, and before the next flight
            stated = floor if 2 * k < flights[0] + flights[-1] else trip.floor
            inside[k] = inside[k]._replace(stated=stated)
    inside[-1] = inside[-1]._replace(stated=trip.floor)
    return inside


def stay(
    building: Building,
    floor: int,
    length: float,
    rng: np.random.Generator,
    *,
    manner: Manner = AT_EASE,
    visits: IntArray | None = None,
) -> Journey:
    """A walk of about ``length`` m on one floor; parameters as of `wayfuse.simulator.routes.plan_route`."""
    route = plan_route(building.storeys[floor], length, rng, manner=manner, visits=visits)
    places, pauses = route.xy.tolist(), route.pause.tolist()
    legs = tuple(
        Leg(Stretch(x, y, Activity.WALKING), pause, stated=floor, left=floor if pause else -1)
        for (x, y), pause in zip(places[1:], pauses[1:], strict=True)
    )
    return Journey((places[0][0], places[0][1], floor), legs)
