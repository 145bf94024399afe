"""Where people walk: routes over the corridor graph of a storey.

A survey spreads over all corridors (the least walked edge next), a visitor wanders; neither turns back except
in a dead end. Each node is passed a little beside its place, as far as the walls leave room.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from wayfuse.core.types import Array, IntArray
from wayfuse.simulator.building import Storey

__all__ = ["AT_EASE", "Manner", "Route", "beside", "plan_route"]

_MARGIN = 0.7  # m from the walls: half a shoulder and what a rounded turn cuts off


class Manner(NamedTuple):
    """How one walks."""

    wander: float = 0.6  # m, how far beside a node one passes, at most, per axis
    pause_share: float = 0.15  # of inner nodes at which one stands
    pause_range: tuple[float, float] = (2.0, 5.0)  # s, how long


AT_EASE = Manner()


@dataclass(frozen=True, slots=True, eq=False)
class Route:
    """Way-points (k, 2) m joined by straight lines, and how long one stands at each, (k,) s."""

    xy: Array
    pause: Array


def plan_route(
    storey: Storey,
    length: float,
    rng: np.random.Generator,
    *,
    manner: Manner = AT_EASE,
    visits: IntArray | None = None,
) -> Route:
    """Draw a route of about ``length`` m.

    Parameters
    ----------
    manner : how one walks.
    visits : (e,) counts per edge, updated in place; with them the least walked edges come first (a survey).
    """
    nodes = _node_sequence(storey, length, rng, visits)
    places = [beside(storey, nodes[0], None, manner.wander, rng)]
    for node in nodes[1:]:
        places.append(beside(storey, node, places[-1], manner.wander, rng))
    xy = np.array(places)
    pause = np.where(rng.random(len(xy)) < manner.pause_share, rng.uniform(*manner.pause_range, len(xy)), 0.0)
    pause[0] = pause[-1] = 0.0
    return Route(xy, pause)


def _node_sequence(
    storey: Storey, length: float, rng: np.random.Generator, visits: IntArray | None
) -> list[int]:
    edges = storey.edges
    counts = np.zeros(len(edges), dtype=np.int64) if visits is None else visits
    first = int(rng.choice(np.flatnonzero(counts == counts.min())))
    a, b = (int(i) for i in rng.permutation(edges[first]))
    nodes, walked = [a], 0.0
    edge, node = first, b
    while True:
        counts[edge] += visits is not None
        walked += float(np.linalg.norm(storey.nodes[node] - storey.nodes[nodes[-1]]))
        nodes.append(node)
        if walked >= length:
            return nodes
        around = np.flatnonzero(np.any(edges == node, axis=1))
        onward = around[around != edge]
        choices = onward if len(onward) else around
        least = choices[counts[choices] == counts[choices].min()]
        edge = int(rng.choice(least))
        node = int(edges[edge].sum() - node)


def beside(storey: Storey, node: int, before: Array | None, wander: float, rng: np.random.Generator) -> Array:
    """A place near a node that is reached from the place before without coming close to a wall."""
    centre = storey.nodes[node]
    for shrink in (1.0, 1.0, 1.0, 0.5, 0.25):
        place = centre + rng.uniform(-wander, wander, 2) * shrink
        if storey.is_clear(centre if before is None else before, place, _MARGIN):
            return np.asarray(place)
    return np.asarray(centre)
