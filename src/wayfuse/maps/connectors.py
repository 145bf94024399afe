"""Connectors: what joins the floors of a building, as chu2009 Section 2.3 describes it.

A stairway, escalator or ramp joins the floors of its landings in turn; a lift serves every floor it has a landing
on, and no other: one that passes a floor without a stop has no landing there. A connector is a vertex of the
building graph (`wayfuse.maps.graph`), each landing an edge to the unit it opens into.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from itertools import pairwise
from typing import NamedTuple

from wayfuse.core.errors import MapError
from wayfuse.core.types import Array

__all__ = ["Connector", "ConnectorKind", "Landing"]


class ConnectorKind(StrEnum):
    """What kind of connector; people move on it by steps (stairs, ramp), or are moved (lift, escalator)."""

    STAIRS = "stairs"
    LIFT = "lift"
    ESCALATOR = "escalator"
    RAMP = "ramp"


class Landing(NamedTuple):
    """Where a connector meets a floor: index of the floor, and the place (m, frame of that floor)."""

    floor: int
    x: float
    y: float


@dataclass(frozen=True, slots=True, eq=False)
class Connector:
    """A stairway, lift, escalator or ramp.

    id : unique in the site. landings : bottom up, at least two on different floors.
    n_steps : stairs between one landing and the next, one number fewer than landings; empty where not known
    (chu2009's descriptor of a stairway). direction : +1 up only, -1 down only (escalators), 0 both ways.
    footprint : closed ring (k, 2) m in the frame of its lowest floor, None where not known (chu2009's "ground
    part" of a lift). name : as the plan has it.

    Raises
    ------
    MapError : fewer than two landings, landings not bottom up, or steps that do not match them; names the id.
    """

    id: str
    kind: ConnectorKind
    landings: tuple[Landing, ...]
    n_steps: tuple[int, ...] = ()
    direction: int = 0
    footprint: Array | None = None
    name: str = ""

    def __post_init__(self) -> None:
        floors = self.floors
        if len(floors) < 2 or any(a >= b for a, b in pairwise(floors)):
            raise MapError(
                f"connector {self.id} joins floors {', '.join(map(str, floors)) or 'none'}",
                remedy="give one landing per floor, at least two, the lowest floor first",
            )
        if self.n_steps and len(self.n_steps) != len(floors) - 1:
            raise MapError(
                f"connector {self.id} has {len(self.n_steps)} numbers of steps for {len(floors)} landings",
                remedy="give one number between each landing and the next, or none",
            )
        if self.direction not in (-1, 0, 1):
            raise MapError(f"connector {self.id} has direction {self.direction}", remedy="-1, 0 or 1")

    @property
    def floors(self) -> tuple[int, ...]:
        """Indices of the floors served, bottom up."""
        return tuple(landing.floor for landing in self.landings)

    def landing(self, floor: int) -> Landing | None:
        """The landing on a floor, None where the connector does not stop there."""
        return next((landing for landing in self.landings if landing.floor == floor), None)
