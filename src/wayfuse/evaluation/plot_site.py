"""Draw a floor: outline, units with their names, walls, walkable space, scale bar and north.

Colours are light and thin, so that tracks, clouds and errors can be drawn over a plan (z-order from `ABOVE`).
Figures are made without pyplot: no display, no global state.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from wayfuse.core.types import Array
from wayfuse.maps.site import Floor, Polygon, Unit

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.path import Path as Outline

__all__ = ["ABOVE", "draw_floor", "draw_names", "floor_figure", "save_figure"]

ABOVE = 10.0  # z-order from which callers draw over the plan

PAPER = "#ffffff"
GROUND = "#f6f5f1"  # inside the outline
WALKABLE = "#dfeee3"
WALL = "#b9b5ab"
HATCH = "#e4e1da"  # over voids
EDGE = "#6b675e"  # the outline
INK = "#57534b"
UNITS = {
    "shop": "#eae4da",
    "food": "#f1e3d3",
    "leisure": "#e6e2ee",
    "education": "#e3e8f0",
    "service": "#e2eaea",
    "toilet": "#dde7f0",
    "void": PAPER,
    "rest area": "#e9eedd",
    "parking bay": "#efeeea",
}
OTHER_UNIT = "#ebe9e4"
UNNAMED = frozenset({"closed area", "auxiliary", "void", "vacant", "rest area", "parking bay", "toilet"})
MARGIN = 0.03  # of the larger side, around the plan
FONT_SIZES = (8.0, 7.0, 6.0, 5.0, 4.2)  # pt, tried in turn
CLEAR, GLYPH_HEIGHT = 1.1, 1.15  # a name needs this much of its own width, of its font size in height


def draw_floor(
    ax: Axes, floor: Floor, *, walkable: bool = False, names: bool = True, scale: bool = True
) -> None:
    """Draw a floor into axes, in metres of its frame, and set their limits and equal aspect.

    Parameters
    ----------
    ax : axes of a figure whose size is final (names are fitted to it).
    walkable : tint the walkable cells.
    names : write the names of units where they fit.
    scale : draw a scale bar below the plan.
    """
    from matplotlib.collections import LineCollection, PathCollection

    ax.set_facecolor(PAPER)
    _frame(ax, floor)
    ground = [_path(polygon) for polygon in floor.outline]
    ax.add_collection(PathCollection(ground, facecolors=GROUND, edgecolors="none", zorder=1.0))
    units = [_path(unit.polygon) for unit in floor.units]
    fills = [UNITS.get(unit.category, OTHER_UNIT) for unit in floor.units]
    ax.add_collection(PathCollection(units, facecolors=fills, edgecolors="none", zorder=2.0))
    if walkable:
        _tint(ax, floor)
    voids = [_path(unit.polygon) for unit in floor.units if unit.category == "void"]
    ax.add_collection(
        PathCollection(voids, facecolors="none", edgecolors=HATCH, hatch="////", linewidths=0.0, zorder=2.8)
    )
    ax.add_collection(LineCollection(_segments(floor.walls), colors=WALL, linewidths=0.5, zorder=3.0))
    ax.add_collection(PathCollection(ground, facecolors="none", edgecolors=EDGE, linewidths=1.1, zorder=4.0))
    if scale:
        _scale_bar(ax, floor)
    if floor.anchor is not None:
        _north(ax, 0.5 * np.pi - floor.anchor.rotation)
    if names:
        draw_names(ax, floor)


def floor_figure(floor: Floor, title: str = "", *, walkable: bool = True, width: float = 12.0) -> Figure:
    """Figure of one floor, ``width`` inches wide and as high as the plan needs."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    box = np.array([0.62, 0.5, 0.2, 0.45 if title else 0.2])  # inches left, below, right, above
    low, high = _extent(floor)
    across, along = high - low
    inner = width - box[0] - box[2]
    height = float(np.clip(inner * along / across, 0.25 * width, 1.6 * width)) + box[1] + box[3]
    figure = Figure(figsize=(width, height), facecolor=PAPER)
    FigureCanvasAgg(figure)
    ax = figure.add_axes(
        (box[0] / width, box[1] / height, inner / width, (height - box[1] - box[3]) / height)
    )
    draw_floor(ax, floor, walkable=walkable)
    if title:
        ax.set_title(title, loc="left", fontsize=11, color=INK, parse_math=False)
    return figure


def save_figure(figure: Figure, path: Path) -> Path:
    """Write a figure as PNG or SVG, by the suffix of ``path``; the same figure gives the same bytes."""
    import matplotlib as mpl

    metadata: dict[str, Any] = {"Date": None} if path.suffix == ".svg" else {"Software": None}
    with mpl.rc_context({"svg.hashsalt": "wayfuse"}):
        figure.savefig(path, dpi=160, metadata=metadata)
    return path


def _extent(floor: Floor) -> tuple[Array, Array]:
    corners = np.concatenate([polygon.exterior for polygon in floor.outline] + [[[0.0, 0.0]]])
    low, high = corners.min(axis=0), np.maximum(corners.max(axis=0), (floor.width, floor.height))
    pad = MARGIN * float(np.max(high - low))
    return low - pad, high + pad


def _frame(ax: Axes, floor: Floor) -> None:
    low, high = _extent(floor)
    ax.set_xlim(low[0], high[0])
    ax.set_ylim(low[1], high[1])
    ax.set_aspect("equal")
    ax.apply_aspect()
    ax.set_xlabel("x east (m)", fontsize=8, color=INK)
    ax.set_ylabel("y north (m)", fontsize=8, color=INK)
    ax.tick_params(labelsize=7, color=WALL, labelcolor=INK, length=3)
    for spine in ax.spines.values():
        spine.set_color("#d9d6cf")
        spine.set_linewidth(0.6)


def _path(polygon: Polygon) -> Outline:
    from matplotlib.path import Path as Outline

    return Outline.make_compound_path(*[Outline(ring, closed=True) for ring in polygon.rings])


def _segments(walls: Array) -> list[Array]:
    return list(walls.reshape(-1, 2, 2))


def _tint(ax: Axes, floor: Floor) -> None:
    from matplotlib.colors import ListedColormap

    walkable = floor.walkable
    ny, nx = walkable.mask.shape
    x0, y0 = walkable.origin
    extent = (x0, x0 + nx * walkable.cell, y0, y0 + ny * walkable.cell)
    limits = ax.get_xlim(), ax.get_ylim()
    shown = np.ma.masked_equal(walkable.mask, 0)
    colours = ListedColormap([WALKABLE])
    ax.imshow(shown, origin="lower", extent=extent, cmap=colours, interpolation="nearest", zorder=2.5)
    ax.set_xlim(limits[0])
    ax.set_ylim(limits[1])


def _scale_bar(ax: Axes, floor: Floor) -> None:
    low, high = _extent(floor)
    target = 0.14 * float(high[0] - low[0])
    power = 10.0 ** np.floor(np.log10(target))
    length = float(max(m for m in (1.0, 2.0, 5.0) if m * power <= target) * power)
    pad = 0.6 * MARGIN * float(np.max(high - low))
    x, y = float(high[0] - pad - length), float(low[1] + pad)
    ax.plot([x, x + length], [y, y], color=INK, lw=2.0, solid_capstyle="butt", zorder=6.0)
    ax.annotate(
        f"{length:g} m",
        (x, y),
        (-4, 0),
        textcoords="offset points",
        ha="right",
        va="center",
        fontsize=8,
        color=INK,
        zorder=6.0,
    )


def _north(ax: Axes, direction: float) -> None:
    """Arrow at the upper right; ``direction`` is the heading of north in the floor's frame (rad)."""
    step = np.array([np.cos(direction), np.sin(direction)]) * 13.0  # pt
    ax.annotate(
        "",
        xy=(0.972, 0.955),
        xycoords="axes fraction",
        xytext=(-2 * step[0], -2 * step[1]),
        textcoords="offset points",
        arrowprops={"arrowstyle": "-|>", "color": INK, "lw": 1.2, "mutation_scale": 11},
        zorder=6.0,
    )
    ax.annotate(
        "N",
        xy=(0.972, 0.955),
        xycoords="axes fraction",
        xytext=(0.35 * step[0], 0.35 * step[1]),
        textcoords="offset points",
        ha="center",
        va="center",
        fontsize=8,
        color=INK,
        zorder=6.0,
    )


def draw_names(ax: Axes, floor: Floor) -> None:
    """Write each name at the largest size that fits its unit and the axes' limits; leave out the rest."""
    from matplotlib.font_manager import FontProperties, findfont, get_font
    from matplotlib.textpath import TextPath

    pixels = ax.transData.transform([(0.0, 0.0), (1.0, 0.0)])
    metres_per_point = float(ax.figure.dpi) / 72.0 / float(pixels[1, 0] - pixels[0, 0])
    glyphs = get_font(findfont(FontProperties())).get_charmap()
    for unit in floor.units:
        if unit.category in UNNAMED or not unit.name or any(ord(c) not in glyphs for c in unit.name):
            continue
        across = TextPath((0.0, 0.0), _literal(unit.name), size=1.0).get_extents().width
        fit = _fit(unit, across * CLEAR, metres_per_point)
        if fit is not None and _is_inside(ax, fit, across * metres_per_point):
            x, y, size, turn = fit
            ax.text(
                x,
                y,
                unit.name,
                fontsize=size,
                rotation=turn,
                rotation_mode="anchor",
                ha="center",
                va="center",
                color=INK,
                alpha=0.85,
                parse_math=False,
                clip_on=True,
                zorder=5.0,
            )


def _is_inside(ax: Axes, fit: tuple[float, float, float, float], width: float) -> bool:
    """Whether a name of ``width`` (m per pt of size) lies within the limits of the axes whole."""
    x, y, size, turn = fit
    angle = np.deg2rad(turn)
    half = 0.5 * width * size * np.abs([np.cos(angle), np.sin(angle)])
    (left, right), (low, high) = sorted(ax.get_xlim()), sorted(ax.get_ylim())
    return bool(left <= x - half[0] and x + half[0] <= right and low <= y - half[1] and y + half[1] <= high)


def _literal(text: str) -> str:
    return text.replace("$", r"\$")


def _fit(unit: Unit, width: float, metres_per_point: float) -> tuple[float, float, float, float] | None:
    """Place (m), font size (pt) and turn (degrees) of a name inside its unit, or None; ``width`` per pt.

    Level or upright names are preferred to those along the longer axis of the unit.
    """
    import shapely
    from shapely.affinity import rotate

    shape = shapely.Polygon(unit.polygon.exterior, [*unit.polygon.holes])
    spots = [shape.centroid, shapely.get_point(shapely.maximum_inscribed_circle(shape, tolerance=0.5), 0)]
    shapely.prepare(shape)
    axis = _axis(shapely.get_coordinates(shapely.minimum_rotated_rectangle(shape)))
    for turns in ((0.0, 90.0), (axis,)):
        for size in FONT_SIZES:
            w, h = 0.5 * width * size * metres_per_point, 0.5 * GLYPH_HEIGHT * size * metres_per_point
            for turn in turns:
                for spot in spots:
                    box = shapely.box(spot.x - w, spot.y - h, spot.x + w, spot.y + h)
                    if shape.contains(rotate(box, turn, origin="center")):
                        return float(spot.x), float(spot.y), size, turn
    return None


def _axis(rectangle: Array) -> float:
    """Direction of the longer side of a rectangle (5, 2), degrees in (-90, 90]."""
    sides = np.diff(rectangle[:3], axis=0)
    dx, dy = sides[int(np.argmax(np.hypot(*sides.T)))]
    return float(90.0 - (90.0 - np.rad2deg(np.arctan2(dy, dx))) % 180.0)
