"""Variants that take turns in one process: thread CPU time, minima and medians."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass

__all__ = ["Taken", "race"]

TURN = 0.004  # s of CPU that a variant has in a turn, where a single call is shorter


@dataclass(frozen=True, slots=True)
class Taken:
    """Seconds per call: minimum and median over turns, and how many turns."""

    least: float
    median: float
    turns: int


def race(
    variants: Mapping[str, Callable[[], object]], *, seconds: float = 2.0, least_turns: int = 5
) -> dict[str, Taken]:
    """Time variants in turns for about so many seconds of CPU, but no fewer turns than ``least_turns``.

    A variant is called once beforehand (compilation, caches). Short calls are repeated within a turn.
    """
    calls = {}
    for name, run in variants.items():
        run()
        start = time.thread_time()
        run()
        calls[name] = max(1, int(TURN / max(time.thread_time() - start, 1e-7)))
    times: dict[str, list[float]] = {name: [] for name in variants}
    spent = 0.0
    while spent < seconds or min(len(t) for t in times.values()) < least_turns:
        for name, run in variants.items():
            start = time.thread_time()
            for _ in range(calls[name]):
                run()
            taken = time.thread_time() - start
            spent += taken
            times[name].append(taken / calls[name])
    return {name: Taken(min(t), statistics.median(t), len(t)) for name, t in times.items()}
