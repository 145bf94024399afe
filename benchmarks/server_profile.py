"""Where the server's time goes under load, by looking at the stacks of its threads.

    python -m benchmarks.server_profile [--mode steps] [--phones 100] [--seconds 30] [--page]

The server is started by this module (``python -m benchmarks.server_profile serve ...``): a thread of its own looks at
every other thread's stack each few milliseconds, and gives the CPU time that the thread used since the last look to
what it finds there. The sums by thread are exact. By stage and function they lean to where a thread lets another one go
on: the wait for the network, the disk, and compiled loops.
"""

from __future__ import annotations

import argparse
import json
import os
import signal
import sys
import tempfile
import threading
import time
from collections import Counter
from functools import partial
from pathlib import Path
from types import FrameType

_PERIOD = 0.003  # s between looks
_OUT = "SERVER_PROFILE"  # environment: the file that the server's part writes
_PACKAGE = "/wayfuse/"
_SHOWN = 0.01  # shares below are not listed

_THREADS = {"MainThread": "requests and streams (event loop)", "wayfuse-pipeline": "log and tracks"}
# first match from the innermost frame outwards
_STAGES = (
    ("/wayfuse/service/checkpoint", "checkpoints"),
    ("/wayfuse/service/stretch", "records to columns"),
    ("/wayfuse/service/adapters", "reading bodies"),
    ("/wayfuse/formats", "reading bodies"),
    ("/wayfuse/service/wire", "reading bodies"),
    ("/wayfuse/storage/log", "writing the log"),
    ("/wayfuse/storage", "database, other"),
    ("/wayfuse/inertial", "steps and heading"),
    ("/wayfuse/radio", "scans"),
    ("/wayfuse/models", "particle filter"),
    ("/wayfuse/filters", "particle filter"),
    ("/wayfuse/tracking", "tracker"),
    ("/wayfuse/service/positions", "positions out"),
    ("/wayfuse/service/server", "positions out"),
    ("/wayfuse/service/events", "positions out"),
    ("/wayfuse/service/routes/stream", "positions out"),
    ("/wayfuse/service/live", "bookkeeping of tracks"),
    ("/wayfuse/service/pipeline", "bookkeeping of tracks"),
    ("/wayfuse/service", "routes and access"),
    ("/fastapi/", "web framework"),
    ("/starlette/", "web framework"),
    ("/uvicorn/", "HTTP"),
    ("/anyio/", "threads for waiting calls"),
    ("/sqlalchemy/", "database, other"),
)


class Looker(threading.Thread):
    """Gives CPU seconds to stages and functions, until it is told to stop."""

    def __init__(self) -> None:
        super().__init__(daemon=True)
        self.stages: Counter[str] = Counter()
        self.functions: Counter[str] = Counter()
        self.threads: Counter[str] = Counter()
        self._spent: dict[int, float] = {}
        self.is_over = False

    def run(self) -> None:
        while not self.is_over:
            time.sleep(_PERIOD)
            frames = sys._current_frames()
            for thread in threading.enumerate():
                if thread.ident is not None and thread is not self and thread.ident in frames:
                    self._give(thread.name, thread.ident, frames[thread.ident])

    def forget(self) -> None:
        """Begin anew: what was so far is the start of the server."""
        for counts in (self.stages, self.functions, self.threads):
            counts.clear()

    def _give(self, name: str, ident: int, frame: FrameType) -> None:
        try:
            now = time.clock_gettime(time.pthread_getcpuclockid(ident))
        except OSError:
            return  # it has just ended
        spent = now - self._spent.get(ident, now)
        self._spent[ident] = now
        if spent > 0.0:
            stage, function = _found(frame)
            self.stages[stage] += spent
            self.functions[function] += spent
            self.threads[_THREADS.get(name, "other")] += spent


def _found(frame: FrameType | None) -> tuple[str, str]:
    function = ""
    while frame is not None:
        path = frame.f_code.co_filename
        if not function:
            function = f"{Path(path).parent.name}/{Path(path).stem}.{frame.f_code.co_qualname}"
        for part, name in _STAGES:
            if part in path:
                return name, function
        frame = frame.f_back
    return "event loop and other", function or "?"


def serve() -> None:
    """The server's part: `wayfuse` with a looker; its counts go to a file when it ends."""
    from wayfuse.cli.main import main as wayfuse

    signal.signal(
        signal.SIGTERM, lambda _signal, _frame: sys.exit(0)
    )  # uvicorn raises it again when it is done
    looker = Looker()
    signal.signal(signal.SIGUSR1, lambda _signal, _frame: looker.forget())
    looker.start()
    try:
        wayfuse()
    finally:
        looker.is_over = True
        counts = {
            "threads": dict(looker.threads),
            "stages": dict(looker.stages),
            "functions": dict(looker.functions),
        }
        Path(os.environ[_OUT]).write_text(json.dumps(counts), encoding="utf-8")


def main(arguments: list[str] | None = None) -> None:
    """Load the server, print where its time went, and write the section of the page."""
    import uvloop

    from benchmarks.report import machine
    from benchmarks.server_load import MODES, PERIOD, scripts
    from benchmarks.server_page import table, write_section
    from benchmarks.server_phones import Phones
    from benchmarks.server_process import serving, simulated

    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--mode", default=MODES[0], choices=MODES)
    parser.add_argument("--phones", type=int, default=100)
    parser.add_argument("--seconds", type=float, default=30.0)
    parser.add_argument("--page", action="store_true", help="write docs/server-performance.md")
    options = parser.parse_args(arguments)
    before = machine()
    with tempfile.TemporaryDirectory() as folder:
        scene, out = simulated(Path(folder), 7), Path(folder) / "profile.json"
        os.environ[_OUT] = str(out)
        many = Phones(scripts(scene.walks, options.mode), options.phones, PERIOD, 7)
        with serving(scene, Path(folder) / "data", start=("-m", "benchmarks.server_profile")) as server:
            ready = partial(os.kill, server.pid, signal.SIGUSR1)
            uvloop.run(many.walk(server.host, server.port, server.token, options.seconds, ready))
        counts = json.loads(out.read_text(encoding="utf-8"))
    n = round(options.phones * options.seconds / PERIOD)
    text = (
        f"Where the server's time goes\n\n{options.phones} simulated phones, mode {options.mode}, {n:,} batches of "
        f"{PERIOD:g} s, {sum(counts['stages'].values()):.1f} s of CPU; how: `benchmarks/server_profile.py`.\n\n"
    )
    for what, key in (("thread", "threads"), ("stage", "stages"), ("function", "functions")):
        of = Counter(counts[key])
        rows = [
            (name, 1e6 * t / n, f"{100.0 * t / of.total():.1f} %")
            for name, t in of.most_common()
            if t >= _SHOWN * of.total()
        ]
        text += table((what, "µs per batch", "share"), rows) + "\n"
    print(text)
    if options.page:
        command = " ".join(["python -m benchmarks.server_profile", *(arguments or sys.argv[1:])])
        write_section("profile", command, before, text)


if __name__ == "__main__":
    if _OUT in os.environ:
        serve()
    else:
        main()
