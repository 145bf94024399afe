"""Dead reckoning from a known start: what the motion sensors alone can do."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

from wayfuse.core.errors import UsageError
from wayfuse.inertial.front_end import StepEvent
from wayfuse.inertial.vertical import VerticalEvent
from wayfuse.radio.survey import Fingerprint
from wayfuse.sensors.records import Range
from wayfuse.tracking.engine import Known, Why
from wayfuse.tracking.estimate import Estimate, State

__all__ = ["DeadReckoning", "DeadReckoningState", "Start"]


_R95 = 1.73  # 95 % of a circular normal law lie within this many sigma
_FAST_WALK = 1.8  # m/s; few people walk faster indoors


class Start(NamedTuple):
    """A known start: x, y (m), floor index."""

    x: float
    y: float
    floor: int


class DeadReckoningState(NamedTuple):
    """Position (m), distance walked since the start (m), steps since the last estimate; m gone unheard, if at all."""

    x: float
    y: float
    walked: float = 0.0
    why: Why = Why()
    unheard: float = 0.0


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
    uses_ranges: bool = False
    uses_scans: bool = False
    supports_lag: bool = False
    uses_vertical: bool = False

    def begun_at(self, start: Start) -> DeadReckoning:
        """The engine of tracks that begin elsewhere."""
        return replace(self, start=start)

    def init(self, track: str, seed: int) -> DeadReckoningState:
        """State at the start."""
        return DeadReckoningState(self.start.x, self.start.y)

    def resume(self, state: DeadReckoningState, track: str, seed: int, silence: float) -> DeadReckoningState:
        """On from the last place, lost: r95 reaches as far as a person can have walked meanwhile."""
        return state._replace(unheard=state.unheard + _FAST_WALK * silence, why=Why())

    def on_step(self, state: DeadReckoningState, event: StepEvent) -> DeadReckoningState:
        """One step on."""
        heading = event.heading - self.rotation
        why = state.why._replace(n_steps=state.why.n_steps + 1)
        x, y = state.x + event.length * math.cos(heading), state.y + event.length * math.sin(heading)
        return state._replace(x=x, y=y, walked=state.walked + event.length, why=why)

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

    def on_ranges(
        self, state: DeadReckoningState, t: float, ranges: Sequence[Range], known: Known
    ) -> DeadReckoningState:
        """Ranges are not used."""
        return state

    def estimate(self, state: DeadReckoningState, t: float) -> tuple[DeadReckoningState, Estimate]:
        """The sum of the steps; radii grow with the distance walked."""
        sigma = 1.0 + self.heading_error * state.walked + state.unheard / _R95
        e = Estimate(
            t,
            state.x,
            state.y,
            self.start.floor,
            sigma**2 / 2,
            0.0,
            sigma**2 / 2,
            1.07 * sigma,
            _R95 * sigma,
            State.LOST if state.unheard else State.TRACKING,
            state.why.n_steps,
        )
        return state._replace(why=Why()), e

    def mark(self, state: DeadReckoningState, t: float) -> DeadReckoningState:
        """Not for this method."""
        raise UsageError("dead reckoning has no lag", remedy="leave --lag out, or use --method fused")

    def recall(self, state: DeadReckoningState) -> tuple[DeadReckoningState, Estimate]:
        """Not for this method."""
        raise UsageError("dead reckoning has no lag", remedy="leave --lag out, or use --method fused")
