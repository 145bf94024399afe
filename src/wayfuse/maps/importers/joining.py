"""Join what plans draw of stairs and lifts, floor by floor, into connectors with a landing on each floor.

A piece is one drawn area and the floors it is drawn for. Pieces for several floors are connectors as they are.
Pieces for one floor only are joined with what they overlap: on their own floor (a plan may draw each flight), and
on the next floor above or below, where a stairwell or a shaft continues. Whatever is left serves one floor: it
leads nowhere, is no connector, and is noted as such.

A landing lies where the piece opens to its floor: before the widest door in its edge, else before the longest stretch
of its edge without wall, else (it is mostly open, or opens to nothing walkable) in its middle.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from itertools import combinations
from typing import Any

import numpy as np

from wayfuse.core.types import Array
from wayfuse.maps.connectors import Connector, ConnectorKind, Landing
from wayfuse.maps.importers.report import Notes
from wayfuse.maps.site import Floor

__all__ = ["KINDS", "Piece", "join_pieces"]

KINDS = {
    "elevator": ConnectorKind.LIFT,
    "escalator": ConnectorKind.ESCALATOR,
    "movingwalkway": ConnectorKind.RAMP,
    "ramp": ConnectorKind.RAMP,
    "stairs": ConnectorKind.STAIRS,
    "steps": ConnectorKind.STAIRS,
}  # of the categories of units
TOUCHING = 0.3  # m, flights drawn this near are one stairway
SHARED = 0.25  # of the smaller area: pieces of two floors that share less are different stairs
WALL_NEAR = 0.15  # m, an edge with a wall this near is closed
NARROWEST = 0.4  # m, a shorter gap in the walls of a piece is no way in
MOSTLY = 0.5  # of the edge without wall: the piece is open, and has no entrance
BEFORE = 0.4  # m, a landing lies this far before the door
CLEAR = 0.2  # m, from the walls: no landing in the slit between two of them
SEARCHED = 1.5  # m, from a landing that is not walkable to a place that is


@dataclass(frozen=True, slots=True)
class Piece:
    """An area (shapely, m) of a connector and the floors (indices) it is drawn for.

    places : landings (m) where the plan says them, by floor. n_steps : of the flight between two floors, 0 where
    not known. direction : as `Connector`.
    """

    id: str
    kind: ConnectorKind
    shape: Any
    floors: tuple[int, ...]
    name: str = ""
    n_steps: int = 0
    direction: int = 0
    places: dict[int, tuple[float, float]] = field(default_factory=dict)


def join_pieces(floors: Sequence[Floor], pieces: Iterable[Piece], notes: Notes) -> tuple[Connector, ...]:
    """Connectors of a site; pieces that lead nowhere are added to ``notes``.

    The frames of the floors must be one (their places comparable).
    """
    found: list[Connector] = []
    for group in _groups(list(pieces)):
        first = group[0]
        served = sorted({k for piece in group for k in piece.floors})
        if len(served) < 2:
            where = floors[served[0]].name if served else ""
            what = f"{first.kind} on floor {where} only: leads nowhere"
            notes.add("connector-to-nowhere", first.id, what)
            continue
        landings = tuple(_landing(floors[k], k, group) for k in served)
        known = [piece for piece in group if piece.n_steps and len(served) == 2]
        found.append(
            Connector(
                id=_unused(first.id, found),
                kind=first.kind,
                landings=landings,
                n_steps=(known[0].n_steps,) if known else (),
                direction=first.direction,
                footprint=_footprint(_on(group, served[0])),
                name=next((piece.name for piece in group if piece.name), ""),
            )
        )
    return tuple(sorted(found, key=lambda connector: connector.id))


def _unused(ident: str, found: list[Connector]) -> str:
    taken = {connector.id for connector in found}
    number = 2
    name = ident
    while name in taken:
        name, number = f"{ident} ({number})", number + 1
    return name


def _groups(pieces: list[Piece]) -> list[list[Piece]]:
    """Pieces of each connector: those of one id, those for one floor that belong together, then both."""
    root = list(range(len(pieces)))
    alone = [i for i, piece in enumerate(pieces) if len(piece.floors) == 1]
    several = [i for i, piece in enumerate(pieces) if len(piece.floors) > 1]

    def find(i: int) -> int:
        while root[i] != i:
            i = root[i]
        return i

    def join(i: int, j: int) -> None:
        low, high = sorted((find(i), find(j)))
        root[high] = low

    for i, j in combinations(range(len(pieces)), 2):
        if pieces[i].id == pieces[j].id:
            join(i, j)
    for i, j in combinations(alone, 2):
        if _belong(pieces[i], pieces[j]):
            join(i, j)
    for i in {
        find(i) for i in alone
    }:  # one part of a stairwell must not join two that only stand side by side
        near = [
            (pieces[i].shape.intersection(pieces[j].shape).area, j)
            for j in several
            if _belong(pieces[i], pieces[j])
        ]
        if near:
            join(i, max(near)[1])
    groups: dict[int, list[Piece]] = {}
    for i, piece in enumerate(pieces):
        groups.setdefault(find(i), []).append(piece)
    return list(groups.values())


def _belong(a: Piece, b: Piece) -> bool:
    if a.kind is not b.kind or a.direction != b.direction:
        return False
    apart = min(abs(k - m) for k in a.floors for m in b.floors)
    if apart == 0 and a.kind is ConnectorKind.STAIRS:
        return bool(a.shape.distance(b.shape) <= TOUCHING)
    shared, smaller = a.shape.intersection(b.shape).area, min(a.shape.area, b.shape.area)
    return apart <= 1 and bool(shared > SHARED * smaller)


def _on(group: list[Piece], floor: int) -> Any:
    import shapely

    return shapely.union_all([piece.shape for piece in group if floor in piece.floors])


def _footprint(shape: Any) -> Array | None:
    from shapely import get_parts
    from shapely.geometry.polygon import orient

    parts = [part for part in get_parts(shape) if part.geom_type == "Polygon"]
    if not parts:
        return None
    largest = max(parts, key=lambda part: float(part.area))
    return np.asarray(orient(largest).exterior.coords)[:, :2].copy()


def _landing(floor: Floor, index: int, group: list[Piece]) -> Landing:
    known = [piece.places[index] for piece in group if index in piece.places]
    shape = _on(group, index)
    x, y = known[0] if known else _entrance(floor, shape)
    if not floor.walkable.contains([x], [y])[0]:
        x, y = _nearest_walkable(floor, x, y)
    return Landing(index, x, y)


def _entrance(floor: Floor, shape: Any) -> tuple[float, float]:
    """Where a piece opens to the rest of its floor: see the module's words."""
    import shapely

    edge = shape.boundary
    doors: Any = shapely.linestrings(_near(floor.doors, shape).reshape(-1, 2, 2))
    walls = shapely.linestrings(_near(floor.walls, shape).reshape(-1, 2, 2))
    bare = edge.difference(shapely.union_all(walls).buffer(WALL_NEAR))
    gaps = [part for part in shapely.get_parts(shapely.line_merge(bare)) if part.length >= NARROWEST]
    ways = sorted((door for door in doors if door.distance(edge) <= WALL_NEAR + 0.1), key=_shortness)
    if bare.length <= MOSTLY * edge.length:
        ways += sorted(gaps, key=_shortness)
    places = (_before(floor, shape, way) for way in ways)
    middle = shape.representative_point()
    return next((place for place in places if place is not None), (float(middle.x), float(middle.y)))


def _shortness(line: Any) -> float:
    return -float(line.length)


def _near(segments: Array, shape: Any) -> Array:
    """Those of some segments (w, 4) m whose box comes near that of a shape."""
    x0, y0, x1, y1 = shape.bounds
    low = np.minimum(segments[:, :2], segments[:, 2:]) - 1.0
    high = np.maximum(segments[:, :2], segments[:, 2:]) + 1.0
    return np.asarray(segments[np.all((low <= (x1, y1)) & (high >= (x0, y0)), axis=1)])


def _before(floor: Floor, shape: Any, gap: Any) -> tuple[float, float] | None:
    """Walkable place before the middle of a gap outside a piece; None where there is none (it leads out)."""
    import shapely

    at = gap.interpolate(0.5, normalized=True)
    angles = np.arange(16) * (np.pi / 8)
    around = np.column_stack([at.x + BEFORE * np.cos(angles), at.y + BEFORE * np.sin(angles)])
    outside = shapely.distance(shape, shapely.points(around))
    walkable = floor.walkable.contains(around[:, 0], around[:, 1])
    crossing = floor.wall_index.crosses(at.x, at.y, around[:, 0], around[:, 1])
    walls: Any = shapely.linestrings(_near(floor.walls, shape).reshape(-1, 2, 2))
    clear = shapely.distance(shapely.union_all(walls), shapely.points(around)) if len(walls) else np.inf
    free = np.where(walkable & ~crossing & (clear > CLEAR), outside, 0.0)
    best = int(np.argmax(free))
    return (float(around[best, 0]), float(around[best, 1])) if free[best] > 0.5 * BEFORE else None


def _nearest_walkable(floor: Floor, x: float, y: float) -> tuple[float, float]:
    """Centre of the nearest walkable cell, or the place itself where none is near."""
    centres = floor.walkable.centres()
    if not len(centres):
        return x, y
    distance = np.hypot(centres[:, 0] - x, centres[:, 1] - y)
    best = int(np.argmin(distance))
    return (x, y) if distance[best] > SEARCHED else (float(centres[best, 0]), float(centres[best, 1]))
