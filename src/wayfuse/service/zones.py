"""Rooms and geofences: who is in which, with hysteresis, so that nobody flickers on a threshold.

The rooms are the named units of a site's plan; geofences are polygons of the operator's own. A phone enters a zone when
its estimates have been inside for a while, and leaves it when they have been clearly outside for a while, or on another
floor. A lost track changes nothing. What is told depends on the estimates in the order in which they came.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from wayfuse.core.errors import ConfigError
from wayfuse.core.types import Array
from wayfuse.maps.areas import Area, distance_to_area
from wayfuse.maps.site import Site
from wayfuse.tracking.estimate import Estimate, State

__all__ = ["Crossing", "Zone", "ZoneConfig", "ZoneState", "Zones", "read_geofences", "rooms_of"]


@dataclass(frozen=True, slots=True, eq=False)
class Zone:
    """An area of a floor. rings : closed, (k, 2) m each, the outer one first. is_fence : not of the plan."""

    id: str
    name: str
    floor: int
    rings: tuple[Array, ...]
    is_fence: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class ZoneConfig:
    """Hysteresis. enter_s, leave_s : s inside until entered, s outside until left. margin_m : outside is beyond it."""

    enter_s: float = 2.0
    leave_s: float = 3.0
    margin_m: float = 1.5


class Crossing(NamedTuple):
    """An event: at time t (s, phone's clock) somebody entered or left a zone."""

    t: float
    zone: str
    name: str
    is_fence: bool
    is_enter: bool


class ZoneState(NamedTuple):
    """Zones somebody is in, and those about to be entered or left, each since when (s); ``t`` : the last estimate."""

    t: float = -np.inf
    inside: tuple[str, ...] = ()
    pending: tuple[tuple[str, float], ...] = ()


class Zones:
    """All zones of a site."""

    def __init__(self, zones: Iterable[Zone], config: ZoneConfig | None = None) -> None:
        self.config = config or ZoneConfig()
        self._by_id = {zone.id: zone for zone in zones}
        self._floors: dict[int, tuple[Array, list[tuple[str, Area]]]] = {}
        for floor in {zone.floor for zone in self._by_id.values()}:
            some = [zone for zone in self._by_id.values() if zone.floor == floor]
            boxes = [(*z.rings[0].min(axis=0), *z.rings[0].max(axis=0)) for z in some]
            areas = [(z.id, Area.of(z.rings)) for z in some]
            self._floors[floor] = (np.array(boxes, np.float64).T.copy(), areas)

    def __len__(self) -> int:
        return len(self._by_id)

    def __iter__(self) -> Iterator[Zone]:
        return iter(self._by_id.values())

    def called(self, names: Sequence[str], e: Estimate) -> list[str]:
        """Identifiers of the zones that somebody is in by name: of several of one name, the nearest on the floor."""
        found = []
        for name in names:
            mine = [zone for zone in self if zone.name == name]
            here = [zone for zone in mine if zone.floor == e.floor] or mine
            if len(here) > 1 and np.isfinite(e.x) and np.isfinite(e.y):
                place = np.array([e.x, e.y])
                here.sort(key=lambda zone: distance_to_area(zone.rings, place))
            found += [zone.id for zone in here[:1]]
        return found

    def names(self, state: ZoneState) -> tuple[str, ...]:
        """Names of the zones somebody is in."""
        return tuple(self._by_id[z].name for z in state.inside if z in self._by_id)

    def step(self, state: ZoneState, estimates: Sequence[Estimate]) -> tuple[ZoneState, list[Crossing]]:
        """Take estimates; those not after the last one are no news."""
        out: list[Crossing] = []
        for e in estimates:
            if e.t > state.t and e.state is State.TRACKING and np.isfinite(e.x) and np.isfinite(e.y):
                state = self._one(state, e, out)
        return state, out

    def _one(self, state: ZoneState, e: Estimate, out: list[Crossing]) -> ZoneState:
        distance = self._near(e)
        waiting, inside, pending = dict(state.pending), list(state.inside), dict[str, float]()
        for zone in state.inside:
            if zone in self._by_id and distance.get(zone, np.inf) <= self.config.margin_m:
                continue
            since = waiting.get(zone, e.t)
            if zone in self._by_id and e.t - since < self.config.leave_s:
                pending[zone] = since
                continue
            inside.remove(zone)
            if zone in self._by_id:
                out.append(self._crossing(e.t, zone, is_enter=False))
        for zone, d in distance.items():
            if d > 0.0 or zone in state.inside:
                continue
            since = waiting.get(zone, e.t)
            if e.t - since < self.config.enter_s:
                pending[zone] = since
            else:
                inside.append(zone)
                out.append(self._crossing(e.t, zone, is_enter=True))
        return ZoneState(e.t, tuple(inside), tuple(pending.items()))

    def _crossing(self, t: float, zone: str, *, is_enter: bool) -> Crossing:
        z = self._by_id[zone]
        return Crossing(t, z.id, z.name, z.is_fence, is_enter)

    def _near(self, e: Estimate) -> dict[str, float]:
        """Distances (m) to the zones at hand, 0 inside."""
        found = self._floors.get(e.floor)
        if found is None:
            return {}
        (left, bottom, right, top), areas = found
        m = self.config.margin_m
        near = (left <= e.x + m) & (bottom <= e.y + m) & (right >= e.x - m) & (top >= e.y - m)
        at_hand = [areas[i] for i in near.nonzero()[0].tolist()]
        return {name: area.distance(e.x, e.y) for name, area in at_hand}


def rooms_of(site: Site) -> list[Zone]:
    """The named units of a plan."""
    return [
        Zone(f"{floor.name}/{unit.id or n}", unit.name, index, unit.polygon.rings)
        for index, floor in enumerate(site.floors)
        for n, unit in enumerate(floor.units)
        if unit.name
    ]


def read_geofences(path: Path, sites: Mapping[str, Site]) -> dict[str, list[Zone]]:
    """Geofences of a GeoJSON file: polygons in longitude and latitude with the properties site, level and name.

    Raises
    ------
    ConfigError : the file cannot be read, or a feature is no such polygon.
    """
    try:
        features = list(json.loads(path.read_text(encoding="utf-8"))["features"])
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise ConfigError(f"no GeoJSON features: {error}", where=path, remedy="see docs/server.md") from error
    out: dict[str, list[Zone]] = {name: [] for name in sites}
    for n, feature in enumerate(features):
        try:
            said, shape = feature["properties"], feature["geometry"]
            name, site = str(said["name"]), str(said.get("site") or next(iter(sites)))
            if shape["type"] != "Polygon" or site not in sites:
                raise ValueError("no Polygon, or of no site that is served")
            out[site].append(
                _fence(sites[site], f"fence/{n}", name, str(said["level"]), shape["coordinates"])
            )
        except (ValueError, KeyError, TypeError, AttributeError, IndexError) as error:
            raise ConfigError(
                f"feature {n} is no geofence: {error}", where=path, remedy="see docs/server.md"
            ) from error
    return out


def _fence(site: Site, id_: str, name: str, level: str, coordinates: Sequence[Any]) -> Zone:
    floor = site.floor_names.index(level)
    anchor = site.floors[floor].anchor
    if anchor is None:
        raise ValueError(f"level {level} has no place on earth")
    rings = tuple(anchor.to_xy(np.array(ring, np.float64)[:, :2]) for ring in coordinates)
    if not rings or any(len(r) < 4 or not np.isfinite(r).all() or (r[0] != r[-1]).any() for r in rings):
        raise ValueError("rings must be closed and have at least four positions")
    return Zone(id_, name, floor, rings, is_fence=True)
