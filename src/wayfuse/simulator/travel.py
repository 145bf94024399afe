"""A walker on a journey over floors: level ways, stairs and rides become one path in three dimensions.

As on one floor (`wayfuse.simulator.walker`), foot contacts come first. On stairs every contact is one stair: its
number is the plan's. A rider stands while the lift or escalator moves. Heights are continuous by construction.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from wayfuse.core.types import Array, IntArray
from wayfuse.simulator.passages import Activity, Stretch
from wayfuse.simulator.rides import LiftModel, ride
from wayfuse.simulator.walker import (
    GRID_HZ,
    Climb,
    Person,
    Walk,
    WalkerModel,
    path_on_grid,
    smooth,
    steps_between,
)

__all__ = ["Leg", "travel"]

_CLIMB_WINDOW = 0.6  # s, Hann window that rounds the height on stairs: one stair after the other


class Leg(NamedTuple):
    """One stretch of a journey, the pause (s) at its end, and what the surveyor states there.

    passage : index into the building's, -1 outside. stated : floor stated on arrival at its end, -1 for none;
    left : floor stated on leaving it after the pause, -1 for none.
    """

    stretch: Stretch
    pause: float = 0.0
    passage: int = -1
    stated: int = -1
    left: int = -1


@dataclass(slots=True)
class _Log:
    """What has happened so far: times in s."""

    t: float
    arc: float = 0.0
    z: float = 0.0
    knots: list[tuple[float, float, float]] = field(default_factory=list)  # time, arc length, phase
    heights: list[tuple[float, float]] = field(default_factory=list)  # time, height but for rides (m)
    rides: list[tuple[float, Array]] = field(default_factory=list)  # start, heights ridden on the grid (m)
    contacts: list[tuple[float, float]] = field(default_factory=list)  # time, length
    bouts: list[float] = field(default_factory=list)  # start, end, start ... of walking
    stated: list[tuple[float, int]] = field(default_factory=list)  # time, floor
    doings: list[tuple[float, int, int]] = field(default_factory=list)  # from this time on: activity, passage


def travel(
    start: tuple[float, float, int],
    legs: tuple[Leg, ...],
    elevations: Array,
    person: Person,
    model: WalkerModel,
    lifts: LiftModel,
    rng: np.random.Generator,
) -> Walk:
    """Go the legs one after the other from ``start`` (x, y, floor); elevations (m) of the storeys, bottom up."""
    xy = np.array([start[:2], *[(leg.stretch.x, leg.stretch.y) for leg in legs]])
    vertex = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(xy, axis=0).T))])
    log = _Log(float(rng.uniform(*model.lead_in)))
    log.knots.append((0.0, 0.0, 0.0))
    log.heights.append((0.0, float(elevations[start[2]])))
    log.doings.append((0.0, Activity.STILL, -1))
    log.stated.append((0.0, start[2]))
    direction = _directions(xy)
    k = 0
    while k < len(legs):
        last = _bout(legs, k)
        _go(log, legs, k, last, vertex, direction, person, model, lifts, rng)
        k = last + 1
    log.t += float(rng.uniform(*model.lead_out))
    stated_t = np.array([row[0] for row in log.stated])
    stated_floor = np.array([row[1] for row in log.stated], dtype=np.int64)
    events = np.array(log.knots), np.array(log.contacts), log.bouts, stated_t
    level = path_on_grid(xy, vertex, direction, *events, log.t, model)
    return replace(level, climb=_climbed(log, level.t, elevations, stated_floor))


def _directions(xy: Array) -> Array:
    """Heading (k,) rad of each leg, unwrapped; legs without length keep that of the leg before."""
    d = np.diff(xy, axis=0)
    raw = np.arctan2(d[:, 1], d[:, 0])
    moved = np.hypot(*d.T) > 1e-9
    held = np.maximum.accumulate(np.where(moved, np.arange(len(d)), 0))
    return np.asarray(np.unwrap(raw[held]))


def _bout(legs: tuple[Leg, ...], first: int) -> int:
    """Last leg that is walked in one go with the first: level ways up to a pause, one flight, one ride."""
    last = first
    walking = Activity.WALKING
    while (
        legs[last].stretch.activity is walking
        and not legs[last].pause
        and last + 1 < len(legs)
        and legs[last + 1].stretch.activity is walking
        and legs[last + 1].passage == legs[first].passage
    ):
        last += 1
    return last


def _go(
    log: _Log,
    legs: tuple[Leg, ...],
    first: int,
    last: int,
    vertex: Array,
    direction: Array,
    person: Person,
    model: WalkerModel,
    lifts: LiftModel,
    rng: np.random.Generator,
) -> None:
    """One bout: legs ``first`` to ``last``, and the pause after them."""
    leg, began = legs[last], log.t
    activity = leg.stretch.activity
    log.doings.append((log.t, activity, leg.passage))
    if activity is Activity.LIFT:
        heights = ride(leg.stretch.rise, float(rng.uniform(*lifts.acceleration)), lifts, 1.0 / GRID_HZ)
        log.rides.append((log.t, heights))
        log.t += (len(heights) - 1) / GRID_HZ
        arrivals = [log.t]
    else:
        knot = len(log.knots)
        log.knots.append((log.t, log.arc, float(len(log.contacts))))
        if activity is Activity.STAIRS:
            _climb(log, leg.stretch, float(vertex[last + 1] - vertex[last]), person, model, rng)
        elif activity is Activity.ESCALATOR:
            _carry(log, leg.stretch, float(vertex[last + 1] - vertex[last]), lifts)
        else:
            for duration, length in steps_between(vertex, direction, first, last + 1, person, model, rng):
                _step(log, duration, length)
        times, arcs, _ = np.array(log.knots[knot:]).T
        arrivals = np.interp(vertex[first + 1 : last + 2], arcs, times).tolist()
        log.bouts += [] if activity is Activity.ESCALATOR else [began, log.t]
        log.arc = float(vertex[last + 1])  # steps add up to it but for rounding
        log.knots[-1] = (log.t, log.arc, log.knots[-1][2])
    log.stated += [
        (t, each.stated) for t, each in zip(arrivals, legs[first : last + 1], strict=True) if each.stated >= 0
    ]
    if leg.pause:
        log.doings.append((log.t, Activity.STILL, leg.passage))
        log.t += leg.pause
    if leg.left >= 0:
        log.stated.append((log.t, leg.left))


def _step(log: _Log, duration: float, length: float) -> None:
    log.t += duration
    log.arc += length
    log.contacts.append((log.t, length))
    log.knots.append((log.t, log.arc, float(len(log.contacts))))


def _climb(
    log: _Log, flight: Stretch, run: float, person: Person, model: WalkerModel, rng: np.random.Generator
) -> None:
    """One step on every stair."""
    rate = person.step_rate * (model.up_rate if flight.rise > 0.0 else model.down_rate)
    height = log.heights[-1][1]
    log.heights.append((log.t, height))
    for k in range(flight.n_steps):
        _step(log, 1.0 / (rate * (1.0 + model.rate_jitter * rng.normal())), run / flight.n_steps)
        log.heights.append((log.t, height + flight.rise * (k + 1) / flight.n_steps))


def _carry(log: _Log, flight: Stretch, run: float, lifts: LiftModel) -> None:
    """Standing on the moving stairs of an escalator."""
    height = log.heights[-1][1]
    log.heights.append((log.t, height))
    log.t += float(np.hypot(run, flight.rise)) / lifts.escalator_speed
    log.arc += run
    log.knots.append((log.t, log.arc, log.knots[-1][2]))
    log.heights.append((log.t, height + flight.rise))


def _climbed(log: _Log, grid: Array, elevations: Array, stated_floor: IntArray) -> Climb:
    stairs_t, stairs_z = np.array(log.heights).T
    z = smooth(np.interp(grid, stairs_t, stairs_z), _CLIMB_WINDOW)
    for start, heights in log.rides:
        z = z + np.interp(grid, start + np.arange(len(heights)) / GRID_HZ, heights)
    since, activity, passage = np.array(log.doings).T
    row = np.searchsorted(since, grid, side="right") - 1
    middle = 0.5 * (elevations[1:] + elevations[:-1])
    return Climb(
        z=z,
        floor=np.searchsorted(middle, z),
        activity=activity[row].astype(np.int64),
        passage=passage[row].astype(np.int64),
        stated_floor=stated_floor,
    )
