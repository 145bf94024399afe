"""The world of li2015: an office floor of 30 x 16 m, three paths walked five times, 4 and 5 anchors.

Section 7.1 gives two scenarios (4 anchors at 0.9 m/s, 5 at 0.6 m/s), three paths, five repeats and a position every
second; Figure 6 shows the floor without a scale. Walls, paths, places of anchors and all noise are therefore chosen
here. Errors of ranges are white: normal in line of sight; larger, and too long on average, where the ray crosses a
wall. Most runs have a good heading and some a bad one, for the paper's dead reckoning has a median error of about
0.5 m and 4 m at 90 %, which no single normal gives.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from wayfuse.core.types import Array, BoolArray

__all__ = [
    "EQUAL_ERRORS",
    "GROWING_ERRORS",
    "LOS_NLOS",
    "PATHS",
    "WALLS",
    "Run",
    "Scenario",
    "simulate_run",
    "walls_between",
]

_DT = 1.0  # s, Section 7.1: the error is calculated every second
_DOORS_SOUTH, _DOORS_NORTH, _DOOR = (3.0, 10.5, 18.0, 26.0), (2.5, 8.5, 14.5, 20.5, 26.5), 1.0


def _wall_with_doors(y: float, doors: tuple[float, ...]) -> list[tuple[float, float, float, float]]:
    ends = [0.0, *(e for d in doors for e in (d, d + _DOOR)), 30.0]
    return [(a, y, b, y) for a, b in zip(ends[::2], ends[1::2], strict=True)]


WALLS = np.array(
    [
        *_wall_with_doors(6.5, _DOORS_SOUTH),
        *_wall_with_doors(9.5, _DOORS_NORTH),
        *((x, 0.0, x, 6.5) for x in (7.5, 15.0, 22.5)),
        *((x, 9.5, x, 16.0) for x in (6.0, 12.0, 18.0, 24.0)),
    ]
)  # (m, 4) m: x, y of both ends; a corridor of 3 m between two rows of rooms

PATHS = (
    np.array(
        [
            [1.5, 8.0],
            [26.5, 8.0],
            [26.5, 2.0],
            [29.0, 2.0],
            [29.0, 5.0],
            [26.5, 5.0],
            [26.5, 8.0],
            [18.5, 8.0],
        ]
    ),
    np.array(
        [
            [3.0, 15.0],
            [3.0, 8.0],
            [18.5, 8.0],
            [18.5, 2.0],
            [21.0, 2.0],
            [21.0, 5.0],
            [18.5, 5.0],
            [18.5, 8.0],
        ]
    ),
    np.array(
        [
            [28.5, 8.0],
            [15.0, 8.0],
            [15.0, 14.0],
            [17.0, 14.0],
            [17.0, 11.0],
            [15.0, 11.0],
            [15.0, 8.0],
            [4.0, 8.0],
        ]
    ),
)  # m


@dataclass(frozen=True, slots=True, eq=False)
class Scenario:
    """A scenario of Section 7.1.

    anchors : (n, 2) m. speed : m/s. los_sigma, nlos_sigma, nlos_bias : m, error of a range without and with a wall in
    between. The remaining ones are the error of the measured velocity: share of runs with a bad heading, sigma of the
    heading of a good and of a bad run (rad, constant in a run), white heading error (rad), relative speed error. Then
    the repeats of each path, and a further error of a range as a share of it.
    """

    anchors: Array
    speed: float
    los_sigma: float
    nlos_sigma: float
    nlos_bias: float
    bad_share: float = 0.25
    good_heading_sigma: float = 0.03
    bad_heading_sigma: float = 0.42
    white_heading_sigma: float = 0.05
    speed_sigma: float = 0.05
    repeats: int = 5
    relative_sigma: float = 0.0


_FOUR = np.array([[2.0, 1.5], [28.0, 1.5], [21.0, 14.5], [7.0, 14.5]])
_FIVE = np.array([[1.0, 15.0], [29.0, 15.0], [29.0, 1.0], [1.0, 1.0], [15.5, 1.0]])
LOS_NLOS = (Scenario(_FOUR, 0.9, 0.8, 2.0, 1.2), Scenario(_FIVE, 0.6, 0.8, 2.2, 1.35))
EQUAL_ERRORS = (Scenario(_FOUR, 0.9, 2.0, 2.0, 0.0), Scenario(_FIVE, 0.6, 2.0, 2.0, 0.0))
GROWING_ERRORS = (
    Scenario(_FOUR, 0.9, 0.0, 0.0, 0.0, relative_sigma=0.2),
    Scenario(_FIVE, 0.6, 0.0, 0.0, 0.0, relative_sigma=0.2),
)


class Run(NamedTuple):
    """One walk, sampled every ``dt`` seconds; row 0 is the start.

    xy : (k, 2) m, truth. ranges : (k, n) m. velocity : (k, 2) m/s, as the inertial sensors give it, of the second that
    ends at the row.
    """

    dt: float
    xy: Array
    ranges: Array
    velocity: Array


def walls_between(places: Array, anchors: Array, walls: Array = WALLS) -> BoolArray:
    """Whether the segment from each place (k, 2) to each anchor (n, 2) crosses a wall (m, 4): (k, n)."""
    p, q = places[:, None, None], anchors[None, :, None]
    a, b = walls[None, None, :, :2], walls[None, None, :, 2:]
    apart = _side(p, q, a) * _side(p, q, b) < 0.0
    return np.asarray((apart & (_side(a, b, p) * _side(a, b, q) < 0.0)).any(axis=-1))


def _side(a: Array, b: Array, c: Array) -> Array:
    """Twice the signed area of the triangles a, b, c (..., 2)."""
    u, v = b - a, c - a
    return np.asarray(u[..., 0] * v[..., 1] - u[..., 1] * v[..., 0])


def _walk(path: Array, speed: float) -> Array:
    """Places (k, 2) along a path (m, 2) every second at a speed."""
    length = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(path, axis=0).T))])
    at = np.arange(0.0, length[-1], speed * _DT)
    return np.column_stack([np.interp(at, length, path[:, axis]) for axis in (0, 1)])


def simulate_run(scenario: Scenario, path: int, rng: np.random.Generator) -> Run:
    """One walk along a path (0, 1, 2) with its errors."""
    xy = _walk(PATHS[path], scenario.speed)
    true = np.hypot(*(xy[:, None] - scenario.anchors[None]).transpose(2, 0, 1))
    blocked = walls_between(xy, scenario.anchors)
    sigma = np.hypot(
        np.where(blocked, scenario.nlos_sigma, scenario.los_sigma), scenario.relative_sigma * true
    )
    ranges = true + np.where(blocked, scenario.nlos_bias, 0.0) + sigma * rng.standard_normal(true.shape)
    is_bad = rng.random() < scenario.bad_share
    offset = (scenario.bad_heading_sigma if is_bad else scenario.good_heading_sigma) * rng.standard_normal()
    move = np.diff(xy, axis=0, prepend=xy[:1]) / _DT
    speed = np.hypot(*move.T) * (1.0 + scenario.speed_sigma * rng.standard_normal(len(xy)))
    heading = np.arctan2(move[:, 1], move[:, 0]) + offset
    heading += scenario.white_heading_sigma * rng.standard_normal(len(xy))
    velocity = speed[:, None] * np.column_stack([np.cos(heading), np.sin(heading)])
    return Run(_DT, xy, np.maximum(ranges, 0.0), velocity)
