"""A day of visitors in minutes: does the server grow?

    python -m benchmarks.server_soak [--hours 24] [--page]

The server of this process, whole, behind HTTP on the loopback; its clock is the time of the visitors' records. Visitors
come and go, each with a phone never seen before; the log is kept for two hours and tracks for six, so that after
six hours as much must be deleted as comes. Memory and rows are counted each half hour. The files lie
in memory, so that a day is not spent waiting for the disk.
"""

from __future__ import annotations

import argparse
import gc
import heapq
import http.client
import secrets
import sys
import tempfile
import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import uvicorn
from sqlalchemy import func, select

from benchmarks.report import machine
from benchmarks.server_load import scripts
from benchmarks.server_page import table, write_section
from benchmarks.server_phones import MARK, Script
from benchmarks.server_process import Process, Scene, simulated
from wayfuse.service.app import create_app
from wayfuse.service.server import Server, SiteFiles
from wayfuse.service.settings import Settings
from wayfuse.storage.schema import audit, checkpoints, estimates, ingest_log, tracks

__all__ = ["Sample", "soak"]

_SEED = 5
_SHM = Path("/dev/shm")  # noqa: S108 (the folder itself)
_PRESENT = 0.3  # visitors, on average over the day
_CLEAN_S = 600.0  # as `service.app`
_SAMPLE_S = 1800.0
_SETTLED_H = 8.0  # from then on nothing may grow: tracks are kept for six hours
_MOST_GROWTH = 1.05  # of memory; of the mean over a quarter of the rest of the day
_TABLES = {
    "log": ingest_log,
    "tracks": tracks,
    "estimates": estimates,
    "checkpoints": checkpoints,
    "audit": audit,
}
_SETTINGS = {
    "rate_per_s": 0.0,
    "retain_log_h": 2.0,
    "retain_tracks_d": 0.25,
    "idle_s": 900.0,
    "checkpoint_s": 60.0,
    "events": 2000,
}


@dataclass
class Clock:
    """The visitors' time, Unix s."""

    now: float

    def __call__(self) -> float:
        return self.now


@dataclass(frozen=True, slots=True)
class Sample:
    """hour : of the visitors. resident, disk : bytes. live : tracks in memory. rows : by table."""

    hour: float
    resident: int
    disk: int
    live: int
    batches: int
    rows: dict[str, int]


def _visits(
    all_scripts: Sequence[Script], hours: float, draw: np.random.Generator
) -> Iterator[tuple[float, bytes]]:
    """Batches and when they are sent, s from the start, in order."""
    waiting: list[tuple[float, int, int]] = []  # due, visitor, number of the batch
    comes = n = 0
    lengths = [len(s) for s in all_scripts]
    gap = float(np.mean(lengths)) / _PRESENT
    while comes < 3600.0 * hours or waiting:
        if waiting and (waiting[0][0] <= comes or comes >= 3600.0 * hours):
            due, visitor, at = heapq.heappop(waiting)
            script = all_scripts[visitor % len(all_scripts)]
            yield due, script[at].replace(MARK, b"%08d" % visitor)
            if at + 1 < len(script):
                heapq.heappush(waiting, (due + 1.0, visitor, at + 1))
        else:
            heapq.heappush(waiting, (comes, n, 0))
            n += 1
            comes += float(draw.exponential(gap))


@contextmanager
def _served(server: Server) -> Iterator[Process]:
    """The server in a thread of this process."""
    config = uvicorn.Config(
        create_app(server),
        port=0,
        loop="uvloop",
        http="httptools",
        log_config=None,
        access_log=False,
        timeout_graceful_shutdown=5,  # the watcher would stay for ever
    )
    here = uvicorn.Server(config)
    thread = threading.Thread(target=here.run, daemon=True)
    thread.start()
    while not here.started:
        time.sleep(0.02)
    host, port = here.servers[0].sockets[0].getsockname()[:2]
    token = server.tokens.create({"admin"}, server.clock(), label="soak")[0]
    try:
        yield Process(0, host, port, token)
    finally:
        here.should_exit = True
        thread.join(60.0)


class _Watcher(threading.Thread):
    """Somebody who has the page open all day: reads the stream of events, and counts."""

    def __init__(self, process: Process) -> None:
        super().__init__(daemon=True)
        self._process, self.events, self.ends = process, 0, 0

    def run(self) -> None:
        while True:
            connection = http.client.HTTPConnection(self._process.host, self._process.port, timeout=60.0)
            try:
                headers = {"Authorization": f"Bearer {self._process.token}"}
                connection.request("GET", "/api/v1/events", headers=headers)
                for line in connection.getresponse():
                    self.events += line.startswith(b"event: position")
            except OSError:
                return
            finally:
                connection.close()
                self.ends += 1
            if self.ends > 1000:
                return


def soak(scene: Scene, data: Path, hours: float) -> tuple[list[Sample], int]:
    """Samples, and how many events the watcher got."""
    draw = np.random.default_rng(_SEED)
    start = 1_800_000_000.0
    clock = Clock(start)
    files = [SiteFiles(scene.folder / "SITE", scene.folder / "map.npz")]
    server = Server(Settings(data=str(data), **_SETTINGS), files, clock=clock, random=secrets.token_bytes)
    all_scripts = scripts(scene.walks, "steps")
    samples: list[Sample] = []
    with _served(server) as process:
        watcher = _Watcher(process)
        watcher.start()
        connection = http.client.HTTPConnection(process.host, process.port, timeout=60.0)
        headers = {"Authorization": f"Bearer {process.token}", "Content-Type": "application/json"}
        clean_at, sample_at = _CLEAN_S, _SAMPLE_S
        for batches, (due, body) in enumerate(_visits(all_scripts, hours, draw), 1):
            clock.now = start + due
            connection.request("POST", "/api/v1/in/own", body, headers)
            answer = connection.getresponse()
            said = answer.read()
            if answer.status != 200:
                raise RuntimeError(f"{answer.status}: {said[:200]!r}")
            if due >= clean_at:
                clean_at = due - due % _CLEAN_S + _CLEAN_S
                server.clean()
                process.get("/api/v1/positions")
                process.get("/metrics")
            if due >= sample_at:
                sample_at = due - due % _SAMPLE_S + _SAMPLE_S
                samples.append(_sample(server, data, due / 3600.0, batches))
                print(samples[-1], flush=True)
    return samples, watcher.events


def _sample(server: Server, data: Path, hour: float, batches: int) -> Sample:
    gc.collect()
    fields = Path("/proc/self/statm").read_text(encoding="ascii").split()
    with server.engine.connect() as connection:
        rows = {
            name: int(connection.execute(select(func.count()).select_from(of)).scalar_one())
            for name, of in _TABLES.items()
        }
    disk = sum(path.stat().st_size for path in data.iterdir())
    return Sample(hour, int(fields[1]) * 4096, disk, len(server.live.views()), batches, rows)


def grown(samples: Sequence[Sample]) -> dict[str, float]:
    """Last quarter of the settled part of the day over its first, by what is counted."""
    settled = [s for s in samples if s.hour >= _SETTLED_H]
    quarter = max(1, len(settled) // 4)
    out = {}
    for name, of in (("resident", lambda s: s.resident), ("disk", lambda s: s.disk)):
        out[name] = float(
            np.mean([of(s) for s in settled[-quarter:]]) / np.mean([of(s) for s in settled[:quarter]])
        )
    return out


def main(arguments: list[str] | None = None) -> list[Sample]:
    """Soak, print, and write the section of the page."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--hours", type=float, default=24.0)
    parser.add_argument("--page", action="store_true", help="write docs/server-performance.md")
    options = parser.parse_args(arguments)
    before, began = machine(), time.perf_counter()
    # in memory where there is such a folder: a day of waiting for a disk shows nothing more of growth
    with tempfile.TemporaryDirectory(dir=_SHM if _SHM.is_dir() else None) as folder:
        scene = simulated(Path(folder), _SEED)
        samples, events = soak(scene, Path(folder) / "data", options.hours)
    text = _text(samples, events, options.hours, time.perf_counter() - began)
    print(text)
    if options.page:
        write_section("soak", "python -m benchmarks.server_soak --page", before, text)
    return samples


def _text(samples: Sequence[Sample], events: int, hours: float, took: float) -> str:
    growth = grown(samples)
    shown = [s for n, s in enumerate(samples) if n % 4 == 3 or n == 0 or n == len(samples) - 1]
    rows = [
        (f"{s.hour:.1f}", s.batches, s.resident / 1e6, s.disk / 1e6, s.live, *s.rows.values()) for s in shown
    ]
    said = ", ".join(f"{name} {100.0 * (ratio - 1.0):+.1f} %" for name, ratio in growth.items())
    verdict = "no growth" if growth["resident"] <= _MOST_GROWTH else "**it grows**"
    fullest = max(samples, key=lambda s: s.disk)
    kept_h = 24.0 * float(_SETTINGS["retain_tracks_d"])
    return (
        f"Endurance: {hours:g} h of visitors\n\nVisitors of a simulated site, {samples[-1].batches:,} batches in "
        f"{took / 60.0:.0f} minutes; kept: the log {_SETTINGS['retain_log_h']:g} h, tracks {kept_h:g} h "
        f"(seed {_SEED}). The watcher got {events:,} events. From hour {_SETTLED_H:g} on, last quarter against first: "
        f"{said}: {verdict} of memory. The files of SQLite were largest in hour {fullest.hour:.1f}, "
        f"{fullest.disk / 1e6:.0f} MB: what is deleted is given back, but for an eighth, kept for what comes.\n\n"
        + table(("hour", "batches so far", "memory (MB)", "disk (MB)", "tracks in memory", *_TABLES), rows)
    )


if __name__ == "__main__":
    sys.exit(int(grown(main())["resident"] > _MOST_GROWTH))
