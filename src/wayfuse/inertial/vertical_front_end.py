"""The vertical front end: motion records, pressure and steps in, reports of stairs, lifts and escalators out.

Streaming and causal, a record or an array at a time; both ways give the same bits. Bad data never stop it.

>>> front_end = VerticalFrontEnd()
>>> state, event = front_end.step(front_end.init(), Pressure(0.0, 1013.25))
>>> event is None
True
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from wayfuse.core.types import Array
from wayfuse.inertial import _vertical_kernels as kernels
from wayfuse.inertial import _vertical_layout as at
from wayfuse.inertial.front_end import StepEvent, StepEvents
from wayfuse.inertial.vertical import Behaviour, VerticalEvent
from wayfuse.inertial.vertical_config import VerticalConfig
from wayfuse.sensors.recording import Recording
from wayfuse.sensors.records import Acceleration, Pressure, Record, RotationRate

__all__ = ["VerticalConfig", "VerticalFrontEnd", "VerticalState"]


class VerticalState(NamedTuple):
    """What the next record needs: one vector, never changed in place: a state is its own checkpoint."""

    memory: Array


@dataclass(frozen=True, slots=True)
class VerticalFrontEnd:
    """Stairs, lifts and escalators from the motion records, pressure and steps of a phone.

    Parameters
    ----------
    config : parameters of the detectors.
    """

    config: VerticalConfig = field(default_factory=VerticalConfig)
    _parameters: Array = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "_parameters", self.config.parameters())

    def init(self) -> VerticalState:
        """State before the first record."""
        return VerticalState(at.initial_memory())

    def step(self, state: VerticalState, record: Record) -> tuple[VerticalState, VerticalEvent | None]:
        """Feed one record; a report where it completes one. Records of other kinds change nothing."""
        if isinstance(record, Acceleration):
            return self._consume(state, at.ACCELERATION, *record)
        if isinstance(record, RotationRate):
            return self._consume(state, at.ROTATION_RATE, *record)
        if isinstance(record, Pressure):
            return self._consume(state, at.PRESSURE, record.t, record.hpa, 0.0, 0.0)
        return state, None

    def on_step(self, state: VerticalState, event: StepEvent) -> tuple[VerticalState, VerticalEvent | None]:
        """Feed a foot step of `InertialFrontEnd`, before or after the records of equal time."""
        return self._consume(state, at.STEP, event.t, 0.0, 0.0, 0.0)

    def run(
        self,
        state: VerticalState,
        recording: Recording,
        steps: StepEvents,
        start: float = -np.inf,
        stop: float = np.inf,
    ) -> tuple[VerticalState, list[VerticalEvent]]:
        """Feed the records and steps with start < t <= stop; the same bits as one by one in time order."""
        memory = state.memory.copy()
        columns: list[Array] = []
        for series in (recording.acceleration, recording.rotation_rate, recording.pressure):
            part = series.between(start, stop)
            columns += [np.require(column, np.float64, ("C", "W")) for column in (part.t, part.values)]
        i, j = np.searchsorted(steps.t, (start, stop), side="right")
        feet = np.require(steps.t[i:j], np.float64, ("C", "W"))
        rows = np.empty((len(columns[0]) + len(columns[2]) + len(columns[4]) + len(feet) + 1, at.N_EVENT))
        n = kernels.consume_series(memory, self._parameters, tuple(columns), feet, rows)
        return VerticalState(memory), [_event(row) for row in rows[:n]]

    def flush(self, state: VerticalState, t: float) -> tuple[VerticalState, VerticalEvent | None]:
        """At the end of a recording (s): a movement under way is over."""
        memory, row = state.memory.copy(), np.empty(at.N_EVENT)
        if kernels.finish(memory, self._parameters, t, row):
            return VerticalState(memory), _event(row)
        return VerticalState(memory), None

    def altitude(self, state: VerticalState) -> float:
        """Running mean of the altitude above the first reading (m); NaN without a barometer."""
        v = state.memory
        if not self.config.use_pressure or v[at.V_TICKS] < 1.0 or np.isnan(v[at.V_P_ZERO]):
            return float("nan")
        return float(v[at.V_RING_Z + int(v[at.V_TICKS] - 1) % at.N_RING])

    def _consume(
        self, state: VerticalState, kind: int, t: float, a: float, b: float, c: float
    ) -> tuple[VerticalState, VerticalEvent | None]:
        memory, row = state.memory.copy(), np.empty(at.N_EVENT)
        if kernels.consume(memory, self._parameters, kind, t, a, b, c, row):
            return VerticalState(memory), _event(row)
        return VerticalState(memory), None


def _event(row: Array) -> VerticalEvent:
    t, began, behaviour, rise, sigma, n_steps, over, ended, pressed = row.tolist()
    return VerticalEvent(
        t, began, Behaviour(int(behaviour)), rise, sigma, round(n_steps), over > 0.0, ended, pressed > 0.0
    )
