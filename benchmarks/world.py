"""The made-up world of the filter benchmarks: a floor with walls, anchors, a radio map, and a walk round in circles."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from wayfuse.core.types import Array

__all__ = ["Moment", "World", "made_up"]

SIZE = (80.0, 50.0)  # m
RADIUS = 9.0  # m, of the circle that the person walks
STEP = 0.7  # m
FREE = 1.6  # m, width of the way without walls
RANGE_SIGMA = 3.0  # m
MAP_STEP = 2.0  # m between nodes of the radio map


class Moment(NamedTuple):
    """One step and what is observed after it: length m, heading rad, ranges (A,) m, scan (a,) dBm, place (2,) m."""

    length: float
    heading: float
    ranges: Array
    scan: Array
    place: Array


@dataclass(frozen=True, slots=True, eq=False)
class World:
    """walls (w, 4) m, anchors (A, 2) m, levels mean and sigma (rows, columns, a), the moments of one round."""

    walls: Array
    anchors: Array
    mean: Array
    sigma: Array
    moments: tuple[Moment, ...]

    @property
    def start(self) -> Array:
        """Where the round begins (and ends), (2,) m."""
        return self.moments[-1].place


def made_up(walls: int = 500, anchors: int = 10, aps: int = 30, seed: int = 0) -> World:
    """A floor of 80 m by 50 m: walls of 1-8 m, four in five along the axes, denser than in a real building."""
    rng = np.random.default_rng(seed)
    n = round(2 * np.pi * RADIUS / STEP)
    angle = 2 * np.pi * np.arange(n) / n
    way = 0.5 * np.array(SIZE) + RADIUS * np.column_stack([np.cos(angle), np.sin(angle)])
    drawn = np.empty((0, 4))
    while len(drawn) < walls:
        drawn = np.vstack([drawn, _walls(rng, walls, way)])
    columns, rows = int(SIZE[0] / MAP_STEP) + 1, int(SIZE[1] / MAP_STEP) + 1
    gx, gy = np.meshgrid(MAP_STEP * np.arange(columns), MAP_STEP * np.arange(rows))
    at = rng.uniform((0.0, 0.0), SIZE, (aps, 2))
    far = np.hypot(gx[..., None] - at[:, 0], gy[..., None] - at[:, 1])
    mean = -40.0 - 28.0 * np.log10(np.maximum(far, 2.0)) + rng.normal(0.0, 2.0, far.shape)
    sigma = rng.uniform(3.0, 7.0, far.shape)
    places = rng.uniform((0.0, 0.0), SIZE, (anchors, 2))
    moments = []
    for k, place in enumerate(way):
        ranges = np.hypot(*(places - place).T) + rng.normal(0.0, RANGE_SIGMA, anchors)
        node = np.round(place / MAP_STEP).astype(int)
        scan = mean[node[1], node[0]] + rng.normal(0.0, 5.0, aps)
        heading = float(angle[k] + np.pi / 2 - np.pi / n)
        moments.append(Moment(2 * RADIUS * np.sin(np.pi / n), heading, ranges, scan, place))
    return World(drawn[:walls], places, mean, sigma, tuple(moments))


def _walls(rng: np.random.Generator, n: int, way: Array) -> Array:
    """Walls that leave the way (k, 2) free: who walks it crosses none."""
    a = rng.uniform((0.0, 0.0), SIZE, (n, 2))
    turn = np.where(rng.random(n) < 0.8, rng.integers(0, 4, n) * np.pi / 2, rng.uniform(0, 2 * np.pi, n))
    b = a + rng.uniform(1.0, 8.0, (n, 1)) * np.column_stack([np.cos(turn), np.sin(turn)])
    t = np.linspace(0.0, 1.0, 33)[:, None, None]
    along = a + t * (b - a)
    near = np.hypot(*np.moveaxis(along[:, :, None] - way, -1, 0)).min(axis=(0, 2))
    return np.hstack([a, b])[near > 0.5 * FREE]
