"""What every importer says about its work: the residual of each floor's frame, and warnings."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["FloorReport", "ImportReport"]


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
