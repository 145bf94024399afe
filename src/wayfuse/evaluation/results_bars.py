"""A bar: a bound that was set before the measurement, the value measured, and whether it holds."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["Bar", "at_least", "at_most", "within"]


@dataclass(frozen=True, slots=True)
class Bar:
    """What was measured, the bound in words, the value, its unit (``m``, ``%``, ``ms/s``), whether it holds.

    A share is given as such (0.9 is 90 %).
    """

    what: str
    bound: str
    value: float
    unit: str
    met: bool


def at_most(what: str, limit: float, value: float, unit: str, *, strict: bool = False) -> Bar:
    """The value is to be at most (``strict``: below) a limit; an unknown value (NaN) does not hold."""
    return Bar(what, f"{'<' if strict else '<='} {_text(limit, unit)}", value, unit,
               bool(value < limit if strict else value <= limit))  # fmt: skip


def at_least(what: str, limit: float, value: float, unit: str, *, low: float | None = None) -> Bar:
    """The value is to be at least a limit; where ``low`` is given, the lower end of its interval is to exceed 0."""
    bound = f">= {_text(limit, unit)}" + ("" if low is None else ", interval above 0")
    return Bar(what, bound, value, unit, bool(value >= limit and (low is None or low > 0.0)))


def within(what: str, low: float, high: float, value: float, unit: str) -> Bar:
    """The value is to lie between two limits, these included."""
    bound = f"{_text(low, unit)} to {_text(high, unit)}"
    return Bar(what, bound, value, unit, bool(low <= value <= high))


def _text(value: float, unit: str) -> str:
    return f"{100 * value:g} %" if unit == "%" else f"{value:g} {unit}"
