"""A site: the floors of a building in metres, each with its outline, units, walls and walkable space.

Every floor has its own frame, for that is what public floor plans come with: x to the east edge and y to the
north edge of *its* plan. Floors therefore carry their own `GeoAnchor`; `Site.shift` gives the offset between
two of them. A site is built once by an importer (`wayfuse.maps.build`), saved in a folder and loaded by
everything else without a geometry library.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from wayfuse.core.errors import MapError
from wayfuse.core.frames import GeoAnchor
from wayfuse.core.types import Array
from wayfuse.maps.connectors import Connector
from wayfuse.maps.walkable import Walkable
from wayfuse.maps.walls import WallIndex

__all__ = ["STOREY_HEIGHT", "Floor", "Polygon", "Site", "Unit"]

STOREY_HEIGHT = 4.5  # m from floor to floor where a plan does not say: nominal for shopping centres


class Polygon(NamedTuple):
    """A polygon in metres: closed rings (k, 2), exterior counter-clockwise, holes clockwise."""

    exterior: Array
    holes: tuple[Array, ...] = ()

    @property
    def rings(self) -> tuple[Array, ...]:
        """All rings, the exterior first."""
        return (self.exterior, *self.holes)

    @property
    def area(self) -> float:
        """Area in m2 (holes, being clockwise, count negative)."""
        return sum(_signed_area(ring) for ring in self.rings)


class Unit(NamedTuple):
    """An area of a floor: a shop, a room, a void, a corridor, stairs.

    Whether people walk in it is the plan's to say (`Floor.walkable`): in the shops of ms-indoor they do not,
    in the rooms of OpenStreetMap they do.
    """

    id: str
    name: str
    category: str
    polygon: Polygon


@dataclass(frozen=True, slots=True, eq=False)
class Floor:
    """One floor.

    name : as the plan has it. level : as people count, F1 = 1, B1 = -1; floors are sorted by it.
    width, height : m, extent of the frame. elevation : m above ground, nominal where the plan does not say.
    outline : outer polygons with their holes. units : areas with a name or category. walls : (w, 4) m: x0, y0, x1, y1.
    barriers : (b, 4) m, edges of the walkable space: walls set back by its widening, for neither plans nor
    people are exact (of 3064 straight legs between surveyed waypoints in a mall, 5.3 % cross a wall and 1.9 %
    a barrier). On a plan of thin walls and doors the walls themselves, which leave the doors open.
    walkable, wall_index, barrier_index : derived tables. anchor : to WGS84, None where the plan has none.
    doors : (d, 4) m like walls: the clear widths of doors and openings, where the plan has them.
    """

    name: str
    level: int
    width: float
    height: float
    elevation: float
    outline: tuple[Polygon, ...]
    units: tuple[Unit, ...]
    walls: Array
    barriers: Array
    walkable: Walkable
    wall_index: WallIndex
    barrier_index: WallIndex
    anchor: GeoAnchor | None = None
    doors: Array = field(default_factory=lambda: np.empty((0, 4)))

    @property
    def area(self) -> float:
        """Area inside the outline (m2)."""
        return sum(polygon.area for polygon in self.outline)

    @property
    def walkable_share(self) -> float:
        """Walkable share of the outline's area."""
        return self.walkable.area / self.area

    def to_lonlat(self, xy: ArrayLike) -> Array:
        """Longitude and latitude (degrees), shape (..., 2), of places (m) of this floor's frame.

        Raises
        ------
        MapError : the floor has no anchor.
        """
        if self.anchor is None:
            raise MapError(f"floor {self.name} has no WGS84 anchor", remedy="import a plan with coordinates")
        return self.anchor.to_lonlat(xy)


@dataclass(frozen=True, slots=True, eq=False)
class Site:
    """A building: floors bottom up and what they were made of.

    provenance : free text by key (format, source folder, file checksums), saved with the site.
    connectors : stairs, lifts, escalators and ramps between the floors.
    """

    name: str
    floors: tuple[Floor, ...]
    provenance: Mapping[str, str] = field(default_factory=dict)
    connectors: tuple[Connector, ...] = ()

    def __post_init__(self) -> None:
        names = [floor.name for floor in self.floors]
        if not names:
            raise MapError("a site needs at least one floor", where=self.name)
        if len(set(names)) != len(names):
            raise MapError(f"floor names repeat: {', '.join(names)}", where=self.name)
        ids = [connector.id for connector in self.connectors]
        if len(set(ids)) != len(ids):
            raise MapError(f"connector ids repeat: {', '.join(sorted(ids))}", where=self.name)
        for connector in self.connectors:
            if connector.floors[0] < 0 or connector.floors[-1] >= len(names):
                raise MapError(f"connector {connector.id} has a landing on no floor", where=self.name)

    @property
    def anchor(self) -> GeoAnchor | None:
        """Anchor of the reference floor (the lowest at or above ground), the one for a site-wide picture."""
        return self.floors[self.reference].anchor

    @property
    def reference(self) -> int:
        """Index of the reference floor: the lowest with level >= 0, else the highest."""
        above = [i for i, floor in enumerate(self.floors) if floor.level >= 0]
        return above[0] if above else len(self.floors) - 1

    @property
    def floor_names(self) -> tuple[str, ...]:
        """Names bottom up."""
        return tuple(floor.name for floor in self.floors)

    def floor_index(self, name: str) -> int:
        """Index of a floor by its name (case does not matter).

        Raises
        ------
        MapError : no such floor; lists those there are.
        """
        folded = [known.casefold() for known in self.floor_names]
        if name.casefold() not in folded:
            raise MapError(
                f"site {self.name} has no floor {name!r}", remedy=f"floors: {', '.join(self.floor_names)}"
            )
        return folded.index(name.casefold())

    def shift(self, source: int, target: int) -> Array:
        """Offset (2,) m to add to a place of floor ``source`` for its place in the frame of ``target``.

        Zero where either floor has no anchor. It is that of the middle of the source floor: frames of a site
        share axes and, but for millimetres over a building, scale.
        """
        a, b = self.floors[source].anchor, self.floors[target].anchor
        if a is None or b is None or source == target:
            return np.zeros(2)
        middle = 0.5 * np.array([self.floors[source].width, self.floors[source].height])
        return np.asarray(b.to_xy(a.to_lonlat(middle)) - middle)

    def save(self, folder: Path, *, overwrite: bool = False) -> None:
        """Write the site into a folder; see `wayfuse.maps.store`."""
        from wayfuse.maps.store import save_site

        save_site(self, folder, overwrite=overwrite)

    @classmethod
    def load(cls, folder: Path) -> Site:
        """Read a site from a folder; see `wayfuse.maps.store`."""
        from wayfuse.maps.store import load_site

        return load_site(folder)


def _signed_area(ring: Array) -> float:
    x, y = ring[:, 0] - ring[0, 0], ring[:, 1] - ring[0, 1]
    return float(0.5 * np.sum(x[:-1] * y[1:] - x[1:] * y[:-1]))
