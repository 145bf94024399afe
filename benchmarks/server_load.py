"""How many phones one core serves: phones replayed against a running server, over HTTP.

    python -m benchmarks.server_load [--mode steps raw] [--walks simulated ms-indoor] [--page]

The server runs as `wayfuse serve` on one core, with its defaults, but for the limit on requests per token; the phones
on another. Modes: ``raw``, all samples of a phone's motion sensors; ``steps``, the steps that a phone worked out itself
and its scans; ``scans``, scans alone. The number of phones at which 99 % of positions come within the goal is looked
for in at most five runs, the first at what the CPU time of a short run lets expect.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import uvloop

from benchmarks.report import machine
from benchmarks.server_page import table, write_section
from benchmarks.server_phones import MARK, Phones, Script
from benchmarks.server_process import Scene, development, serving, simulated
from wayfuse.inertial.front_end import InertialFrontEnd
from wayfuse.sensors.recording import Recording
from wayfuse.sensors.records import Step
from wayfuse.service.replay import envelopes
from wayfuse.service.wire import encode

GOAL_S = 0.25  # 99 % of positions within, from the moment a batch is sent
PERIOD = 1.0  # s between a phone's batches
WARM_S = 5.0  # connections, first batches of all tracks
MOST_RUNS = 5
CLOSE = 1.15  # ratio of the bounds at which the search ends
MODES = ("steps", "raw", "scans")
_SEED = 7


@dataclass(frozen=True, slots=True)
class Run:
    """One run: N phones for so many seconds. cpu, clients : s of the server and of the phones per phone and second."""

    phones: int
    seconds: float
    sent: int
    refused: int
    answer: tuple[float, float, float]  # s, 50, 95, 99 %
    place: tuple[float, float, float]
    cpu: float
    clients: float
    share: float

    @property
    def is_sustained(self) -> bool:
        """Whether the goal was held."""
        return self.refused == 0 and self.place[2] < GOAL_S


def scripts(walks: Sequence[Recording], mode: str) -> list[Script]:
    """Bodies of phones: one per walk and period. Walks shorter than a minute are joined: a phone walks on."""
    joined: list[list[bytes]] = []
    for walk in walks:
        sent = replace(told(walk, mode), name=walk.name)
        made = [encode(e) for e in envelopes(sent, MARK.decode(), f"{walk.name} {MARK.decode()}", PERIOD)]
        if joined and len(joined[-1]) < 60.0 / PERIOD:
            joined[-1] += made
        else:
            joined.append(made)
    return [*joined]


def told(walk: Recording, mode: str) -> Recording:
    """What a phone sends of a walk."""
    if mode == "raw":
        return walk
    front_end = InertialFrontEnd()
    events = front_end.run(front_end.init(), walk, -np.inf, walk.span[1])[1]
    columns = (events.t.tolist(), events.length.tolist(), events.heading.tolist())
    steps = tuple(Step(*row) for row in zip(*columns, strict=True))
    return Recording(name=walk.name, wifi=walk.wifi, steps=steps if mode == "steps" else ())


def one_run(scene: Scene, mode: str, phones: int, seconds: float, cores: tuple[int, int]) -> Run:
    """A fresh server, and so many phones."""
    os.sched_setaffinity(0, {cores[1]})
    with tempfile.TemporaryDirectory() as data, serving(scene, Path(data), core=cores[0]) as server:
        many = Phones(scripts(scene.walks, mode), phones, PERIOD, _SEED)
        before = [0.0, 0.0]

        def ready() -> None:
            before[:] = server.cpu(), time.process_time()

        start, end = uvloop.run(many.walk(server.host, server.port, server.token, seconds, ready))
        spent, ours = server.cpu() - before[0], time.process_time() - before[1]
    answer, place = many.heard.latencies(start + min(WARM_S, 0.3 * seconds), end)
    return Run(
        phones,
        seconds,
        many.heard.sent,
        many.heard.refused,
        _quantiles(answer),
        _quantiles(place),
        spent / (phones * seconds),
        ours / (phones * seconds),
        spent / seconds,
    )


def _quantiles(values: np.ndarray) -> tuple[float, float, float]:
    if not len(values):
        return (np.inf, np.inf, np.inf)
    p50, p95, p99 = np.quantile(values, (0.5, 0.95, 0.99), method="higher").tolist()
    return p50, p95, p99


def search(scene: Scene, mode: str, seconds: float, first: int, cores: tuple[int, int]) -> list[Run]:
    """Runs, in the order of their numbers of phones."""
    if not first:
        one_run(scene, mode, 20, 3.0, cores)  # files in the cache, kernels compiled
        some = max(10, int(0.4 / one_run(scene, mode, 40, 10.0, cores).cpu))
        first = int(0.8 / one_run(scene, mode, some, 10.0, cores).cpu)  # under load a batch costs less
    runs: list[Run] = []
    low, high, n = 0, 0, first
    while len(runs) < MOST_RUNS:
        runs.append(one_run(scene, mode, n, seconds, cores))
        print(_line(runs[-1]), flush=True)
        if runs[-1].is_sustained:
            low = n
        else:
            high = n
        n = round(n * _further(runs[-1]) if not (low and high) else (low * high) ** 0.5)
        if 0 < high < CLOSE * low:
            break
    return sorted(runs, key=lambda run: run.phones)


def _further(run: Run) -> float:
    """How many times the phones to try next, while only one bound is known."""
    if run.is_sustained:
        return 1.6 if run.place[2] < 0.5 * GOAL_S else 1.3
    return 0.5 if run.place[2] > 4.0 * GOAL_S else 0.75


def _line(run: Run) -> str:
    ms = " ".join(f"{1e3 * t:.0f}" for t in (*run.answer, *run.place))
    verdict = "held" if run.is_sustained else "missed"
    return (
        f"{run.phones} phones: {ms} ms, {1e3 * run.cpu:.3f} ms CPU per phone-second (phones {1e3 * run.clients:.3f}), "
        f"{run.share:.2f} of a core, "
        f"{run.refused} of {run.sent} refused: {verdict}"
    )


_COLUMNS = (
    "phones", "batches", "refused", "answer 50 / 95 / 99 % (ms)", "position 50 / 95 / 99 % (ms)",
    "CPU of the server per phone and second (ms)", "of its core", "CPU of the phones (ms)", "goal",
)  # fmt: skip


def _rows(runs: Sequence[Run]) -> list[tuple[object, ...]]:
    return [
        (
            run.phones, run.sent, run.refused, _ms(run.answer), _ms(run.place), 1e3 * run.cpu,
            f"{100.0 * run.share:.0f} %", 1e3 * run.clients, "held" if run.is_sustained else "missed",
        )
        for run in runs
    ]  # fmt: skip


def _ms(times: tuple[float, float, float]) -> str:
    return " / ".join(f"{1e3 * t:,.0f}" for t in times)


def _what(scene: Scene, mode: str) -> str:
    """Contents of a batch, in figures."""
    sent = [told(walk, mode) for walk in scene.walks]
    seconds = sum(walk.span[1] - walk.span[0] for walk in scene.walks)
    size = np.mean([len(body) for script in scripts(scene.walks, mode) for body in script]) / 1e3
    readings = np.mean([len(scan.bssid) for walk in sent for scan in walk.wifi])
    per_s = [sum(of(walk) for walk in sent) / seconds for of in (_samples, _n_steps, _scans)]
    return (
        f"{scene.name}, {mode}: {len(sent)} walks; a second has {per_s[0]:.0f} samples of motion sensors, "
        f"{per_s[1]:.1f} steps and {per_s[2]:.2f} scans of {readings:.0f} readings; a batch each {PERIOD:g} s, "
        f"{size:.1f} kB"
    )


def _samples(walk: Recording) -> int:
    return walk.n_motion


def _n_steps(walk: Recording) -> int:
    return len(walk.steps)


def _scans(walk: Recording) -> int:
    return len(walk.wifi)


def main(arguments: list[str] | None = None) -> list[Run]:
    """Search, print, and write the section of the page."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--mode", nargs="+", default=["steps", "raw"], choices=MODES)
    parser.add_argument("--walks", nargs="+", default=["simulated"], choices=("simulated", "ms-indoor"))
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument(
        "--first", type=int, default=0, help="phones of the first run, instead of a short run before"
    )
    parser.add_argument("--page", action="store_true", help="write docs/server-performance.md")
    options = parser.parse_args(arguments)
    before, cores = machine(), _cores()
    parts, every = [], list[Run]()
    with tempfile.TemporaryDirectory() as folder:
        for name in options.walks:
            place = Path(folder) / name
            place.mkdir()
            scene = simulated(place, _SEED) if name == "simulated" else development(place)
            for mode in options.mode:
                print(_what(scene, mode), flush=True)
                runs = search(scene, mode, options.seconds, options.first, cores)
                parts.append((_what(scene, mode), runs))
                every += runs
    if options.page:
        command = " ".join(["python -m benchmarks.server_load", *(arguments or sys.argv[1:])])
        write_section("load", command, before, _text(parts, options.seconds))
    return every


def _cores() -> tuple[int, int]:
    """A core for the server and one for the phones."""
    mine = sorted(os.sched_getaffinity(0))
    return mine[0], mine[-1]


def _text(parts: Sequence[tuple[str, Sequence[Run]]], seconds: float) -> str:
    lines = [
        "Phones per core\n",
        (
            "The server on one core, the phones on another, a connection each that stays open, and one watcher of all "
            f"positions; {seconds:g} s per run, seed {_SEED}. Times are from the moment a batch is due to its answer "
            "(it is on the disk) and to the event with its position; CPU times from the first batch due on. Goal: 99 % "
            f"of positions within {1e3 * GOAL_S:.0f} ms, nothing refused.\n"
        ),
    ]
    for what, runs in parts:
        held = max((run.phones for run in runs if run.is_sustained), default=0)
        lines += [
            f"**{what}: {held} phones held** (goal of the project: 2,500).\n",
            table(_COLUMNS, _rows(runs)),
        ]
    return "\n".join(lines)


if __name__ == "__main__":
    main()
    sys.exit(0)
