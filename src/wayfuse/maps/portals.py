"""Passable segments between convex cells: common edges without a wall, open or a door."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from typing import Any

import numpy as np

from wayfuse.core.types import Array, BoolArray, IntArray

__all__ = ["find_portals"]

KEY = 1e5  # corners are compared to 10 um
NEAR_WALL = 4e-3  # m, an edge this near a wall is that wall (slits are 2 mm deep)
APART = 5e-3  # m, edges of two cells this far apart are one
NARROWEST = 0.05  # m, a shorter common edge lets nobody through
ON_DOOR = 0.05  # m, a portal this near a door is that door


def find_portals(
    cells: Sequence[Array], faces: Sequence[int], lines: Array, doors: Array
) -> tuple[Array, IntArray, BoolArray]:
    """Portals between cells: segments (p, 4) m, the two cells of each (p, 2), whether it is a door (p,).

    Parameters
    ----------
    cells : (k, 2) m each, counter-clockwise. faces : area between walls and doors that each cell is part of:
        inside one, every common edge is open. lines, doors : (w, 4) m each, what is closed and what is a door.
    """
    sides: dict[Any, list[tuple[int, Array]]] = defaultdict(list)
    for i, cell in enumerate(cells):
        for a, b in zip(cell, np.roll(cell, -1, axis=0), strict=True):
            p, q = tuple(np.rint(a * KEY).tolist()), tuple(np.rint(b * KEY).tolist())
            sides[min(p, q), max(p, q)].append((i, np.concatenate([a, b])))
    found: dict[tuple[int, int], list[Array]] = defaultdict(list)
    single: list[tuple[int, Array]] = []
    for owners in _open(list(sides.values()), lines):
        if len(owners) == 2 and faces[owners[0][0]] == faces[owners[1][0]]:
            pair = sorted(owner for owner, _ in owners)
            found[pair[0], pair[1]].append(owners[0][1])
        else:
            single += owners
    for i, j, segment in _meetings(single):
        if faces[i] != faces[j]:
            found[min(i, j), max(i, j)].append(segment)
    portals = [(pair, line) for pair, parts in sorted(found.items()) for line in _joined(parts)]
    portals = [(pair, line) for pair, line in portals if np.hypot(*(line[2:] - line[:2])) >= NARROWEST]
    segments = np.array([line for _, line in portals]).reshape(-1, 4)
    return (
        segments,
        np.array([pair for pair, _ in portals], dtype=np.int64).reshape(-1, 2),
        _are_doors(segments, doors),
    )


def _open(sides: list[list[tuple[int, Array]]], lines: Array) -> list[list[tuple[int, Array]]]:
    """Those of the sides of cells (with the owners of each) whose middle has no wall."""
    import shapely

    if not sides or not len(lines):
        return sides
    segments = np.array([owners[0][1] for owners in sides])
    middles = shapely.points(0.5 * (segments[:, :2] + segments[:, 2:]))
    walls: Any = shapely.linestrings(lines.reshape(-1, 2, 2))
    near, _ = shapely.STRtree(walls).query(middles, predicate="dwithin", distance=NEAR_WALL)
    closed = set(near.tolist())
    return [side for k, side in enumerate(sides) if k not in closed]


def _meetings(sides: list[tuple[int, Array]]) -> list[tuple[int, int, Array]]:
    """Common parts of sides of different cells that lie on one line."""
    import shapely

    if not sides:
        return []
    lines: Any = shapely.linestrings([segment.reshape(2, 2) for _, segment in sides])
    one, other = shapely.STRtree(lines).query(lines, predicate="dwithin", distance=APART)
    found = []
    for k, m in zip(one.tolist(), other.tolist(), strict=True):
        i, j = sides[k][0], sides[m][0]
        common = _common(sides[k][1], sides[m][1]) if k < m and i != j else None
        if common is not None:
            found.append((i, j, common))
    return found


def _common(one: Array, other: Array) -> Array | None:
    """Part of the first segment along which the second lies, None where there is none."""
    start, along = one[:2], one[2:] - one[:2]
    length = float(np.hypot(*along))
    if length < NARROWEST:
        return None
    along = along / length
    offset = other.reshape(2, 2) - start
    if float(np.max(np.abs(offset @ (-along[1], along[0])))) > APART:
        return None
    low, high = np.clip(np.sort(offset @ along), 0.0, length)
    return np.concatenate([start + low * along, start + high * along]) if high - low >= NARROWEST else None


def _joined(lines: list[Array]) -> list[Array]:
    """Segments of one line, those that touch made one."""
    if len(lines) == 1:
        return lines
    start, along = lines[0][:2], lines[0][2:] - lines[0][:2]
    along = along / np.hypot(*along)
    spans = sorted(tuple(sorted(((line.reshape(2, 2) - start) @ along).tolist())) for line in lines)
    merged = [list(spans[0])]
    for low, high in spans[1:]:
        if low <= merged[-1][1] + APART:
            merged[-1][1] = max(merged[-1][1], high)
        else:
            merged.append([low, high])
    return [np.concatenate([start + low * along, start + high * along]) for low, high in merged]


def _are_doors(segments: Array, doors: Array) -> BoolArray:
    """Whether the middle of each portal lies on a door."""
    import shapely

    found = np.zeros(len(segments), dtype=np.bool_)
    if len(segments) and len(doors):
        middles = shapely.points(0.5 * (segments[:, :2] + segments[:, 2:]))
        drawn: Any = shapely.linestrings(doors.reshape(-1, 2, 2))
        near, _ = shapely.STRtree(drawn).query(middles, predicate="dwithin", distance=ON_DOOR)
        found[near] = True
    return found
