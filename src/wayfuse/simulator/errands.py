"""Walks over a net of ways in open space: from one place of interest to the next, each by the shortest way.

On a corridor graph a walker may turn at any node (`wayfuse.simulator.routes`); on a net that would be zigzag.
"""

from __future__ import annotations

import numpy as np

from wayfuse.core.types import IntArray
from wayfuse.simulator.building import Building, Storey
from wayfuse.simulator.journeys import Journey, shortest
from wayfuse.simulator.passages import Activity, Stretch
from wayfuse.simulator.routes import AT_EASE, Manner, beside
from wayfuse.simulator.travel import Leg

__all__ = ["errands"]

_ASKED = 24  # places of interest to choose from
_AROUND = 8.0  # m about a place that counts as seen with it


def errands(
    building: Building,
    floor: int,
    length: float,
    rng: np.random.Generator,
    *,
    manner: Manner = AT_EASE,
    visits: IntArray | None = None,
) -> Journey:
    """A walk of about ``length`` m on one floor.

    Parameters
    ----------
    manner : how one walks.
    visits : (e,) counts per edge, updated in place; with them the goals least seen so far come first (a survey).
    """
    storey = building.storeys[floor]
    counts = np.zeros(len(storey.edges), dtype=np.int64) if visits is None else visits
    nodes = [_goal(storey, counts, -1, rng)]
    walked = 0.0
    while walked < length:
        way = shortest(storey, nodes[-1], _goal(storey, counts, nodes[-1], rng))
        for node in way:
            walked += float(np.hypot(*(storey.nodes[node] - storey.nodes[nodes[-1]])))
            if visits is not None:
                visits[np.all(np.sort(storey.edges, axis=1) == sorted((nodes[-1], node)), axis=1)] += 1
            nodes.append(node)
            if walked >= length:
                break
    place = beside(storey, nodes[0], None, manner.wander, rng)
    start = (float(place[0]), float(place[1]), floor)
    legs = []
    for k, node in enumerate(nodes[1:]):
        place = beside(storey, node, place, manner.wander, rng)
        stands = rng.random() < manner.pause_share and k < len(nodes) - 2
        pause = float(rng.uniform(*manner.pause_range)) if stands else 0.0
        stretch = Stretch(float(place[0]), float(place[1]), Activity.WALKING)
        legs.append(Leg(stretch, pause, stated=floor, left=floor if stands else -1))
    return Journey(start, tuple(legs))


def _goal(storey: Storey, counts: IntArray, here: int, rng: np.random.Generator) -> int:
    """Of some places drawn, the one about which the fewest edges were walked."""
    drawn = rng.integers(0, len(storey.nodes), _ASKED)
    middle = storey.nodes[storey.edges].mean(axis=1)
    seen = [
        counts[np.hypot(*(middle - storey.nodes[node]).T) < _AROUND].mean() if node != here else np.inf
        for node in drawn.tolist()
    ]
    return int(drawn[int(np.argmin(seen))])
