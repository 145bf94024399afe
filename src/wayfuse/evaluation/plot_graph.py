"""Draw what joins places: connectors with the floors they serve, cells and portals of the building graph, routes."""

from __future__ import annotations

from collections.abc import Collection
from typing import TYPE_CHECKING

import numpy as np

from wayfuse.core.types import Array
from wayfuse.evaluation.plot_site import ABOVE, INK, draw_floor
from wayfuse.maps.connectors import Connector, ConnectorKind
from wayfuse.maps.graph import BuildingGraph
from wayfuse.maps.route import Leg, Ride, Route
from wayfuse.maps.site import Floor, Site

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["draw_connectors", "draw_graph", "route_figure", "served_floors"]

CELL_EDGE = "#8fb39a"
OPEN_PORTAL = "#5b8f6b"
DOOR = "#c2703d"
COLOURS = {
    ConnectorKind.STAIRS: "#7b3fa0",
    ConnectorKind.LIFT: "#1f6fb2",
    ConnectorKind.ESCALATOR: "#a03f6d",
    ConnectorKind.RAMP: "#7a7a2a",
}
SYMBOLS = {
    ConnectorKind.STAIRS: "^",
    ConnectorKind.LIFT: "s",
    ConnectorKind.ESCALATOR: "D",
    ConnectorKind.RAMP: "P",
}
PATH = "#d1322d"
LINE = 9.0  # pt, height of a line of a label
LETTER = 4.0  # pt, width of a letter, about


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


def draw_connectors(ax: Axes, site: Site, floor: int, labelled: Collection[str] | None = None) -> None:
    """Draw each connector's landing on a floor: symbol by kind, footprint, name and floors served.

    labelled : ids of the connectors to write names and floors at; without it all.
    """
    from matplotlib.collections import PolyCollection

    served = [(c, at) for c in site.connectors if (at := c.landing(floor)) is not None]
    rings = [_footprint(site, c, floor) for c, _ in served]
    faces = [(ring, COLOURS[c.kind]) for (c, _), ring in zip(served, rings, strict=True) if ring is not None]
    ax.add_collection(
        PolyCollection(
            [ring for ring, _ in faces],
            facecolors=[c for _, c in faces],
            alpha=0.25,
            linewidths=0,
            zorder=4.2,
        )
    )
    for c, at in served:
        ax.plot(at.x, at.y, SYMBOLS[c.kind], color=COLOURS[c.kind], ms=7, mec="white", mew=0.8, zorder=ABOVE)
    written = [(c, at.x, at.y) for c, at in served if labelled is None or c.id in labelled]
    _labels(ax, site, served_at=written, floor=floor)


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


def _footprint(site: Site, connector: Connector, floor: int) -> Array | None:
    """Footprint in the frame of a floor, None where the connector has none."""
    if connector.footprint is None:
        return None
    return np.asarray(connector.footprint + site.shift(connector.floors[0], floor))


def _labels(ax: Axes, site: Site, served_at: list[tuple[Connector, float, float]], floor: int) -> None:
    """Write name and floors beside each symbol, on the side with room, clear of labels written before."""
    taken: list[Array] = []
    middle = 0.5 * sum(ax.get_xlim())
    for c, x, y in sorted(served_at, key=lambda item: (-item[2], item[1])):
        text = f"{c.name or c.kind.value}  {served_floors(site, c, floor)}"
        right = x < middle
        at = ax.transData.transform((x, y)) * 72.0 / float(ax.figure.dpi)  # pt
        width = LETTER * len(text)
        shifts = [sign * k * LINE for k in range(5) for sign in (1.0, -1.0)]
        shift = next((s for s in shifts if _is_clear(at, s, width, right, taken)), 0.0)
        taken.append(_box(at, shift, width, right))
        ax.annotate(
            text,
            (x, y),
            (8.0 if right else -8.0, shift),
            textcoords="offset points",
            ha="left" if right else "right",
            va="center",
            fontsize=7,
            color=COLOURS[c.kind],
            parse_math=False,
            bbox={"boxstyle": "round,pad=0.15", "fc": "white", "ec": "none", "alpha": 0.8},
            zorder=ABOVE + 1.0,
        )


def _box(at: Array, shift: float, width: float, right: bool) -> Array:
    x0 = at[0] + 6.0 if right else at[0] - 6.0 - width
    return np.array([x0, at[1] + shift - 0.5 * LINE, x0 + width, at[1] + shift + 0.5 * LINE])


def _is_clear(at: Array, shift: float, width: float, right: bool, taken: list[Array]) -> bool:
    box = _box(at, shift, width, right)
    return all(box[0] > t[2] or box[2] < t[0] or box[1] > t[3] or box[3] < t[1] for t in taken)


def served_floors(site: Site, connector: Connector, here: int | None = None) -> str:
    """Floors of a connector in words: ``EG to 4OG``, with an arrow where it moves one way only.

    here : leave this floor out of two, for it is the one drawn.
    """
    names = [site.floors[k].name for k in connector.floors]
    if here is not None and len(names) == 2:
        other = connector.floors[1] if connector.floors[0] == here else connector.floors[0]
        way = "\u2191" if other > here else "\u2193"
        return f"{way} {site.floors[other].name}"
    if connector.floors == tuple(range(connector.floors[0], connector.floors[-1] + 1)) and len(names) > 3:
        return f"{names[0]} \u2026 {names[-1]}"
    return ", ".join(names)
