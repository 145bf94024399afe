"""The speed filter of chu2009 (Section 3.3.1) step by step: after each step, nobody is far from where it leads.

`speed_filter` keeps speeds over time and needs estimates; between two steps the speed is the step itself, so the disc
lies about the mean of the cloud before, moved by the step, and its radius is the step's length but at least ``least``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from wayfuse.core.errors import ConfigError
from wayfuse.filters.particle_filter import Constraint, FilterState, MotionModel
from wayfuse.filters.widening import WideningFilter
from wayfuse.models.constraint.speed_filter import SpeedDisc
from wayfuse.models.motion.pdr import StepInput

__all__ = ["StepSpeedFilter"]


@dataclass(frozen=True, slots=True, kw_only=True)
class StepSpeedFilter:
    """Parameters: filter : what predicts. least : m, least radius. penalty : nats for particles outside."""

    filter: WideningFilter
    least: float = 10.0
    penalty: float = 30.0

    def __post_init__(self) -> None:
        if not (self.least > 0.0 and 0.0 <= self.penalty < math.inf):
            raise ConfigError(
                f"least must be positive, penalty finite and not negative, got {self.least}, {self.penalty}",
                where="StepSpeedFilter",
            )

    def predict(
        self,
        key: tuple[int, int],
        state: FilterState,
        motion: MotionModel[StepInput],
        event: StepInput,
        constraint: Constraint | None,
    ) -> tuple[FilterState, int]:
        """Move the cloud as ``filter`` does, then filter those too far; how many moves were undone or filtered."""
        after, n_blocked = self.filter.predict(key, state, motion, event, constraint)
        weights, before = state.weights, state.cloud
        floor = int(np.argmax(np.bincount(before.floor, weights)))
        on = np.where(before.floor == floor, weights, 0.0)
        total = float(on.sum())
        x = float(on @ before.x) / total + event.length * math.cos(event.heading)
        y = float(on @ before.y) / total + event.length * math.sin(event.heading)
        disc = SpeedDisc(x, y, floor, max(self.least, event.length), self.penalty)
        log_weights = after.log_weights.copy()
        _, n_outside = disc.restrict(before, after.cloud, log_weights)
        return after._replace(log_weights=log_weights), n_blocked + n_outside
