"""What the reproduction of a paper is made of: tables of paper against ours, bars, and words.

A file of this room named as its preset has ``SEEDS``, how many seeds its figures take, ``reproduce(seeds, mapper)``
and, where it draws, ``pictures(result, folder)``; pages/<preset>.md has the words of docs/papers/<preset>.md (equation,
function, test; departures and misprints; why figures differ).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field
from importlib import import_module, resources
from pathlib import Path
from typing import Any, Protocol, cast

import numpy as np
from numpy.typing import ArrayLike

from wayfuse.core.errors import UsageError
from wayfuse.evaluation.results_bars import Bar
from wayfuse.evaluation.results_folds import Mapper
from wayfuse.presets.catalogue import PAPERS

__all__ = [
    "EXPERIMENTS",
    "Curve",
    "Interval",
    "Paper",
    "Reproduction",
    "Table",
    "mean_interval",
    "page",
    "paper",
    "write_pictures",
]

EXPERIMENTS = (*PAPERS, "comparison")  # the last has all systems on the same walks
_STUDENT = 1.645  # of a normal: two sides, 90 %; with 20 seeds and more Student's differs by less than 5 %


@dataclass(frozen=True, slots=True)
class Interval:
    """A mean over seeds and the ends of the 90 % interval of that mean."""

    value: float
    low: float
    high: float

    def __str__(self) -> str:
        return f"{self.value:.2f} [{self.low:.2f}, {self.high:.2f}]"


def mean_interval(values: ArrayLike) -> Interval:
    """Mean over seeds (n,) with the 90 % interval of the mean; one seed has no interval."""
    v = np.asarray(values, dtype=np.float64)
    half = _STUDENT * float(v.std(ddof=1)) / np.sqrt(len(v)) if len(v) > 1 else 0.0
    return Interval(float(v.mean()), float(v.mean() - half), float(v.mean() + half))


@dataclass(frozen=True, slots=True)
class Table:
    """Paper against ours. Cells: text, numbers (two decimals), intervals. note : what was fitted, what is a test."""

    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str | float | Interval, ...], ...]
    note: str = ""


@dataclass(frozen=True, slots=True)
class Curve:
    """A line of a picture. picture : file name. panel, label : what it is of. x, y : points, equally many."""

    picture: str
    panel: str
    label: str
    x: tuple[float, ...]
    y: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class Reproduction:
    """Everything measured for one paper. lost : runs that lost the track, by row; they are never dropped. curves :
    what a paper draws."""

    preset: str
    seeds: tuple[int, ...]
    tables: tuple[Table, ...]
    bars: tuple[Bar, ...]
    lost: tuple[str, ...] = field(default=())
    curves: tuple[Curve, ...] = field(default=())

    def plain(self) -> dict[str, Any]:
        """As plain values for JSON."""
        return asdict(self)


class Paper(Protocol):
    """A module of this room."""

    SEEDS: int

    def reproduce(self, seeds: Sequence[int], mapper: Mapper) -> Reproduction:
        """Run the experiments of the paper with each seed."""
        ...


def paper(name: str) -> Paper:
    """The module of an experiment of `EXPERIMENTS`.

    Raises
    ------
    UsageError : there is no such experiment.
    """
    if name not in EXPERIMENTS:
        raise UsageError(f"no paper {name!r}", where="PRESET", remedy=f"one of {', '.join(EXPERIMENTS)}")
    return cast("Paper", import_module(f"wayfuse.papers.{name}"))


def write_pictures(module: Paper, result: Reproduction, folder: Path) -> list[Path]:
    """Draw the pictures of a paper into a folder; the files written, none where the paper draws none."""
    draw: Callable[[Reproduction, Path], list[Path]] | None = getattr(module, "pictures", None)
    return [] if draw is None else draw(result, folder)


def page(name: str) -> str:
    """The words of docs/papers/<name>.md, without the figures."""
    return (resources.files("wayfuse.papers") / "pages" / f"{name}.md").read_text(encoding="utf-8")
