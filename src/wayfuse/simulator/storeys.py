"""The building of the demo: three storeys of 60 m x 36 m, two stairways and a lift.

A ring of corridors between an outer row of rooms and a core. In the core's west a stairway of two half flights
joins all floors beside the lift; in its east a hall on floor 0, open up to floor 1, with straight stairs to
the gallery above. Rooms are closed to walkers. Only the cuts between rooms are drawn at random. Floors are named
by their number, as the logs that the demo writes can say no other name.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from wayfuse.core.frames import GeoAnchor
from wayfuse.core.types import Array
from wayfuse.maps.connectors import Landing
from wayfuse.simulator.building import Building, Room, Storey, box, corridor_graph, cuts
from wayfuse.simulator.geometry import polygon_walls
from wayfuse.simulator.passages import RISER, TREAD, Activity, Passage, Stretch, escalator, lift, stairway

__all__ = ["three_storeys"]

_WIDTH, _HEIGHT = 60.0, 36.0  # m
_USUAL = 3  # passages without an escalator
_STEPS = 13  # of a half flight
_STOREY_HEIGHT = 2 * _STEPS * RISER  # m: 4.42
_LON, _LAT = 11.0, 48.0  # degrees: a made-up place
_FLIGHT = _STEPS * TREAD  # m, level length of a half flight
_OUTLINE = ((0.0, 0.0), (60.0, 0.0), (60.0, 30.0), (54.0, 36.0), (0.0, 36.0))
_WEST = {"ws": (9.75, 13.2), "st": (10.75, 13.2), "wl": (9.75, 18.0), "li": (10.75, 18.0)}
_RING = {
    "sw": (9.75, 9.75), "s": (30.0, 9.75), "se": (50.25, 9.75), "ne": (50.25, 26.25), "n": (30.0, 26.25),
    "nw": (9.75, 26.25), "p": (30.0, 18.0), "e": (50.25, 18.0),
}  # fmt: skip
_WAYS = "sw-s s-se se-e e-ne ne-n n-nw nw-wl wl-ws ws-sw ws-st wl-li s-p p-n"
_STAIRS = (box(11.5, 18.1, 11.5, 14.9), 3)  # footprint and its open edge, which is the west one
_LIFT = (box(11.5, 13.7, 17.0, 19.0), 3)
_HALL_STAIRS = box(38.0, 47.2, 22.4, 24.1)
_ESCALATOR = box(38.0, 47.2, 21.3, 22.4)


def three_storeys(rng: np.random.Generator, *, with_escalator: bool = False) -> Building:
    """Draw the building of the demo; with an escalator from the hall up to the gallery where asked for."""
    passages = (_core_stairs(), _hall_stairs(), _lift(), *([_escalator()] if with_escalator else []))
    storeys = (_ground_floor(passages, rng), _gallery(passages, rng), _top_floor(passages, rng))
    anchor = GeoAnchor.from_origin(_LON, _LAT)
    return Building("Wayfuse Demo House", storeys, _WIDTH, _HEIGHT, anchor, passages)


def _core_stairs() -> Passage:
    """Up along the south wall, a turn on the half landing, back along the north wall."""
    south, north, foot, half = 12.4, 14.0, 12.4, 12.4 + _FLIGHT
    turn = half + 0.9
    landings = tuple(Landing(k, *_WEST["st"]) for k in range(3))
    walk, climb = Activity.WALKING, Activity.STAIRS
    way = (
        Stretch(foot, south, walk),
        Stretch(half, south, climb, _STEPS * RISER, _STEPS),
        Stretch(turn, south, walk),
        Stretch(turn, north, walk),
        Stretch(half, north, walk),
        Stretch(foot, north, climb, _STEPS * RISER, _STEPS),
        Stretch(*_WEST["st"], walk),
    )
    return stairway("core stairs", landings, (way, way), _STAIRS[0], (_STAIRS[1],) * 3)


def _hall_stairs() -> Passage:
    """Straight up from the hall to the gallery, with a landing half way."""
    y, x0, x1 = 23.25, 38.0, 47.2
    middle = x1 - x0 - 2 * _FLIGHT
    walk, climb = Activity.WALKING, Activity.STAIRS
    landings = (Landing(0, x0 - 0.75, y), Landing(1, x1 + 0.75, y))
    way = (
        Stretch(x0, y, walk),
        Stretch(x0 + _FLIGHT, y, climb, _STEPS * RISER, _STEPS),
        Stretch(x0 + _FLIGHT + middle, y, walk),
        Stretch(x1, y, climb, _STEPS * RISER, _STEPS),
        Stretch(x1 + 0.75, y, walk),
    )
    return stairway("hall stairs", landings, (way,), _HALL_STAIRS, (3, 1))


def _escalator() -> Passage:
    """Beside the hall's stairs, up only."""
    x0, x1, y = 38.0, 47.2, float(_ESCALATOR[:, 1].mean())
    walk = Activity.WALKING
    way = (
        Stretch(x0 + 0.4, y, walk),
        Stretch(x1 - 0.4, y, Activity.ESCALATOR, _STOREY_HEIGHT),
        Stretch(x1 + 0.75, y, walk),
    )
    return escalator(
        "escalator", (Landing(0, x0 - 0.75, y), Landing(1, x1 + 0.75, y)), way, _ESCALATOR, (3, 1)
    )


def _lift() -> Passage:
    landings = tuple(Landing(k, *_WEST["li"]) for k in range(3))
    return lift("lift", landings, tuple(_STOREY_HEIGHT * k for k in range(3)), *_LIFT)


def _ground_floor(passages: tuple[Passage, ...], rng: np.random.Generator) -> Storey:
    rooms = _outer_rooms(rng, south_gap=(28.0, 32.0)) + _west_core(rng)
    rooms += [box(a, b, 11.5, 14.5) for a, b in pairwise(cuts(32.0, 48.5, rng))]
    points = {**_RING, **_WEST, "door": (30.0, 2.0), "w": (35.0, 18.0), "hs": (37.25, 23.25)}
    ways = f"{_WAYS} door-s p-w w-e w-hs hs-n"
    if len(passages) > _USUAL:
        points["es"], ways = (37.25, float(_ESCALATOR[:, 1].mean())), f"{ways} w-es"
    return _storey(0, rooms, [], points, ways, passages)


def _gallery(passages: tuple[Passage, ...], rng: np.random.Generator) -> Storey:
    rooms = _outer_rooms(rng) + _west_core(rng)
    rooms += [box(a, b, 11.5, 14.5) for a, b in pairwise(cuts(32.0, 48.5, rng))]
    points = {**_RING, **_WEST, "hs": (47.95, 23.25), "eh": (50.25, 23.25)}
    ways = _WAYS.replace("e-ne ", "e-eh eh-ne ") + " eh-hs"
    if len(passages) > _USUAL:
        points["es"], ways = (47.95, float(_ESCALATOR[:, 1].mean())), f"{ways} es-e"
    return _storey(1, rooms, [box(33.5, 46.5, 14.5, 21.0)], points, ways, passages)


def _top_floor(passages: tuple[Passage, ...], rng: np.random.Generator) -> Storey:
    rooms = _outer_rooms(rng) + _west_core(rng)
    for low, high in ((11.5, 16.25), (19.75, 24.5)):
        rooms += [box(a, b, low, high) for a, b in pairwise(cuts(32.0, 48.5, rng))]
    return _storey(2, rooms, [], {**_RING, **_WEST}, f"{_WAYS} p-e", passages)


def _outer_rooms(rng: np.random.Generator, south_gap: tuple[float, float] | None = None) -> list[Array]:
    """The rooms along the outline, depth 8 m; a gap in the south row is the way to the door."""
    south = cuts(8.0, 52.0, rng, south_gap)
    rooms = [box(a, b, 0.0, 8.0) for a, b in pairwise(south) if (a, b) != south_gap]
    rooms += [box(a, b, 28.0, 36.0) for a, b in pairwise(cuts(8.0, 52.0, rng))]
    for west, east in ((0.0, 8.0), (52.0, 60.0)):
        rooms += [box(west, east, a, b) for a, b in pairwise(cuts(8.0, 28.0, rng))]
        rooms.append(box(west, east, 0.0, 8.0))
    rooms.append(box(0.0, 8.0, 28.0, 36.0))
    rooms.append(np.array([(52.0, 28.0), (60.0, 28.0), (60.0, 30.0), (54.0, 36.0), (52.0, 36.0)]))
    return rooms


def _west_core(rng: np.random.Generator) -> list[Array]:
    """What fills the core around stairs and lift."""
    split = 18.0 + float(np.round(rng.uniform(-1.0, 1.0), 2))
    rooms = [box(11.5, 18.1, 14.9, 17.0), box(13.7, 18.1, 17.0, 19.0), box(11.5, 18.1, 19.0, 24.5)]
    for low, high in ((11.5, split), (split, 24.5)):
        rooms += [box(a, b, low, high) for a, b in pairwise(cuts(18.1, 28.0, rng))]
    return rooms


def _storey(
    number: int,
    rooms: list[Array],
    voids: list[Array],
    points: dict[str, tuple[float, float]],
    ways: str,
    passages: tuple[Passage, ...],
) -> Storey:
    outline = np.array(_OUTLINE)
    nodes, edges = corridor_graph(points, ways)
    shafts = [p.walls(number) for p in passages if number in p.connector.floors]
    return Storey(
        name=str(number),
        elevation=_STOREY_HEIGHT * number,
        outline=outline,
        rooms=tuple(Room(f"{number}.{i + 1:02d}", polygon) for i, polygon in enumerate(rooms)),
        voids=tuple(Room(f"{number} void", polygon) for polygon in voids),
        walls=np.concatenate([polygon_walls([outline, *rooms, *voids]), *shafts]),
        nodes=nodes,
        edges=edges,
    )
