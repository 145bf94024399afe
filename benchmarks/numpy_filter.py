"""The filter step in well vectorised NumPy, float64: what a careful author writes without a compiler."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from benchmarks.walls import brute_numpy
from benchmarks.world import MAP_STEP, RANGE_SIGMA, SIZE, Moment, World
from wayfuse.core.types import Array, BoolArray

__all__ = [
    "NumpyFilter",
    "brute_walls",
    "likelihood_of_levels",
    "likelihood_of_ranges",
    "raster_walls",
    "start_of",
]

RASTER = 0.1  # m
SAMPLES = 8  # places of a move that are looked up in the raster
SIGMAS = (0.15, 0.08, 0.02, 0.01)  # length, heading, bias, scale, as of PdrMotion
PENALTY = 1.2  # nats, of a move through a wall
Likelihood = Callable[[Array, Array, Moment], Array]
Walls = Callable[[Array, Array, Array, Array], BoolArray]


def start_of(world: World, n: int, seed: int = 0) -> Array:
    """(4, n) x, y m, heading bias rad, step scale: the cloud that all variants begin with."""
    rng = np.random.default_rng(seed)
    cloud = np.empty((4, n))
    cloud[:2] = rng.normal(world.start[:, None], 2.0, (2, n))
    cloud[2], cloud[3] = rng.normal(0.0, 0.1, n), rng.normal(1.0, 0.05, n)
    return cloud


def likelihood_of_ranges(world: World) -> Likelihood:
    """Gaussian ranges to anchors."""
    ax, ay = world.anchors.T[:, :, None]

    def log_likelihood(x: Array, y: Array, moment: Moment) -> Array:
        residual = moment.ranges[:, None] - np.sqrt((x - ax) ** 2 + (y - ay) ** 2)
        return np.asarray((-0.5 / RANGE_SIGMA**2) * np.einsum("an,an->n", residual, residual))

    return log_likelihood


def likelihood_of_levels(world: World) -> Likelihood:
    """Gaussian readings, mean and inverse deviation read bilinearly."""
    rows, columns, aps = world.mean.shape
    mean, inverse = world.mean.reshape(-1, aps), 1.0 / world.sigma.reshape(-1, aps)
    logs = np.log(inverse)

    def log_likelihood(x: Array, y: Array, moment: Moment) -> Array:
        u, v = np.clip(x / MAP_STEP, 0.0, columns - 1.001), np.clip(y / MAP_STEP, 0.0, rows - 1.001)
        i, j = u.astype(np.int64), v.astype(np.int64)
        u, v, node = u - i, v - j, j * columns + i
        m, s, g = (np.zeros((len(x), aps)) for _ in range(3))
        for shift, weight in (
            (0, (1 - u) * (1 - v)), (1, u * (1 - v)), (columns, (1 - u) * v), (columns + 1, u * v)
        ):  # fmt: skip
            m += weight[:, None] * mean[node + shift]
            s += weight[:, None] * inverse[node + shift]
            g += weight[:, None] * logs[node + shift]
        z = (moment.scan - m) * s
        return np.asarray((g - 0.5 * z * z).sum(axis=1))

    return log_likelihood


def raster_walls(world: World) -> Walls:
    """Walls drawn into cells of 0.1 m, eight places of each move looked up: not exact, it fattens walls."""
    nx, ny = (round(s / RASTER) for s in SIZE)
    drawn = np.zeros((ny, nx), np.bool_)
    for ax, ay, bx, by in world.walls:
        t = np.linspace(0.0, 1.0, 2 + int(np.hypot(bx - ax, by - ay) / (0.5 * RASTER)))
        i, j = ((ax + t * (bx - ax)) / RASTER).astype(int), ((ay + t * (by - ay)) / RASTER).astype(int)
        ok = (i >= 0) & (i < nx) & (j >= 0) & (j < ny)
        drawn[j[ok], i[ok]] = True
    t = np.linspace(0.0, 1.0, SAMPLES)[:, None] / RASTER

    def crosses(x0: Array, y0: Array, x1: Array, y1: Array) -> BoolArray:
        i = (x0 / RASTER + t * (x1 - x0)).astype(np.int64)
        j = (y0 / RASTER + t * (y1 - y0)).astype(np.int64)
        np.clip(i, 0, nx - 1, out=i)
        np.clip(j, 0, ny - 1, out=j)
        return np.asarray(drawn[j, i].any(axis=0))

    return crosses


def brute_walls(world: World) -> Walls:
    """Every move against every wall, exactly."""
    walls = world.walls
    swap = (walls[:, 0] > walls[:, 2]) | ((walls[:, 0] == walls[:, 2]) & (walls[:, 1] > walls[:, 3]))
    ordered = np.where(swap[:, None], walls[:, [2, 3, 0, 1]], walls)
    return lambda x0, y0, x1, y1: brute_numpy(ordered, np.vstack([x0, y0, x1, y1]))


class NumpyFilter:
    """Step, walls, likelihood, effective sample size, moments, systematic resampling."""

    def __init__(
        self, cloud: Array, likelihood: Likelihood | None, walls: Walls | None = None, seed: int = 0
    ):
        self.cloud, self.likelihood, self.walls = cloud.copy(), likelihood, walls
        self.logs = np.zeros(cloud.shape[1])
        self.rng = np.random.Generator(np.random.SFC64(seed))
        self.resampled = 0

    def update(self, moment: Moment) -> Array:
        """One step and one observation; the mean place (2,)."""
        x, y, bias, scale = self.cloud
        n = len(x)
        z = self.rng.standard_normal((4, n))
        bias = bias + SIGMAS[2] * z[2]
        scale = np.maximum(scale + SIGMAS[3] * z[3], 0.4)
        length = moment.length * scale * (1.0 + SIGMAS[0] * z[0])
        heading = moment.heading + bias + SIGMAS[1] * z[1]
        nx, ny = x + length * np.cos(heading), y + length * np.sin(heading)
        if self.walls is not None:
            hit = self.walls(x, y, nx, ny)
            nx, ny = np.where(hit, x, nx), np.where(hit, y, ny)
            self.logs -= PENALTY * hit
        self.cloud = np.stack([nx, ny, bias, scale])
        if self.likelihood is not None:
            self.logs += self.likelihood(nx, ny, moment)
        self.logs -= self.logs.max()
        w = np.exp(self.logs)
        w /= w.sum()
        mean = self.cloud[:2] @ w
        off = self.cloud[:2] - mean[:, None]
        self.covariance = (off * w) @ off.T
        if 0.5 * n * (w @ w) > 1.0:
            self.resampled += 1
            at = np.searchsorted(np.cumsum(w), (np.arange(n) + self.rng.random()) / n)
            self.cloud = self.cloud[:, np.minimum(at, n - 1)]
            self.logs = np.zeros(n)
        return np.asarray(mean)
