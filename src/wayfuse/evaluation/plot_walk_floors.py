"""The picture of a walk over several floors: the floors side by side, and the floor over time below them.

All panels show the same part of the building at the same scale, so that a staircase is at the same place in each.
Changes of floor are numbered in the order they happen: a badge where the truth leaves a floor, and one of the same
number where it comes to the next. Estimates are drawn on the floor they state; where that is not the true one, the
first method's are crosses on the floor they state.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from wayfuse.core.types import Array
from wayfuse.evaluation.errors import MethodScores, Scores, places_in_frame
from wayfuse.evaluation.plot_connectors import draw_connectors
from wayfuse.evaluation.plot_look import FAINT, INK, new_figure, shown, style
from wayfuse.evaluation.plot_walk_parts import (
    OVER,
    ROW,
    TRUTH,
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
from wayfuse.evaluation.truth import Truth

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from wayfuse.maps.connectors import Connector
    from wayfuse.maps.site import Site

__all__ = ["Change", "floor_changes", "floors_figure"]

_MAX_PANELS = 4
_PANEL = 5.6  # inches wide
_TIMES, _AROUND = 1.6, 1.5  # inches: the panel of times, titles and labels
_ENTRY = 4.0  # inches wide, an entry of the legend
_NEAR = 8.0  # m from a landing to the waypoint before it: a stairway's half landing is so far
_PAPER = {"boxstyle": "round,pad=0.12", "fc": "white", "ec": "none", "alpha": 0.75}
_BADGE = {"boxstyle": "circle,pad=0.22", "fc": TRUTH, "ec": "white", "lw": 1.0}


class Change(NamedTuple):
    """A change of the true floor between the waypoints ``row`` and ``row`` + 1; how, where the site knows."""

    row: int
    start: str
    stop: str
    by: str


def floors_figure(scores: Scores, walk: str, names: list[str], site: Site | None) -> Figure:
    """Figure of a walk over the floors ``names``; they are put bottom up where the site knows them."""
    truth = scores.truths[walk]
    names = _bottom_up(names, site)[:_MAX_PANELS]
    boxes = [tuple(corner - shift_to(scores, n) for corner in window(scores, truth, n)) for n in names]
    low, high = np.min([b[0] for b in boxes], axis=0), np.max([b[1] for b in boxes], axis=0)
    ratio = float(np.clip((high[1] - low[1]) / (high[0] - low[0]), 0.4, 1.4))
    width, height = _PANEL * len(names), _PANEL * ratio + _AROUND + _TIMES
    figure = new_figure(width, height)
    panels = figure.add_gridspec(2, len(names), height_ratios=[_PANEL * ratio, _TIMES])
    changes = floor_changes(scores, truth, site)
    for k, name in enumerate(names):
        ax = figure.add_subplot(panels[0, k])
        shift = shift_to(scores, name)
        draw_plan(ax, site, name, truth, (low + shift, high + shift))
        known = [] if site is None else [n.casefold() for n in site.floor_names]
        if site is not None and truth.plane is None and name.casefold() in known:
            draw_connectors(ax, site, known.index(name.casefold()), brief=True)
        draw_truth(ax, truth, name, shift)
        for index, method in enumerate(scores.methods):
            _estimates(ax, scores, method, index, truth, name)
        draw_ends(ax, truth, name, shift)
        _badges(ax, truth, changes, name, shift)
        if k:
            ax.set_ylabel("")
    title = figure.suptitle(_heading(walk, truth, changes), x=0.005, ha="left", fontsize=11, color=INK)
    title.set_parse_math(False)
    _times(figure.add_subplot(panels[1, :]), scores, truth, names, changes)
    rows = legend_below(figure, int(width / _ENTRY))
    figure.set_size_inches(width, height + ROW * rows)
    return figure


def _heading(walk: str, truth: Truth, changes: list[Change]) -> str:
    ways = [f"{change.by or 'change'} {change.start} to {change.stop}" for change in changes]
    return f"{walk_title(walk, truth)}; {', '.join(ways)}"


def _bottom_up(names: list[str], site: Site | None) -> list[str]:
    known = [] if site is None else [name.casefold() for name in site.floor_names]
    return sorted(names, key=lambda n: known.index(n.casefold()) if n.casefold() in known else len(known))


def floor_changes(scores: Scores, truth: Truth, site: Site | None) -> list[Change]:
    """Changes of floor in the truth, in order, each with the name of the connector's kind nearest to it."""
    rows = np.flatnonzero(truth.floor[1:] != truth.floor[:-1]).tolist()
    changes = []
    for row in rows:
        start, stop = str(truth.floor[row]), str(truth.floor[row + 1])
        connector = _taken(scores, truth, row, site)
        changes.append(Change(row, start, stop, "" if connector is None else str(connector.kind)))
    return changes


def _taken(scores: Scores, truth: Truth, row: int, site: Site | None) -> Connector | None:
    """The connector that joins both floors nearest to the waypoints around a change, None where none is near."""
    if site is None or truth.plane is not None:
        return None
    best: tuple[float, Connector | None] = (_NEAR, None)
    for connector in site.connectors:
        apart = 0.0
        for i in (row, row + 1):
            name = str(truth.floor[i]).casefold()
            here = [p for p in connector.landings if site.floor_names[p.floor].casefold() == name]
            shift = shift_to(scores, str(truth.floor[i]))
            place = truth.xy[i] + shift
            gaps = [float(np.hypot(place[0] - p.x, place[1] - p.y)) for p in here]
            apart = max(apart, min(gaps, default=np.inf))
        if apart < best[0]:
            best = (apart, connector)
    return best[1]


def _estimates(ax: Axes, scores: Scores, method: MethodScores, index: int, truth: Truth, floor: str) -> None:
    """A method's places on this floor; only the first method's are marked where the truth is on another."""
    track = track_of(method, truth.walk)
    xy = None if track is None else places_in_frame(track, truth, scores.frame)
    if track is None or xy is None:
        return
    xy = xy + shift_to(scores, floor)
    look = style(index) | ({} if index == 0 else {"linewidth": 1.0, "alpha": 0.65})
    stated = informed(track) & (np.char.lower(track.floor) == floor.casefold())
    right = np.char.lower(true_floor(truth, track.t)) == floor.casefold()
    over = OVER + 4 - 0.1 * index  # the first method on top
    label = f"{shown(method.name)}: {error_text(scores, method, truth.walk)}"
    line = np.where((stated & right)[:, None], xy, np.nan)
    ax.plot(*line.T, marker=".", markersize=4 if index == 0 else 2, zorder=over, label=label, **look)
    wrong = stated & ~right
    if index == 0 and wrong.any():
        ax.plot(*xy[wrong].T, "x", color=look["color"], markersize=6, zorder=over + 1,
                label=f"{shown(method.name)}: here while the truth is on another floor")  # fmt: skip


def _badges(ax: Axes, truth: Truth, changes: list[Change], floor: str, shift: Array) -> None:
    """Number, and where the change leads or comes from: odd ones on the right of their place, even on the left."""
    for number, change in enumerate(changes, 1):
        aside = 1 if number % 2 else -1
        for row, name, text, up in (
            (change.row, change.start, f"{change.by or 'change'} to {change.stop}", 1),
            (change.row + 1, change.stop, f"from {change.start}", -1),
        ):
            if name != floor:
                continue
            x, y = truth.xy[row] + shift
            look: dict[str, Any] = {
                "textcoords": "offset points",
                "fontsize": 8,
                "va": "center",
                "zorder": OVER + 9,
            }
            line = {"arrowstyle": "-", "color": TRUTH, "lw": 1.0}
            ax.annotate(str(number), (x, y), (13 * aside, 13 * up), color="white", ha="center", bbox=_BADGE,
                        arrowprops=line, **look)  # fmt: skip
            ax.annotate(text, (x, y), (23 * aside, 13 * up), color=TRUTH, ha="left" if aside > 0 else "right",
                        bbox=_PAPER, parse_math=False, **look)  # fmt: skip


def _times(ax: Axes, scores: Scores, truth: Truth, names: list[str], changes: list[Change]) -> None:
    """The floor over time: truth, and the first method's; spans in which they differ are tinted."""
    height = {name.casefold(): k for k, name in enumerate(names)}
    start = truth.t[0]
    grid = np.arange(truth.t[0], truth.t[-1], 0.25)
    level = np.array([height.get(name.casefold(), np.nan) for name in true_floor(truth, grid).tolist()])
    ax.plot(grid - start, level, color=TRUTH, linewidth=3.0, drawstyle="steps-post", solid_capstyle="butt")
    method = scores.methods[0] if scores.methods else None
    track = None if method is None else track_of(method, truth.walk)
    if method is not None and track is not None and len(track):
        row = np.clip(np.searchsorted(track.t, grid, side="right") - 1, 0, len(track) - 1)
        known = (grid >= track.t[0]) & informed(track)[row]
        said = np.array([height.get(str(name).casefold(), np.nan) for name in track.floor[row].tolist()])
        said = np.where(known, said, np.nan)
        look: dict[str, Any] = {**style(0), "linewidth": 1.6}
        ax.plot(grid - start, said - 0.07, drawstyle="steps-post", **look)
        ax.fill_between(grid - start, -0.6, len(names) - 0.4, where=known & (said != level), color="#D55E00",
                        alpha=0.22, linewidth=0.0, step="post")  # fmt: skip
    for number, change in enumerate(changes, 1):
        at = 0.5 * (truth.t[change.row] + truth.t[change.row + 1]) - start
        middle = 0.5 * (height.get(change.start.casefold(), 0) + height.get(change.stop.casefold(), 0))
        ax.annotate(
            str(number), (at, middle), fontsize=8, color="white", ha="center", va="center", bbox=_BADGE
        )
        ax.annotate(
            change.by, (at, middle), (10, 0), textcoords="offset points", fontsize=8, color=TRUTH, va="center"
        )
    ax.set_yticks(range(len(names)), [f"floor {name}" for name in names], fontsize=8, color=INK)
    ax.set_ylim(-0.6, len(names) - 0.4)
    ax.set_xlim(0.0, truth.t[-1] - start)
    ax.set_xlabel("time since the first waypoint (s)", fontsize=8, color=INK)
    ax.tick_params(labelsize=8)
    ax.grid(visible=True, axis="x", color=FAINT, linewidth=0.5)
    name = "" if method is None else f", {shown(method.name).strip()} (thin)"
    ax.set_title(f"Floor over time: truth (thick){name}; tinted where they differ", loc="left", fontsize=10, color=INK,
                 parse_math=False)  # fmt: skip
    for side in ("top", "right"):
        ax.spines[side].set_visible(False)
