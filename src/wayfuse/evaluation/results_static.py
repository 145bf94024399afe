"""Radio maps on the static fingerprints of SODIndoorLoc (see `wayfuse.evaluation.fingerprints`), with their bars."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from wayfuse.evaluation.fingerprints import SPLITS, StaticScore, score_static
from wayfuse.evaluation.intervals import Bootstrap
from wayfuse.evaluation.results_bars import Bar, at_most, within
from wayfuse.evaluation.results_folds import Mapper, in_turn

__all__ = ["measure_static"]

_WHERE = "CETC331"
_REFERENCE = 2.817  # m, the k-NN of the data set's authors (k = 5, Euclidean, unheard = -104 dBm)
_KNN = "knn raw euclid -104"


def measure_static(
    root: Path, bootstrap: Bootstrap | None = None, mapper: Mapper = in_turn
) -> dict[str, Any]:
    """Fit and score every method on every split; all figures as plain values."""
    draw = Bootstrap() if bootstrap is None else bootstrap
    tables = [root / split.training for split in SPLITS]
    scores = [s for of in mapper(_Worker(root, draw), tables, "static fingerprints") for s in of]
    return {
        "bootstrap": asdict(draw),
        "scores": [asdict(s) for s in scores],
        "bars": [asdict(bar) for bar in _bars(scores)],
    }


class _Worker:
    """Scores one split; travels to the worker processes."""

    def __init__(self, root: Path, draw: Bootstrap) -> None:
        self.root, self.draw = root, draw

    def __call__(self, training: Path) -> list[StaticScore]:
        mine = [split for split in SPLITS if self.root / split.training == training]
        return score_static(self.root, splits=mine, bootstrap=self.draw)


def _bars(scores: Sequence[StaticScore]) -> list[Bar]:
    mean = {s.method: s.mean.value for s in scores if s.split == _WHERE}
    low, high = round(0.995 * _REFERENCE, 3), round(1.005 * _REFERENCE, 3)
    return [
        within(f"{_WHERE}: {_KNN}, mean error (published: {_REFERENCE} m)", low, high, mean[_KNN], "m"),
        at_most(f"{_WHERE}: knn powed sorensen, mean error", 2.46, mean["knn powed sorensen"], "m"),
        at_most(f"{_WHERE}: horus, mean error", 2.43, mean["horus"], "m"),
        at_most(f"{_WHERE}: gaussian process, mean error", 2.42, mean["gaussian process"], "m", strict=True),
    ]
