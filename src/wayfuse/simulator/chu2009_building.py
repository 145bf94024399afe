r"""The building of chu2009, chapter 5: three floors of 74.4 m x 37.2 m, 153 training places, 11 access points heard.

The thesis prints neither plan nor walk nor radio: here public areas around two stairways and a lift, closed rooms on
all sides. The radio is that of chapter 4 (`chu2009_world`, RIM) with a loss per floor between, and the *drift* that
the thesis is about: from the training to the walk, and on the walk, the level of each access point wanders,

.. math:: z_a(t) = P_r(a) + b_a(t) + N(0, \sigma_f), \quad b_a(t + 1) = \rho b_a(t) + N(0, (1 - \rho^2) \sigma_b^2).

The sensors on the belt tell a displacement per second on a floor, a number of stairs on stairs, and the begin and the
end of a lift ride with the number of floors, each with its errors.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayfuse.core.frames import GeoAnchor
from wayfuse.core.types import Array
from wayfuse.maps.connectors import Landing
from wayfuse.simulator.building import Building, Room, Storey, box, corridor_graph
from wayfuse.simulator.chu2009_world import draw_pattern, rim_levels
from wayfuse.simulator.geometry import clearance, inside, polygon_walls
from wayfuse.simulator.passages import RISER, TREAD, Activity, Passage, Stretch, lift, stairway

__all__ = ["FLOOR_HEIGHT", "BuildingModel", "Radio", "Walk", "draw_radio", "engineering_building", "walk"]

_WIDTH, _HEIGHT = 74.4, 37.2  # m, chapter 5
_STAIRS = 24  # of a stairway from floor to floor, in two flights
FLOOR_HEIGHT = _STAIRS * RISER  # m
_PUBLIC = (8.4, 66.0, 8.4, 28.8)  # x0, x1, y0, y1, m: hallways and other public areas
_LOBBY = (32.2, 42.2)  # x, m
_BAND = (16.95, 20.25)  # y, m: of stairs, lift and shafts
_STAIRS_AT = (11.2, 63.2)  # x, m, of the stairways' open ends
_STAIRWELL = 6.6  # m
_POINTS = {
    "sw": (9.8, 9.8), "s1": (21.5, 9.8), "s": (37.2, 9.8), "s2": (53.0, 9.8), "se": (64.6, 9.8), "ec": (64.6, 14.0),
    "e": (64.6, 18.6), "ed": (64.6, 22.5), "ne": (64.6, 27.4), "n2": (53.0, 27.4), "n": (37.2, 27.4),
    "n1": (21.5, 27.4), "nw": (9.8, 27.4), "wb": (9.8, 22.5), "w": (9.8, 18.6), "wa": (9.8, 14.5), "m": (37.2, 18.6),
    "l": (33.2, 18.6), "ms": (37.2, 13.5), "mn": (37.2, 23.5), "a1": (13.0, 15.5), "a2": (30.0, 15.5),
    "b1": (13.5, 23.5), "b2": (30.0, 23.5), "c1": (45.0, 13.5), "c2": (61.5, 13.5), "d1": (45.0, 21.4),
    "d2": (61.5, 21.4),
}  # fmt: skip
_WAYS = (
    "sw-s1 s1-s s-s2 s2-se se-ec ec-e e-ed ed-ne ne-n2 n2-n n-n1 n1-nw nw-wb wb-w w-wa wa-sw s-ms ms-m m-mn mn-n m-l "
    "wa-a1 a1-a2 a2-ms wb-b1 b1-b2 b2-mn b1-n1 ms-c1 c1-c2 c2-ec c1-s2 mn-d1 d1-d2 d2-ed"
)
_POWER = 15.0  # dBm, as chapter 4
_FLIGHT = 0.5 * _STAIRS * TREAD  # m, level length of a flight
_ASIDE = 0.6  # of the way to the nearest wall: how far beside a node one passes, per axis
_STAIRS_PACE = 0.5  # m/s along the level: 1.7 stairs a second
_DOORS, _LIFT_SPEED = 5.0, 1.0  # s to wait in the cabin, m/s


@dataclass(frozen=True, slots=True, kw_only=True)
class BuildingModel:
    """What chapter 5 prints (first block) and what it does not.

    n_places : training places of the building, n_samples of each. heard : access points of an average scan, to which
    the least level that is heard is set. n_aps : of the building, a third on each floor.
    noise, drift : dB, sigma_f and sigma_b. memory : s, in which the drift forgets 63 %. waf, faf : dB per wall, floor.
    angle : rad, error of a second's direction; bias : rad, of a walk's. distance : share, error of a second's
    displacement. missed : share of stairs that are not counted.
    """

    n_places: int = 153
    n_samples: int = 100
    heard: float = 11.0
    n_aps: int = 18
    noise: float = 10.0
    drift: float = 3.0
    memory: float = 60.0
    waf: float = 3.0
    faf: float = 12.0
    doi: float = 0.004
    vsp: float = 0.02
    angle: float = 0.35
    bias: float = 0.15
    distance: float = 0.1
    missed: float = 0.04
    seconds: int = 300
    speed: float = 1.0


@dataclass(frozen=True, slots=True, eq=False)
class Radio:
    """Access points as drawn, and the survey of them.

    places (a, 2) m, floor (a,), power (a,) dBm, pattern (a, 360); limit dBm, the least level that is heard.
    survey_xy (p, 2) m, survey_floor (p,), samples (p, n, a) dBm, NaN where unheard.
    """

    model: BuildingModel
    building: Building
    places: Array
    floor: NDArray[np.int32]
    power: Array
    pattern: Array
    limit: float
    survey_xy: Array
    survey_floor: NDArray[np.int32]
    samples: Array


class Walk(NamedTuple):
    """A walk, second by second.

    xy (t, 2) m, z (t,) m and floor (t,), the nearest: the truth. moved (t, 2) m: displacement since the second before
    as the sensors tell it. stairs (t,): stairs climbed in this second, negative down. on_stairs (t,) bool: whether the
    sensors see stairs. rides (t,): +1 or -1 in the second a ride begins. stops (t,): floors ridden, in the second a
    ride ends. levels (t, a) dBm: the scan, NaN where unheard.
    """

    xy: Array
    z: Array
    floor: NDArray[np.int32]
    moved: Array
    stairs: NDArray[np.int64]
    on_stairs: NDArray[np.bool_]
    rides: NDArray[np.int64]
    stops: NDArray[np.int64]
    levels: Array


def engineering_building() -> Building:
    """The plan: floors 4, 5 and 6."""
    passages = (_stairs("west stairs", _STAIRS_AT[0], 1.0), _stairs("east stairs", _STAIRS_AT[1], -1.0),
                _lift())  # fmt: skip
    storeys = tuple(_storey(number, passages) for number in range(3))
    return Building(
        "Engineering Building III", storeys, _WIDTH, _HEIGHT, GeoAnchor.from_origin(120.997, 24.787), passages
    )


def _storey(number: int, passages: tuple[Passage, ...]) -> Storey:
    outline, rooms = box(0.0, _WIDTH, 0.0, _HEIGHT), _rooms()
    nodes, edges = corridor_graph(_POINTS, _WAYS)
    return Storey(
        name=str(number + 4),
        elevation=FLOOR_HEIGHT * number,
        outline=outline,
        rooms=tuple(Room(f"{number + 4}{i + 1:02d}", polygon) for i, polygon in enumerate(rooms)),
        voids=(),
        walls=np.concatenate([polygon_walls([outline, *rooms]), *(p.walls(number) for p in passages)]),
        nodes=nodes,
        edges=edges,
    )


def _rooms() -> list[Array]:
    """Closed rooms: along the outline, two in the public area, and the shafts between stairways and lobby."""
    x0, x1, y0, y1 = _PUBLIC
    low, high = _BAND
    along = np.linspace(x0, x1, 9).tolist()
    rooms = [box(a, b, 0.0, y0) for a, b in pairwise(along)]
    rooms += [box(a, b, y1, _HEIGHT) for a, b in pairwise(along)]
    for west, east in ((0.0, x0), (x1, _WIDTH)):
        rooms += [box(west, east, a, b) for a, b in pairwise([0.0, y0, 15.2, 22.0, y1, _HEIGHT])]
    rooms += [box(15.0, 28.0, 11.2, 14.2), box(47.0, 60.0, 22.5, 26.0)]
    rooms.append(box(_STAIRS_AT[0] + _STAIRWELL, _LOBBY[0] - 2.0, low, high))
    rooms.append(box(_LOBBY[1], _STAIRS_AT[1] - _STAIRWELL, low, high))
    return rooms


def _stairs(name: str, x: float, way_in: float) -> Passage:
    """A stairway behind the corridor's inner wall at x; ``way_in`` : +1 to the east, -1 to the west."""
    mid, off = 0.5 * _HEIGHT, 0.8
    foot, turn = x + way_in * 1.0, x + way_in * (1.0 + _FLIGHT)
    place = (x - way_in * 1.4, mid)
    landings = tuple(Landing(k, *place) for k in range(3))
    half = _STAIRS // 2
    up = (
        Stretch(foot, mid - off, Activity.WALKING),
        Stretch(turn, mid - off, Activity.STAIRS, half * RISER, half),
        Stretch(turn, mid + off, Activity.WALKING),
        Stretch(foot, mid + off, Activity.STAIRS, half * RISER, half),
        Stretch(*place, Activity.WALKING),
    )
    end = x + way_in * _STAIRWELL
    footprint = box(min(x, end), max(x, end), *_BAND)
    return stairway(name, landings, (up, up), footprint, (3 if way_in > 0.0 else 1,) * 3)


def _lift() -> Passage:
    mid = 0.5 * _HEIGHT
    landings = tuple(Landing(k, _LOBBY[0] + 1.0, mid) for k in range(3))
    heights = tuple(FLOOR_HEIGHT * k for k in range(3))
    return lift("lift", landings, heights, box(_LOBBY[0] - 2.0, _LOBBY[0], *_BAND), 1)


def draw_radio(building: Building, model: BuildingModel, rng: np.random.Generator) -> Radio:
    """Draw the access points' powers and patterns, and survey public places."""
    n_floors = len(building.storeys)
    ap_floor = (np.arange(model.n_aps) % n_floors).astype(np.int32)
    nth = np.arange(model.n_aps) // n_floors
    angle = 2.0 * np.pi * (nth + ap_floor / n_floors) / max(model.n_aps // n_floors, 1)
    places = np.array([_WIDTH, _HEIGHT]) * (0.5 + 0.36 * np.column_stack([np.cos(angle), np.sin(angle)]))
    power = _POWER * (1.0 + model.vsp * rng.standard_normal(model.n_aps))
    pattern = np.array([draw_pattern(model.doi, rng) for _ in places])
    xy, floor = _public_places(building, model.n_places, rng)
    mean = _levels(building, model, (places, ap_floor, power, pattern), xy, floor)
    noisy = mean[:, None] + model.noise * rng.standard_normal((len(xy), model.n_samples, model.n_aps))
    limit = float(np.quantile(noisy, 1.0 - model.heard / model.n_aps))
    samples = np.where(noisy >= limit, np.round(noisy), np.nan)
    return Radio(model, building, places, ap_floor, power, pattern, limit, xy, floor, samples)


def walk(radio: Radio, rng: np.random.Generator) -> Walk:
    """A walk through corridors, over stairs and by lift, and what the sensors and the radio tell of it."""
    model = radio.model
    knots, spans = _path(radio.building, model, rng)
    t = np.arange(model.seconds + 1.0)
    x, y, z = (np.interp(t, knots[:, 0], knots[:, k]) for k in (1, 2, 3))
    xy = np.column_stack([x, y])
    floor = np.clip(np.round(z / FLOOR_HEIGHT), 0, 2).astype(np.int32)
    on_stairs = np.zeros(len(t), np.bool_)
    rides, stops = np.zeros((2, len(t)), np.int64)
    afloat = np.zeros(len(t), np.bool_)  # the displacement is not one of walking a floor
    for start, end, rise, is_lift in spans:
        inside = (t > start) & (t <= end + 1.0)
        afloat |= inside
        if not is_lift:
            on_stairs |= inside
        elif int(end) + 1 < len(t):
            rides[int(start) + 1] = np.sign(rise)
            stops[int(end) + 1] = rise
    climbed = np.where(on_stairs, np.diff(np.round(z / RISER), prepend=0.0), 0.0).astype(np.int64)
    counted = np.sign(climbed) * rng.binomial(np.abs(climbed), 1.0 - model.missed)
    moved = np.where(afloat[:, None], 0.0, np.diff(xy, axis=0, prepend=xy[:1]))
    return Walk(
        xy,
        z,
        floor,
        _sensed(moved, model, rng),
        counted,
        on_stairs,
        rides,
        stops,
        _scans(radio, xy, floor, rng),
    )


def _levels(
    building: Building,
    model: BuildingModel,
    aps: tuple[Array, NDArray[np.int32], Array, Array],
    xy: Array,
    floor: NDArray[np.int32],
) -> Array:
    """Levels (m, a) dBm without noise and drift of access points (place, floor, power, pattern) at places (m, 2)."""
    places, ap_floor, power, pattern = aps
    out = np.empty((len(xy), len(places)))
    for f, storey in enumerate(building.storeys):
        rows = np.flatnonzero(floor == f)
        out[rows] = rim_levels(places, power, pattern, storey.walls, model.waf, xy[rows])
        out[rows] -= model.faf * np.abs(ap_floor - f)
    return out


def _scans(radio: Radio, xy: Array, floor: NDArray[np.int32], rng: np.random.Generator) -> Array:
    model = radio.model
    aps = (radio.places, radio.floor, radio.power, radio.pattern)
    levels = _levels(radio.building, model, aps, xy, floor)
    keep = np.exp(-1.0 / model.memory)
    drift = model.drift * rng.standard_normal(model.n_aps)
    for second in range(len(levels)):
        levels[second] += drift
        drift = keep * drift + np.sqrt(1.0 - keep**2) * model.drift * rng.standard_normal(model.n_aps)
    levels += model.noise * rng.standard_normal(levels.shape)
    return np.where(levels >= radio.limit, np.round(levels), np.nan)


def _sensed(moved: Array, model: BuildingModel, rng: np.random.Generator) -> Array:
    turn = model.bias * rng.standard_normal() + model.angle * rng.standard_normal(len(moved))
    stretch = 1.0 + model.distance * rng.standard_normal(len(moved))
    c, s = stretch * np.cos(turn), stretch * np.sin(turn)
    return np.column_stack([c * moved[:, 0] - s * moved[:, 1], s * moved[:, 0] + c * moved[:, 1]])


def _public_places(building: Building, n: int, rng: np.random.Generator) -> tuple[Array, NDArray[np.int32]]:
    """Random places (n, 2) m in public areas, as many on each floor."""
    floor = (np.arange(n) % len(building.storeys)).astype(np.int32)
    xy = np.empty((n, 2))
    for f, storey in enumerate(building.storeys):
        shafts = [Room("", p.footprint) for p in building.passages]
        tries = rng.uniform(_PUBLIC[::2], _PUBLIC[1::2], (4 * n, 2))
        free = storey.is_walkable(tries)
        for shaft in shafts:
            free &= ~inside(shaft.polygon, tries)
        rows = np.flatnonzero(floor == f)
        xy[rows] = tries[free][: len(rows)]
    return xy, floor


class _Span(NamedTuple):
    """Stairs from the first to the last, or a ride: start, end (s), floors risen, whether by lift."""

    start: float
    end: float
    rise: int
    is_lift: bool


def _path(building: Building, model: BuildingModel, rng: np.random.Generator) -> tuple[Array, list[_Span]]:
    """Knots (k, 4) of time, x, y, z, and the movements between floors."""
    floor = int(rng.integers(len(building.storeys)))
    node = int(rng.integers(len(building.storeys[floor].nodes)))
    x, y = building.storeys[floor].nodes[node]
    knots = [(0.0, float(x), float(y), building.storeys[floor].elevation)]
    spans: list[_Span] = []
    while knots[-1][0] < model.seconds + 2.0:
        passage = building.passages[int(rng.integers(len(building.passages)))]
        to = int(rng.choice([f for f in range(3) if f != floor and (passage.is_lift or abs(f - floor) == 1)]))
        storey = building.storeys[floor]
        landing = passage.connector.landings[floor]
        goal = int(np.argmin(np.hypot(*(storey.nodes - (landing.x, landing.y)).T)))
        middle = int(rng.integers(len(storey.nodes)))
        for at in [*_way(storey, node, middle), *_way(storey, middle, goal)]:
            reach = _ASIDE * min(float(clearance(storey.nodes[at][None], storey.walls)[0]), 4.0)
            aside = rng.uniform(-reach, reach, 2) if at != goal else np.zeros(2)
            there = storey.nodes[at] + aside
            _go(knots, float(there[0]), float(there[1]), knots[-1][3], model.speed)
        first = len(knots)
        for piece in passage.way(floor, to):
            pace = _STAIRS_PACE if piece.activity is Activity.STAIRS else model.speed
            if piece.activity is Activity.LIFT:
                t, cx, cy, z = knots[-1]
                knots.append((t + _DOORS, cx, cy, z))
                knots.append((t + _DOORS + abs(piece.rise) / _LIFT_SPEED, cx, cy, z + piece.rise))
            else:
                _go(knots, piece.x, piece.y, knots[-1][3] + piece.rise, pace)
        moving = np.flatnonzero(np.diff([k[3] for k in knots[first - 1 :]]) != 0.0)
        spans.append(
            _Span(knots[first - 1 + moving[0]][0], knots[first + moving[-1]][0], to - floor, passage.is_lift)
        )
        floor = to
        node = int(np.argmin(np.hypot(*(building.storeys[to].nodes - knots[-1][1:3]).T)))
    return np.array(knots), spans


def _go(knots: list[tuple[float, float, float, float]], x: float, y: float, z: float, pace: float) -> None:
    t, x0, y0, _ = knots[-1]
    knots.append((t + max(float(np.hypot(x - x0, y - y0)) / pace, 0.01), float(x), float(y), z))


def _way(storey: Storey, start: int, goal: int) -> list[int]:
    """Nodes of a shortest way, the start left out."""
    n = len(storey.nodes)
    gap = np.full((n, n), np.inf)
    a, b = storey.edges.T
    gap[a, b] = gap[b, a] = np.hypot(*(storey.nodes[a] - storey.nodes[b]).T)
    far, came = np.full(n, np.inf), np.full(n, -1)
    far[start] = 0.0
    for _ in range(n):
        through = far[:, None] + gap
        best = np.argmin(through, axis=0)
        shorter = through[best, np.arange(n)] < far
        if not shorter.any():
            break
        came[shorter] = best[shorter]
        far = np.minimum(far, through.min(axis=0))
    way = [goal] if goal != start else []
    while way and came[way[-1]] != start:
        way.append(int(came[way[-1]]))
    return way[::-1]
