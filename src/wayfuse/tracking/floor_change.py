"""A movement between floors in a particle filter: board when it is reported, ride while it lasts, alight at its end."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayfuse.core.errors import ConfigError
from wayfuse.core.philox import Noise
from wayfuse.filters.cloud import NO_CONNECTOR, Cloud
from wayfuse.filters.particle_filter import Constraint, FilterState, MotionModel, ParticleFilter
from wayfuse.inertial.vertical import VerticalEvent
from wayfuse.models.motion.connectors import ConnectorMotion
from wayfuse.models.motion.pdr import StepInput

__all__ = ["FloorChange", "Movement"]


class Movement(NamedTuple):
    """What a track remembers of movements: the last report of one under way, and recent steps (t, step).

    An end is reported late; the steps since are then made up for. ``rested`` : s, since when particles may rest on
    connectors, infinite while none does.
    """

    event: VerticalEvent | None = None
    steps: tuple[tuple[float, StepInput], ...] = ()
    rested: float = math.inf


@dataclass(frozen=True, slots=True, kw_only=True)
class FloorChange:
    """Takes the cloud of a track through movements between floors.

    Parameters
    ----------
    connectors, steps : the motion models on connectors and on floors. constraint : of the floors, for steps that are
    made up for. memory : s, how long steps are remembered, at least the delay of the reported ends. patience : s until
    a particle that rests half-way up the stairs is taken to have arrived.
    """

    connectors: ConnectorMotion
    steps: MotionModel[StepInput]
    filter: ParticleFilter
    constraint: Constraint | None = None
    memory: float = 8.0
    patience: float = 14.0

    def __post_init__(self) -> None:
        if not (self.memory >= 0.0 and self.patience >= 0.0):
            raise ConfigError(
                f"memory and patience must not be negative, got {self.memory}, {self.patience}",
                where="FloorChange",
            )

    def step(
        self,
        key: tuple[int, int],
        before: FilterState,
        after: FilterState,
        movement: Movement,
        now: float,
        step: StepInput,
    ) -> tuple[FilterState, Movement]:
        """A step was made at ``now``, from ``before`` to ``after``: particles on connectors are held or leave them."""
        kept = tuple(old for old in movement.steps if old[0] > now - self.memory)
        movement = movement._replace(steps=(*kept, (now, step)))
        held = before.cloud.connector != NO_CONNECTOR
        if not np.any(held):
            return after, movement._replace(rested=math.inf)
        cloud = _where(held, before.cloud, after.cloud)
        after = after._replace(cloud=cloud, log_weights=np.where(held, before.log_weights, after.log_weights))
        if movement.event is None:
            noise = Noise(key, after.draw)
            if now - movement.rested > self.patience:
                cloud = self.connectors.settle(cloud)
            cloud = self.connectors.leave(noise, cloud)
            after = after._replace(cloud=cloud, draw=noise.draw)
        return after, movement

    def report(
        self, key: tuple[int, int], state: FilterState, movement: Movement, event: VerticalEvent
    ) -> tuple[FilterState, Movement]:
        """The cloud after a report."""
        last = movement.event
        if last is not None and last.began != event.began:  # its end was not reported
            state = self._end(key, state, last, movement)
            last = None
        if last is None:
            state = self._board(key, state, event)
        log_weights = state.log_weights.copy()
        before = 0.0 if last is None else last.rise
        self.connectors.doubt(state.cloud, before, event.rise, event.sigma, log_weights)
        state = self._weighed(key, state._replace(log_weights=log_weights))
        if event.is_over:
            state = self._end(key, state, event, movement)
            return state, movement._replace(event=None, rested=event.ended)
        if last is not None:
            state = state._replace(cloud=self.connectors.ride(state.cloud, event))
        return state, movement._replace(event=event)

    def _board(self, key: tuple[int, int], state: FilterState, event: VerticalEvent) -> FilterState:
        noise, log_weights = Noise(key, state.draw), state.log_weights.copy()
        cloud = self.connectors.board(noise, state.cloud, event, log_weights)
        return self._weighed(key, state._replace(cloud=cloud, log_weights=log_weights, draw=noise.draw))

    def _end(
        self, key: tuple[int, int], state: FilterState, event: VerticalEvent, movement: Movement
    ) -> FilterState:
        noise, log_weights = Noise(key, state.draw), state.log_weights.copy()
        stayed = state.cloud.connector == NO_CONNECTOR
        cloud = self.connectors.end(noise, state.cloud, event, log_weights)
        for t, step in movement.steps:
            if event.is_over and t > event.ended:
                cloud = self.connectors.leave(noise, cloud)
                moved = self.steps.propagate(noise, cloud, step)
                if self.constraint is not None:
                    moved, _ = self.constraint.restrict(cloud, moved, np.zeros(cloud.n))
                cloud = _where(stayed | (cloud.connector != NO_CONNECTOR), cloud, moved)
        return self._weighed(key, state._replace(cloud=cloud, log_weights=log_weights, draw=noise.draw))

    def _weighed(self, key: tuple[int, int], state: FilterState) -> FilterState:
        after, _ = self.filter.update(key, state, np.zeros(state.cloud.n))
        return after


def _where(mask: NDArray[np.bool_], yes: Cloud, no: Cloud) -> Cloud:
    columns: list[NDArray[Any]] = [np.where(mask, a, b) for a, b in zip(yes, no, strict=True)]
    return Cloud(*columns)
