"""A walk through given places: straight where the way is clear, else along corridors, by stairs or lift."""

from __future__ import annotations

import numpy as np

from wayfuse.core.errors import ConfigError
from wayfuse.core.types import Array
from wayfuse.simulator.building import Building, Storey
from wayfuse.simulator.journeys import Journey, Trip, landing_node, shortest, through, trips_from
from wayfuse.simulator.passages import Activity, Stretch
from wayfuse.simulator.rides import LiftModel
from wayfuse.simulator.scenario_file import Place
from wayfuse.simulator.travel import Leg

__all__ = ["given_journey"]

_MARGIN = 0.3  # m from walls, on a way that goes straight


def given_journey(
    building: Building,
    places: tuple[Place, ...],
    rng: np.random.Generator,
    *,
    lifts: LiftModel,
    connectors: str = "both",
) -> Journey:
    """The journey through places in their order.

    Raises
    ------
    ConfigError : a place is outside its floor, or no way leads to it.
    """
    floors = [building.floor_index(place.floor) for place in places]
    for place, floor in zip(places, floors, strict=True):
        if not building.storeys[floor].is_walkable(np.array([[place.x, place.y]]))[0]:
            raise ConfigError(
                f"({place.x:g}, {place.y:g}) on floor {place.floor} is nowhere to walk",
                where="walkers.waypoints",
                remedy="give places inside the outline, in no closed room",
            )
    legs: list[Leg] = []
    at, floor = np.array(places[0][:2]), floors[0]
    for place, goal in zip(places[1:], floors[1:], strict=True):
        for trip in _trips(building, floor, goal, connectors):
            passage = building.passages[trip.passage]
            landing = building.storeys[floor].nodes[landing_node(building, floor, passage)]
            legs += _level(building.storeys[floor], floor, at, landing)
            legs += through(passage, trip, floor, legs, lifts, rng)
            floor, at = trip.floor, np.array(legs[-1].stretch[:2])
        target = np.array(place[:2])
        legs += _level(building.storeys[floor], floor, at, target)
        at = target
    return Journey((places[0].x, places[0].y, floors[0]), tuple(legs))


def _trips(building: Building, start: int, goal: int, connectors: str) -> list[Trip]:
    """The fewest changes of floors from one to another."""
    kinds = {"both": (False, True), "stairs": (False,), "lift": (True,)}[connectors]
    came: dict[int, list[Trip]] = {start: []}
    queue = [start]
    while queue and goal not in came:
        floor = queue.pop(0)
        for by_lift in kinds:
            for trip in trips_from(building, floor, by_lift=by_lift):
                if trip.floor not in came:
                    came[trip.floor] = [*came[floor], trip]
                    queue.append(trip.floor)
    if goal not in came:
        names = [building.storeys[k].name for k in (start, goal)]
        raise ConfigError(
            f"no way from floor {names[0]} to floor {names[1]}",
            where="walkers.waypoints",
            remedy="allow other walkers.connectors, or give places on one floor",
        )
    return came[goal]


def _level(storey: Storey, floor: int, start: Array, stop: Array) -> list[Leg]:
    """Legs on one floor, none where one is there already."""
    if np.hypot(*(stop - start)) < _MARGIN:
        return []
    way = [stop]
    if not storey.is_clear(start, stop, _MARGIN):
        first, last = (_nearest(storey, place) for place in (start, stop))
        between = shortest(storey, first, last) if first != last else []
        way = [*storey.nodes[[first, *between]], stop]
    return [Leg(Stretch(float(x), float(y), Activity.WALKING), stated=floor) for x, y in way]


def _nearest(storey: Storey, place: Array) -> int:
    """The nearest node that a place sees, else the nearest."""
    order = np.argsort(np.hypot(*(storey.nodes - place).T))
    return next((int(k) for k in order[:12] if storey.is_clear(place, storey.nodes[k], 0.0)), int(order[0]))
