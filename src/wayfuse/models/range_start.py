"""Where a track by ranges begins: at the fix of the first ranges, or where it is told.

The fix is constrained weighted least squares from the weighted centroid (`radio.multilateration`, reference [4] of
li2015), the centroid itself where fewer than three anchors are heard. The anchors of the floor that has most of those
heard count. Particles are at rest (`models.motion.course_and_speed`), but for a spread.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from wayfuse.core.errors import ConfigError
from wayfuse.core.philox import Noise
from wayfuse.filters.cloud import Cloud
from wayfuse.radio.ap_places import ApPlaces
from wayfuse.radio.multilateration import constrained_least_squares, weighted_centroid
from wayfuse.radio.range_correction import AS_MEASURED, RangeLine
from wayfuse.radio.survey import Fingerprint
from wayfuse.sensors.records import Range

__all__ = ["RangeStart", "RestingStart"]

_FEW = 3  # anchors; with fewer there is no fix, and the centroid is as far off as the nearest range


@dataclass(frozen=True, slots=True)
class RestingStart:
    """About a place that is told, hardly moving.

    Parameters
    ----------
    x, y : m, frame of the floor. floor : index. sigma : m, speed_sigma : m/s, per axis.
    """

    x: float = 0.0
    y: float = 0.0
    floor: int = 0
    sigma: float = 3.0
    speed_sigma: float = 0.5

    def at(self, x: float, y: float, floor: int) -> RestingStart:
        """The same about another place."""
        return replace(self, x=x, y=y, floor=floor)

    def draw(self, noise: Noise, seen: object, n: int, *, heading_known: bool = True) -> Cloud:  # noqa: ARG002
        """n particles about the place, with the velocities of `models.motion.course_and_speed`."""
        z = noise.normals(n)
        vx, vy = self.speed_sigma * z[2].astype(np.float64), self.speed_sigma * z[3].astype(np.float64)
        return Cloud.on_floors(
            (self.x + self.sigma * z[0]).astype(np.float32),
            (self.y + self.sigma * z[1]).astype(np.float32),
            np.arctan2(vy, vx).astype(np.float32),
            np.hypot(vx, vy).astype(np.float32),
            np.full(n, self.floor, np.int32),
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class RangeStart:
    """Draws the first cloud.

    Parameters
    ----------
    places : of the anchors. line : from ranges to distances. sigma : m, per axis, about the fix;
    more where its ranges misfit it by more. speed_sigma : m/s, per axis.
    """

    places: ApPlaces
    line: RangeLine = AS_MEASURED
    sigma: float = 3.0
    speed_sigma: float = 0.5

    def __post_init__(self) -> None:
        if not (self.sigma > 0.0 and self.speed_sigma >= 0.0):
            raise ConfigError(
                f"sigma must be positive, speed_sigma not negative, got {self}", where="RangeStart"
            )

    def draw(self, noise: Noise, seen: object, n: int, *, heading_known: bool) -> Cloud | None:  # noqa: ARG002
        """n particles; None where no range to a known anchor was seen."""
        fix = self._fix(seen)
        return None if fix is None else RestingStart(*fix, speed_sigma=self.speed_sigma).draw(noise, seen, n)

    def _fix(self, seen: object) -> tuple[float, float, int, float] | None:
        if seen is None or isinstance(seen, Fingerprint) or not isinstance(seen, tuple | list):
            return None
        ranges = [r for r in seen if isinstance(r, Range)]
        rows = self.places.rows(np.array([r.anchor for r in ranges], np.uint64))
        known = rows[rows >= 0]
        if not len(known):
            return None
        floor = int(np.argmax(np.bincount(self.places.floor[known])))
        mine = (rows >= 0) & (self.places.floor[rows] == floor)
        distance = self.line.distance([r.distance for r in ranges])[mine]
        xy = self.places.xy[rows[mine]]
        if int(mine.sum()) < _FEW:
            x, y = weighted_centroid(xy, distance[None])[0].tolist()
            return x, y, floor, max(self.sigma, float(distance.min()))
        x, y = constrained_least_squares(xy, distance[None])[0].tolist()
        misfit = distance - np.hypot(xy[:, 0] - x, xy[:, 1] - y)
        return x, y, floor, max(self.sigma, float(np.sqrt(np.mean(misfit**2))))
