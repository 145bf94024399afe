"""From a weighted cloud to one estimate: the point, its covariance, and the radii that hold the truth.

The point is the geometric median of the particles on the heaviest floor: with a cloud of two lumps the mean lies
between them, where nobody is. The radii are weighted quantiles of the particles' distances, made honest by an affine
map fitted on recordings with known truth (a filter that tempers its likelihoods by feel is calibrated by data).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from wayfuse.core.errors import ConfigError
from wayfuse.core.types import Array, Array32
from wayfuse.filters._kernels import floor_masses, geometric_median, reaching, scatter
from wayfuse.filters.particle_filter import Snapshot
from wayfuse.maps.walkable import Walkable
from wayfuse.tracking.estimate import Estimate, State

__all__ = ["Held", "Summary", "on_walkable", "summarise"]

_SMOOTH = 0.5  # m; Weiszfeld's weights are 1 / max(distance, about this)


@dataclass(frozen=True, slots=True, kw_only=True)
class Summary:
    """How a cloud is summed up.

    median_iterations : Weiszfeld steps, 0 = the mean. scale_68, scale_95, offset_68, offset_95 : radius = offset (m)
    + scale * weighted quantile.
    """

    median_iterations: int = 8
    scale_68: float = 1.0
    offset_68: float = 0.0
    scale_95: float = 1.0
    offset_95: float = 0.0

    def __post_init__(self) -> None:
        if self.median_iterations < 0 or min(self.scale_68, self.scale_95) <= 0.0:
            raise ConfigError("median_iterations must not be negative, scales positive", where="Summary")


class Held(NamedTuple):
    """The floor said before, kept while at least a share of the weight is on it: nobody flickers between floors."""

    floor: int
    share: float


def summarise(
    cloud: Snapshot, weights: Array, n_floors: int, t: float, how: Summary, held: Held | None = None
) -> Estimate:
    """The estimate of a cloud (N,) with normalised weights (N,), on the heaviest floor or the one held to."""
    mass = np.empty(n_floors)
    floor_masses(cloud.floor, weights, mass)
    floor = int(np.argmax(mass))
    if held is not None and mass[held.floor] >= held.share:
        floor = held.floor
    x, y = geometric_median(cloud.x, cloud.y, cloud.floor, weights, floor, how.median_iterations, _SMOOTH)
    radius = np.empty_like(cloud.x)
    xx, xy, yy = scatter(cloud.x, cloud.y, cloud.floor, weights, floor, x, y, radius)
    r68, r95 = _weighted_quantiles(radius, weights, (0.68, 0.95))
    r68 = how.offset_68 + how.scale_68 * r68
    r95 = max(how.offset_95 + how.scale_95 * r95, r68)
    return Estimate(t, x, y, floor, xx, xy, yy, r68, r95, State.TRACKING)


def on_walkable(estimate: Estimate, cloud: Snapshot, walkable: tuple[Walkable, ...]) -> Estimate:
    """The estimate, moved to the nearest particle of its floor where it lies in a wall, a shop or a void.

    A median of particles on both sides of an atrium lies in the atrium. Empty ``walkable`` = no map, nothing moves.
    """
    if not walkable or walkable[estimate.floor].holds(estimate.x, estimate.y):
        return estimate
    dx, dy = cloud.x - np.float32(estimate.x), cloud.y - np.float32(estimate.y)
    squared = np.where(cloud.floor == estimate.floor, dx * dx + dy * dy, np.inf)
    nearest = int(np.argmin(squared))
    return estimate._replace(x=float(cloud.x[nearest]), y=float(cloud.y[nearest]))


def _weighted_quantiles(values: Array32, weights: Array, shares: tuple[float, float]) -> tuple[float, float]:
    """Weighted quantiles of values that are not negative: the bits of such numbers sort as the numbers do."""
    order = values.view(np.uint32).astype(np.uint64)
    order <<= np.uint64(32)
    order |= np.arange(len(values), dtype=np.uint64)
    order.sort()  # keys are sorted several times as fast as places are found
    i, j = reaching(order, weights, *shares)
    return float(values[i]), float(values[j])
