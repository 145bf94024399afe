r"""The simulated field of chu2009, chapter 4: a 100 x 100 m floor of rooms, access points at its edge, RIM radio.

.. math:: P_r = P_t (1 + N(0, VSP)) - PL(d) K_i - \min(N_{obs}, maxW) \, WAF + N(0, \sigma_f)   \quad (4.1-4.5)

The paper prints neither the walls of Figure 4.1 nor the walk: the rooms here are twelve, joined by doors of 4 m; the
walker takes random way points in line of sight at 1 m/s.

Departures: Eq. 4.4 calls a Weibull variable zero-mean, which it is not: it gets a random sign; its parameters are not
given: shape and scale 1. The pattern closes (:math:`|K_0 - K_{359}| \le DOI`) by drawing it until it does. Eq. 4.2
scales a level in dBm, as printed.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wayfuse.core.types import Array
from wayfuse.simulator.geometry import crossings

__all__ = [
    "AP_PLACES",
    "SIDE",
    "Field",
    "FieldModel",
    "Walk",
    "draw_field",
    "draw_pattern",
    "rim_levels",
    "room_walls",
    "walk",
]

SIDE = 100.0  # m
# the twelve of the paper, reordered so that the first n of them surround the field for every n
AP_PLACES = np.array(
    [
        (5, 5),
        (95, 5),
        (95, 95),
        (5, 95),
        (40, 5),
        (60, 95),
        (95, 60),
        (5, 40),
        (60, 5),
        (95, 40),
        (40, 95),
        (5, 60),
    ],
    dtype=np.float64,
)
_REFERENCE = 37.3  # dB, path loss at 1 m
_EXPONENT = 3.3
_MAX_WALLS = 4
_SAMPLES = 100  # of each training place
_DOOR = 4.0  # m
_MOST_DRAWS = 20_000


@dataclass(frozen=True, slots=True, kw_only=True)
class FieldModel:
    """Parameters of Section 4.1 that its figures vary. noise : sigma_f (dB). grain : m between training places."""

    n_aps: int = 8
    noise: float = 3.0
    grain: float = 1.0
    doi: float = 0.004
    waf: float = 3.0
    power: float = 15.0
    vsp: float = 0.02
    seconds: int = 300
    speed: float = 1.0


@dataclass(frozen=True, slots=True, eq=False)
class Field:
    """A field as drawn. power (a,) dBm; pattern (a, 360) K_i; radio map on the grid of training places: levels
    (ny, nx, a) dBm, the mean of 100 samples each."""

    model: FieldModel
    places: Array
    power: Array
    pattern: Array
    levels: Array

    def mean_levels(self, xy: Array) -> Array:
        """Levels (m, a) dBm at places (m, 2), without background noise."""
        return _mean_levels(self.model, self.places, self.power, self.pattern, xy)


@dataclass(frozen=True, slots=True, eq=False)
class Walk:
    """A walk, second by second: xy (t, 2) m; moved (t, 2) m since the second before; levels (t, a) dBm observed."""

    xy: Array
    moved: Array
    levels: Array


def room_walls() -> Array:
    """Walls (w, 4) m: three lines of x and two of y, open at their doors."""
    walls: list[tuple[float, float, float, float]] = []
    for x in (25.0, 50.0, 75.0):
        walls += [(x, a, x, b) for a, b in _open(np.array([16.0, 50.0, 84.0]))]
    for y in (33.0, 66.0):
        walls += [(a, y, b, y) for a, b in _open(np.array([12.0, 37.0, 62.0, 87.0]))]
    return np.array(walls)


def draw_field(model: FieldModel, rng: np.random.Generator) -> Field:
    """Draw access points' powers and patterns, and survey the field."""
    places = AP_PLACES[: model.n_aps]
    power = model.power * (1.0 + model.vsp * rng.standard_normal(len(places)))
    pattern = np.array([draw_pattern(model.doi, rng) for _ in places])
    line = np.arange(0.0, SIDE + 1e-9, model.grain)
    grid = np.stack(np.meshgrid(line, line), axis=-1)
    levels = _mean_levels(model, places, power, pattern, grid.reshape(-1, 2)).reshape(*grid.shape[:2], -1)
    levels += model.noise / np.sqrt(_SAMPLES) * rng.standard_normal(levels.shape)
    return Field(model, places, power, pattern, levels)


def walk(field: Field, rng: np.random.Generator) -> Walk:
    """A walk from way point to way point in line of sight, and what is received on it."""
    model, walls = field.model, room_walls()
    legs = [rng.uniform(2.0, SIDE - 2.0, 2)]
    length = 0.0
    while length < model.seconds * model.speed + 1.0:
        aims = rng.uniform(2.0, SIDE - 2.0, (64, 2))
        seen = ~crossings(np.broadcast_to(legs[-1], aims.shape), aims, walls).any(axis=1)
        if seen.any():
            aim = aims[int(np.argmax(seen))]
            length += float(np.hypot(*(aim - legs[-1])))
            legs.append(aim)
    corner = np.array(legs)
    along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(corner, axis=0).T))])
    s = model.speed * np.arange(model.seconds + 1)
    xy = np.column_stack([np.interp(s, along, corner[:, k]) for k in (0, 1)])
    moved = np.diff(xy, axis=0, prepend=xy[:1])
    levels = field.mean_levels(xy)
    return Walk(xy, moved, levels + model.noise * rng.standard_normal(levels.shape))


def _mean_levels(model: FieldModel, places: Array, power: Array, pattern: Array, xy: Array) -> Array:
    return rim_levels(places, power, pattern, room_walls(), model.waf, xy)


def rim_levels(places: Array, power: Array, pattern: Array, walls: Array, waf: float, xy: Array) -> Array:
    """Levels (m, a) dBm without noise at places (m, 2) m of access points at (a, 2) m behind walls (w, 4) m."""
    out = np.empty((len(xy), len(places)))
    for a, place in enumerate(places):
        to = xy - place
        loss = _REFERENCE + 10.0 * _EXPONENT * np.log10(np.maximum(np.hypot(*to.T), 1.0))
        degree = np.degrees(np.arctan2(to[:, 1], to[:, 0])) % 360.0
        i = np.floor(degree).astype(int) % 360
        k = pattern[a, i] + (degree - np.floor(degree)) * (pattern[a, (i + 1) % 360] - pattern[a, i])
        n_walls = crossings(np.broadcast_to(place, xy.shape), xy, walls).sum(axis=1)
        out[:, a] = power[a] - loss * k - waf * np.minimum(n_walls, _MAX_WALLS)
    return out


def draw_pattern(doi: float, rng: np.random.Generator) -> Array:
    """K_0 to K_359 (Eq. 4.4); drawn until it closes, which about one in thirty does."""
    for _ in range(_MOST_DRAWS):
        steps = rng.weibull(1.0, 359) * np.where(rng.random(359) < 0.5, -1.0, 1.0) * doi
        pattern = np.concatenate([[1.0], 1.0 + np.cumsum(steps)])
        if abs(pattern[0] - pattern[-1]) <= doi:
            return pattern
    raise AssertionError("no pattern of twenty thousand closes")  # chance 0.97 ** 20000


def _open(doors: Array) -> list[tuple[float, float]]:
    """A line from 0 to SIDE without its doors."""
    ends = np.concatenate([[0.0], np.sort(np.concatenate([doors - _DOOR / 2, doors + _DOOR / 2])), [SIDE]])
    return [(float(a), float(b)) for a, b in ends.reshape(-1, 2)]
