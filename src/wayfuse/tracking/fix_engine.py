"""Wi-Fi alone: every scan is a fix, the last fix holds until the next. Nearest neighbour (NNSS) and weighted k-NN."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from wayfuse.core.errors import UsageError
from wayfuse.inertial.front_end import StepEvent
from wayfuse.inertial.vertical import VerticalEvent
from wayfuse.radio.device_offset import DeviceOffset, OffsetState, shifted
from wayfuse.radio.sparse_knn import SparseKnn, fix_of
from wayfuse.radio.survey import Fingerprint
from wayfuse.sensors.records import Range
from wayfuse.tracking.engine import Known, Why, unknown
from wayfuse.tracking.estimate import Estimate, State

__all__ = ["FixEngine", "FixState"]


class FixState(NamedTuple):
    """The last fix (None before the first), what went into it, and what is known of the phone."""

    fix: Estimate | None = None
    why: Why = Why()
    offset: OffsetState | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class FixEngine:
    """A fix per scan, without memory.

    Parameters
    ----------
    radio_map : with k = 1 this is NNSS. prior : the estimate before the first fix.
    device : estimates how the phone's levels differ from the survey's, None = not at all.
    radius_68, radius_95 : offset (m) and slope (m per unit of signal distance) of the radii.
    """

    radio_map: SparseKnn
    prior: Estimate
    radius_68: tuple[float, float] = (3.0, 15.0)
    radius_95: tuple[float, float] = (6.0, 45.0)
    device: DeviceOffset | None = None
    uses_steps: bool = True  # steps are counted, nothing else
    uses_ranges: bool = False
    uses_scans: bool = True
    supports_lag: bool = False
    uses_vertical: bool = False

    def init(self, track: str, seed: int) -> FixState:
        """State before the first record."""
        return FixState(offset=None if self.device is None else self.device.init())

    def resume(self, state: FixState, track: str, seed: int, silence: float) -> FixState:
        """State after a long silence: as before the first record."""
        return self.init(track, seed)

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
        offset = state.offset
        if self.device is not None and offset is not None:
            offset = self.device.step(offset, self.radio_map, fingerprint)
            fingerprint = shifted(fingerprint, self.device.shift(offset))
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
        return FixState(said, Why(n_aps=near.n_aps), offset)

    def on_ranges(self, state: FixState, t: float, ranges: Sequence[Range], known: Known) -> FixState:
        """Ranges are not used."""
        return state

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
