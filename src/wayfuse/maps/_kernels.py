"""Kernels of the wall test. The rule they all follow is stated in `wayfuse.maps.walls`."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from wayfuse.core.jit import inline_kernel, kernel
from wayfuse.core.types import Array, BoolArray

__all__ = ["brute_one", "build_cells", "crosses_many", "crosses_one", "cut", "fill_clearance", "is_inside"]


@inline_kernel
def cut(px: float, py: float, qx: float, qy: float, ax: float, ay: float, bx: float, by: float) -> bool:
    """Whether move p -> q (lower end first) crosses wall a -> b (lower end first)."""
    ymin, ymax = min(py, qy), max(py, qy)
    wmin, wmax = min(ay, by), max(ay, by)
    if not (px <= bx and ax <= qx and ymin <= wmax and wmin <= ymax):
        return False
    wx, wy = bx - ax, by - ay
    if (wx * (py - ay) - wy * (px - ax) > 0.0) == (wx * (qy - ay) - wy * (qx - ax) > 0.0):
        return False
    mx, my = qx - px, qy - py
    return (mx * (ay - py) - my * (ax - px) > 0.0) != (mx * (by - py) - my * (bx - px) > 0.0)


@inline_kernel
def brute_one(x0: float, y0: float, x1: float, y1: float, walls: Array) -> bool:
    """Whether a move crosses any of the walls (w, 4): the definition."""
    swap = x0 > x1 or (x0 == x1 and y0 > y1)
    px, py = (x1, y1) if swap else (x0, y0)
    qx, qy = (x0, y0) if swap else (x1, y1)
    hit = False
    for k in range(walls.shape[0]):
        if cut(px, py, qx, qy, walls[k, 0], walls[k, 1], walls[k, 2], walls[k, 3]):
            hit = True
            break
    return hit


@inline_kernel
def crosses_one(
    x0: float,
    y0: float,
    x1: float,
    y1: float,
    grid: Array,
    clearance: NDArray[np.uint8],
    start: NDArray[np.int32],
    packed: Array,
    walls: Array,
) -> bool:
    """Whether a move crosses any wall, by clearance field and packed cell list; see `WallIndex.arrays`.

    ``packed`` (m, 5) = the walls of each list cell, nearest first, and the square of their distance from it.
    ``grid`` = (origin x, origin y, 1 / clearance cell, metres per unit of clearance, 1 / list cell, longest
    move, list cells per row).
    """
    # float32 moves are widened first, so that they mean the same as in the definition
    sx, sy, ex, ey = np.float64(x0), np.float64(y0), np.float64(x1), np.float64(y1)
    dx, dy = ex - sx, ey - sy
    length2 = dx * dx + dy * dy
    hit = False
    if length2 > grid[5] * grid[5]:
        hit = brute_one(sx, sy, ex, ey, walls)
    else:
        u, v = (sx - grid[0]) * grid[2], (sy - grid[1]) * grid[2]
        # off the grid no wall is within the longest move; NaN fails every comparison and crosses nothing
        if u >= 0.0 and v >= 0.0 and u < clearance.shape[1] and v < clearance.shape[0]:
            free = clearance[int(v), int(u)] * grid[3]
            if not length2 < free * free:
                swap = sx > ex or (sx == ex and sy > ey)
                px, py = (ex, ey) if swap else (sx, sy)
                qx, qy = (sx, sy) if swap else (ex, ey)
                cell = int((sy - grid[1]) * grid[4]) * int(grid[6]) + int((sx - grid[0]) * grid[4])
                for k in range(start[cell], start[cell + 1]):
                    if packed[k, 4] > length2:
                        break  # nearest first: the others are out of reach
                    if cut(px, py, qx, qy, packed[k, 0], packed[k, 1], packed[k, 2], packed[k, 3]):
                        hit = True
                        break
    return hit


@inline_kernel
def _cuts(px: float, py: float, qx: float, qy: float, ax: float, ay: float, bx: float, by: float) -> bool:
    """`cut` without a branch: for loops whose answers no processor can foresee."""
    boxes = (px <= bx) & (ax <= qx) & (min(py, qy) <= max(ay, by)) & (min(ay, by) <= max(py, qy))
    wx, wy, mx, my = bx - ax, by - ay, qx - px, qy - py
    sides = (wx * (py - ay) - wy * (px - ax) > 0.0) != (wx * (qy - ay) - wy * (qx - ax) > 0.0)
    ends = (mx * (ay - py) - my * (ax - px) > 0.0) != (mx * (by - py) - my * (bx - px) > 0.0)
    return boxes & sides & ends


@kernel
def _look_up(
    x0: NDArray[np.floating],
    y0: NDArray[np.floating],
    x1: NDArray[np.floating],
    y1: NDArray[np.floating],
    grid: Array,
    nx: int,
    ny: int,
    at: NDArray[np.int32],
    need: NDArray[np.int32],
) -> None:
    """Clearance cell of each move, and the clearance (units) that lets it pass: -1 if it crosses nothing anyway."""
    longest2 = grid[5] * grid[5]
    for i in range(len(x0)):
        sx, sy = np.float64(x0[i]), np.float64(y0[i])
        dx, dy = np.float64(x1[i]) - sx, np.float64(y1[i]) - sy
        length2 = dx * dx + dy * dy
        u, v = (sx - grid[0]) * grid[2], (sy - grid[1]) * grid[2]
        # off the grid no wall is within the longest move; NaN fails every comparison and crosses nothing
        on = (u >= 0.0) & (v >= 0.0) & (u < nx) & (v < ny) & (length2 <= longest2)
        at[i] = np.int32(v) * np.int32(nx) + np.int32(u) if on else np.int32(0)
        most = np.int32(256) if length2 > longest2 else np.int32(-1)
        need[i] = np.int32(math.sqrt(length2) / grid[3]) + np.int32(1) if on else most


@kernel
def crosses_many(
    x0: NDArray[np.floating],
    y0: NDArray[np.floating],
    x1: NDArray[np.floating],
    y1: NDArray[np.floating],
    grid: Array,
    clearance: NDArray[np.uint8],
    start: NDArray[np.int32],
    packed: Array,
    walls: Array,
    out: BoolArray,
) -> None:
    """`crosses_one` of n moves (float64 or float32) into ``out`` (n,); other kernels may call it too.

    Moves that the clearance does not settle are tested against the nearest wall of their cell, those left against the
    next, and so on: several times faster than `crosses_one` in a loop, for no branch depends on a single move.
    """
    n, (ny, nx) = len(x0), clearance.shape
    at, end, todo = np.empty(n, np.int32), np.empty(n, np.int32), np.empty(n, np.int32)
    _look_up(x0, y0, x1, y1, grid, nx, ny, at, end)
    free = clearance.reshape(ny * nx)
    m = 0
    for i in range(n):
        out[i] = False
        todo[m] = i
        m += np.int32(free[at[i]]) <= end[i]
    left = 0
    for k in range(m):
        i = todo[k]
        sx, sy = np.float64(x0[i]), np.float64(y0[i])
        if end[i] == 256:  # longer than the lists reach
            out[i] = brute_one(sx, sy, np.float64(x1[i]), np.float64(y1[i]), walls)
            continue
        cell = int((sy - grid[1]) * grid[4]) * int(grid[6]) + int((sx - grid[0]) * grid[4])
        at[i], end[i] = start[cell], start[cell + 1]
        todo[left] = i
        left += at[i] < end[i]
    while left:
        m, left = left, 0
        for k in range(m):
            i = todo[k]
            j = at[i]
            sx, sy, ex, ey = np.float64(x0[i]), np.float64(y0[i]), np.float64(x1[i]), np.float64(y1[i])
            swap = (sx > ex) | ((sx == ex) & (sy > ey))
            px, py = ex if swap else sx, ey if swap else sy
            qx, qy = sx if swap else ex, sy if swap else ey
            dx, dy = ex - sx, ey - sy
            near = packed[j, 4] <= dx * dx + dy * dy  # nearest first: the others are out of reach
            hit = _cuts(px, py, qx, qy, packed[j, 0], packed[j, 1], packed[j, 2], packed[j, 3]) & near
            out[i] = hit
            at[i] = j + 1
            todo[left] = i
            left += near & (not hit) & (j + 1 < end[i])


@inline_kernel
def _box_distance(
    x0: float, y0: float, x1: float, y1: float, ax: float, ay: float, bx: float, by: float
) -> float:
    """Distance of segment a-b from the rectangle (x0, y0)-(x1, y1), 0 where they touch."""
    # Liang-Barsky: does any part of the segment lie in the rectangle?
    lo, hi = 0.0, 1.0
    dx, dy = bx - ax, by - ay
    inside = True
    for axis in range(2):
        d = dx if axis == 0 else dy
        low = (x0 - ax) if axis == 0 else (y0 - ay)
        high = (x1 - ax) if axis == 0 else (y1 - ay)
        if d == 0.0:
            inside = inside and low <= 0.0 <= high
        else:
            t0, t1 = low / d, high / d
            lo, hi = max(lo, min(t0, t1)), min(hi, max(t0, t1))
    if inside and lo <= hi:
        return 0.0
    # apart: the nearest points are a corner and the segment, or an end and the rectangle
    best: float = np.inf
    length2 = max(dx * dx + dy * dy, 1e-30)
    for corner in range(4):
        cx = x0 if corner % 2 == 0 else x1
        cy = y0 if corner < 2 else y1
        t = min(1.0, max(0.0, ((cx - ax) * dx + (cy - ay) * dy) / length2))
        ex, ey = ax + t * dx - cx, ay + t * dy - cy
        best = min(best, ex * ex + ey * ey)
    for end in range(2):
        ex = ax if end == 0 else bx
        ey = ay if end == 0 else by
        gx, gy = max(x0 - ex, 0.0, ex - x1), max(y0 - ey, 0.0, ey - y1)
        best = min(best, gx * gx + gy * gy)
    return float(best**0.5)


@kernel
def fill_clearance(
    walls: Array,
    origin_x: float,
    origin_y: float,
    cell: float,
    reach: float,
    unit: float,
    out: NDArray[np.uint8],
) -> None:
    """Lower each cell of ``out`` (ny, nx) to floor(distance to the nearest wall / unit), within reach."""
    ny, nx = out.shape
    for k in range(walls.shape[0]):
        ax, ay, bx, by = walls[k, 0], walls[k, 1], walls[k, 2], walls[k, 3]
        i0 = max(0, int((min(ax, bx) - reach - origin_x) / cell) - 1)
        i1 = min(nx, int((max(ax, bx) + reach - origin_x) / cell) + 2)
        j0 = max(0, int((min(ay, by) - reach - origin_y) / cell) - 1)
        j1 = min(ny, int((max(ay, by) + reach - origin_y) / cell) + 2)
        for j in range(j0, j1):
            y = origin_y + j * cell
            for i in range(i0, i1):
                x = origin_x + i * cell
                d = int(_box_distance(x, y, x + cell, y + cell, ax, ay, bx, by) / unit)
                out[j, i] = min(out[j, i], d)


@kernel
def build_cells(
    walls: Array,
    origin_x: float,
    origin_y: float,
    cell: float,
    nx: int,
    ny: int,
    reach: float,
    start: NDArray[np.int32],
    index: NDArray[np.int32],
    distance: Array,
) -> None:
    """List the walls within reach of each cell: with ``index`` empty, count into start[c + 1]; else fill it.

    On filling, start[c] must be where cell c begins; it comes back as where it ends. ``distance`` takes the
    distance (m) of each listed wall from its cell.
    """
    counting = len(index) == 0
    for k in range(walls.shape[0]):
        ax, ay, bx, by = walls[k, 0], walls[k, 1], walls[k, 2], walls[k, 3]
        i0 = max(0, int((min(ax, bx) - reach - origin_x) / cell) - 1)
        i1 = min(nx, int((max(ax, bx) + reach - origin_x) / cell) + 2)
        j0 = max(0, int((min(ay, by) - reach - origin_y) / cell) - 1)
        j1 = min(ny, int((max(ay, by) + reach - origin_y) / cell) + 2)
        for j in range(j0, j1):
            y = origin_y + j * cell
            for i in range(i0, i1):
                x = origin_x + i * cell
                d = _box_distance(x, y, x + cell, y + cell, ax, ay, bx, by)
                if d <= reach:
                    c = j * nx + i
                    if counting:
                        start[c + 1] += 1
                    else:
                        index[start[c]] = k
                        distance[start[c]] = d
                        start[c] += 1


@inline_kernel
def is_inside(
    x: float, y: float, origin_x: float, origin_y: float, inverse_cell: float, mask: NDArray[np.uint8]
) -> bool:
    """Whether a place lies in a set cell of a mask (ny, nx); NaN and places off the mask do not."""
    u, v = (x - origin_x) * inverse_cell, (y - origin_y) * inverse_cell
    inside = False
    if u >= 0.0 and v >= 0.0 and u < mask.shape[1] and v < mask.shape[0]:
        inside = mask[int(v), int(u)] != 0
    return inside
