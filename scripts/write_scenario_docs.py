"""Write the tables of keys in docs/simulator.md from the classes: ``python scripts/write_scenario_docs.py``.

A key's default is that of its class, its meaning the comment beside it. ``tests/simulator/test_sim_docs.py`` fails
where the page is stale.
"""

from __future__ import annotations

import ast
import inspect
import io
import tokenize
from collections.abc import Iterator
from dataclasses import fields, is_dataclass
from pathlib import Path

from wayfuse.simulator.scenario_file import ScenarioFile

__all__ = ["MARK", "PAGE", "page", "tables"]

PAGE = Path(__file__).resolve().parent.parent / "docs" / "simulator.md"
MARK = "<!-- written by scripts/write_scenario_docs.py from here on -->"


def page() -> str:
    """The whole page: what is above the mark stays."""
    return PAGE.read_text(encoding="utf-8").partition(MARK)[0] + MARK + "\n\n" + tables()


def tables() -> str:
    """The tables of all parts."""
    parts = []
    for name, part in _parts("", ScenarioFile()):
        notes = _comments(type(part))
        title = f"### [{name}]" if name else "### Above all tables"
        lines = [title, "", "| key | default | meaning |", "|---|---|---|"]
        for f in fields(part):  # type: ignore[arg-type]
            value = getattr(part, f.name)
            if not is_dataclass(value):
                words = ", ".join(f.metadata.get("one_of", ()))
                meaning = "; ".join(filter(None, (notes.get(f.name, ""), f"one of {words}" if words else "")))
                lines.append(f"| `{f.name}` | `{_toml(value)}` | {meaning.replace('|', chr(92) + '|')} |")
        parts.append("\n".join(lines))
    return "\n\n".join(parts) + "\n"


def _parts(name: str, part: object) -> Iterator[tuple[str, object]]:
    yield name, part
    for f in fields(part):  # type: ignore[arg-type]
        value = getattr(part, f.name)
        if is_dataclass(value):
            yield from _parts(f"{name}.{f.name}" if name else f.name, value)


def _comments(kind: type) -> dict[str, str]:
    """Comments beside the fields of a class, by field."""
    source = inspect.getsource(kind)
    notes = {
        token.start[0]: token.string.lstrip("# ").strip()
        for token in tokenize.generate_tokens(io.StringIO(source).readline)
        if token.type == tokenize.COMMENT
    }
    body = ast.parse(source).body[0]
    if not isinstance(body, ast.ClassDef):
        raise TypeError(kind)
    return {
        node.target.id: " ".join(
            notes[n] for n in range(node.lineno, (node.end_lineno or 0) + 1) if n in notes
        )
        for node in body.body
        if isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name)
    }


def _toml(value: object) -> str:
    """A default as the file would have it."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return f'"{value}"'
    if isinstance(value, tuple):
        return "[" + ", ".join(_toml(v) for v in value) + "]"
    if is_dataclass(value):
        return "{ " + ", ".join(f"{f.name} = {_toml(getattr(value, f.name))}" for f in fields(value)) + " }"
    return repr(value)


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
