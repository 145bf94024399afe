"""Formats of buildings by name, and what one of them made of a file or folder."""

from __future__ import annotations

import importlib
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:  # the command line reads the names here, and its help loads nothing else
    from wayfuse.maps.importers.report import ImportReport
    from wayfuse.maps.site import Site

__all__ = ["IMPORTERS", "floor_rows", "import_plan"]

# name of a format -> module of its importer: import_site(path) -> (site, report)
IMPORTERS: Mapping[str, str] = MappingProxyType(
    {
        name: f"wayfuse.maps.importers.{name.replace('-', '_')}"
        for name in ("hcu", "image", "imdf", "ipin2023", "ms-indoor", "osm", "simpleloc")
    }
)


def import_plan(plan_format: str, path: Path) -> tuple[Site, ImportReport]:
    """Site of a file or folder of a format of `IMPORTERS`, and what was met on the way.

    Raises
    ------
    MapError : it cannot be read; names the file and the remedy.
    """
    made: tuple[Site, ImportReport] = importlib.import_module(IMPORTERS[plan_format]).import_site(path)
    return made


def floor_rows(site: Site, report: ImportReport) -> list[dict[str, Any]]:
    """A row per floor, bottom up: its size, what was drawn on it, and what its import met."""
    return [
        {
            "floor": floor.name,
            "level": floor.level,
            "width_m": round(floor.width, 2),
            "height_m": round(floor.height, 2),
            "elevation_m": floor.elevation,
            "units": len(floor.units),
            "walls": len(floor.walls),
            "doors": len(floor.doors),
            "connectors": sum(k in connector.floors for connector in site.connectors),
            "walkable_share": round(floor.walkable_share, 4),
            "anchor_residual_m": None if note.residual is None else round(note.residual, 4),
            "warnings": list(note.warnings),
        }
        for k, (floor, note) in enumerate(zip(site.floors, report.floors, strict=True))
    ]
