r"""The three series of chu2009, Section 3.1: horizontal motion H(t), stairs S(t), lifts E(t).

H(t) is the sum of the step vectors of each period (Eq. 3.2), S(t) the stairs taken with their sign, E(t) the floors
ridden with their sign. All are posterior: an entry at :math:`t_i` tells of :math:`(t_{i-1}, t_i]`. They are derived
from step events and vertical events, whose latency they share.

Departs from the paper: an entry of S(t) may count several stairs (a report comes about once a second), and E(t)
comes with the probability of every number of floors instead of one number, for floors differ in height and a rise
has an error.

>>> floor_probabilities(rise=5.9, sigma=0.5, storey_height=3.0, most=3).round(3)
array([0., 0., 0., 0., 1., 0.])

References
----------
.. [1] H.-T. Chu, master's thesis, National Chiao Tung University, 2009, Sections 3.1.1 to 3.1.3.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from wayfuse.core.errors import UsageError
from wayfuse.core.types import Array, IntArray
from wayfuse.inertial.front_end import StepEvents
from wayfuse.inertial.vertical import Behaviour, VerticalEvent

__all__ = [
    "HorizontalSeries",
    "RideSeries",
    "StairSeries",
    "floor_counts",
    "floor_probabilities",
    "horizontal_series",
    "ride_series",
    "stair_series",
]


class HorizontalSeries(NamedTuple):
    """H(t): ends of the periods (n,) s and displacement in each (n, 2) m, building frame."""

    t: Array
    displacement: Array


class StairSeries(NamedTuple):
    """S(t): times (n,) s and stairs taken since the entry before (n,), negative down."""

    t: Array
    stairs: IntArray


class RideSeries(NamedTuple):
    """E(t): times (n,) s, most probable number of floors (n,), negative down, and (n, 2 most) probabilities.

    The columns are those of `floor_counts`.
    """

    t: Array
    floors: IntArray
    probabilities: Array


def horizontal_series(steps: StepEvents, start: float, stop: float, period: float = 1.0) -> HorizontalSeries:
    """H(t) of the steps with start < t <= stop, at start + period, start + 2 period, ...

    Raises
    ------
    UsageError : the period is not positive or the span is empty.
    """
    if not (period > 0.0 and stop > start):
        raise UsageError(
            f"no periods of {period} s from {start} to {stop} s", remedy="give start < stop and period > 0"
        )
    n = int(np.ceil((stop - start) / period - 1e-9))
    ends: Array = start + period * np.arange(1, n + 1, dtype=np.float64)
    displacement = np.zeros((n, 2))
    inside = (steps.t > start) & (steps.t <= stop)
    place = np.minimum(np.searchsorted(ends, steps.t[inside], side="left"), n - 1)
    vectors = steps.length[inside, None] * np.column_stack(
        [np.cos(steps.heading[inside]), np.sin(steps.heading[inside])]
    )
    np.add.at(displacement, place, vectors)  # Eq. (3.2)
    return HorizontalSeries(ends, displacement)


def stair_series(events: Sequence[VerticalEvent]) -> StairSeries:
    """S(t): what each report of stairs adds to the one before; a movement taken back is taken off again."""
    t, stairs = [], []
    counted: dict[float, int] = {}
    for event in events:
        if event.behaviour != Behaviour.STAIRS and event.began not in counted:
            continue
        is_stairs = event.behaviour == Behaviour.STAIRS
        now = int(np.sign(event.rise)) * event.n_steps if is_stairs else 0
        t.append(event.t)
        stairs.append(now - counted.get(event.began, 0))
        counted[event.began] = now
    return StairSeries(np.array(t, dtype=np.float64), np.array(stairs, dtype=np.int64))


def ride_series(events: Sequence[VerticalEvent], storey_height: float, most: int = 10) -> RideSeries:
    """E(t): one entry per ride that is over, at the time at which that is known.

    storey_height : m from floor to floor. most : largest number of floors considered.
    """
    over = [e for e in events if e.is_over and e.behaviour == Behaviour.LIFT]
    rows = [floor_probabilities(e.rise, e.sigma, storey_height, most) for e in over]
    probabilities = np.array(rows).reshape(-1, 2 * most)
    floors = floor_counts(most)[probabilities.argmax(axis=1)] if rows else np.empty(0, np.int64)
    return RideSeries(np.array([e.t for e in over], dtype=np.float64), floors, probabilities)


def floor_counts(most: int) -> IntArray:
    """Numbers of floors a ride may go: -most, ..., -1, 1, ..., most."""
    counts = np.arange(-most, most + 1, dtype=np.int64)
    return np.asarray(counts[counts != 0])


def floor_probabilities(rise: float, sigma: float, storey_height: float, most: int = 10) -> Array:
    """Probability of each number of floors of `floor_counts`, given a rise with its standard deviation (m).

    Raises
    ------
    UsageError : a height, standard deviation or number of floors that is not positive.
    """
    if not (sigma > 0.0 and storey_height > 0.0 and most > 0):
        raise UsageError(
            f"sigma = {sigma}, storey_height = {storey_height}, most = {most}", remedy="give positive numbers"
        )
    score = -0.5 * ((rise - floor_counts(most) * storey_height) / sigma) ** 2
    weight = np.exp(score - score.max())
    return np.asarray(weight / weight.sum())
