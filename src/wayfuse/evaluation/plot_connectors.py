"""Symbols of stairs, lifts, escalators and ramps on a floor plan, with the floors each leads to."""

from __future__ import annotations

from collections.abc import Collection
from typing import TYPE_CHECKING

import numpy as np

from wayfuse.core.types import Array
from wayfuse.evaluation.plot_site import ABOVE
from wayfuse.maps.connectors import Connector, ConnectorKind
from wayfuse.maps.site import Site

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.path import Path

__all__ = ["draw_connectors", "served_floors"]

COLOURS = {
    ConnectorKind.STAIRS: "#7b3fa0",
    ConnectorKind.LIFT: "#1f6fb2",
    ConnectorKind.ESCALATOR: "#a03f6d",
    ConnectorKind.RAMP: "#7a7a2a",
}
PALE = "#f0edf5"
SIZE = 11.0  # pt, of a symbol
LINE = 9.0  # pt, height of a line of a label
LETTER = 4.0  # pt, width of a letter, about


def draw_connectors(
    ax: Axes, site: Site, floor: int, labelled: Collection[str] | None = None, *, brief: bool = False
) -> None:
    """Draw each connector that stops on a floor: footprint, symbol by kind at its landing, name and floors served.

    labelled : ids of the connectors to write names and floors at; without it all. brief : write floors only, and put
    the symbol into the middle of the footprint, for pictures whose landings are crowded by other things.
    """
    served = [(c, at) for c in site.connectors if (at := c.landing(floor)) is not None]
    written = []
    for c, at in served:
        x, y, ring, colour = at.x, at.y, _footprint(site, c, floor), COLOURS[c.kind]
        if ring is not None:
            if not brief:
                ax.fill(*ring.T, facecolor=colour, alpha=0.2, linewidth=0.0, zorder=4.2)
            else:  # opaque: over the name of the unit
                ax.fill(*ring.T, facecolor=PALE, edgecolor=colour, linewidth=0.9, zorder=ABOVE - 2)
                x, y = (0.5 * (ring.min(axis=0) + ring.max(axis=0))).tolist()
        ax.plot([x], [y], marker=_symbol(c.kind), color=colour, markersize=SIZE, markeredgecolor="white",
                markeredgewidth=0.4, linestyle="none", zorder=ABOVE - 1 if brief else ABOVE)  # fmt: skip
        if labelled is None or c.id in labelled:
            written.append((c, x, y))
    if brief:
        for c, x, y in written:
            leads = ", ".join(site.floor_names[k] for k in c.floors if k != floor)
            ax.annotate(f"to {leads}", (x, y), (0, -0.75 * SIZE), textcoords="offset points",
                        ha="center", va="top", fontsize=6.5, color=COLOURS[c.kind], zorder=ABOVE - 1,
                        annotation_clip=True, parse_math=False,
                        bbox={"boxstyle": "round,pad=0.1", "fc": "white", "ec": "none", "alpha": 0.85})  # fmt: skip
    else:
        _labels(ax, site, served_at=written, floor=floor)


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
