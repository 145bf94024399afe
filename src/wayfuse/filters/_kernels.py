"""Compiled loops of the particle filter: weights and summaries."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from wayfuse.core.jit import fast_kernel, kernel
from wayfuse.core.types import Array, Array32

__all__ = ["floor_masses", "geometric_median", "normalise", "reaching", "scatter"]


@kernel
def normalise(log_weights: Array, weights: Array) -> tuple[float, float, float]:
    """Weights summing to 1 from log-weights, written to ``weights``.

    Returns the greatest log-weight, the log of the mean weight (evidence increment of the unnormalised weights), and
    the effective sample size 1 / sum w².
    """
    n = log_weights.shape[0]
    top = log_weights[0]
    for i in range(n):
        top = max(top, log_weights[i])
    total = 0.0
    for i in range(n):
        w = math.exp(log_weights[i] - top)
        weights[i] = w
        total += w
    squares = 0.0
    for i in range(n):
        weights[i] /= total
        squares += weights[i] * weights[i]
    return top, top + math.log(total / n), 1.0 / squares


@kernel
def floor_masses(floor: NDArray[np.int32], weights: Array, out: Array) -> None:
    """Weight on each floor, written to ``out`` (n_floors,)."""
    for k in range(out.shape[0]):
        out[k] = 0.0
    for i in range(floor.shape[0]):
        out[floor[i]] += weights[i]


@fast_kernel
def geometric_median(
    x: Array32,
    y: Array32,
    floor: NDArray[np.int32],
    weights: Array,
    on: int,
    n_iterations: int,
    smooth: float,
) -> tuple[float, float]:
    """Weighted geometric median of the particles on floor ``on`` (Weiszfeld, from the mean).

    ``n_iterations`` = 0 gives the mean. ``smooth`` (m) keeps a particle at the estimate from a division by zero.
    """
    total = 0.0
    mx = 0.0
    my = 0.0
    for i in range(x.shape[0]):
        w = weights[i] * np.float64(floor[i] == on)
        total += w
        mx += w * x[i]
        my += w * y[i]
    mx /= total
    my /= total
    for _ in range(n_iterations):
        total = 0.0
        sx = 0.0
        sy = 0.0
        for i in range(x.shape[0]):
            dx = x[i] - mx
            dy = y[i] - my
            w = weights[i] * np.float64(floor[i] == on) / math.sqrt(dx * dx + dy * dy + smooth * smooth)
            total += w
            sx += w * x[i]
            sy += w * y[i]
        mx = sx / total
        my = sy / total
    return mx, my


@fast_kernel
def scatter(
    x: Array32,
    y: Array32,
    floor: NDArray[np.int32],
    weights: Array,
    on: int,
    mx: float,
    my: float,
    radius: Array32,
) -> tuple[float, float, float]:
    """Second moments (xx, xy, yy) m² about (mx, my) on floor ``on``; ``radius`` gets each particle's distance (m).

    Particles on other floors count in ``radius`` by their horizontal distance, not in the moments.
    """
    total = 0.0
    xx = 0.0
    xy = 0.0
    yy = 0.0
    for i in range(x.shape[0]):
        dx = x[i] - mx
        dy = y[i] - my
        radius[i] = math.sqrt(dx * dx + dy * dy)
        w = weights[i] * np.float64(floor[i] == on)
        total += w
        xx += w * dx * dx
        xy += w * dx * dy
        yy += w * dy * dy
    return xx / total, xy / total, yy / total


@kernel
def reaching(order: NDArray[np.uint64], weights: Array, low: float, high: float) -> tuple[int, int]:
    """Particles with which the weight, summed in an order, reaches two shares of itself, the lower first.

    order : (N,), the number of the particle in its lower 32 bits.
    """
    n, low_32 = order.shape[0], np.uint64(0xFFFFFFFF)
    total = 0.0
    for i in range(n):
        total += weights[order[i] & low_32]
    at, reached = 0, weights[order[0] & low_32]
    while reached < low * total and at < n - 1:
        at += 1
        reached += weights[order[at] & low_32]
    first = at
    while reached < high * total and at < n - 1:
        at += 1
        reached += weights[order[at] & low_32]
    return int(order[first] & low_32), int(order[at] & low_32)
