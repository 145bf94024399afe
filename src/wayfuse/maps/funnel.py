"""Pull a path through a channel of portals taut: the shortest line that crosses them in turn.

References
----------
.. [1] Lee, Preparata, Euclidean shortest paths in the presence of rectilinear barriers, Networks 1984: the funnel.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from wayfuse.core.types import Array

__all__ = ["pull_taut"]


def pull_taut(start: Array, goal: Array, portals: Sequence[Array]) -> Array:
    """Shortest path (k, 2) m from start to goal through portals (4,) m in turn, all in one frame.

    The channel is that of convex cells which share the portals one after another, so straight lines between the
    corners of the path stay in it.
    """
    # left and right end of each portal as seen on the way; the goal is a portal of one point
    gates = [*_sides(start, goal, portals), (goal, goal)]
    path, apex, left, right = [start], start, start, start
    at_left = at_right = -1
    i = 0
    while i < len(gates):
        new_left, new_right = gates[i]
        if _turn(apex, right, new_right) >= 0.0:
            if _same(apex, right) or _turn(apex, left, new_right) < 0.0:
                right, at_right = new_right, i
            else:  # the right side crosses the left one: that corner is on the path
                path.append(left)
                apex, i = left, at_left + 1
                left = right = apex
                continue
        if _turn(apex, left, new_left) <= 0.0:
            if _same(apex, left) or _turn(apex, right, new_left) > 0.0:
                left, at_left = new_left, i
            else:
                path.append(right)
                apex, i = right, at_right + 1
                left = right = apex
                continue
        i += 1
    path.append(goal)
    return _without_repeats(np.array(path))


def _sides(start: Array, goal: Array, portals: Sequence[Array]) -> list[tuple[Array, Array]]:
    """Left and right end of each portal, seen from the portal before towards the one after."""
    middles = [start, *(0.5 * (p[:2] + p[2:]) for p in portals), goal]
    found = []
    for k, portal in enumerate(portals):
        a, b = portal[:2], portal[2:]
        ahead = middles[k + 2] - middles[k]
        is_left = ahead[0] * (a - b)[1] - ahead[1] * (a - b)[0] > 0.0
        found.append((a, b) if is_left else (b, a))
    return found


def _turn(a: Array, b: Array, c: Array) -> float:
    """Positive where c lies to the left of the line from a to b."""
    return float((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]))


def _same(a: Array, b: Array) -> bool:
    return bool(np.all(np.abs(a - b) < 1e-9))


def _without_repeats(path: Array) -> Array:
    keep = np.concatenate([[True], np.hypot(*np.diff(path, axis=0).T) > 1e-9])
    return path[keep] if keep.sum() > 1 else path[[0, -1]]
