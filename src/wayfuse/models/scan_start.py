"""Where a track begins: anywhere, on training places likely by the first scan, or on the mean of the nearest."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from wayfuse.core.errors import ConfigError
from wayfuse.core.philox import Noise
from wayfuse.core.types import Array, IdArray, IntArray
from wayfuse.filters.cloud import Cloud
from wayfuse.filters.particle_filter import Constraint
from wayfuse.maps.walkable import Walkable
from wayfuse.radio.interpolated_map import InterpolatedMap
from wayfuse.radio.survey import Fingerprint, Fix
from wayfuse.sensors.records import Range

__all__ = ["AnywhereAtRest", "LikelyPlaces", "NearestPlaces"]


class _Locates(Protocol):
    def locate(self, fingerprint: Fingerprint) -> Fix: ...

    @property
    def bssid(self) -> IdArray: ...


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class AnywhereAtRest:
    """Particles uniform over the walkable space of a building. walkable : mask per floor."""

    walkable: tuple[Walkable, ...]

    def draw(
        self, noise: Noise, seen: Fingerprint | Sequence[Range] | None, n: int, *, heading_known: bool
    ) -> Cloud:
        """n particles, whatever is seen."""
        del seen, heading_known
        centres = [mask.centres() for mask in self.walkable]
        xy = np.concatenate(centres)
        floor = np.repeat(np.arange(len(centres)), [len(part) for part in centres])
        row = np.minimum((noise.uniforms(n)[0] * len(xy)).astype(np.int64), len(xy) - 1)
        return _at_rest(xy[row], floor[row])  # in the middle of a cell: its edge may be a wall


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LikelyPlaces:
    """Particles on training places drawn by their likelihood, each in a disc about its place.

    Parameters
    ----------
    radio_map : whose places. radius : m, of the disc, uniform in radius as Eq. 3.3 of chu2009. most : access points
    that the scan may count for, as in `MapLikelihood`. walls : nobody is drawn through a wall.
    """

    radio_map: InterpolatedMap
    radius: float = 3.0
    most: float = 11.0
    walls: Constraint | None = None

    def __post_init__(self) -> None:
        if not (self.radius > 0.0 and self.most > 0.0):
            raise ConfigError(
                f"radius and most must be positive, got {self.radius}, {self.most}", where="LikelyPlaces"
            )

    def draw(
        self, noise: Noise, seen: Fingerprint | Sequence[Range] | None, n: int, *, heading_known: bool
    ) -> Cloud | None:
        """n particles; None where nothing known is heard. Headings are the sensors', known or not."""
        del heading_known
        if not isinstance(seen, Fingerprint):
            return None
        at_places = self.radio_map.at_places(seen)
        if at_places is None:
            return None
        n_known = int(np.isin(seen.bssid, self.radio_map.bssid).sum())
        at_places = at_places * min(1.0, self.most / n_known)
        total = np.cumsum(np.exp(at_places - at_places.max()))
        u = noise.uniforms(n)
        row = np.minimum(np.searchsorted(total, u[0] * total[-1]), len(total) - 1)
        place = _at_rest(self.radio_map.xy[row], self.radio_map.floor[row])
        r, theta = self.radius * u[1], 2.0 * np.pi * u[2]
        x, y = place.x + r * np.cos(theta), place.y + r * np.sin(theta)
        cloud = place._replace(x=x.astype(np.float32), y=y.astype(np.float32))
        if self.walls is not None:
            cloud, _ = self.walls.restrict(place, cloud, np.zeros(n))
        return cloud


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class NearestPlaces:
    """All particles on one place: what a radio map makes of the scan (he2014: the mean of k nearest fingerprints)."""

    radio_map: _Locates

    def draw(
        self, noise: Noise, seen: Fingerprint | Sequence[Range] | None, n: int, *, heading_known: bool
    ) -> Cloud | None:
        """n particles; None where nothing known is heard."""
        del noise, heading_known
        if not isinstance(seen, Fingerprint) or not np.isin(seen.bssid, self.radio_map.bssid).any():
            return None
        fix = self.radio_map.locate(seen)
        return _at_rest(np.tile([[fix.x, fix.y]], (n, 1)), np.full(n, fix.floor))


def _at_rest(xy: Array, floor: IntArray) -> Cloud:
    n = len(xy)
    x, y = xy.T.astype(np.float32)
    zero = np.zeros(n, np.float32)
    return Cloud.on_floors(x, y, zero, zero + 1, floor.astype(np.int32))
