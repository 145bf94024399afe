"""CPU time of tracking per second of walk, once the kernels are compiled: of `Tracker.run` alone, and with reading.

Process time, not wall time, so that other work on the machine counts little; the least of several repeats is the
figure nearest to what the code needs, the median what to expect.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from wayfuse.evaluation.results_bars import at_most
from wayfuse.evaluation.results_folds import FOLDS, LAG, Folds, build_tracker
from wayfuse.formats.reading import read

__all__ = ["measure_speed"]

_METHODS = ("fused", f"fused --lag {LAG:g}", "random-walk", "wknn", "nnss")
_LIMIT = 1.0  # ms of CPU per second of walk


def measure_speed(
    folds: Folds,
    fold: int = FOLDS[0],
    repeats: int = 5,
    clock: Callable[[], float] = time.process_time,
    methods: Sequence[str] = _METHODS,
) -> dict[str, Any]:
    """CPU time (ms) per second of walk over all walks of a fold, one process; min and median of repeats."""
    recordings, paths = folds.of(fold), folds.paths[fold]
    seconds = float(np.sum([r.span[1] - r.span[0] for r in recordings]))
    rows: dict[str, Any] = {}
    for name in methods:
        tracker = build_tracker(name, folds.site, folds.surveys[fold])
        tracker.run(recordings[0])
        runs = _times(lambda t=tracker: [t.run(r) for r in recordings], repeats, clock)  # type: ignore[misc]
        rows[name] = {"run": _ratio(runs, seconds)}
        if name == "fused":
            both = _times(lambda t=tracker: [t.run(read(p)) for p in paths], repeats, clock)  # type: ignore[misc]
            rows[name]["read_and_run"] = _ratio(both, seconds)
    least = rows["fused"]["run"]["least"]
    bar = at_most("fused: CPU time per second of walk, least of the repeats", _LIMIT, least, "ms/s")
    return {
        "walks": len(recordings),
        "minutes": seconds / 60.0,
        "repeats": repeats,
        "cpu_ms_per_s": rows,
        "bars": [asdict(bar)],
    }


def _times(work: Callable[[], object], repeats: int, clock: Callable[[], float]) -> list[float]:
    out = []
    for _ in range(repeats):
        start = clock()
        work()
        out.append(clock() - start)
    return out


def _ratio(times: Sequence[float], seconds: float) -> dict[str, float]:
    return {"least": 1000.0 * min(times) / seconds, "median": 1000.0 * float(np.median(times)) / seconds}
