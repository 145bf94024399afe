"""The filter step as repositories of indoor positioning write it: a loop over particles, walls by shapely."""

from __future__ import annotations

import math
import random

from benchmarks.numpy_filter import PENALTY, SIGMAS
from benchmarks.world import RANGE_SIGMA, Moment, World
from wayfuse.core.types import Array

__all__ = ["NaiveFilter"]


class NaiveFilter:
    """Lists of floats; each move a LineString tested against all walls as one geometry."""

    def __init__(self, cloud: Array, world: World, *, walls: bool, seed: int = 0):
        from shapely.geometry import MultiLineString

        self.particles = cloud.T.tolist()
        self.weights = [1.0 / len(self.particles)] * len(self.particles)
        self.anchors = world.anchors.tolist()
        self.walls = (
            MultiLineString([((a, b), (c, d)) for a, b, c, d in world.walls.tolist()]) if walls else None
        )
        self.rng = random.Random(seed)  # noqa: S311 - a simulation
        self.resampled = 0

    def update(self, moment: Moment) -> tuple[float, float]:
        """One step and one observation; the mean place."""
        from shapely.geometry import LineString

        gauss = self.rng.gauss
        for i, (x, y, bias, scale) in enumerate(self.particles):
            bias = bias + gauss(0.0, SIGMAS[2])  # noqa: PLW2901
            scale = max(scale + gauss(0.0, SIGMAS[3]), 0.4)  # noqa: PLW2901
            length = moment.length * scale * (1.0 + gauss(0.0, SIGMAS[0]))
            heading = moment.heading + bias + gauss(0.0, SIGMAS[1])
            nx, ny = x + length * math.cos(heading), y + length * math.sin(heading)
            if self.walls is not None and LineString([(x, y), (nx, ny)]).intersects(self.walls):
                nx, ny = x, y
                self.weights[i] *= math.exp(-PENALTY)
            self.particles[i] = [nx, ny, bias, scale]
            for (ax, ay), measured in zip(self.anchors, moment.ranges.tolist(), strict=True):
                off = (measured - math.hypot(nx - ax, ny - ay)) / RANGE_SIGMA
                self.weights[i] *= math.exp(-0.5 * off * off) + 1e-12
        total = sum(self.weights)
        n = len(self.particles)
        self.weights = [w / total for w in self.weights]
        mx = sum(w * p[0] for w, p in zip(self.weights, self.particles, strict=True))
        my = sum(w * p[1] for w, p in zip(self.weights, self.particles, strict=True))
        if 1.0 / sum(w * w for w in self.weights) < 0.5 * n:
            self._resample(n)
        return mx, my

    def _resample(self, n: int) -> None:
        self.resampled += 1
        chosen, j, total = [], 0, self.weights[0]
        u = self.rng.random()
        for k in range(n):
            while total < (k + u) / n and j < n - 1:
                j += 1
                total += self.weights[j]
            chosen.append(list(self.particles[j]))
        self.particles, self.weights = chosen, [1.0 / n] * n
