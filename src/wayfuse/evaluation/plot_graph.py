"""Draw what joins places: cells and portals of the building graph, routes over floors."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from wayfuse.evaluation.plot_connectors import draw_connectors
from wayfuse.evaluation.plot_site import ABOVE, INK, draw_floor
from wayfuse.maps.graph import BuildingGraph
from wayfuse.maps.route import Leg, Ride, Route
from wayfuse.maps.site import Floor, Site

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["draw_graph", "route_figure"]

CELL_EDGE = "#8fb39a"
OPEN_PORTAL = "#5b8f6b"
DOOR = "#c2703d"
PATH = "#d1322d"


def draw_graph(ax: Axes, graph: BuildingGraph, floor: int) -> None:
    """Draw the cells of a floor faintly and its portals: doors across, open ones thin."""
    from matplotlib.collections import LineCollection, PolyCollection

    cells = [graph.polygon(int(i)) for i in np.nonzero(graph.cell_floor == floor)[0]]
    ax.add_collection(
        PolyCollection(cells, facecolors="none", edgecolors=CELL_EDGE, linewidths=0.35, zorder=2.9)
    )
    here = graph.cell_floor[graph.portal_cells[:, 0]] == floor
    for doors, colour, width in ((False, OPEN_PORTAL, 0.8), (True, DOOR, 2.2)):
        lines = graph.portal_xy[here & (graph.portal_door == doors)].reshape(-1, 2, 2)
        style = "-" if doors else (0, (1.5, 2.5))
        ax.add_collection(
            LineCollection(list(lines), colors=colour, linewidths=width, linestyles=style, zorder=4.5)
        )


def route_figure(site: Site, route: Route, title: str = "", width: float = 8.0) -> Figure:
    """The floors of a route side by side, the lowest at the left, ``width`` inches each, with the way on each."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    legs = [part for part in route.parts if isinstance(part, Leg)]
    used = [part.connector.id for part in route.parts if isinstance(part, Ride)]
    shown = sorted({leg.floor for leg in legs})
    height = max(0.55 * width, min(1.3 * width, max(width * _shape(site.floors[k]) for k in shown)))
    figure = Figure(figsize=(width * len(shown), height), facecolor="white", layout="constrained")
    FigureCanvasAgg(figure)
    axes = np.ravel(figure.subplots(1, len(shown)))
    figure.draw_without_rendering()  # settles the size of the axes, which names are fitted to
    for ax, k in zip(axes, shown, strict=True):
        draw_floor(ax, site.floors[k], walkable=True)
        draw_connectors(ax, site, k, used)
        ax.set_title(f"floor {site.floors[k].name}", loc="left", fontsize=10, color=INK, parse_math=False)
    for number, leg in enumerate(legs):
        ax = axes[shown.index(leg.floor)]
        ax.plot(*leg.path.T, color=PATH, lw=2.2, solid_joinstyle="round", zorder=ABOVE + 2.0)
        for k, symbol, is_end in ((0, "o", number == 0), (-1, "X", number == len(legs) - 1)):
            if is_end:
                ax.plot(*leg.path[k], symbol, color=PATH, ms=9, mec="white", zorder=ABOVE + 3.0)
    if title:
        text = f"{title}   {route.length:.0f} m, {route.seconds:.0f} s"
        figure.suptitle(text, fontsize=11, color=INK, parse_math=False)
    return figure


def _shape(floor: Floor) -> float:
    return floor.height / floor.width
