"""Compiled loops that join one domain (steps, radio, maps) to the particles."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from wayfuse.core.elementary import exp32, log32, sincos32
from wayfuse.core.jit import fast_kernel, kernel, uncounted_kernel
from wayfuse.core.types import Array, Array32

__all__ = [
    "add_levels",
    "add_places",
    "add_ranges",
    "block_on_mask",
    "late_log_density",
    "mixture_log_likelihood",
    "pdr_move",
]


@uncounted_kernel
def pdr_move(
    z: Array32,
    x: Array32,
    y: Array32,
    bias: Array32,
    scale: Array32,
    length: float,
    heading: float,
    length_sigma: float,
    heading_sigma: float,
    bias_sigma: float,
    scale_sigma: float,
    new_x: Array32,
    new_y: Array32,
    new_bias: Array32,
    new_scale: Array32,
) -> None:
    """Move every particle by one step; ``z`` (4, N) standard normals: length, heading, bias, scale."""
    step = np.float32(length)
    toward = np.float32(heading)
    sd_length = np.float32(length_sigma)
    sd_heading = np.float32(heading_sigma)
    sd_bias = np.float32(bias_sigma)
    sd_scale = np.float32(scale_sigma)
    for i in range(x.shape[0]):
        b = bias[i] + sd_bias * z[2, i]
        s = max(scale[i] + sd_scale * z[3, i], np.float32(0.4))
        d = step * s * (np.float32(1.0) + sd_length * z[0, i])
        sine, cosine = sincos32(toward + b + sd_heading * z[1, i])
        new_x[i] = x[i] + d * cosine
        new_y[i] = y[i] + d * sine
        new_bias[i] = b
        new_scale[i] = s


@kernel
def block_on_mask(
    x: Array32,
    y: Array32,
    new_x: Array32,
    new_y: Array32,
    floor: NDArray[np.int32],
    mask: NDArray[np.uint8],
    start: NDArray[np.int64],
    nx: NDArray[np.int64],
    ny: NDArray[np.int64],
    x0: Array,
    y0: Array,
    cell: float,
    penalty: float,
    log_weights: Array,
) -> int:
    """Stop particles whose step leaves walkable space: they stay, and lose ``penalty`` in log-weight.

    The middle and the end of the step are looked up; a particle already outside may go anywhere, at the same
    penalty, so that a cloud that starts on a blocked cell can leave it. Returns how many were stopped.
    """
    blocked = 0
    for i in range(x.shape[0]):
        f = floor[i]
        ok = True
        for half in range(2):
            if half == 0:
                px = np.float64(new_x[i])
                py = np.float64(new_y[i])
            else:
                px = 0.5 * (np.float64(new_x[i]) + np.float64(x[i]))
                py = 0.5 * (np.float64(new_y[i]) + np.float64(y[i]))
            cx = math.floor((px - x0[f]) / cell)
            cy = math.floor((py - y0[f]) / cell)
            if cx < 0 or cy < 0 or cx >= nx[f] or cy >= ny[f] or mask[start[f] + cy * nx[f] + cx] == 0:
                ok = False
                break
        if not ok:
            blocked += 1
            log_weights[i] -= penalty
            cx = math.floor((np.float64(x[i]) - x0[f]) / cell)
            cy = math.floor((np.float64(y[i]) - y0[f]) / cell)
            inside = cx >= 0 and cy >= 0 and cx < nx[f] and cy < ny[f]
            if inside and mask[start[f] + cy * nx[f] + cx] != 0:
                new_x[i] = x[i]
                new_y[i] = y[i]
    return blocked


@fast_kernel
def mixture_log_likelihood(
    x: Array32,
    y: Array32,
    floor: NDArray[np.int32],
    place_x: Array32,
    place_y: Array32,
    place_floor: NDArray[np.int32],
    weight: Array32,
    sigma: float,
    background: float,
    exponent: float,
    out: Array,
) -> None:
    """Add exponent * log(sum_j w_j exp(-r_ij² / 2 sigma²) + background) over places j on the particle's floor."""
    # places in the outer loop: the inner one has no branch and is vectorised
    half = np.float32(-0.5 / (sigma * sigma))
    total = np.full(x.shape[0], np.float32(background))
    for j in range(place_x.shape[0]):
        px = place_x[j]
        py = place_y[j]
        w = weight[j]
        f = place_floor[j]
        for i in range(x.shape[0]):
            dx = x[i] - px
            dy = y[i] - py
            # times 0 or 1 rather than a choice: a branch here costs a factor of twelve
            total[i] += w * exp32(half * (dx * dx + dy * dy)) * np.float32(floor[i] == f)
    for i in range(x.shape[0]):
        out[i] += exponent * log32(total[i])


@fast_kernel
def add_ranges(
    x: Array32, y: Array32, anchors: Array32, ranges: Array32, precision: float, out: Array32
) -> None:
    """Add -p sum_a (d_a - |x - anchor a|)² to ``out`` (N,); anchors (A, 2) m, ranges d (A,) m, NaN = none; p 1/m²."""
    # anchors in the outer loop: the inner one is vectorised over particles
    p = np.float32(precision)
    for a in range(len(anchors)):
        ax, ay, d = anchors[a, 0], anchors[a, 1], ranges[a]
        if not np.isnan(d):
            for i in range(len(x)):
                dx = x[i] - ax
                dy = y[i] - ay
                e = d - math.sqrt(dx * dx + dy * dy)
                out[i] -= p * (e * e)


@fast_kernel
def late_log_density(
    excess: Array, sigma: float, late: float, lateness: float, least: float, out: Array
) -> None:
    """Write log((1 - e) N(d; 0, s²) + e exp(-d / mu) / mu [d > 0]), at least log ``least``, of d (n,) m to ``out``."""
    scale = np.float32(-0.5 / (sigma * sigma))
    peak = np.float32((1.0 - late) / (2.5066282746310002 * sigma))
    rate, share = np.float32(-1.0 / lateness), np.float32(late / lateness)
    floor = np.float32(least)
    for i in range(len(excess)):
        d = np.float32(excess[i])
        tail = share * exp32(rate * max(d, np.float32(0.0))) * np.float32(d > np.float32(0.0))
        out[i] = log32(max(peak * exp32(scale * d * d) + tail, floor))


@fast_kernel
def add_levels(x: Array32, y: Array32, levels: Array32, frame: Array32, scan: Array32, out: Array32) -> None:
    """Add sum_a h_a (log s_a - (z_a - m_a)² s_a² / 2) to ``out`` (N,): Gaussian readings on a grid, read bilinearly.

    levels (C, nodes, 3, 16): m dBm, s = 1 / sigma 1/dB, log s of 16 C access points; frame (5,): x, y m of node 0,
    1 / step 1/m, nodes per row, rows; scan (C, 2, 16): z dBm, h = 1 where heard, else 0.
    """
    n, columns = len(x), int(frame[3])
    one, half = np.float32(1.0), np.float32(0.5)
    most_u, most_v = frame[3] - np.float32(1.001), frame[4] - np.float32(1.001)
    node, part_u, part_v = np.empty(n, np.int32), np.empty(n, np.float32), np.empty(n, np.float32)
    for i in range(n):
        u = min(max((x[i] - frame[0]) * frame[2], np.float32(0.0)), most_u)
        v = min(max((y[i] - frame[1]) * frame[2], np.float32(0.0)), most_v)
        node[i] = np.int32(v) * np.int32(columns) + np.int32(u)
        part_u[i] = u - np.float32(np.int32(u))
        part_v[i] = v - np.float32(np.int32(v))
    for c in range(len(levels)):
        table, z, h = levels[c], scan[c, 0], scan[c, 1]
        for i in range(n):
            fu, fv = part_u[i], part_v[i]
            wa, wb, wc, wd = (one - fu) * (one - fv), fu * (one - fv), (one - fu) * fv, fu * fv
            low = np.uint32(node[i])
            high = low + np.uint32(columns)
            a, b = table[low], table[low + np.uint32(1)]
            d, e = table[high], table[high + np.uint32(1)]
            total = np.float32(0.0)
            for q in range(16):  # a whole vector
                m = wa * a[0, q] + wb * b[0, q] + wc * d[0, q] + wd * e[0, q]
                s = wa * a[1, q] + wb * b[1, q] + wc * d[1, q] + wd * e[1, q]
                g = wa * a[2, q] + wb * b[2, q] + wc * d[2, q] + wd * e[2, q]
                r = (z[q] - m) * s
                total += h[q] * (g - half * r * r)
            out[i] += total


@fast_kernel
def add_places(x: Array32, y: Array32, places: Array32, out: Array32) -> None:
    """Add log sum_j exp(w_j - p_j |x - place j|²) to ``out`` (N,), finite wherever the particle is.

    places (k, 4): x, y m, log-weight w (-1e9 = none), p 1/m².
    """
    n = len(x)
    top, total = np.full(n, np.float32(-1e9)), np.zeros(n, np.float32)
    for j in range(len(places)):
        px, py, w, p = places[j, 0], places[j, 1], places[j, 2], places[j, 3]
        for i in range(n):
            dx = x[i] - px
            dy = y[i] - py
            t = w - p * (dx * dx + dy * dy)
            top[i] = t if t > top[i] else top[i]
    for j in range(len(places)):
        px, py, w, p = places[j, 0], places[j, 1], places[j, 2], places[j, 3]
        for i in range(n):
            dx = x[i] - px
            dy = y[i] - py
            total[i] += exp32(w - p * (dx * dx + dy * dy) - top[i])
    for i in range(n):
        out[i] += top[i] + log32(total[i])
