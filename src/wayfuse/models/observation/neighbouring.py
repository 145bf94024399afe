r"""Floors without a survey borrow the fingerprints of the floors next to them.

A mezzanine nobody surveyed is heard much like the halls above and below it. A neighbour on a surveyed floor counts
at the same place of an unsurveyed one with weight :math:`\exp(-\Delta z^2 / 2 \sigma_z^2)`; surveyed floors keep
to their own.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wayfuse.core.types import Array
from wayfuse.maps.site import Site
from wayfuse.radio.sparse_knn import Neighbours
from wayfuse.radio.survey import Survey

__all__ = ["NeighbouringFloors"]


@dataclass(frozen=True, slots=True, eq=False)
class NeighbouringFloors:
    """Which floor lends to which.

    weight : (floors, floors) of a fingerprint of the row's floor on the column's, 0 where it does not count. shift :
    (floors, floors, 2) m between their frames.
    """

    weight: Array
    shift: Array

    @classmethod
    def build(cls, site: Site, survey: Survey, sigma: float = 3.0) -> NeighbouringFloors | None:
        """Of a site and its survey; None where every floor is surveyed. sigma : m."""
        n = len(site.floors)
        surveyed = np.bincount(survey.floor, minlength=n) > 0
        if surveyed.all():
            return None
        z = np.array([floor.elevation for floor in site.floors])
        weight = np.exp(-0.5 * ((z[:, None] - z[None, :]) / sigma) ** 2)
        weight[~surveyed, :] = 0.0
        weight[:, surveyed] = 0.0
        shift = np.array([[site.shift(a, b) for b in range(n)] for a in range(n)])
        return cls(weight, shift)

    def lend(self, near: Neighbours) -> Neighbours:
        """The neighbours, and copies of them on the floors that borrow."""
        x, y, floor, weight = [near.x], [near.y], [near.floor], [near.weight]
        for to in np.flatnonzero(self.weight.any(axis=0)).tolist():
            lent = self.weight[near.floor, to]
            rows = np.flatnonzero(lent > 0.01)
            x.append((near.x[rows] + self.shift[near.floor[rows], to, 0]).astype(np.float32))
            y.append((near.y[rows] + self.shift[near.floor[rows], to, 1]).astype(np.float32))
            floor.append(np.full(len(rows), to, near.floor.dtype))
            weight.append((near.weight[rows] * lent[rows]).astype(np.float32))
        return near._replace(
            x=np.concatenate(x),
            y=np.concatenate(y),
            floor=np.concatenate(floor),
            weight=np.concatenate(weight),
        )
