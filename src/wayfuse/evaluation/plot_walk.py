"""The picture of one walk: floor plan, truth with its waypoints, the estimates of each method, 95 % ellipses.

An estimate on another floor than the truth is no part of the line: it is a cross at the place below or above it.
Walks over several floors are drawn by `wayfuse.evaluation.plot_walk_floors` from the same parts.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from wayfuse.core.types import Array
from wayfuse.evaluation.errors import MethodScores, Scores, places_in_frame
from wayfuse.evaluation.estimates_file import WalkEstimates
from wayfuse.evaluation.plot_look import INK, new_figure, shown, style
from wayfuse.evaluation.truth import Truth

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from wayfuse.maps.site import Site

from wayfuse.evaluation.plot_walk_floors import floors_figure
from wayfuse.evaluation.plot_walk_parts import (
    OVER,
    ROW,
    broken,
    draw_ends,
    draw_plan,
    draw_truth,
    error_text,
    informed,
    legend_below,
    shift_to,
    track_of,
    true_floor,
    walk_title,
    window,
)

__all__ = ["walk_figure"]

_N_ELLIPSES = 7  # per method and walk
_RHO95 = 2.4477468306808166  # radius in standard deviations that holds 95 % of a Gaussian in the plane
_AROUND = 0.85  # inches: the titles and labels of the axes


def walk_figure(scores: Scores, walk: str, site: Site | None = None) -> Figure:
    """Figure of one walk of a scoring: of one floor here, of several by `plot_walk_floors`."""
    truth = scores.truths[walk]
    names: list[str] = list(dict.fromkeys(truth.floor.tolist()))
    if len(names) > 1:
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


def _size(box: tuple[Array, Array]) -> tuple[float, float]:
    """Inches of a figure with a panel of the box's shape."""
    low, high = box
    ratio = float(np.clip((high[1] - low[1]) / (high[0] - low[0]), 0.45, 1.5))
    return 9.0, 9.0 * ratio + _AROUND


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
    ax.plot(*broken(xy, here & right).T, marker=".", markersize=4, zorder=over, label=label, **look)
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
