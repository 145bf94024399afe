"""Going up and down: what the vertical detectors tell the tracker.

Stairs, lifts and escalators are reported in phases: once declared, about every second while they last, and once
when they are over. A report says how far the person has come since the movement began, so a listener that missed
one needs only the next. This is S(t) and E(t) of chu2009 Section 3.1 in metres with a standard deviation, from
whatever sensor can tell; counts of steps come along, numbers of floors are the map's to give.
"""

from __future__ import annotations

from enum import IntEnum
from typing import NamedTuple

__all__ = ["Behaviour", "VerticalEvent"]


class Behaviour(IntEnum):
    """What the carrier of a phone does."""

    STILL = 0
    WALKING = 1
    STAIRS = 2
    LIFT = 3
    ESCALATOR = 4


class VerticalEvent(NamedTuple):
    """One report of a movement between floors.

    t : s, when it is reported; nothing later is used. began : s, when the movement began (back-dated; it tells one
    movement from the next). behaviour : STAIRS, LIFT or ESCALATOR; it may be revised while the movement lasts.
    rise : m, climbed since `began`, negative down. sigma : m, its standard deviation. n_steps : steps since `began`.
    is_over : this is the last report, and the movement ended at ``ended`` (s, back-dated; NaN before).
    has_pressure : whether a barometer was used; without one ``rise`` comes from steps or accelerations.
    """

    t: float
    began: float
    behaviour: Behaviour
    rise: float
    sigma: float
    n_steps: int
    is_over: bool
    ended: float
    has_pressure: bool
