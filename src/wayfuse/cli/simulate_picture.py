"""The picture of a simulation: every floor with its access points and the ways of all walks."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from wayfuse.core.types import Array, BoolArray

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes

    from wayfuse.maps.site import Site
    from wayfuse.simulator.experiment import World
    from wayfuse.simulator.experiment_files import WalkFiles
    from wayfuse.simulator.simulate import SimulatedSite

__all__ = ["write_picture"]

_SURVEY, _MARK = "#9a948a", "#b3261e"
_WALKS = ("#1f6fb2", "#2e8b57", "#7b4ab5", "#c06a00", "#0f8b8d", "#a83279", "#5b6b00", "#444444")
_PANEL, _MOST_COLUMNS = 6.4, 3  # inches wide; panels side by side
_HEAD, _FOOT = 0.45, 0.45  # inches
_OVER = 12.0  # z-order over the plan


def write_picture(path: Path, site: Site, world: World, done: Sequence[WalkFiles]) -> Path:
    """Draw into a PNG or SVG; the same simulation gives the same bytes."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    from wayfuse.evaluation.plot_site import draw_floor, save_figure

    floors = site.floors
    columns = min(len(floors), _MOST_COLUMNS)
    rows = -(-len(floors) // columns)
    shape = max(floor.height / floor.width for floor in floors)
    height = float(np.clip(_PANEL * shape, 0.3 * _PANEL, 1.6 * _PANEL)) + _HEAD
    figure = Figure(
        figsize=(_PANEL * columns, height * rows + _FOOT), facecolor="white", layout="constrained"
    )
    FigureCanvasAgg(figure)
    if (engine := figure.get_layout_engine()) is not None:
        engine.set(h_pad=0.08, w_pad=0.08)  # type: ignore[call-arg]
    for k, floor in enumerate(floors):
        ax = figure.add_subplot(rows, columns, k + 1)
        draw_floor(ax, floor, names=False)
        ax.set_title(f"floor {floor.name}", loc="left", fontsize=11, parse_math=False)
        _draw_walks(ax, k, world.shift[k], done)
        _draw_access_points(ax, k, world)
    handles: dict[str, Artist] = {}
    for ax in figure.axes:
        for handle, label in zip(*ax.get_legend_handles_labels(), strict=True):
            handles.setdefault(str(label), handle)
    order = sorted(handles, key=lambda label: (label.startswith("walk-"), label))
    figure.legend(
        [handles[label] for label in order],
        order,
        loc="outside lower left",
        ncols=max(1, min(len(order), 5 * columns)),
        frameon=False,
        fontsize=9,
    )
    return save_figure(figure, path)


def _draw_walks(ax: Axes, floor: int, shift: Array, done: Sequence[WalkFiles]) -> None:
    number = 0
    for one in done:
        is_survey = one.role == "survey"
        places = np.array(one.places)
        here = places[:, 2] == floor
        number += not is_survey
        if not here.any():
            continue
        xy = _broken(places[:, :2] + shift, here)
        colour = _SURVEY if is_survey else _WALKS[(number - 1) % len(_WALKS)]
        named = number <= len(_WALKS)
        label = "survey" if is_survey else (one.name if named else "further walks")
        ax.plot(*xy.T, color=colour, linewidth=0.8 if is_survey else 1.7, alpha=0.7 if is_survey else 0.95,
                zorder=_OVER + (not is_survey), label=label)  # fmt: skip


def _broken(xy: Array, here: BoolArray) -> Array:
    """Places with NaN where the walker is on another floor, so that the line breaks there."""
    return np.where(here[:, None], xy, np.nan)


def _draw_access_points(ax: Axes, floor: int, world: World) -> None:
    before, later = world.before.radios, world.later.radios
    same = np.all(before.ap_xy == later.ap_xy, axis=1)
    gone = ~_is_there(world.later)
    kinds = (
        ("access point", before.ap_xy, same & ~gone, "^", _MARK),
        ("removed after the survey", before.ap_xy, gone, "x", _MARK),
        ("moved after the survey: from", before.ap_xy, ~same, "v", "#d99a94"),
        ("moved: to", later.ap_xy, ~same, "^", "#6a0dad"),
    )
    for label, xy, chosen, marker, colour in kinds:
        which = chosen & (before.ap_floor == floor)
        if which.any():
            places = xy[which] + world.shift[floor]
            ax.plot(*places.T, marker, color=colour, markersize=6.5, markeredgewidth=1.3 if marker == "x" else 0.6,
                    markeredgecolor=colour if marker == "x" else "white", linestyle="none", zorder=_OVER + 3,
                    label=label)  # fmt: skip


def _is_there(site: SimulatedSite) -> BoolArray:
    """Whether each access point (a,) still has a radio."""
    radios = site.radios
    there = np.zeros(len(radios.ap_xy), dtype=bool)
    there[radios.ap[radios.is_there]] = True
    return there
