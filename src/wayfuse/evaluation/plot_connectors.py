"""Symbols of stairs, lifts and escalators on a floor plan, with the floors each leads to."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from wayfuse.core.types import Array
from wayfuse.evaluation.plot_site import ABOVE
from wayfuse.maps.connectors import ConnectorKind

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.path import Path

    from wayfuse.maps.site import Site

__all__ = ["draw_connectors"]

_COLOUR, _FILL = "#5b4a8a", "#ece8f5"
_SIZE = 15.0  # pt


def draw_connectors(ax: Axes, site: Site, floor: str) -> None:
    """Draw the connectors that stop on a floor: footprint, symbol at its middle, and where it leads."""
    index = next((k for k, name in enumerate(site.floor_names) if name.casefold() == floor.casefold()), None)
    if index is None:
        return
    for connector in site.connectors:
        landing = connector.landing(index)
        if landing is None:
            continue
        x, y = landing.x, landing.y
        ring = connector.footprint
        if ring is not None:
            ring = ring + site.shift(connector.floors[0], index)
            x, y = (0.5 * (ring.min(axis=0) + ring.max(axis=0))).tolist()
            ax.fill(*ring.T, facecolor=_FILL, edgecolor=_COLOUR, linewidth=0.9, zorder=ABOVE - 2)
        look: dict[str, Any] = {
            "color": _COLOUR,
            "markeredgewidth": 0.0,
            "linestyle": "none",
            "zorder": ABOVE - 1,
        }
        ax.plot([x], [y], marker=_symbol(connector.kind), markersize=_SIZE, **look)
        others = ", ".join(site.floor_names[k] for k in connector.floors if k != index)
        ax.annotate(f"to {others}", (x, y), (0, -0.7 * _SIZE), textcoords="offset points", ha="center", va="top",
                    fontsize=6.5, color=_COLOUR, zorder=ABOVE - 1, annotation_clip=True, parse_math=False,
                    bbox={"boxstyle": "round,pad=0.1", "fc": "white", "ec": "none", "alpha": 0.85})  # fmt: skip


def _symbol(kind: ConnectorKind) -> Path:
    """Outline of a symbol in the square from -1 to 1."""
    from matplotlib.path import Path

    if kind is ConnectorKind.LIFT:  # two arrows, up and down
        up = np.array([(-0.9, -0.1), (-0.5, 0.9), (-0.1, -0.1)])
        parts = [Path(ring, closed=True) for ring in (_ring(up), _ring(-up))]
        return Path.make_compound_path(*parts)
    if kind is ConnectorKind.STAIRS:
        corners = [(-0.9, -0.8)]
        for k in range(4):
            left, top = -0.9 + 0.45 * k, -0.8 + 0.4 * (k + 1)
            corners += [(left, top), (left + 0.45, top)]
        corners.append((0.9, -0.8))
        return Path(_ring(np.array(corners)), closed=True)
    slope = np.array(
        [
            (-0.9, -0.8),
            (-0.4, -0.8),
            (0.5, 0.4),
            (0.9, 0.4),
            (0.9, 0.8),
            (0.3, 0.8),
            (-0.6, -0.4),
            (-0.9, -0.4),
        ]
    )
    return Path(_ring(slope), closed=True)


def _ring(corners: Array) -> Array:
    return np.concatenate([corners, corners[:1]])
