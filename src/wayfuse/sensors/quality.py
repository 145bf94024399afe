"""Verdicts on bad data: every refused line or record is counted, with the places of the first few.

A bad line costs that line and nothing else. A `ReadReport` travels with its recording, so that a command can say
at its end what was left out and where.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import Enum

__all__ = ["Issue", "ReadReport", "Verdict"]

_KEPT_PLACES = 5  # line numbers kept per kind of fault


class Verdict(Enum):
    """What became of a record on its way into a track."""

    USED = "used"
    LATE = "late"
    DUPLICATE = "duplicate"
    NOT_FINITE = "not finite"
    OUT_OF_RANGE = "out of range"
    UNKNOWN_ACCESS_POINTS = "no access point of the survey"
    IGNORED = "not used by this method"


@dataclass(slots=True)
class Issue:
    """One kind of fault in a file: how often, and the first line numbers (1-based)."""

    count: int = 0
    lines: list[int] = field(default_factory=list)


@dataclass(slots=True)
class ReadReport:
    """What a reader met: records per kind, faults per kind.

    ``issues`` maps a kind of fault (``"WIFI: 4 fields of 6"``) to its `Issue`.
    """

    path: str = ""
    n_lines: int = 0
    n_records: dict[str, int] = field(default_factory=dict)
    issues: dict[str, Issue] = field(default_factory=dict)

    def add(self, kind: str, line: int, count: int = 1) -> None:
        """Count a fault of a kind at a line."""
        issue = self.issues.setdefault(kind, Issue())
        issue.count += count
        if len(issue.lines) < _KEPT_PLACES:
            issue.lines.append(line)

    @property
    def n_bad(self) -> int:
        """Number of faults of all kinds."""
        return sum(i.count for i in self.issues.values())

    def describe(self) -> list[str]:
        """One line per kind of fault: file, count and the first places."""
        return [
            f"{self.path}: {issue.count} x {kind} (line {', '.join(map(str, issue.lines))}"
            f"{', ...' if issue.count > len(issue.lines) else ''})"
            for kind, issue in sorted(self.issues.items())
        ]
