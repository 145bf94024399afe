"""Cells and tables of docs/results.md."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

__all__ = ["error_table", "metres", "millimetres", "percent", "signed", "span", "table", "whole", "with_unit"]


_ERRORS = {"mean": "mean", "p50": "median", "p75": "75 %", "p90": "90 %", "p95": "95 %"}


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A Markdown table."""
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def metres(value: float | None) -> str:
    """A number with two decimals, a dash where there is none."""
    return "-" if value is None else f"{value:.2f}"


def millimetres(value: float | None) -> str:
    """A number with three decimals."""
    return "-" if value is None else f"{value:.3f}"


def signed(value: float | None) -> str:
    """A number with its sign and two decimals."""
    return "-" if value is None else f"{value:+.2f}"


def percent(value: float | None) -> str:
    """A share in per cent with one decimal."""
    return "-" if value is None else f"{100 * value:.1f} %"


def whole(value: float | None) -> str:
    """A share in whole per cent."""
    return "-" if value is None else f"{100 * value:.0f} %"


def with_unit(value: float | None, unit: str) -> str:
    """A value as its unit wants it: a share in per cent, a count whole, else three decimals."""
    if value is None:
        return "-"
    if unit == "%":
        return percent(value)
    return f"{value:.0f} {unit}" if unit.startswith("of ") or unit == "changes" else f"{value:.3f} {unit}"


def span(interval: Mapping[str, Any], show: Any = metres) -> str:
    """A value with the ends of its interval, where it has one."""
    if interval["low"] is None:
        return str(show(interval["value"]))
    ends = [str(show(interval[k])).removesuffix(" %") for k in ("low", "high")]
    return f"{show(interval['value'])} [{', '.join(ends)}]"


def error_table(methods: Mapping[str, Any], *, up_to: str) -> str:
    """Errors of each method, the figures up to one of them, floors and IPIN score; the mean of each seed."""
    names = list(_ERRORS)[: list(_ERRORS).index(up_to) + 1]
    rows = []
    for method, of in methods.items():
        f, means = of["figures"], of["mean_by_seed"]
        row = [method, f"{of['n_walks']}, {of['n']}", *(span(f[name]) for name in names)]
        row += [span(f["floor_accuracy"], percent), span(f["ipin"])]
        rows.append([*row, " ".join(map(metres, means)) if len(means) > 1 else ""])
    head = [
        "method",
        "walks, points",
        *(_ERRORS[name] for name in names),
        "right floor",
        "IPIN",
        "mean by seed",
    ]
    return table(head, rows)
