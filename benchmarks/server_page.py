"""The page of the server's figures: each command writes its own section and leaves the others as they are."""

from __future__ import annotations

import re
import time
from collections.abc import Sequence
from pathlib import Path

from benchmarks.report import machine, versions

__all__ = ["PAGE", "table", "write_section"]

PAGE = Path(__file__).parents[1] / "docs" / "server-performance.md"
_HEAD = """\
# The live server: speed, endurance, exactness

Every section is written by the command that it names; nothing here is edited by hand. The machine is shared with other
work: read times as plus or minus 30 %.
"""
_ORDER = ("load", "profile", "soak", "replay", "fuzz")


def table(columns: Sequence[str], rows: Sequence[Sequence[object]]) -> str:
    """A table in Markdown; numbers in three digits."""
    head = "| " + " | ".join(columns) + " |\n" + "|" + "---|" * len(columns) + "\n"
    return head + "".join("| " + " | ".join(map(_cell, row)) + " |\n" for row in rows)


def _cell(value: object) -> str:
    if isinstance(value, float):
        return f"{value:,.0f}" if abs(value) >= 100 else f"{value:.3g}"
    return f"{value:,}" if isinstance(value, int) else str(value)


def write_section(key: str, command: str, before: str, text: str, path: Path = PAGE) -> None:
    """Put a section into the page. before : `machine()` at the start of the run."""
    found = versions()
    ran = (
        f"Written by `{command}` on {time.strftime('%Y-%m-%d')}. At the start: {before}; at the end: {machine()}; "
        f"Python {found['python']}, NumPy {found['numpy']}, numba {found['numba']}.\n"
    )
    title, _, rest = text.partition("\n")
    page = path.read_text(encoding="utf-8") if path.exists() else ""
    sections = dict(re.findall(r"<!-- (\w+) -->\n(.*?)(?=\n<!-- \w+ -->|\Z)", page, re.DOTALL))
    sections[key] = f"## {title}\n\n{ran}\n{rest.strip()}\n"
    written = [f"<!-- {k} -->\n{sections[k]}" for k in _ORDER if k in sections]
    path.write_text("\n".join([_HEAD, *written]), encoding="utf-8")
