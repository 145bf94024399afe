"""How pictures look: colours, dashes, an empty figure.

Colours are Okabe and Ito's, told apart with any colour vision; lines differ in dash too. No pyplot: no
display and no global state. The Agg canvas makes the same file from the same figures.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["COLOURS", "FAINT", "INK", "new_figure", "shown", "style"]

# Okabe, Ito, Color Universal Design, 2008; yellow is left out: too light for a line on white.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#7F7F7F")
DASHES: tuple[Any, ...] = ("-", (0, (5, 1.6)), (0, (1.4, 1.2)), (0, (6, 1.4, 1.4, 1.4)))
INK, FAINT = "#333333", "#d9d9d9"


def style(index: int) -> dict[str, Any]:
    """Colour and dash of the method with an index; the first seven differ in colour."""
    dash = DASHES[(index % len(COLOURS) + index // len(COLOURS)) % len(DASHES)]
    return {"color": COLOURS[index % len(COLOURS)], "linestyle": dash, "linewidth": 1.9}


def new_figure(width: float, height: float) -> Figure:
    """Empty figure (inches) on the Agg canvas, laid out so that nothing overlaps."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), facecolor="white", layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def shown(name: str) -> str:
    """Name of a method as the start of a label: one that begins with _ would be kept out of the legend."""
    return f" {name}" if name.startswith("_") else name
