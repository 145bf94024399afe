"""Cells and tables of docs/results.md."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

__all__ = ["metres", "millimetres", "percent", "signed", "span", "table", "whole", "with_unit"]


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
