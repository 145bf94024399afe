"""Pictures of a scoring: distribution of errors, error and calibration over time, and one picture per walk."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from itertools import count, pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from wayfuse.core.errors import UsageError
from wayfuse.core.types import Array
from wayfuse.evaluation.calibration import nominal_level
from wayfuse.evaluation.errors import MethodScores, PointErrors, Scores
from wayfuse.evaluation.plot_look import FAINT, INK, new_figure, shown, style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from wayfuse.maps.site import Site

__all__ = [
    "calibration_figure",
    "cdf_figure",
    "choose_walks",
    "error_by_time_figure",
    "write_plots",
]

LEVELS = (50, 75, 95)  # % marked in the distribution
_FAR = 1e6  # m, beyond any plot: a distribution goes on at 100 %
_MIN_POINTS = 10  # per span of time; fewer make no figure


def _axes(ax: Axes, x: str, y: str, title: str) -> None:
    ax.set_xlabel(x, color=INK)
    ax.set_ylabel(y, color=INK)
    ax.set_title(title, loc="left", fontsize=11, color=INK, parse_math=False)
    ax.grid(visible=True, color=FAINT, linewidth=0.5)
    ax.set_axisbelow(True)
    ax.tick_params(labelsize=9, colors=INK, length=3)
    for side, spine in ax.spines.items():
        spine.set_visible(side in ("left", "bottom"))
        spine.set_color("#9a9a9a")


def _used(scores: Scores, missing: str) -> list[tuple[MethodScores, PointErrors]]:
    return [(m, m.points["1hz"].used(missing)) for m in scores.methods]


def _legend(ax: Axes) -> None:
    """Legend where a distribution leaves room."""
    if not ax.get_legend_handles_labels()[0]:
        return
    look: dict[str, Any] = {"fontsize": 8.5, "framealpha": 0.92, "edgecolor": FAINT}
    for text in ax.legend(loc="lower right", **look).get_texts():
        text.set_parse_math(False)


def _legend_below(figure: Figure, ax: Axes, columns: int) -> None:
    """Legend of one of the axes below all of them, where it hides nothing."""
    handles, labels = ax.get_legend_handles_labels()
    if not handles:
        return
    look: dict[str, Any] = {"fontsize": 8.5, "frameon": False, "ncols": min(columns, len(handles))}
    for text in figure.legend(handles, labels, loc="outside lower left", **look).get_texts():
        text.set_parse_math(False)


def cdf_figure(scores: Scores, missing: str = "skip") -> Figure:
    """Share of the points at 1 Hz whose horizontal error is at most x, all methods, with 50, 75 and 95 %
    marked."""
    figure = new_figure(8.0, 5.2)
    ax = figure.add_subplot()
    reach = 1.0
    for k, (method, points) in enumerate(_used(scores, missing)):
        if not len(points):
            continue
        error = np.sort(points.error)
        share = np.arange(1, len(error) + 1) / len(error)
        label = f"{shown(method.name)}: mean {error.mean():.2f} m, median {np.median(error):.2f} m"
        ax.plot(
            [0.0, *error, _FAR],
            [0.0, *(100 * share), 100.0],
            drawstyle="steps-post",
            label=label,
            **style(k),
        )
        quantiles = np.percentile(error, LEVELS)
        ax.plot(
            quantiles, LEVELS, "o", color=style(k)["color"], markersize=4.5, markeredgecolor="white", zorder=5
        )
        reach = max(reach, float(np.percentile(error, 98)))
    for level in LEVELS:
        ax.axhline(level, color="#8c8c8c", linewidth=0.8, linestyle=(0, (2, 3)), zorder=1)
        ax.annotate(f"{level} %", (1.0, level), (-2, 2), xycoords=("axes fraction", "data"),
                    textcoords="offset points", ha="right", fontsize=8, color="#6b6b6b")  # fmt: skip
    ax.set_xlim(0.0, 1.05 * reach)
    ax.set_ylim(0.0, 101.0)
    n = max((len(points) for _, points in _used(scores, missing)), default=0)
    title = f"Horizontal error at 1 Hz: {len(scores.walks)} walks, {n} points"
    _axes(ax, "horizontal error (m)", "share of points with at most this error (%)", title)
    _legend(ax)
    return figure


def _spans(points: Sequence[PointErrors]) -> Array:
    """Ends (s) of spans of time since the first scan, to where one walk in twenty is still going on."""
    since = np.concatenate([p.since_start for p in points])
    low, high = np.percentile(since, (1, 95)).tolist() if len(since) else (0.0, 5.0)
    width = next(
        (w for w in (2.5, 5.0, 10.0, 20.0, 30.0, 60.0, 120.0, 300.0) if (high - low) / w <= 16), 600.0
    )
    first = width * np.floor(low / width)
    return np.asarray(np.arange(first, max(high, first + width) + 0.5 * width, width))


def _binned(points: PointErrors, edges: Array, figure_of: Any) -> tuple[Array, Array]:
    """Middle (s) and a figure of each span that holds enough points."""
    at, values = [], []
    for low, high in pairwise(edges):
        rows = (points.since_start >= low) & (points.since_start < high)
        if rows.sum() >= _MIN_POINTS:
            at.append(0.5 * (low + high))
            values.append(figure_of(points.select(rows)))
    return np.array(at), np.array(values)


def error_by_time_figure(scores: Scores, missing: str = "skip") -> Figure:
    """Median (line) and mean (thin line, open marks) error against the time since the first scan; walks still
    going."""
    used = _used(scores, missing)
    edges = _spans([p for _, p in used])
    figure = new_figure(8.0, 5.6)
    ax, below = figure.subplots(2, 1, sharex=True, gridspec_kw={"height_ratios": [4.2, 1]})
    for k, (method, points) in enumerate(used):
        look = style(k)
        at, median = _binned(points, edges, lambda p: float(np.median(p.error)))
        ax.plot(at, median, marker="o", markersize=4, label=shown(method.name), **look)
        at, mean = _binned(points, edges, lambda p: float(np.mean(p.error)))
        thin = look | {"linewidth": 1.0}
        ax.plot(at, mean, marker="o", markersize=4, markerfacecolor="white", **thin)
    ax.set_ylim(bottom=0.0)
    title = "Error at 1 Hz since the first Wi-Fi scan: median (thick), mean (thin, open marks)"
    _axes(ax, "", "horizontal error (m)", title)
    _legend_below(figure, ax, 5)
    widest = max((p for _, p in used), key=len)
    going = [len(np.unique(widest.walk[(widest.since_start >= a) & (widest.since_start < b)]))
             for a, b in pairwise(edges)]  # fmt: skip
    below.bar(edges[:-1], going, width=np.diff(edges), align="edge", color="#c9d3da", edgecolor="white")
    _axes(below, "time since the first Wi-Fi scan (s)", "walks", "")
    below.set_xlim(edges[0], edges[-1])
    below.yaxis.get_major_locator().set_params(integer=True)
    return figure


def calibration_figure(scores: Scores, missing: str = "skip") -> Figure | None:
    """Stated against observed coverage, and the stated r95 against the 95th percentile of the error over
    time.

    None where no method states radii.
    """
    stated = []
    for k, (method, points) in enumerate(_used(scores, missing)):
        given = points.select(np.isfinite(points.r68) & np.isfinite(points.r95))
        if len(given):
            stated.append((k, method, given))
    if not stated:
        return None
    figure = new_figure(11.0, 5.2)
    left, right = figure.subplots(1, 2)
    left.plot([0, 100], [0, 100], color="#8c8c8c", linewidth=1.0, label="calibrated")
    edges = _spans([p for _, _, p in stated])
    for k, method, points in stated:
        look = style(k)
        level = 100 * np.sort(nominal_level(points.error, points.r68, points.r95))
        left.plot(level, 100 * np.arange(1, len(level) + 1) / len(level), label=shown(method.name), **look)
        within = [100 * float(np.mean(points.error <= r)) for r in (points.r68, points.r95)]
        left.plot((68, 95), within, "o", color=look["color"], markeredgecolor="white", markersize=7, zorder=5)
        at, worst = _binned(points, edges, lambda p: float(np.percentile(p.error, 95)))
        right.plot(at, worst, marker="o", markersize=4, **look)
        at, radius = _binned(points, edges, lambda p: float(np.mean(p.r95)))
        thin = look | {"linewidth": 1.0}
        right.plot(at, radius, marker="D", markersize=4, markerfacecolor="white", **thin)
    left.set_xlim(0, 100)
    left.set_ylim(0, 100)
    left.set_aspect("equal")
    _axes(left, "stated level (%)", "share of points within the radius of that level (%)",
          "Coverage: below the diagonal is over-confident")  # fmt: skip
    for mark in (68, 95):
        left.axvline(mark, color="#8c8c8c", linewidth=0.8, linestyle=(0, (2, 3)), zorder=1)
    right.set_xlim(edges[0], edges[-1])
    right.set_ylim(bottom=0.0)
    title = "Radius of 95 % of the errors (thick), mean r95 stated (thin, open)"
    _axes(right, "time since the first Wi-Fi scan (s)", "radius (m)", title)
    _legend_below(figure, left, 8)
    return figure


def choose_walks(scores: Scores, most: int) -> tuple[list[str], str]:
    """Walks to draw: all, or the best, middle and worst by the mean error of the first method; and a note on
    that."""
    if len(scores.walks) <= most:
        return list(scores.walks), ""
    first = scores.methods[0]
    points = first.points["1hz"].used("backfill")
    sums = np.bincount(points.walk, weights=points.error, minlength=len(scores.walks))
    sizes = np.bincount(points.walk, minlength=len(scores.walks))
    order = [i for i in np.argsort(sums / np.maximum(sizes, 1), kind="stable").tolist() if sizes[i]]
    n_best = most // 3
    n_middle = most // 3
    n_worst = most - n_best - n_middle
    middle = max(n_best, (len(order) - n_middle) // 2)
    rows = [*order[:n_best], *order[middle : middle + n_middle], *order[max(len(order) - n_worst, 0) :]]
    chosen = [scores.walks[i] for i in dict.fromkeys(rows)]
    return chosen, (
        f"Pictures of {len(chosen)} of {len(scores.walks)} walks: best, middle and worst by the mean error of"
        f" {first.name}."
    )


def write_plots(
    scores: Scores,
    folder: Path,
    walks: Iterable[str] = (),
    site: Site | None = None,
    missing: str = "skip",
) -> list[Path]:
    """Write cdf.png, error_by_time.png, coverage.png and walks/<walk>.png for the walks given; their
    paths."""
    from wayfuse.evaluation.plot_site import save_figure
    from wayfuse.evaluation.plot_walk import walk_figure

    figures = {
        "cdf.png": cdf_figure(scores, missing),
        "error_by_time.png": error_by_time_figure(scores, missing),
        "coverage.png": calibration_figure(scores, missing),
    }
    try:
        (folder / "walks").mkdir(parents=True, exist_ok=True)
        paths = [save_figure(figure, folder / name) for name, figure in figures.items() if figure is not None]
        stems = _file_stems(scores.walks)
        paths += [
            save_figure(walk_figure(scores, w, site), folder / "walks" / f"{stems[w]}.png") for w in walks
        ]
    except OSError as error:
        raise UsageError(
            f"cannot write pictures: {error.strerror}", where=folder, remedy="name another"
        ) from error
    return paths


def _file_stems(walks: Sequence[str]) -> Mapping[str, str]:
    """File names of walks: what a file system or shell may mistake is replaced, and repeats are numbered."""
    stems: dict[str, str] = {}
    taken: set[str] = set()
    for walk in walks:
        plain = re.sub(r"[^\w.-]+", "_", walk).lstrip(".") or "walk"
        candidates = (f"{plain}-{k}" if k > 1 else plain for k in count(1))
        stem = next(c for c in candidates if c.casefold() not in taken)
        taken.add(stem.casefold())
        stems[walk] = stem
    return stems
