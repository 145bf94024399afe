"""A simulated building as a site, and as the IMDF archive that a user would import."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from wayfuse.core.types import Array
from wayfuse.maps.build import build_floor
from wayfuse.maps.connectors import ConnectorKind
from wayfuse.maps.importers.imdf_write import write_archive
from wayfuse.maps.site import Floor, Polygon, Site, Unit
from wayfuse.simulator.building import Building, Storey

__all__ = ["site_of", "write_plan"]

_CATEGORY = {
    ConnectorKind.STAIRS: "stairs",
    ConnectorKind.LIFT: "elevator",
    ConnectorKind.ESCALATOR: "escalator",
    ConnectorKind.RAMP: "ramp",
}
_CREATED = "2020-01-01T10:00:00Z"  # no clock: the same building gives the same bytes


def site_of(building: Building) -> Site:
    """The building as its plan knows it: floors with rooms, stairs and lifts, and the connectors between them."""
    floors = tuple(_floor(building, storey, number) for number, storey in enumerate(building.storeys))
    return Site(building.name, floors, {}, tuple(passage.connector for passage in building.passages))


def write_plan(path: Path, building: Building) -> None:
    """Write the building as an IMDF archive."""
    write_archive(site_of(building), path, _CREATED)


def _floor(building: Building, storey: Storey, number: int) -> Floor:
    here = [passage for passage in building.passages if number in passage.connector.floors]
    rooms = [Unit(room.name, room.name, "room", _polygon(room.polygon)) for room in storey.rooms]
    voids = [Unit(room.name, "", "void", _polygon(room.polygon)) for room in storey.voids]
    ways = [
        Unit(
            passage.connector.id,
            passage.connector.name,
            _CATEGORY[passage.connector.kind],
            _polygon(passage.footprint),
        )
        for passage in here
    ]
    doors = [passage.opening(number) for passage in here if passage.is_lift]
    return build_floor(
        storey.name,
        number,
        [_polygon(storey.outline)],
        [*rooms, *voids, *ways],
        walls=storey.walls,
        closed=[unit.polygon for unit in (*rooms, *voids)],
        width=building.width,
        height=building.height,
        elevation=storey.elevation,
        anchor=building.anchor,
        doors=np.array(doors).reshape(-1, 4),
    )


def _polygon(corners: Array) -> Polygon:
    return Polygon(np.concatenate([corners, corners[:1]]))
