"""What a survey covers of a floor, and where to survey next; how strong an access point is over a floor.

Grids are as a map draws them: values row by row, from the corner ``origin`` (m) on, rows along y, ``cell`` m apart.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayfuse.core.types import Array
from wayfuse.maps.site import Floor
from wayfuse.radio.interpolated_map import fit
from wayfuse.radio.survey import Survey

__all__ = ["Grid", "cells_of", "coverage", "heard_at", "level_of", "next_places"]

CELL = 0.5  # m
_FAR = 5.0  # m from the next fingerprint; a place farther away has to be surveyed
_PLACE = 2.0  # m, fingerprints in one square are one training place of an access point's level
_MOST_CELLS = 60_000  # of a floor; beyond, cells are larger


class Grid(NamedTuple):
    """origin (x, y) m of the corner; cell m; values (ny, nx), NaN where there is nothing to say."""

    origin: tuple[float, float]
    cell: float
    values: Array


def cells_of(floor: Floor, cell: float = CELL) -> tuple[Grid, NDArray[np.intp], Array]:
    """An empty grid over a floor, and index (k,) and centres (k, 2) m of its walkable cells."""
    cell = max(cell, math.sqrt(floor.width * floor.height / _MOST_CELLS))
    nx, ny = max(1, math.ceil(floor.width / cell)), max(1, math.ceil(floor.height / cell))
    x, y = np.meshgrid((np.arange(nx) + 0.5) * cell, (np.arange(ny) + 0.5) * cell)
    centres = np.column_stack([x.ravel(), y.ravel()])
    walkable = np.flatnonzero(floor.walkable.contains(centres[:, 0], centres[:, 1]))
    return Grid((0.0, 0.0), cell, np.full((ny, nx), np.nan)), walkable, centres[walkable]


def coverage(floor: Floor, places: Array, cell: float = CELL) -> Grid:
    """Distance (m) from each walkable cell to the nearest fingerprint at ``places`` (n, 2) m; infinite without any."""
    from scipy.spatial import cKDTree

    grid, at, centres = cells_of(floor, cell)
    if len(at):
        grid.values.ravel()[at] = cKDTree(places).query(centres)[0] if len(places) else np.inf
    return grid


def next_places(
    floor: Floor, places: Array, n: int = 5, cell: float = CELL
) -> list[tuple[float, float, float]]:
    """Where to survey next: x, y (m) and the distance (m) from there to the nearest fingerprint, the worst first.

    Each is the place farthest from all fingerprints and from those named before; none is nearer than 5 m.
    """
    _, at, centres = cells_of(floor, cell)
    if not len(at):
        return []
    distance = coverage(floor, places, cell).values.ravel()[at]
    if not len(places):  # nowhere is as good as the middle to begin with
        middle = int(np.argmin(np.hypot(*(centres - centres.mean(axis=0)).T)))
        distance[middle] = np.inf
        order = [middle]
    else:
        order = [int(np.argmax(distance))]
    found: list[tuple[float, float, float]] = []
    while len(found) < n and distance[order[-1]] >= _FAR:
        i = order[-1]
        found.append((float(centres[i, 0]), float(centres[i, 1]), float(distance[i])))
        distance = np.minimum(distance, np.hypot(*(centres - centres[i]).T))
        order.append(int(np.argmax(distance)))
    return found


def heard_at(survey: Survey, column: int, floor: int) -> tuple[Array, Array]:
    """Places (k, 2) m of the fingerprints of a floor, and the level (k,) dBm of an access point there, NaN unheard."""
    rows = np.flatnonzero(survey.floor == floor)
    levels = np.full(len(survey), np.nan)
    row_of = np.repeat(np.arange(len(survey)), np.diff(survey.indptr))
    mine = survey.indices == column
    levels[row_of[mine]] = survey.rssi[mine]
    return survey.xy[rows], levels[rows]


def level_of(floor: Floor, places: Array, levels: Array, cell: float = CELL) -> Grid:
    """Level (dBm) of an access point over a floor, read between fingerprints at most 5 m away; NaN farther out.

    places : (k, 2) m. levels : (k,) dBm, NaN where it was not heard, which counts as -100 dBm between places.
    """
    grid, at, centres = cells_of(floor, cell)
    if not len(at) or not np.isfinite(levels).any():
        return grid
    one = Survey.from_dense(levels[:, None], places, np.zeros(len(places), np.int32), (floor.name,))
    radio_map = fit(one, cell=_PLACE, missing=-100.0)
    values = radio_map.characteristic(centres, np.zeros(len(centres), np.int32))[:, 0].astype(np.float64)
    near = coverage(floor, places, grid.cell).values.ravel()[at] <= _FAR
    grid.values.ravel()[at] = np.where(near, values, np.nan)
    return grid
