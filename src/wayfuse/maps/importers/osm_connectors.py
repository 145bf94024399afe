"""What the tags of OpenStreetMap say of a flight of stairs, an escalator or a lift.

`step_count`, `incline` (up or down along the way as drawn) and `conveying` (forward or backward along it,
reversible) tell number of steps, ends and direction. Units of both ends: metres of the site's frame.
"""

from __future__ import annotations

from typing import Any

from wayfuse.core.frames import GeoAnchor
from wayfuse.maps.connectors import ConnectorKind
from wayfuse.maps.importers.joining import Piece
from wayfuse.maps.importers.osm_elements import Element

__all__ = ["piece_of"]

MOST_STEPS = 1000  # of a flight; more is a mistake


def piece_of(
    element: Element, kind: ConnectorKind, shape: Any, served: tuple[int, ...], anchor: GeoAnchor
) -> Piece:
    """Piece of a connector that serves these floors (indices, ascending)."""
    tags = element.tags
    rises = {"up": 1, "down": -1}.get(tags.get("incline", ""), 0)
    moves = {"forward": 1, "backward": -1}.get(tags.get("conveying", ""), 0)
    places = {}
    if rises and element.line is not None and not element.polygons and len(served) > 1:
        line = anchor.to_xy(element.line)
        low, high = (line[0], line[-1]) if rises > 0 else (line[-1], line[0])
        places = {served[0]: _pair(low), served[-1]: _pair(high)}
    steps = tags.get("step_count", "")
    n_steps = int(steps) if steps.isascii() and steps.isdigit() and len(steps) < 5 else 0
    return Piece(
        id=element.id,
        kind=kind,
        shape=shape,
        floors=served,
        name=tags.get("name") or tags.get("ref") or "",
        n_steps=n_steps if n_steps <= MOST_STEPS else 0,
        direction=rises * moves,
        places=places,
    )


def _pair(place: Any) -> tuple[float, float]:
    return float(place[0]), float(place[1])
