"""Stairways, lifts and escalators as a walker meets them: what one walks, climbs or rides between two landings.

`wayfuse.maps.connectors.Connector` says what a plan knows of a connector; a `Passage` adds where one puts
one's feet inside it, in pieces (`Stretch`) that a walker turns into steps or a ride.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from typing import NamedTuple

import numpy as np

from wayfuse.core.types import Array
from wayfuse.maps.connectors import Connector, ConnectorKind, Landing

__all__ = ["Activity", "Passage", "Stretch", "escalator", "lift", "stairway"]

TREAD, RISER = 0.30, 0.17  # m, depth and height of a step: what building codes take as comfortable


class Activity(IntEnum):
    """What a walker does."""

    STILL = 0
    WALKING = 1
    STAIRS = 2
    LIFT = 3
    ESCALATOR = 4


class Stretch(NamedTuple):
    """A straight piece of a way: where it ends (x, y, m), what one does on it, height gained (m), stairs."""

    x: float
    y: float
    activity: Activity
    rise: float = 0.0
    n_steps: int = 0


@dataclass(frozen=True, slots=True, eq=False)
class Passage:
    """A connector and the ways through it.

    ways : for each landing but the last, the stretches up to the next one; a lift has one, made anew for each
    ride. footprint : corners (n, 2) m on every floor, not repeated. open_edges : for each landing the edge of
    the footprint (from corner k to k + 1) without a wall. heights : of the
    landings above the lowest (m).
    """

    connector: Connector
    footprint: Array
    open_edges: tuple[int, ...]
    ways: tuple[tuple[Stretch, ...], ...]
    heights: tuple[float, ...]

    @property
    def is_lift(self) -> bool:
        """Whether one rides instead of climbing."""
        return self.connector.kind is ConnectorKind.LIFT

    def way(self, start: int, stop: int) -> tuple[Stretch, ...]:
        """Stretches from the landing on floor ``start`` to that on floor ``stop``, the first landing left out.

        A stairway is climbed from one landing to the next or back; a lift goes to any floor it serves; an
            escalator goes its own way only.
        """
        i, j = self.connector.floors.index(start), self.connector.floors.index(stop)
        if self.is_lift:
            inside = self.ways[0][0]
            ride = inside._replace(activity=Activity.LIFT, rise=self.heights[j] - self.heights[i])
            return (inside, ride, _level(self.connector.landings[j]))
        if abs(j - i) != 1:
            raise ValueError(f"{self.connector.id}: floors {start} and {stop} are not next to each other")
        if (j - i) * self.connector.direction < 0:
            raise ValueError(f"{self.connector.id}: it does not go from floor {start} to floor {stop}")
        return self.ways[i] if j > i else _reverse(self.ways[j], self.connector.landings[j])

    def walls(self, floor: int) -> Array:
        """Edges (w, 4) m of the footprint on a floor it serves, but for the open one."""
        return np.delete(self._edges(), self.open_edges[self.connector.floors.index(floor)], axis=0)

    def opening(self, floor: int) -> Array:
        """The open edge (4,) m on a floor it serves."""
        return np.asarray(self._edges()[self.open_edges[self.connector.floors.index(floor)]])

    def _edges(self) -> Array:
        return np.hstack([self.footprint, np.roll(self.footprint, -1, axis=0)])


def stairway(
    ident: str,
    landings: tuple[Landing, ...],
    ways: tuple[tuple[Stretch, ...], ...],
    footprint: Array,
    open_edges: tuple[int, ...],
) -> Passage:
    """Stairs through the given ways up."""
    counts = tuple(sum(piece.n_steps for piece in way) for way in ways)
    heights = np.concatenate([[0.0], np.cumsum([sum(piece.rise for piece in way) for way in ways])])
    connector = Connector(ident, ConnectorKind.STAIRS, landings, counts, 0, _ring(footprint), ident)
    return Passage(connector, footprint, open_edges, ways, tuple(heights.tolist()))


def escalator(
    ident: str,
    landings: tuple[Landing, Landing],
    way: tuple[Stretch, ...],
    footprint: Array,
    open_edges: tuple[int, int],
) -> Passage:
    """An escalator up the given way."""
    height = sum(piece.rise for piece in way)
    connector = Connector(ident, ConnectorKind.ESCALATOR, landings, (), 1, _ring(footprint), ident)
    return Passage(connector, footprint, open_edges, (way,), (0.0, height))


def lift(
    ident: str, landings: tuple[Landing, ...], heights: tuple[float, ...], footprint: Array, open_edge: int
) -> Passage:
    """A lift whose cabin fills its footprint, the door at one edge."""
    x, y = footprint.mean(axis=0).tolist()
    connector = Connector(ident, ConnectorKind.LIFT, landings, (), 0, _ring(footprint), ident)
    inside = Stretch(x, y, Activity.WALKING)
    return Passage(connector, footprint, (open_edge,) * len(landings), ((inside,),), heights)


def _level(landing: Landing) -> Stretch:
    return Stretch(landing.x, landing.y, Activity.WALKING)


def _reverse(way: tuple[Stretch, ...], bottom: Landing) -> tuple[Stretch, ...]:
    """The same way down: each stretch ends where it began."""
    starts = [(bottom.x, bottom.y), *((piece.x, piece.y) for piece in way[:-1])]
    return tuple(
        piece._replace(x=x, y=y, rise=-piece.rise)
        for piece, (x, y) in zip(reversed(way), reversed(starts), strict=True)
    )


def _ring(footprint: Array) -> Array:
    return np.concatenate([footprint, footprint[:1]])
