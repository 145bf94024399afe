"""Tables of a benchmark run, as a page and as JSON."""

from __future__ import annotations

import json
import os
import platform
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from importlib import metadata
from pathlib import Path

__all__ = ["Table", "Target", "page", "ratio", "versions", "write"]

PEERS = ("particles", "pfilter", "stonesoup", "filterpy", "scikit-learn")
HEAD = """\
Written by `python -m benchmarks` (`make bench`); not edited by hand. The figures as JSON are in
[benchmarks.json](benchmarks.json).

Variants take turns in one process, on the same inputs; times are thread CPU time of one thread, least (median) over the
turns. **Read the ratios, not the times**, and each as plus or minus 30 %: the machine is shared. Ratios are other /
wayfuse, of the least times, in brackets of the medians."""
NAMED = ("numpy", "scipy", "numba", "shapely", *PEERS)


@dataclass(frozen=True, slots=True)
class Table:
    """Rows under a title; note: what was measured, and how to read it."""

    title: str
    note: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str | float, ...], ...]


@dataclass(frozen=True, slots=True)
class Target:
    """A goal of the project and what came out; got None = not measured. less = smaller is better."""

    name: str
    goal: float
    got: float | None
    unit: str = "x"
    less: bool = False

    @property
    def verdict(self) -> str:
        """Reached, missed or not measured."""
        if self.got is None:
            return "not measured"
        return "reached" if (self.got <= self.goal if self.less else self.got >= self.goal) else "**missed**"


def ratio(other: float, ours: float) -> str:
    """A ratio with two or three digits that mean something."""
    value = other / ours
    return f"{value:,.0f}" if value >= 100 else f"{value:.1f}"


def versions() -> dict[str, str | None]:
    """Version of each library of the run, None where it is not installed."""
    found: dict[str, str | None] = {"python": platform.python_version()}
    for name in NAMED:
        try:
            found[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            found[name] = None
    return found


def machine() -> str:
    """Processor, number of cores, and load."""
    model = platform.machine()
    info = Path("/proc/cpuinfo")
    if info.exists():
        lines = [
            line for line in info.read_text(encoding="utf-8").splitlines() if line.startswith("model name")
        ]
        model = lines[0].partition(":")[2].strip() if lines else model
    load = ", ".join(f"{x:.1f}" for x in os.getloadavg())
    return f"{model}, {os.cpu_count()} cores, load {load}"


def page(tables: Sequence[Table], targets: Sequence[Target], loads: tuple[str, str], seconds: float) -> str:
    """The page in Markdown."""
    found = versions()
    missing = [name for name in PEERS if found[name] is None]
    lines = [
        "# Benchmarks",
        "",
        HEAD,
        "",
        f"At the start: {loads[0]}; at the end: {loads[1]}; {seconds:.0f} s.",
        "",
        "Versions: " + ", ".join(f"{n} {v}" for n, v in found.items() if v is not None) + ".",
        "",
    ]
    if missing:
        lines += [
            f"> **Not installed, so not compared: {', '.join(missing)}.** `uv sync --group bench` installs the peers.",
            "",
        ]
    lines += ["## Goals", "", "| goal | wanted | measured | |", "|---|---|---|---|"]
    for t in targets:
        got = "" if t.got is None else f"{t.got:,.3g}" if t.got < 1000 else f"{t.got:,.0f}"
        lines.append(f"| {t.name} | {'<=' if t.less else '>='} {t.goal:,g} {t.unit} | {got} | {t.verdict} |")
    for table in tables:
        lines += ["", f"## {table.title}", "", table.note, ""]
        lines += ["| " + " | ".join(table.columns) + " |", "|" + "---|" * len(table.columns)]
        lines += ["| " + " | ".join(_cell(c) for c in row) + " |" for row in table.rows]
    return "\n".join(lines) + "\n"


def write(folder: Path, text: str, tables: Sequence[Table], targets: Sequence[Target]) -> None:
    """Write benchmarks.md and benchmarks.json."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "benchmarks.md").write_text(text, encoding="utf-8")
    figures = {
        "when": time.strftime("%Y-%m-%d"),
        "machine": machine(),
        "versions": versions(),
        "goals": [{**asdict(t), "verdict": t.verdict.strip("*")} for t in targets],
        "tables": [asdict(t) for t in tables],
    }
    (folder / "benchmarks.json").write_text(json.dumps(figures, indent=1) + "\n", encoding="utf-8")


def _cell(value: str | float) -> str:
    return value if isinstance(value, str) else f"{value:.3g}"
