"""Wi-Fi alone: every scan is a fix, the last fix holds until the next. Nearest neighbour (NNSS) and weighted k-NN."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from wayfuse.core.errors import UsageError
from wayfuse.inertial.front_end import StepEvent
from wayfuse.inertial.vertical import VerticalEvent
from wayfuse.radio.sparse_knn import SparseKnn, fix_of
from wayfuse.radio.survey import Fingerprint
from wayfuse.tracking.engine import Known, Why, unknown
from wayfuse.tracking.estimate import Estimate, State

__all__ = ["FixEngine", "FixState"]


class FixState(NamedTuple):
    """The last fix (None before the first) and what went into it."""

    fix: Estimate | None = None
    why: Why = Why()


@dataclass(frozen=True, slots=True, kw_only=True)
class FixEngine:
    """A fix per scan, without memory.

    Parameters
    ----------
    radio_map : with k = 1 this is NNSS. prior : the estimate before the first fix.
    radius_68, radius_95 : offset (m) and slope (m per unit of signal distance) of the radii.
    """

    radio_map: SparseKnn
    prior: Estimate
    radius_68: tuple[float, float] = (3.0, 15.0)
    radius_95: tuple[float, float] = (6.0, 45.0)
    uses_steps: bool = True  # steps are counted, nothing else
    uses_scans: bool = True
    supports_lag: bool = False
    uses_vertical: bool = False

    def init(self, track: str, seed: int) -> FixState:
        """State before the first record."""
        return FixState()

    def on_step(self, state: FixState, event: StepEvent) -> FixState:
        """Steps do not move a fix."""
        return state

    def on_vertical(self, state: FixState, event: VerticalEvent) -> FixState:
        """Stairs and lifts do not move it."""
        return state

    def on_quiet(self, state: FixState, dt: float) -> FixState:
        """Time does not move a fix."""
        return state

    def on_fingerprint(
        self,
        state: FixState,
        t: float,
        fingerprint: Fingerprint,
        known: Known,
    ) -> FixState:
        """The new fix, where the scan holds a known access point."""
        near = self.radio_map.neighbours(fingerprint)
        if near is None:
            return state
        fix = fix_of(near, len(self.radio_map.floors))
        on = near.floor == fix.floor
        w = near.weight[on] / near.weight[on].sum()
        dx, dy = near.x[on] - fix.x, near.y[on] - fix.y
        r68 = self.radius_68[0] + self.radius_68[1] * near.distance
        r95 = max(self.radius_95[0] + self.radius_95[1] * near.distance, r68)
        xx, xy, yy = (float(np.sum(w * a * b)) for a, b in ((dx, dx), (dx, dy), (dy, dy)))
        said = Estimate(t, fix.x, fix.y, fix.floor, xx, xy, yy, r68, r95, State.TRACKING)
        return FixState(said, Why(n_aps=near.n_aps))

    def estimate(self, state: FixState, t: float) -> tuple[FixState, Estimate]:
        """The last fix."""
        if state.fix is None:
            return state, unknown(t, self.prior)
        return state._replace(why=Why()), state.fix._replace(t=t, n_aps=state.why.n_aps)

    def mark(self, state: FixState, t: float) -> FixState:
        """Not for this method."""
        raise UsageError("a fix per scan has no lag", remedy="leave --lag out, or use --method fused")

    def recall(self, state: FixState) -> tuple[FixState, Estimate]:
        """Not for this method."""
        raise UsageError("a fix per scan has no lag", remedy="leave --lag out, or use --method fused")
