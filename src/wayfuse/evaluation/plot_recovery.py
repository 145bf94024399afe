"""How soon a lost track is found again: the share of runs that are back, by the seconds since."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from wayfuse.evaluation.plot_look import FAINT, INK, new_figure, style

__all__ = ["Returns", "draw_returns"]


class Returns(NamedTuple):
    """A method: seconds since the event, and the share (0 to 1) of runs that are back by then."""

    label: str
    seconds: Sequence[float]
    share: Sequence[float]


def draw_returns(panels: Mapping[str, Sequence[Returns]], file: Path) -> Path:
    """Draw a panel per event, its name above, one line per method; the file written (PNG)."""
    figure = new_figure(4.6 * max(len(panels), 1), 3.4)
    axes = figure.subplots(1, max(len(panels), 1), sharey=True, squeeze=False)[0]
    for ax, (title, lines) in zip(axes, panels.items(), strict=False):
        for k, line in enumerate(lines):
            share = [100.0 * value for value in line.share]
            ax.step(line.seconds, share, where="post", label=line.label, **style(k))
        ax.set_title(title, fontsize=10, color=INK, parse_math=False)
        ax.set_xlabel("seconds since", color=INK)
        ax.set_ylim(-2.0, 102.0)
        ax.grid(color=FAINT, linewidth=0.6)
        ax.spines[["top", "right"]].set_visible(False)
    axes[0].set_ylabel("runs back on the track (%)", color=INK)
    axes[0].legend(frameon=False, fontsize=9, loc="lower right")
    figure.savefig(file, dpi=150)
    return file
