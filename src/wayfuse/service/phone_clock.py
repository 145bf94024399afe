"""The clock of a phone against the server's: lone times from the future, and clocks that are set back or forward.

A phone may be wrong by any constant: its track runs in its own time. What must not happen is that one sample with a
foreign time carries the track into the future, so that everything after it is late; or that all samples are late
because the phone's clock was set back. Old recordings, posted faster than they were made, are no fault.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from wayfuse.core.types import Array, BoolArray

__all__ = ["ClockState", "Judged", "judge"]

TOLERANCE_S = 60.0  # further ahead of the server than it ever was: a foreign time, or a new clock
SUSTAINED = 5  # batches wholly in the past, in step with the server's clock, make a clock that was set back
_IN_STEP = (0.5, 2.0)  # advance of the phone's time over that of the server's; a backlog is sent much faster


class ClockState(NamedTuple):
    """What is known of a phone's clock.

    ahead : s, of the server's, at the first batch (NaN before). newest : s, latest time taken. behind : how many
    batches in a row were wholly in the past; behind_since : phone's and server's time of the first. epoch : how often
    the clock was set.
    """

    ahead: float = math.nan
    newest: float = -math.inf
    behind: int = 0
    behind_since: tuple[float, float] = (0.0, 0.0)
    epoch: int = 0


class Judged(NamedTuple):
    """State after a batch, which of its records belong to the track (n,), and whether the clock was set."""

    state: ClockState
    kept: BoolArray
    is_set: bool


def judge(state: ClockState, t: Array, arrived: float, rewind: float) -> Judged:
    """Take the times (n,) of a batch, finite, in any order. ``rewind`` : s, how late a record may be."""
    if not len(t):
        return Judged(state, np.ones(0, bool), False)
    if math.isnan(state.ahead):
        state = state._replace(ahead=_ahead(t, arrived))
    kept: BoolArray = t <= arrived + max(0.0, state.ahead) + TOLERANCE_S
    if not kept.any():  # all of them: the clock was set forward
        state = ClockState(ahead=_ahead(t, arrived), epoch=state.epoch + 1)
        kept = t <= arrived + max(0.0, state.ahead) + TOLERANCE_S
        return Judged(state._replace(newest=float(t[kept].max())), kept, True)
    newest = float(t[kept].max())
    if newest >= state.newest - rewind:
        return Judged(state._replace(newest=max(newest, state.newest), behind=0), kept, False)
    if not state.behind:
        return Judged(state._replace(behind=1, behind_since=(newest, arrived)), kept, False)
    state = state._replace(behind=state.behind + 1)
    phone, server = newest - state.behind_since[0], arrived - state.behind_since[1]
    if state.behind >= SUSTAINED and _IN_STEP[0] * server <= phone <= _IN_STEP[1] * server and phone > 0.0:
        state = ClockState(ahead=_ahead(t, arrived), newest=newest, epoch=state.epoch + 1)
        return Judged(state, kept, True)
    return Judged(state, kept, False)


def _ahead(t: Array, arrived: float) -> float:
    return float(np.median(t)) - arrived
