"""What a tracker says at one moment: where, how sure, in which state, and why."""

from __future__ import annotations

from enum import Enum
from typing import NamedTuple

__all__ = ["Estimate", "State"]


class State(Enum):
    """State of a track."""

    INITIALISING = "initialising"
    TRACKING = "tracking"
    LOST = "lost"


class Estimate(NamedTuple):
    """One estimate in the building frame.

    t : s, recording's clock. x, y : m. floor : index into the site's floors. cov_* : m². r68, r95 : radius (m)
    about (x, y) that is to hold the truth in 68 and 95 % of cases. Why: steps and access points used since the
    estimate before, share of the particles stopped by walls, effective sample size as a share of the particles.
    """

    t: float
    x: float
    y: float
    floor: int
    cov_xx: float
    cov_xy: float
    cov_yy: float
    r68: float
    r95: float
    state: State
    n_steps: int = 0
    n_aps: int = 0
    share_blocked: float = 0.0
    ess: float = 1.0
