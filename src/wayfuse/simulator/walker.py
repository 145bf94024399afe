"""A walker on a route: foot contacts first, then a smooth path and the direction of the body.

Every step has its own duration and length, drawn about the person's; the path runs through the way-points,
rounded as people round corners. Foot contacts are exact by construction, so step counts and lengths are
truth, not estimates.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from wayfuse.core.angles import wrap
from wayfuse.core.types import Array, IntArray
from wayfuse.simulator.routes import Route
from wayfuse.simulator.toml_tables import no_negative, require

__all__ = [
    "GRID_HZ",
    "Climb",
    "Person",
    "Walk",
    "WalkerModel",
    "draw_person",
    "path_on_grid",
    "smooth",
    "steps_between",
    "walk",
]

GRID_HZ = 100.0  # of the truth path
_RATES, _LENGTHS = (1.6, 2.0), (0.5, 0.84)  # Hz and m, of adults who walk unhurried
_BOUNCES = (0.5, 1.3)


@dataclass(frozen=True, slots=True, kw_only=True)
class WalkerModel:
    """How people walk. Rates and lengths: 2555 straight stretches of the public ms-indoor recordings."""

    step_rate: float = 1.8  # Hz, mean over persons
    step_rate_sigma: float = 0.07  # Hz, between persons
    step_length: float = 0.67  # m, mean over persons: 1.2 m/s
    step_length_sigma: float = 0.05  # m, between persons; per-walk means are 0.51 to 0.84 m there
    rate_jitter: float = 0.03  # relative, step by step: 2 to 4 % in adult gait
    length_jitter: float = 0.05  # relative, step by step
    turn_slowing: float = 0.35  # share of its length a step loses in a turn by a right angle
    lead_in: tuple[float, float] = (0.4, 1.2)  # s of standing before the first step
    lead_out: tuple[float, float] = (0.4, 1.0)  # s of standing after the last
    path_window: float = 0.9  # s, Hann window that rounds the path: corners are cut by about 0.2 m
    turn_window: float = 1.4  # s, Hann window of the body's turn: a right angle at up to 2.2 rad/s
    bounce_share: float = 0.85  # vertical travel as a share of an inverted pendulum's, mean over persons
    bounce_sigma: float = 0.15  # of that share, between persons
    leg_length: float = 0.9  # m
    up_rate: float = 0.96  # of the level step rate, climbing; 1.58 to 1.76 Hz in the stairs logs of ipin2023
    down_rate: float = 1.0  # the same, descending: 1.68 to 1.82 Hz there

    def __post_init__(self) -> None:
        no_negative(self)
        for key, value, (low, high) in (
            ("step_rate", self.step_rate, _RATES),
            ("step_length", self.step_length, _LENGTHS),
            ("bounce_share", self.bounce_share, _BOUNCES),
        ):
            require(key, low <= value <= high, value, f"from {low:g} to {high:g}: what unhurried adults do")
        others = self.up_rate, self.down_rate, self.leg_length
        require("up_rate, down_rate, leg_length", min(others) > 0.0, others, "must be positive")


@dataclass(frozen=True, slots=True)
class Person:
    """One walker: step rate (Hz), step length (m), share of the pendulum's bounce."""

    step_rate: float
    step_length: float
    bounce: float


@dataclass(frozen=True, slots=True, eq=False)
class Climb:
    """The third dimension of a walk over floors, on the walk's grid of times.

    z (n,) m above the lowest storey: of the feet, without the bounce of the gait. floor (n,) ordinal of the storey
    nearest in height. activity (n,) `wayfuse.simulator.passages.Activity`. passage (n,) index into the building's
    passages, -1 outside of them. stated_floor (w,) of the walk's ``stated``.
    """

    z: Array
    floor: IntArray
    activity: IntArray
    passage: IntArray
    stated_floor: IntArray


@dataclass(frozen=True, slots=True, eq=False)
class Walk:
    """Truth of one walk, times in s from its start.

    t (n,), xy (n, 2) m, heading (n,) rad (unwrapped: of the body, which goes on while standing), gait (n,) 0
    standing to 1 walking. contact (k,) s, step_length (k,) m. phase_t, phase: knots of the gait phase, whole
    at a contact. stated: (w, 3) t, x, y where the surveyor stands or turns. duration: s. climb: None for a walk on
    one floor.
    """

    t: Array
    xy: Array
    heading: Array
    gait: Array
    contact: Array
    step_length: Array
    phase_t: Array
    phase: Array
    stated: Array
    climb: Climb | None = None

    @property
    def duration(self) -> float:
        """Length of the walk (s)."""
        return float(self.t[-1])


def draw_person(model: WalkerModel, rng: np.random.Generator) -> Person:
    """Draw a walker; rate and length stay within what adults do unhurried."""
    rate, length, bounce = rng.normal(0.0, 1.0, 3)
    return Person(
        step_rate=float(np.clip(model.step_rate + model.step_rate_sigma * rate, *_RATES)),
        step_length=float(np.clip(model.step_length + model.step_length_sigma * length, *_LENGTHS)),
        bounce=float(np.clip(model.bounce_share + model.bounce_sigma * bounce, *_BOUNCES)),
    )


def walk(route: Route, person: Person, model: WalkerModel, rng: np.random.Generator) -> Walk:
    """Walk a route from its first to its last way-point."""
    vertex = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(route.xy, axis=0).T))])  # arc length, m
    direction = np.unwrap(np.arctan2(*np.diff(route.xy, axis=0).T[::-1]))
    ends = [0, *np.flatnonzero(route.pause > 0.0).tolist(), len(vertex) - 1]
    t, arc = float(rng.uniform(*model.lead_in)), 0.0
    knots = [(0.0, 0.0, 0.0)]  # time, arc length, phase
    contacts: list[tuple[float, float]] = []  # time, length
    bouts: list[float] = []  # start, end, start, end ... of walking
    stated = [0.0]
    for a, b in pairwise(ends):
        first = len(knots)
        knots.append((t, arc, float(len(contacts))))
        for duration, length in steps_between(vertex, direction, a, b, person, model, rng):
            t, arc = t + duration, arc + length
            contacts.append((t, length))
            knots.append((t, arc, float(len(contacts))))
        times, arcs, _ = np.array(knots[first:]).T
        stated += np.interp(vertex[a + 1 : b + 1], arcs, times).tolist()  # passing each way-point
        bouts += [float(times[0]), t]
        if route.pause[b] > 0.0:
            t += float(route.pause[b])
            stated.append(t)  # and leaving where one stood
    t += float(rng.uniform(*model.lead_out))
    events = np.array(knots), np.array(contacts), bouts, np.array(stated)
    return path_on_grid(route.xy, vertex, direction, *events, t, model)


def steps_between(
    vertex: Array,
    direction: Array,
    first: int,
    last: int,
    person: Person,
    model: WalkerModel,
    rng: np.random.Generator,
) -> list[tuple[float, float]]:
    """Durations (s) and lengths (m) of the steps from one standstill to the next; they add up to the way."""
    s, end = float(vertex[first]), float(vertex[last])
    turn = np.abs(wrap(np.diff(direction[first:last]))) / (0.5 * np.pi)  # at the inner vertices
    inner = vertex[first + 1 : last]
    steps: list[tuple[float, float]] = []
    while end - s > 1e-9:
        rate = person.step_rate * (1.0 + model.rate_jitter * rng.normal())
        length = person.step_length * (1.0 + model.length_jitter * rng.normal())
        near = np.abs(inner - s) < 0.7
        length *= 1.0 - model.turn_slowing * float(np.max(turn[near], initial=0.0))
        length *= 1.0 if steps else 0.7  # the first step starts from standing
        left = end - s
        if left < 1.35 * length:  # a last step that lands on the way-point
            length = left
        steps.append((1.0 / rate, length))
        s += length
    return steps


def path_on_grid(
    xy: Array,
    vertex: Array,
    direction: Array,
    knots: Array,
    contacts: Array,
    bouts: list[float],
    stated: Array,
    duration: float,
    model: WalkerModel,
) -> Walk:
    """The rounded path on a regular grid of times.

    Parameters
    ----------
    xy : (k, 2) m, corners of the way. vertex : (k,) m, their arc lengths. direction : (k - 1,) rad, unwrapped.
    knots : (n, 3) times (s), arc lengths (m) and gait phases. contacts : (s, 2) times and lengths of the steps.
    bouts : s, start, end, start ... of walking. stated : (w,) s, when the surveyor states a place.
    """
    grid = np.arange(0.0, duration + 1e-9, 1.0 / GRID_HZ)
    arc = np.interp(grid, knots[:, 0], knots[:, 1])
    straight = np.column_stack([np.interp(arc, vertex, xy[:, k]) for k in (0, 1)])
    place = smooth(straight, model.path_window)
    segment = np.clip(np.searchsorted(vertex, arc, side="right") - 1, 0, len(direction) - 1)
    walking = np.searchsorted(np.array(bouts), grid, side="right") % 2
    steps = contacts.reshape(-1, 2)  # nobody steps on a journey by lift alone
    return Walk(
        t=grid,
        xy=place,
        heading=smooth(direction[segment], model.turn_window),
        gait=smooth(walking.astype(np.float64), 0.3),
        contact=steps[:, 0],
        step_length=steps[:, 1],
        phase_t=knots[:, 0],
        phase=knots[:, 2],
        stated=np.column_stack([stated, *[np.interp(stated, grid, place[:, k]) for k in (0, 1)]]),
    )


def smooth(values: Array, window: float) -> Array:
    """Values (n,) or (n, k) on the path's grid, smoothed by a Hann window of ``window`` s, ends held."""
    half = round(0.5 * window * GRID_HZ)
    weight = np.hanning(2 * half + 1)
    weight /= weight.sum()
    padded = np.pad(values, [(half, half)] + [(0, 0)] * (values.ndim - 1), mode="edge")
    if values.ndim == 1:
        return np.convolve(padded, weight, mode="valid")
    return np.column_stack([np.convolve(column, weight, mode="valid") for column in padded.T])
