"""Truth of a walk: linear in time between the places the surveyor stated, and the times at which errors are
taken.

Protocol (online figures). The 1 Hz grid is the first waypoint's time + 0, 1, 2, ... s, up to the last
waypoint; the waypoint points are the waypoints themselves. Both count from the first Wi-Fi scan on: before it
nothing is knowable. Between two waypoints on different floors the floor changes at an unknown moment: the
floor of the waypoint nearer in time is taken.

Places are compared in metres of one frame, that of the site's reference floor: the floors of a site may each
have their own origin (`wayfuse.maps.site`), so that an estimate on a wrong floor is shifted before it is
compared. Waypoints in degrees go through the site's anchor where there is one, else through a tangent plane
at the first waypoint, into which the estimates' lat and lon are taken too.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from wayfuse.core.errors import UsageError
from wayfuse.core.frames import GeoAnchor
from wayfuse.core.types import Array, BoolArray, IntArray
from wayfuse.sensors.recording import Recording
from wayfuse.sensors.records import Waypoint

__all__ = ["TIMES", "TIME_TOLERANCE", "CommonFrame", "SiteFloors", "Truth", "first_radio", "truth_of"]

TIME_TOLERANCE = 1e-6  # s: what rounding to EST.csv's 0.001 ms and back may move a time
TIMES = ("1hz", "waypoints")


class _Named(Protocol):
    @property
    def name(self) -> str: ...


class SiteFloors(Protocol):
    """What scoring asks of a `wayfuse.maps.site.Site`."""

    @property
    def floors(self) -> Sequence[_Named]:
        """Floors, bottom up."""
        ...

    @property
    def reference(self) -> int:
        """Index of the floor whose frame is the common one."""
        ...

    @property
    def anchor(self) -> GeoAnchor | None:
        """From the common frame to degrees, None where the site is not georeferenced."""
        ...

    def shift(self, source: int, target: int) -> Array:
        """Offset (2,) m that takes a place of one floor's frame into that of another."""
        ...


@dataclass(frozen=True, slots=True, eq=False)
class CommonFrame:
    """Floors by name, and the one frame in which places of all floors are compared.

    Without a site all floors share their frame, and floors whose names differ are one floor apart. Case does
    not matter in names.
    """

    site: SiteFloors | None = None

    def index(self, names: NDArray[np.str_]) -> IntArray:
        """Floor index (n,) of names (n,), -1 where the site has none of that name."""
        known = [] if self.site is None else [f.name.casefold() for f in self.site.floors]
        unique, inverse = np.unique(names, return_inverse=True)
        indices = [known.index(u.casefold()) if u.casefold() in known else -1 for u in unique.tolist()]
        return np.asarray(indices, dtype=np.int64)[inverse]

    def shift(self, names: NDArray[np.str_]) -> Array:
        """Offset (n, 2) m from the frame of each named floor to the common frame; 0 for unknown floors."""
        if self.site is None:
            return np.zeros((len(names), 2))
        reference = self.site.reference
        table = [self.site.shift(i, reference) for i in range(len(self.site.floors))]
        return np.stack([*table, np.zeros(2)])[self.index(names)]

    def steps(self, names: NDArray[np.str_], truth: NDArray[np.str_]) -> Array:
        """Floors (n,) between estimates and truth, NaN where the truth names none.

        A floor that the site does not have is one floor away from all others.
        """
        folded = np.char.lower(names), np.char.lower(truth)
        steps = (folded[0] != folded[1]).astype(np.float64)
        if self.site is not None:
            a, b = self.index(names), self.index(truth)
            steps = np.where((a >= 0) & (b >= 0), np.abs(a - b).astype(np.float64), steps)
        return np.where(truth == "", np.nan, steps)


@dataclass(frozen=True, slots=True, eq=False)
class Truth:
    """Truth of one walk.

    t : (n,) s, ascending. xy : (n, 2) m, common frame or, where ``plane`` is set, the tangent plane that
    takes degrees to metres. floor : (n,) names, empty where unknown. start : s, the first radio record (the
    first waypoint where there is none). has_radio : whether there was one.
    """

    walk: str
    t: Array
    xy: Array
    floor: NDArray[np.str_]
    start: float
    has_radio: bool = True
    plane: GeoAnchor | None = None

    def at(self, t: Array) -> tuple[Array, NDArray[np.str_]]:
        """Places (k, 2) m, linear in time, and floors (k,) at times (k,) within the span of the waypoints."""
        xy = np.stack([np.interp(t, self.t, self.xy[:, k]) for k in (0, 1)], axis=1)
        middle = 0.5 * (self.t[1:] + self.t[:-1])
        return xy, self.floor[np.searchsorted(middle, t, side="left")]

    def in_transit(self, t: Array) -> BoolArray:
        """Whether the waypoints before and after each time are on different floors."""
        i = np.clip(np.searchsorted(self.t, t + TIME_TOLERANCE, side="right") - 1, 0, len(self.t) - 1)
        j = np.minimum(i + 1, len(self.t) - 1)
        return np.asarray((self.floor[i] != self.floor[j]) & (t - self.t[i] > TIME_TOLERANCE))

    def times(self, at: str) -> Array:
        """All evaluation times (s) from the first waypoint to the last: ``at`` = "1hz" or "waypoints".

        Raises
        ------
        UsageError
            if ``at`` is another word.
        """
        if at == "waypoints":
            return self.t
        if at != "1hz":
            raise UsageError(f"no such evaluation times: {at!r}", remedy=f"use one of {TIMES}")
        n = int(np.floor(self.t[-1] - self.t[0] + TIME_TOLERANCE)) + 1
        return np.asarray(self.t[0] + np.arange(n, dtype=np.float64))


def first_radio(recording: Recording) -> float | None:
    """Time (s) of the first Wi-Fi scan; without any, of the first range, channel state or Bluetooth
    reading."""
    if recording.wifi:
        return recording.wifi[0].t
    firsts = [events[0].t for events in (recording.ranges, recording.csi, recording.ble) if events]
    return min(firsts, default=None)


def truth_of(recording: Recording, frame: CommonFrame | None = None) -> Truth | None:
    """Truth of a recording; None where it holds no usable waypoint.

    Waypoints in metres are taken where there are any, else those in degrees; of waypoints at the same time
    the first one is kept. A waypoint without a floor is on the floor that the recording names, if it does.
    """
    frame = CommonFrame() if frame is None else frame
    points = sorted(recording.waypoints, key=lambda w: w.t)
    metres = [w for w in points if np.isfinite(w.x) and np.isfinite(w.y)]
    degrees = [w for w in points if np.isfinite(w.lat) and np.isfinite(w.lon)]
    kept = metres or degrees
    if not kept:
        return None
    first = np.unique(np.round([w.t for w in kept], 6), return_index=True)[1]
    kept = [kept[i] for i in first]
    t = np.array([w.t for w in kept], dtype=np.float64)
    floor = np.array([w.floor or recording.floor for w in kept], dtype=np.str_)
    xy, plane = _places(kept, floor, frame) if metres else _geo_places(kept, frame)
    radio = first_radio(recording)
    return Truth(
        walk=recording.name,
        t=t,
        xy=xy,
        floor=floor,
        start=float(t[0]) if radio is None else radio,
        has_radio=radio is not None,
        plane=plane,
    )


def _places(points: list[Waypoint], floor: NDArray[np.str_], frame: CommonFrame) -> tuple[Array, None]:
    xy = np.array([(w.x, w.y) for w in points], dtype=np.float64)
    return xy + frame.shift(floor), None


def _geo_places(points: list[Waypoint], frame: CommonFrame) -> tuple[Array, GeoAnchor | None]:
    lonlat = np.array([(w.lon, w.lat) for w in points], dtype=np.float64)
    anchor = None if frame.site is None else frame.site.anchor
    if anchor is not None:
        return anchor.to_xy(lonlat), None
    plane = GeoAnchor.from_origin(points[0].lon, points[0].lat)
    return plane.to_xy(lonlat), plane
