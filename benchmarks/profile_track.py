"""Where each millisecond of tracking real walks goes, by sampling the stack.

    python -m benchmarks.profile_track [--walks 50] [--rounds 3] [--out docs/profile.md]

A timer interrupts the process each millisecond of CPU time; the time since the interrupt before goes to the stack
that is found. A call into compiled code is found when it returns and gets all of its time, so nothing is slowed down
by being watched. The walks are those of fold 1 and 2 of ms-indoor (`evaluation.results_folds`), read and tracked by
``fused`` as ``wayfuse track`` does, in one process, after a first walk that loads the kernels.
"""

from __future__ import annotations

import argparse
import signal
import sys
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType

from wayfuse.cli.main import collect_seldom
from wayfuse.evaluation.results_folds import build_tracker, gather
from wayfuse.formats.datasets import data_root
from wayfuse.formats.reading import read

_PERIOD = 0.001  # s of CPU time
_SHOWN = 0.005  # shares below are not listed
_PACKAGE = "/wayfuse/"

# first match from the innermost frame outwards: what a reader would call the work
_STAGES = (
    ("formats/", "reading the log"),
    ("inertial/vertical", "stairs and lifts"),
    ("inertial/_vertical", "stairs and lifts"),
    ("inertial/_speed", "stairs and lifts"),
    ("inertial/", "steps and heading"),
    ("radio/device_offset", "offset of the phone"),
    ("radio/scans", "scan buffer"),
    ("radio/standing", "averaging while standing"),
    ("radio/", "neighbours of a scan"),
    ("models/observation", "likelihood"),
    ("models/constraint", "floor plan"),
    ("models/initial", "fresh particles"),
    ("models/motion", "moving particles"),
    ("filters/", "weights and resampling"),
    ("tracking/summary", "estimate and radii"),
    ("tracking/floor_change", "floor changes"),
    ("tracking/", "bookkeeping of the tracker"),
)


class Samples:
    """CPU seconds by stage and by function."""

    def __init__(self) -> None:
        self.stages: Counter[str] = Counter()
        self.functions: Counter[str] = Counter()
        self.last = 0.0

    def take(self, _signal: int, frame: FrameType | None) -> None:
        """The time since the sample before goes to this stack."""
        now = time.process_time()
        spent, self.last = now - self.last, now
        stage = function = "other"
        while frame is not None:
            path = frame.f_code.co_filename
            if _PACKAGE in path:
                inside = path.rsplit(_PACKAGE, 1)[1]
                if function == "other":
                    function = f"{inside.removesuffix('.py')}.{frame.f_code.co_qualname}"
                found = next((name for start, name in _STAGES if inside.startswith(start)), None)
                # random numbers and other basics count for whom they are made
                if found is not None:
                    stage = found
                    break
            frame = frame.f_back
        self.stages[stage] += spent
        self.functions[function] += spent

    @contextmanager
    def taking(self) -> Iterator[None]:
        """Sample while the block runs."""
        self.last = time.process_time()
        before = signal.signal(signal.SIGPROF, self.take)
        signal.setitimer(signal.ITIMER_PROF, _PERIOD, _PERIOD)
        try:
            yield
        finally:
            signal.setitimer(signal.ITIMER_PROF, 0.0)
            signal.signal(signal.SIGPROF, before)


def main(arguments: list[str] | None = None) -> Samples:
    """Print the tables, or write them as a page."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--walks", type=int, default=50)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--out", type=Path)
    options = parser.parse_args(arguments)
    collect_seldom()
    folds = gather(data_root() / "ms-indoor" / "site1", (1, 2))
    paths = [path for fold in (1, 2) for path in folds.paths[fold]][: options.walks]
    tracker = build_tracker("fused", folds.site, folds.surveys[1])
    tracker.run(read(paths[0]))
    samples, seconds, started = Samples(), 0.0, time.process_time()
    with samples.taking():
        for _ in range(options.rounds):
            for path in paths:
                recording = read(path)
                tracker.run(recording)
                seconds += recording.span[1] - recording.span[0]
    page = _page(samples, len(paths), options.rounds, seconds, time.process_time() - started)
    if options.out is None:
        print(page)
    else:
        options.out.write_text(page, encoding="utf-8")
        print(f"written to {options.out}")
    return samples


def _page(samples: Samples, n_walks: int, rounds: int, seconds: float, spent: float) -> str:
    head = (
        "# Where the time of tracking goes\n\n"
        f"Written by `python -m benchmarks.profile_track --out docs/profile.md`: {n_walks} walks of ms-indoor, "
        f"{rounds} rounds, `fused` with 1000 particles, one process, kernels compiled; "
        f"{spent:.1f} s of CPU time for {seconds / 60.0:.0f} minutes of walking, "
        f"{1000.0 * spent / seconds:.2f} ms per second of walk, reading included. "
        "How it is measured: `benchmarks/profile_track.py`.\n\n"
    )
    return head + "\n".join(
        [
            _table("stage", samples.stages, seconds),
            "The functions that the time was found in (what they call in compiled code is theirs):\n",
            _table("function", samples.functions, seconds),
        ]
    )


def _table(what: str, of: Counter[str], seconds: float) -> str:
    total = sum(of.values())
    rows = "".join(
        f"| {name} | {1e6 * spent / seconds:.0f} | {100.0 * spent / total:.1f} % |\n"
        for name, spent in of.most_common()
        if spent >= _SHOWN * total
    )
    return f"| {what} | µs per second of walk | share |\n|---|---|---|\n{rows}"


if __name__ == "__main__":
    main()
    sys.exit(0)
