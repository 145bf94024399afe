"""Compiled loops over one block of particles in float32: weights with their summary, and systematic resampling."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from wayfuse.core.elementary import exp32
from wayfuse.core.jit import bounded_kernel, kernel
from wayfuse.core.types import Array, Array32

__all__ = ["resample_block", "weigh_block"]

_PART = 1024  # particles whose sums are taken in float32, before they go to float64


@kernel
def weigh_block(x: Array32, y: Array32, log_weights: Array32, weights: Array32, out: Array) -> None:
    """Weights (greatest 1) of finite log-weights (N,), which are lowered so that the greatest is 0, and their summary.

    out (8,): mean x, y, covariance xx, xy, yy, effective sample size, log of the mean weight, 0.
    """
    n = len(x)
    top = _greatest(log_weights, weights)
    _exponentials(log_weights, top, weights)
    # about a particle: float32 holds differences within a cloud better than places in a building
    cx, cy = x[0], y[0]
    for c in range(8):
        out[c] = 0.0
    for first in range(0, n, _PART):
        last = min(first + _PART, n)
        _add_moments(x[first:last], y[first:last], weights[first:last], cx, cy, out)
    total, mx, my = out[5], out[0] / out[5], out[1] / out[5]
    out[0], out[1] = cx + mx, cy + my
    out[2], out[3], out[4] = out[2] / total - mx * mx, out[3] / total - mx * my, out[4] / total - my * my
    out[5] = total * total / out[6]
    out[6] = top + math.log(total / n)


@bounded_kernel
def _greatest(values: Array32, eighth: Array32) -> np.float32:
    # without a chain from one element to the next, but among the few that are left in the end
    m = (len(values) + 7) // 8
    _fold(values, eighth, m)
    if m > 16:
        k = (m + 7) // 8
        _fold(eighth[:m], eighth, k)
        m = k
    top = eighth[0]
    for i in range(m):
        top = max(top, eighth[i])
    return np.float32(top)


@bounded_kernel
def _fold(values: Array32, out: Array32, m: int) -> None:
    """The greatest of each of m sets of 8 values (N,), N <= 8 m: one of each of 8 parts of m, which may overlap."""
    last = len(values) - m
    a, b, c, d = values[:m], values[min(m, last) :], values[min(2 * m, last) :], values[min(3 * m, last) :]
    e, f, g = values[min(4 * m, last) :], values[min(5 * m, last) :], values[min(6 * m, last) :]
    h = values[last:]
    for i in range(m):
        out[i] = max(a[i], b[i], c[i], d[i], e[i], f[i], g[i], h[i])


@bounded_kernel
def _exponentials(log_weights: Array32, top: np.float32, weights: Array32) -> None:
    for i in range(len(log_weights)):
        log_weights[i] -= top
        weights[i] = exp32(log_weights[i])


@bounded_kernel
def _add_moments(
    x: Array32, y: Array32, weights: Array32, cx: np.float32, cy: np.float32, out: Array
) -> None:
    a, b, c, d = np.float32(0.0), np.float32(0.0), np.float32(0.0), np.float32(0.0)
    e, f, g = np.float32(0.0), np.float32(0.0), np.float32(0.0)
    for i in range(len(weights)):
        w = weights[i]
        dx, dy = x[i] - cx, y[i] - cy
        a += w * dx
        b += w * dy
        c += w * dx * dx
        d += w * dx * dy
        e += w * dy * dy
        f += w
        g += w * w
    out[0] += a
    out[1] += b
    out[2] += c
    out[3] += d
    out[4] += e
    out[5] += f
    out[6] += g


@kernel
def resample_block(
    weights: Array32, u: float, block: Array32, marks: NDArray[np.int32], out: Array32, log_weights: Array32
) -> None:
    """Write the offspring of ``block`` (c, N) by systematic resampling to ``out`` (c, N); log-weights become 0.

    The ancestors are those of `filters.resampling.systematic`: positions (k + u) / N in a float64 running sum of the
    weights (N,). ``marks`` (N + 1,) is scratch. Without a branch: particle j leaves its number where its first
    offspring is, a later one writes over it where j has none, and the running maximum is the ancestor.
    """
    n = len(weights)
    sums, ends = np.empty(n), np.empty(n, np.int32)
    total = _running_sum(weights, sums)
    scale = n / total
    for i in range(n):
        ends[i] = np.int32(
            min(sums[i] * scale - u + 1.0, np.float64(n))
        )  # offspring of 0 .. i; not negative: u < 1
    for i in range(n):
        marks[i] = 0
    for j in range(n - 1):
        marks[np.uint32(ends[j])] = np.int32(j + 1)
    ancestor = np.int32(0)
    for k in range(n):
        ancestor = max(ancestor, marks[k])
        marks[k] = ancestor
    for k in range(n):
        log_weights[k] = np.float32(0.0)
    for c in range(block.shape[0]):
        row, offspring = block[c], out[c]
        for k in range(n):
            offspring[k] = row[np.uint32(marks[k])]


@kernel
def _running_sum(weights: Array32, sums: Array) -> float:
    """Running sum in ``sums`` (N,); four at a time, so that their additions do not wait for each other."""
    n, total = len(weights), 0.0
    whole = n - n % 4
    for i in range(0, whole, 4):
        a = np.float64(weights[i])
        b = a + np.float64(weights[i + 1])
        c = b + np.float64(weights[i + 2])
        d = c + np.float64(weights[i + 3])
        sums[i], sums[i + 1], sums[i + 2], sums[i + 3] = total + a, total + b, total + c, total + d
        total += d
    for i in range(whole, n):
        total += np.float64(weights[i])
        sums[i] = total
    return total
