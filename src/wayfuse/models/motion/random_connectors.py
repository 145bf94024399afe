"""Somebody of whom no sensor tells anything may take any stairs or lift: floors for a filter without motion sensors.

chu2009 compares itself with such a filter in a building of three floors and does not say how its particles change
floors; here those near a landing do so with a small chance per second.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wayfuse.core.errors import ConfigError
from wayfuse.core.philox import Noise
from wayfuse.filters.cloud import Cloud
from wayfuse.maps.site import Site

__all__ = ["RandomConnectors"]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RandomConnectors:
    """Parameters: site. reach : m from a landing. chance : per second of those within it, to be at the connector's
    landing of another floor."""

    site: Site
    reach: float = 3.0
    chance: float = 0.1

    def __post_init__(self) -> None:
        if not (self.reach > 0.0 and 0.0 <= self.chance <= 1.0):
            raise ConfigError(
                f"reach must be positive, chance a share, got {self.reach}, {self.chance}",
                where="RandomConnectors",
            )

    def propagate(self, noise: Noise, cloud: Cloud, event: float) -> Cloud:
        """``event`` seconds pass."""
        u = noise.uniforms(cloud.n)
        takes = u[0] < 1.0 - (1.0 - self.chance) ** max(event, 0.0)
        x, y, floor = cloud.x.copy(), cloud.y.copy(), cloud.floor.copy()
        for connector in self.site.connectors:
            for here in connector.landings:
                near = (cloud.floor == here.floor) & takes
                rows = np.flatnonzero(near & (np.hypot(cloud.x - here.x, cloud.y - here.y) <= self.reach))
                others = [landing for landing in connector.landings if landing.floor != here.floor]
                choice = np.minimum((u[1, rows] * len(others)).astype(np.int64), len(others) - 1)
                table = np.array(others)[choice]  # floor, x, y
                floor[rows], x[rows], y[rows] = table[:, 0], table[:, 1], table[:, 2]
        return cloud._replace(x=x, y=y, floor=floor)
