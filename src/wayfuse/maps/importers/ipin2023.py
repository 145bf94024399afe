"""Import the museum of IPIN 2023 Track 3 from the folder of its logs.

The data set has no vector plan. Its floors (0, -1, -2) become rectangles around the stated positions (POSI lines) of
all logs in the folder, in one frame, and everything inside is walkable: a map that knows where the floors, stairs and
lifts are and nothing of walls. Heights and connectors come from ``ipin2023.toml`` beside this file, which says how it
was made.
"""

from __future__ import annotations

import math
import tomllib
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np

from wayfuse.core.errors import MapError
from wayfuse.core.frames import GeoAnchor
from wayfuse.core.types import Array
from wayfuse.maps.build import build_floor
from wayfuse.maps.connectors import Connector, ConnectorKind, Landing
from wayfuse.maps.importers.report import FloorReport, ImportReport
from wayfuse.maps.site import Floor, Polygon, Site

__all__ = ["import_site"]

MARGIN = 12.0  # m around the outermost positions of a floor: rooms reach beyond where the surveyors stopped


def import_site(path: Path) -> tuple[Site, ImportReport]:
    """Site of a folder of logs, named ``ipin2023``.

    Raises
    ------
    MapError : no logs there, or no position on one of the floors.
    """
    logs = sorted(Path(path).glob("*.txt")) if Path(path).is_dir() else []
    if not logs:
        raise MapError("no logs (*.txt) here", where=path, remedy="give the folder of the Track 3 logs")
    stated = _positions(logs)
    facts = tomllib.loads(files(__package__).joinpath("ipin2023.toml").read_text(encoding="utf-8"))
    names = sorted(facts["elevation"], key=lambda name: float(facts["elevation"][name]))
    missing = [name for name in names if name not in stated]
    if missing:
        raise MapError(
            f"no position on floor {', '.join(missing)}",
            where=path,
            remedy="give the whole data set: the trials 51 to 53 reach all floors",
        )
    lonlat = np.concatenate([stated[name] for name in names])
    anchor = GeoAnchor.from_origin(*lonlat.min(axis=0).tolist())
    anchor = GeoAnchor.from_origin(*anchor.to_lonlat((-MARGIN, -MARGIN)).tolist())
    extent = anchor.to_xy(lonlat).max(axis=0) + MARGIN
    floors = tuple(
        _floor(name, anchor.to_xy(stated[name]), float(facts["elevation"][name]), extent, anchor)
        for name in names
    )
    connectors = tuple(_connector(entry, names, anchor) for entry in facts["connector"])
    provenance = {"format": "ipin2023", "logs": str(len(logs)), "positions": str(len(lonlat))}
    site = Site("ipin2023", floors, provenance, connectors)
    return site, ImportReport(tuple(FloorReport(floor.name, 0.0, ()) for floor in floors))


def _positions(logs: list[Path]) -> dict[str, Array]:
    """Longitude and latitude (n, 2) of all positions, by floor name."""
    found: dict[str, list[tuple[float, float]]] = {}
    for log in logs:
        with log.open(encoding="utf-8", errors="replace") as lines:
            for number, line in enumerate(lines, 1):
                if line.startswith("POSI;"):
                    try:
                        floor, place = _position(line)
                    except ValueError as fault:
                        raise MapError(
                            f"damaged position: {fault}", where=f"{log}:{number}", remedy="fetch the log anew"
                        ) from fault
                    found.setdefault(floor, []).append(place)
    return {floor: np.array(places) for floor, places in found.items()}


def _position(line: str) -> tuple[str, tuple[float, float]]:
    """Floor name, and longitude and latitude (degrees)."""
    _, _, _, lat, lon, floor = line.split(";")[:6]
    place = float(lon), float(lat)
    if not (abs(place[0]) <= 180.0 and abs(place[1]) <= 90.0 and math.isfinite(float(floor))):
        raise ValueError(f"longitude {lon}, latitude {lat}, floor {floor.strip()}")
    return f"{round(float(floor))}", place


def _floor(name: str, xy: Array, elevation: float, extent: Array, anchor: GeoAnchor) -> Floor:
    (x0, y0), (x1, y1) = xy.min(axis=0) - MARGIN, xy.max(axis=0) + MARGIN
    ring = np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1], [x0, y0]])
    width, height = extent.tolist()
    return build_floor(
        name, int(name), [Polygon(ring)], width=width, height=height, elevation=elevation, anchor=anchor
    )


def _connector(entry: dict[str, Any], names: list[str], anchor: GeoAnchor) -> Connector:
    landings = []
    for at in entry["landings"]:
        x, y = anchor.to_xy((at["lon"], at["lat"])).tolist()
        landings.append(Landing(names.index(at["floor"]), x, y))
    return Connector(entry["id"], ConnectorKind(entry["kind"]), tuple(landings))
