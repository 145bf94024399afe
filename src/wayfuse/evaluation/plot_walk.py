"""The picture of one walk: floor plan, truth with its waypoints, the estimates of each method, 95 % ellipses.

An estimate on another floor than the truth is no part of the line: it is a cross at the place below or above it.
Walks over several floors are drawn by `wayfuse.evaluation.plot_walk_floors` from the same parts.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from wayfuse.core.types import Array, BoolArray
from wayfuse.evaluation.errors import MethodScores, Scores, places_in_frame, summarise
from wayfuse.evaluation.estimates_file import WalkEstimates
from wayfuse.evaluation.plots import INK, new_figure, shown, style
from wayfuse.evaluation.truth import Truth

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from wayfuse.maps.site import Floor, Site

__all__ = [
    "OVER",
    "ROW",
    "TRUTH",
    "draw_ends",
    "draw_plan",
    "draw_truth",
    "error_text",
    "informed",
    "legend_below",
    "shift_to",
    "track_of",
    "true_floor",
    "walk_figure",
    "walk_title",
    "window",
]

_MARGIN, _LEAST = 6.0, 24.0  # m around what is shown, and the least extent shown
_N_ELLIPSES = 7  # per method and walk
_RHO95 = 2.4477468306808166  # radius in standard deviations that holds 95 % of a Gaussian in the plane
_AROUND = 0.85  # inches: the titles and labels of the axes
ROW = 0.19  # inches, a row of the legend
OVER = 10.0  # z-order of what lies over the plan
TRUTH = "#111111"


def walk_figure(scores: Scores, walk: str, site: Site | None = None) -> Figure:
    """Figure of one walk of a scoring: of one floor here, of several by `plot_walk_floors`."""
    truth = scores.truths[walk]
    names: list[str] = list(dict.fromkeys(truth.floor.tolist()))
    if len(names) > 1:
        from wayfuse.evaluation.plot_walk_floors import floors_figure

        return floors_figure(scores, walk, names, site)
    name, box = names[0], window(scores, truth, names[0])
    width, height = _size(box)
    figure = new_figure(width, height)
    ax = figure.add_subplot()
    draw_plan(ax, site, name, truth, box)
    draw_truth(ax, truth, name, shift_to(scores, name))
    for index, method in enumerate(scores.methods):
        _estimates(ax, scores, method, index, truth, name)
    draw_ends(ax, truth, name, shift_to(scores, name))
    ax.set_title(f"{walk_title(walk, truth)}\n{ax.get_title(loc='left')}", loc="left", fontsize=10, color=INK,
                 parse_math=False)  # fmt: skip
    rows = legend_below(figure, 2)
    figure.set_size_inches(width, height + ROW * rows)
    return figure


def walk_title(walk: str, truth: Truth) -> str:
    """Name, length and time of a walk."""
    length = float(np.sum(np.hypot(*np.diff(truth.xy, axis=0).T)))
    return f"{walk}: {length:.0f} m in {truth.t[-1] - truth.t[0]:.0f} s"


def _size(box: tuple[Array, Array]) -> tuple[float, float]:
    """Inches of a figure with a panel of the box's shape."""
    low, high = box
    ratio = float(np.clip((high[1] - low[1]) / (high[0] - low[0]), 0.45, 1.5))
    return 9.0, 9.0 * ratio + _AROUND


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


def _broken(xy: Array, shown: Any) -> Array:
    """Places with NaN where not shown, so that a line breaks there."""
    return np.where(np.asarray(shown)[:, None], xy, np.nan)


def draw_truth(ax: Axes, truth: Truth, floor: str, shift: Array) -> None:
    """The truth with its waypoints where it is on the floor."""
    xy = _broken(truth.xy + shift, truth.floor == floor)
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


def _estimates(ax: Axes, scores: Scores, method: MethodScores, index: int, truth: Truth, floor: str) -> None:
    track = track_of(method, truth.walk)
    xy = None if track is None else places_in_frame(track, truth, scores.frame)
    if track is None or xy is None:
        return
    xy = xy + shift_to(scores, floor)
    look = style(index) | ({} if index == 0 else {"linewidth": 1.2, "alpha": 0.8})
    here = informed(track) & (true_floor(truth, track.t) == floor)
    right = scores.frame.steps(track.floor, np.full(len(track), floor)) == 0
    right = right | (floor == "")
    label = f"{shown(method.name)}: {error_text(scores, method, truth.walk)}"
    over = OVER + 4 - 0.1 * index  # the first method on top
    ax.plot(*_broken(xy, here & right).T, marker=".", markersize=4, zorder=over, label=label, **look)
    wrong = here & ~right
    if wrong.any():
        ax.plot(*xy[wrong].T, "x", color=look["color"], markersize=6, zorder=over,
                label=f"{shown(method.name)}: on another floor")  # fmt: skip
    if method is _with_covariance(scores) and truth.plane is None:
        _ellipses(ax, track, xy, here, look["color"], method.name)


def _with_covariance(scores: Scores) -> MethodScores | None:
    """The first method that states covariances: ellipses of several would hide the paths."""
    stated = (m for m in scores.methods if np.any(np.isfinite(m.points["1hz"].cov)))
    return next(stated, None)


def _ellipses(ax: Axes, track: WalkEstimates, xy: Array, here: Any, colour: str, name: str) -> None:
    """95 % ellipses of the stated covariance, spread over the walk."""
    from matplotlib.patches import Ellipse

    xx, yy, cross = (track.number(name) for name in ("var_x", "var_y", "cov_xy"))
    given = np.flatnonzero(here)
    rows = given[np.unique(np.linspace(0, len(given) - 1, min(_N_ELLIPSES, len(given))).round().astype(int))]
    drawn = False
    for i in rows:
        matrix = np.array([[xx[i], cross[i]], [cross[i], yy[i]]])
        if not np.all(np.isfinite(matrix)):
            continue
        values, vectors = np.linalg.eigh(matrix)
        if values[0] < 0:
            continue
        width, height = 2.0 * _RHO95 * np.sqrt(values[::-1])
        angle = float(np.degrees(np.arctan2(vectors[1, 1], vectors[0, 1])))
        look = {"facecolor": "none", "edgecolor": colour, "linewidth": 0.9, "alpha": 0.55}
        ax.add_patch(Ellipse(tuple(xy[i]), width, height, angle=angle, zorder=OVER + 2, **look))
        ax.plot(*xy[i], "o", color=colour, markersize=4, zorder=OVER + 4)
        drawn = True
    if drawn:  # an ellipse in the legend would be a box: a ring without a place stands for it
        ax.plot(
            [],
            [],
            "o",
            color=colour,
            markersize=9,
            markerfacecolor="none",
            label=f"{shown(name)}: 95 % ellipses as stated",
        )


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
