"""How well a survey is found by itself, room by room: which rooms want more walks."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from wayfuse.core.types import Array
from wayfuse.maps.areas import distance_to_area
from wayfuse.maps.site import Site
from wayfuse.radio.survey import Survey
from wayfuse.radio.survey_accuracy import held_out

__all__ = ["RoomAccuracy", "held_out_by_room"]

_HELD_OUT = 1000  # fingerprints looked up again at most


class RoomAccuracy(NamedTuple):
    """Held-out errors in a room (empty name: outside all units). median, p90 : m, None where that fix is on a wrong
    floor. n : fingerprints looked up. right_floor : share of them."""

    level: str
    name: str
    n: int
    median: float | None
    p90: float | None
    right_floor: float


def held_out_by_room(site: Site, survey: Survey) -> list[RoomAccuracy]:
    """Errors of fingerprints found by the other walks, by floor and unit, most fingerprints first."""
    found = held_out(survey, _HELD_OUT)
    of: dict[tuple[int, str], list[float]] = {}
    for row, error in zip(found.rows.tolist(), found.errors.tolist(), strict=True):
        floor = int(survey.floor[row])
        of.setdefault((floor, _unit_at(site, floor, survey.xy[row])), []).append(error)
    rooms = [_room(site.floors[floor].name, name, errors) for (floor, name), errors in of.items()]
    return sorted(rooms, key=lambda room: (-room.n, room.level, room.name))


def _room(level: str, name: str, errors: list[float]) -> RoomAccuracy:
    ordered = np.sort(errors)
    median, p90 = (float(ordered[math.ceil(q * len(ordered)) - 1]) for q in (0.5, 0.9))
    right = float(np.mean(np.isfinite(ordered)))
    return RoomAccuracy(level, name, len(errors), _finite(median), _finite(p90), right)


def _unit_at(site: Site, floor: int, xy: Array) -> str:
    for unit in site.floors[floor].units:
        if distance_to_area(unit.polygon.rings, xy) == 0.0:
            return unit.name or unit.category or unit.id
    return ""


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None
