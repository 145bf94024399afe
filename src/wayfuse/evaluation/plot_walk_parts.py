"""The parts that pictures of walks are made of: plan, truth, ends, legend, and what is shown of a track."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from wayfuse.core.types import Array, BoolArray
from wayfuse.evaluation.errors import MethodScores, Scores, places_in_frame, summarise
from wayfuse.evaluation.estimates_file import WalkEstimates
from wayfuse.evaluation.plot_look import INK
from wayfuse.evaluation.truth import Truth

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from wayfuse.maps.site import Floor, Site

__all__ = [
    "OVER",
    "ROW",
    "TRUTH",
    "broken",
    "draw_ends",
    "draw_plan",
    "draw_truth",
    "error_text",
    "informed",
    "legend_below",
    "shift_to",
    "track_of",
    "true_floor",
    "walk_title",
    "window",
]

_MARGIN, _LEAST = 6.0, 24.0  # m around what is shown, and the least extent shown
ROW = 0.19  # inches, a row of the legend
OVER = 10.0  # z-order of what lies over the plan
TRUTH = "#111111"


def walk_title(walk: str, truth: Truth) -> str:
    """Name, length and time of a walk."""
    length = float(np.sum(np.hypot(*np.diff(truth.xy, axis=0).T)))
    return f"{walk}: {length:.0f} m in {truth.t[-1] - truth.t[0]:.0f} s"


def shift_to(scores: Scores, floor: str) -> Array:
    """Offset (2,) from the common frame to that of a floor."""
    return np.asarray(-scores.frame.shift(np.array([floor]))[0])


def track_of(method: MethodScores, walk: str) -> WalkEstimates | None:
    """A method's estimates of a walk, None where it has none."""
    return next((track for track in method.tracks if track.walk == walk), None)


def informed(track: WalkEstimates) -> BoolArray:
    """Rows that rest on more than the building: before its first scan a tracker states the middle of it."""
    return np.asarray(track.states() != "initialising")


def true_floor(truth: Truth, t: Array) -> NDArray[np.str_]:
    """Names (n,) of the true floors at times (n,) s, held at both ends."""
    return truth.at(np.clip(t, truth.t[0], truth.t[-1]))[1]


def window(scores: Scores, truth: Truth, floor: str) -> tuple[Array, Array]:
    """Corners (m, floor's frame) of what is shown: truth on the floor, most of the estimates meanwhile."""
    shift = shift_to(scores, floor)
    places = [truth.xy[truth.floor == floor] + shift]
    for method in scores.methods:
        track = track_of(method, truth.walk)
        xy = None if track is None else places_in_frame(track, truth, scores.frame)
        if track is not None and xy is not None:
            here = xy[informed(track) & (true_floor(truth, track.t) == floor)] + shift
            if len(here):
                places.append(np.percentile(here, (5, 95), axis=0))  # an outlier is not to shrink the rest
    every = np.concatenate(places)
    low, high = every.min(axis=0) - _MARGIN, every.max(axis=0) + _MARGIN
    grow = np.maximum(0.5 * (_LEAST - (high - low)), 0.0)
    return low - grow, high + grow


def draw_plan(ax: Axes, site: Site | None, name: str, truth: Truth, box: tuple[Array, Array]) -> None:
    """Floor plan, or an empty sheet in metres, zoomed to the box, with a scale bar."""
    floor = _floor(site, name) if truth.plane is None else None
    if floor is not None:
        from wayfuse.evaluation.plot_site import draw_floor, draw_names

        draw_floor(ax, floor, names=False, scale=False)
    else:
        ax.grid(visible=True, color="#e4e4e4", linewidth=0.5)
        ax.tick_params(labelsize=8)
        ax.set_xlabel(
            "x (m)" if truth.plane is None else "east of the first waypoint (m)", fontsize=8, color=INK
        )
        ax.set_ylabel(
            "y (m)" if truth.plane is None else "north of the first waypoint (m)", fontsize=8, color=INK
        )
    ax.set_aspect("equal")
    ax.set_xlim(box[0][0], box[1][0])
    ax.set_ylim(box[0][1], box[1][1])
    if floor is not None:
        draw_names(ax, floor)
    ax.set_title(
        f"floor {name}" if name else "floor unknown", loc="left", fontsize=10, color=INK, parse_math=False
    )
    _scale_bar(ax, box)


def _floor(site: Site | None, name: str) -> Floor | None:
    floors = () if site is None else site.floors
    return next((floor for floor in floors if floor.name.casefold() == name.casefold()), None)


def _scale_bar(ax: Axes, box: tuple[Array, Array]) -> None:
    width = float(box[1][0] - box[0][0])
    length = max(n for n in (1, 2, 5, 10, 20, 50, 100, 200, 500) if n <= max(1.0, 0.22 * width))
    x, y = box[0] + 0.03 * (box[1] - box[0])
    ax.plot([x, x + length], [y, y], color=INK, linewidth=2.4, solid_capstyle="butt", zorder=OVER + 6)
    ax.annotate(f"{length} m", (x + 0.5 * length, y), (0, 3), textcoords="offset points", ha="center",
                fontsize=8, color=INK, zorder=OVER + 6)  # fmt: skip


def broken(xy: Array, shown: Any) -> Array:
    """Places with NaN where not shown, so that a line breaks there."""
    return np.where(np.asarray(shown)[:, None], xy, np.nan)


def draw_truth(ax: Axes, truth: Truth, floor: str, shift: Array) -> None:
    """The truth with its waypoints where it is on the floor."""
    xy = broken(truth.xy + shift, truth.floor == floor)
    ax.plot(*xy.T, color="white", linewidth=4.5, zorder=OVER, solid_capstyle="round")
    ax.plot(*xy.T, color=TRUTH, linewidth=2.0, zorder=OVER + 1, label="truth, waypoints", marker="o",
            markersize=5.5, markerfacecolor="white", markeredgecolor=TRUTH)  # fmt: skip


def draw_ends(ax: Axes, truth: Truth, floor: str, shift: Array) -> None:
    """Start and end of the truth."""
    for row, text, symbol, side in ((0, "start", "^", 1), (-1, "end", "s", -1)):
        if truth.floor[row] != floor:
            continue
        x, y = truth.xy[row] + shift
        ax.plot([x], [y], symbol, color=TRUTH, markersize=9, markeredgecolor="white", zorder=OVER + 7)
        box = {"boxstyle": "round,pad=0.15", "fc": "white", "ec": "none", "alpha": 0.8}
        ax.annotate(text, (x, y), (7, 9 * side), textcoords="offset points", fontsize=9, color=TRUTH,
                    zorder=OVER + 8, bbox=box)  # fmt: skip


def error_text(scores: Scores, method: MethodScores, walk: str) -> str:
    """Errors of a method on a walk, for its label."""
    points = method.points["1hz"].used()
    of = summarise(points.select(points.walk == scores.walks.index(walk)))
    if not of.n:
        return "no estimate at the evaluation times"
    floor = "" if np.isnan(of.floor_accuracy) else f", floor {100 * of.floor_accuracy:.0f} %"
    return f"mean {of.mean:.1f} m, median {of.p50:.1f} m{floor}"


def legend_below(figure: Figure, columns: int) -> int:
    """Legend below the panels; its number of rows."""
    entries: dict[str, Any] = {}
    for ax in figure.axes:
        handles, labels = ax.get_legend_handles_labels()
        entries |= dict(zip(labels, handles, strict=True))
    legend = figure.legend(
        entries.values(), entries.keys(), loc="outside lower left", ncols=columns, fontsize=8.5, frameon=False
    )
    for text in legend.get_texts():
        text.set_parse_math(False)
    return -(-len(entries) // columns)
