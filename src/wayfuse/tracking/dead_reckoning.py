"""Dead reckoning from a known start: what the motion sensors alone can do."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

from wayfuse.core.errors import UsageError
from wayfuse.inertial.front_end import StepEvent
from wayfuse.inertial.vertical import VerticalEvent
from wayfuse.radio.survey import Fingerprint
from wayfuse.tracking.engine import Known, Why
from wayfuse.tracking.estimate import Estimate, State

__all__ = ["DeadReckoning", "DeadReckoningState", "Start"]


class Start(NamedTuple):
    """A known start: x, y (m), floor index."""

    x: float
    y: float
    floor: int


class DeadReckoningState(NamedTuple):
    """Position (m), distance walked since the start (m), and steps since the last estimate."""

    x: float
    y: float
    walked: float = 0.0
    why: Why = Why()


@dataclass(frozen=True, slots=True, kw_only=True)
class DeadReckoning:
    """Adds up steps from the start; the map and the radio are not used.

    Parameters
    ----------
    start : of the track. rotation : rad, heading of building +x from east. heading_error : rad, for the radii.
    """

    start: Start
    rotation: float = 0.0
    heading_error: float = 0.2
    uses_steps: bool = True
    uses_scans: bool = False
    supports_lag: bool = False
    uses_vertical: bool = False

    def init(self, track: str, seed: int) -> DeadReckoningState:
        """State at the start."""
        return DeadReckoningState(self.start.x, self.start.y)

    def on_step(self, state: DeadReckoningState, event: StepEvent) -> DeadReckoningState:
        """One step on."""
        heading = event.heading - self.rotation
        why = state.why._replace(n_steps=state.why.n_steps + 1)
        x, y = state.x + event.length * math.cos(heading), state.y + event.length * math.sin(heading)
        return DeadReckoningState(x, y, state.walked + event.length, why)

    def on_vertical(self, state: DeadReckoningState, event: VerticalEvent) -> DeadReckoningState:
        """Stairs and lifts do not move it."""
        return state

    def on_quiet(self, state: DeadReckoningState, dt: float) -> DeadReckoningState:
        """Without steps nobody moves."""
        return state

    def on_fingerprint(
        self,
        state: DeadReckoningState,
        t: float,
        fingerprint: Fingerprint,
        known: Known,
    ) -> DeadReckoningState:
        """The radio is not used."""
        return state

    def estimate(self, state: DeadReckoningState, t: float) -> tuple[DeadReckoningState, Estimate]:
        """The sum of the steps; radii grow with the distance walked."""
        sigma = 1.0 + self.heading_error * state.walked
        e = Estimate(
            t,
            state.x,
            state.y,
            self.start.floor,
            sigma**2 / 2,
            0.0,
            sigma**2 / 2,
            1.07 * sigma,
            1.73 * sigma,
            State.TRACKING,
            state.why.n_steps,
        )
        return state._replace(why=Why()), e

    def mark(self, state: DeadReckoningState, t: float) -> DeadReckoningState:
        """Not for this method."""
        raise UsageError("dead reckoning has no lag", remedy="leave --lag out, or use --method fused")

    def recall(self, state: DeadReckoningState) -> tuple[DeadReckoningState, Estimate]:
        """Not for this method."""
        raise UsageError("dead reckoning has no lag", remedy="leave --lag out, or use --method fused")
