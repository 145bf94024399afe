"""A movement between floors in a particle filter: board when it is reported, ride while it lasts, alight at its end."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from wayfuse.core.errors import ConfigError
from wayfuse.core.philox import Noise
from wayfuse.filters.cloud import NO_CONNECTOR, Cloud
from wayfuse.filters.particle_filter import Constraint, FilterState, ParticleFilter
from wayfuse.inertial.vertical import VerticalEvent
from wayfuse.models.motion.connectors import ConnectorMotion
from wayfuse.models.motion.pdr import PdrMotion, StepInput

__all__ = ["FloorChange", "Movement"]


class Movement(NamedTuple):
    """What a track remembers of movements: the last report of one under way, and recent steps (t, step).

    An end is reported late; the steps since are then made up for.
    """

    event: VerticalEvent | None = None
    steps: tuple[tuple[float, StepInput], ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class FloorChange:
    """Takes the cloud of a track through movements between floors.

    Parameters
    ----------
    connectors, steps : the motion models on connectors and on floors. constraint : of the floors, for steps that are
    made up for. memory : s, how long steps are remembered, at least the delay of the reported ends.
    """

    connectors: ConnectorMotion
    steps: PdrMotion
    filter: ParticleFilter
    constraint: Constraint | None = None
    memory: float = 8.0

    def __post_init__(self) -> None:
        if not self.memory >= 0.0:
            raise ConfigError(f"memory must not be negative, got {self.memory}", where="FloorChange")

    def remember(self, movement: Movement, t: float, step: StepInput) -> Movement:
        """A step was made."""
        kept = tuple(old for old in movement.steps if old[0] > t - self.memory)
        return movement._replace(steps=(*kept, (t, step)))

    def report(
        self, key: tuple[int, int], state: FilterState, movement: Movement, event: VerticalEvent
    ) -> tuple[FilterState, Movement]:
        """The cloud after a report."""
        last = movement.event
        if last is not None and last.began != event.began:  # its end was not reported
            state = self._alight(key, state, last, movement)
            last = None
        if last is None:
            state = self._board(key, state, event)
        elif not event.is_over:
            return state._replace(cloud=self.connectors.ride(state.cloud, event)), movement._replace(
                event=event
            )
        if event.is_over:
            return self._alight(key, state, event, movement), movement._replace(event=None)
        return state, movement._replace(event=event)

    @staticmethod
    def hold(before: FilterState, after: FilterState) -> FilterState:
        """Undo what a step did to particles on connectors: there steps do not count (chu2009, case 2.1)."""
        held = before.cloud.connector != NO_CONNECTOR
        if not np.any(held):
            return after
        return after._replace(
            cloud=_where(held, before.cloud, after.cloud),
            log_weights=np.where(held, before.log_weights, after.log_weights),
        )

    def _board(self, key: tuple[int, int], state: FilterState, event: VerticalEvent) -> FilterState:
        noise, log_weights = Noise(key, state.draw), state.log_weights.copy()
        cloud = self.connectors.board(noise, state.cloud, event, log_weights)
        return self._weighed(key, state._replace(cloud=cloud, log_weights=log_weights, draw=noise.draw))

    def _alight(
        self, key: tuple[int, int], state: FilterState, event: VerticalEvent, movement: Movement
    ) -> FilterState:
        noise, log_weights = Noise(key, state.draw), state.log_weights.copy()
        stayed = state.cloud.connector == NO_CONNECTOR
        cloud = self.connectors.alight(noise, state.cloud, event, log_weights)
        for t, step in movement.steps:
            if event.is_over and t > event.ended:
                moved = self.steps.propagate(noise, cloud, step)
                if self.constraint is not None:
                    moved, _ = self.constraint.restrict(cloud, moved, np.zeros(cloud.n))
                cloud = _where(stayed, cloud, moved)
        return self._weighed(key, state._replace(cloud=cloud, log_weights=log_weights, draw=noise.draw))

    def _weighed(self, key: tuple[int, int], state: FilterState) -> FilterState:
        after, _ = self.filter.update(key, state, np.zeros(state.cloud.n))
        return after


def _where(mask: np.ndarray, yes: Cloud, no: Cloud) -> Cloud:
    return Cloud(*(np.where(mask, a, b) for a, b in zip(yes, no, strict=True)))
