"""What every importer says about its work: the residual of each floor's frame, warnings and named problems."""

from __future__ import annotations

from dataclasses import dataclass

from wayfuse.maps.problems import Problem, Severity

__all__ = ["FloorReport", "ImportReport", "Notes"]


class Notes(list[str]):
    """Warnings of an importer in words; those that concern one feature are kept as `Problem` too."""

    def __init__(self, floor: str = "") -> None:
        super().__init__()
        self.floor = floor
        self.problems: list[Problem] = []

    def add(self, kind: str, feature: str, text: str, severity: Severity = Severity.WARNING) -> None:
        """Note a problem of a feature."""
        self.append(f"{feature}: {text}")
        self.problems.append(Problem(kind, feature, self.floor, text, severity))


@dataclass(frozen=True, slots=True)
class FloorReport:
    """What the import of a floor met: residual of its frame (m, None without a plan) and warnings."""

    name: str
    residual: float | None
    warnings: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class ImportReport:
    """Floor reports, bottom up, and warnings that concern the site."""

    floors: tuple[FloorReport, ...]
    warnings: tuple[str, ...] = ()
