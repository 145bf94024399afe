"""A hall of one storey: an empty room, or a warehouse with rows of racks that nobody walks through."""

from __future__ import annotations

import numpy as np

from wayfuse.core.frames import GeoAnchor
from wayfuse.simulator.building import Building, Room, Storey, box, corridor_graph
from wayfuse.simulator.geometry import polygon_walls
from wayfuse.simulator.toml_tables import require

__all__ = ["hall"]

_LON, _LAT = 11.0, 48.0  # degrees: a made-up place
_AISLE, _EDGE = 3.0, 4.0  # m: least width between racks, and free all around them
_GRID = 4.0  # m, about, between the nodes of an empty hall


def hall(width: float, height: float, racks: int) -> Building:
    """A hall of ``width`` by ``height`` m with rows of racks from west to east.

    Raises
    ------
    ConfigError : the racks do not fit, or the hall is too small to walk in.
    """
    require("size", min(width, height) >= 2.0 * _EDGE, (width, height), f"at least {2 * _EDGE:g} m each way")
    pitch = (height - 2.0 * _EDGE) / racks if racks else height
    require("racks", pitch >= 2.0 * _AISLE or not racks, racks, f"fewer: aisles need {_AISLE:g} m")
    rows = [
        box(_EDGE, width - _EDGE, _EDGE + pitch * k + 0.5 * _AISLE, _EDGE + pitch * (k + 1) - 0.5 * _AISLE)
        for k in range(racks)
    ]
    outline = box(0.0, width, 0.0, height)
    nodes, edges = _aisles(width, height, racks, pitch) if racks else _open(width, height)
    storey = Storey(
        name="0",
        elevation=0.0,
        outline=outline,
        rooms=tuple(Room(f"rack {k + 1}", row) for k, row in enumerate(rows)),
        voids=(),
        walls=polygon_walls([outline, *rows]),
        nodes=nodes,
        edges=edges,
    )
    name = "Wayfuse Warehouse" if racks else "Wayfuse Hall"
    return Building(name, (storey,), width, height, GeoAnchor.from_origin(_LON, _LAT))


def _aisles(width: float, height: float, racks: int, pitch: float) -> tuple[np.ndarray, np.ndarray]:
    """Two ways from south to north along the ends of the racks, joined by the aisles."""
    west, east = 0.5 * _EDGE, width - 0.5 * _EDGE
    levels = [0.5 * _EDGE, *(_EDGE + pitch * k for k in range(1, racks)), height - 0.5 * _EDGE]
    points = {f"{side}{k}": (x, y) for k, y in enumerate(levels) for side, x in (("w", west), ("e", east))}
    across = [f"w{k}-e{k}" for k in range(len(levels))]
    along = [f"{side}{k}-{side}{k + 1}" for k in range(len(levels) - 1) for side in "we"]
    return corridor_graph(points, " ".join([*across, *along]))


def _open(width: float, height: float) -> tuple[np.ndarray, np.ndarray]:
    """A net over an empty hall."""
    columns, rows = (
        np.linspace(0.5 * _EDGE, size - 0.5 * _EDGE, max(2, round((size - _EDGE) / _GRID) + 1))
        for size in (width, height)
    )
    points = {f"{i}.{j}": (float(x), float(y)) for i, x in enumerate(columns) for j, y in enumerate(rows)}
    ways = [f"{i}.{j}-{i + 1}.{j}" for i in range(len(columns) - 1) for j in range(len(rows))]
    ways += [f"{i}.{j}-{i}.{j + 1}" for i in range(len(columns)) for j in range(len(rows) - 1)]
    return corridor_graph(points, " ".join(ways))
