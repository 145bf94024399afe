"""The inertial front end: motion records in, steps out; streaming and causal, a record or an array at a time.

A step is a fold of the memory of the filters over the records (Acceleration, RotationRate, MagneticField,
Orientation; others pass by). Both ways of feeding give the same bits. Bad data never stop it: records that
are not finite or come late are left out; a gap of a second starts the filters afresh; a missing sensor is
replaced (`heading`, `attitude`). Without an accelerometer there are no steps.

>>> front_end = InertialFrontEnd()
>>> state, event = front_end.step(front_end.init(), Acceleration(0.0, 0.0, 0.0, 9.81))
>>> event is None
True
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from wayfuse.core.types import Array
from wayfuse.inertial import _kernels
from wayfuse.inertial import _layout as at
from wayfuse.inertial.config import InertialConfig
from wayfuse.inertial.step_length import DEFAULT, StepFeatures, StepLengthModel
from wayfuse.sensors.recording import Recording, Series
from wayfuse.sensors.records import Acceleration, MagneticField, Orientation, Record, RotationRate

__all__ = [
    "FrontEndState",
    "InertialConfig",
    "InertialFrontEnd",
    "StepEvent",
    "StepEvents",
    "columns_within",
    "contiguous",
    "plain",
]


class StepEvent(NamedTuple):
    """One step; the fields of `StepEvents`, as numbers."""

    t: float
    length: float
    heading: float
    duration: float
    peak: float
    valley: float
    mean_abs: float
    turn: float
    confidence: float


class StepEvents(NamedTuple):
    r"""Steps of a stretch of a recording, each field (n,) float64.

    t : time at which the step is declared (s); nothing later is used.
    length : m.
    heading : direction of the phone about 0.2 s before, rad counter-clockwise from east, in (-pi, pi];
    relative to an unknown start while no absolute heading has been seen
    (`FrontEndState.is_heading_absolute`). duration : s since the previous step; 0.55 s for the first of a
    bout. peak, valley, mean_abs : of the band-passed \|a\| over the step, m/s².
    turn : gyro yaw since the previous step, rad.
    confidence : in (0, 1]: lower for steps barely above the threshold and for the first of a bout.
    """

    t: Array
    length: Array
    heading: Array
    duration: Array
    peak: Array
    valley: Array
    mean_abs: Array
    turn: Array
    confidence: Array


class FrontEndState(NamedTuple):
    """What the next record needs: one vector, never changed in place: a state is its own checkpoint."""

    memory: Array

    @property
    def is_heading_absolute(self) -> bool:
        """Whether a rotation vector or a usable magnetic field has been seen."""
        return bool(self.memory[at.S_HAS_HEADING])

    @property
    def heading(self) -> float:
        """Direction of the phone now, rad counter-clockwise from east."""
        return float(self.memory[at.S_HEADING])

    @property
    def last_step(self) -> float:
        """Time of the last step (s), -inf before the first."""
        return float(self.memory[at.S_T_STEP])


@dataclass(frozen=True, slots=True)
class InertialFrontEnd:
    """Steps with length and heading from the motion records of a phone.

    Parameters
    ----------
    config : parameters of the filters and detectors.
    step_length : model of the step length.
    """

    config: InertialConfig = field(default_factory=InertialConfig)
    step_length: StepLengthModel = DEFAULT
    _parameters: Array = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "_parameters", self.config.parameters(self.step_length))

    def init(self) -> FrontEndState:
        """State before the first record."""
        return FrontEndState(at.initial_state())

    def step(self, state: FrontEndState, record: Record) -> tuple[FrontEndState, StepEvent | None]:
        """Feed one record; a step where the record completes one. Records of other kinds change nothing."""
        if isinstance(record, Orientation):
            kind, t, (a, b, c, d) = at.ORIENTATION, record.t, record[1:]
        elif isinstance(record, Acceleration | RotationRate | MagneticField):
            kind, t, (a, b, c), d = _KIND[type(record)], record.t, record[1:], 0.0
        else:
            return state, None
        memory, event = state.memory.copy(), np.empty(at.N_EVENT)
        if _kernels.consume(memory, self._parameters, kind, t, a, b, c, d, event):
            return FrontEndState(memory), StepEvent(*event[: at.E_CONFIDENCE + 1].tolist())
        return FrontEndState(memory), None

    def run(
        self, state: FrontEndState, recording: Recording, start: float = -np.inf, stop: float = np.inf
    ) -> tuple[FrontEndState, StepEvents]:
        """Feed the records with start < t <= stop; the same bits as feeding them to `step` one by one."""
        state, rows = self._rows(state, recording, start, stop)
        return state, StepEvents(*rows[: at.E_CONFIDENCE + 1])

    def run_with_features(
        self, state: FrontEndState, recording: Recording, start: float = -np.inf, stop: float = np.inf
    ) -> tuple[FrontEndState, StepEvents, StepFeatures]:
        """As `run`, with the features that step-length models are fitted on."""
        state, rows = self._rows(state, recording, start, stop)
        order = (at.E_DURATION, at.E_PEAK, at.E_VALLEY, at.E_MEAN_ABS, at.E_VERTICAL)
        return state, StepEvents(*rows[: at.E_CONFIDENCE + 1]), StepFeatures(*rows[list(order)])

    def _rows(
        self, state: FrontEndState, recording: Recording, start: float, stop: float
    ) -> tuple[FrontEndState, Array]:
        memory = state.memory.copy()
        columns = contiguous(recording, start, stop)
        events = np.empty((len(columns[0]) + 1, at.N_EVENT))
        n = _kernels.consume_series(memory, self._parameters, columns, events, np.empty((0, 5)))
        return FrontEndState(memory), np.ascontiguousarray(events[:n].T)


_KIND = {
    Acceleration: at.ACCELERATION,
    RotationRate: at.ROTATION_RATE,
    MagneticField: at.MAGNETIC_FIELD,
}


def contiguous(recording: Recording, start: float = -np.inf, stop: float = np.inf) -> tuple[Array, ...]:
    """Times and values of the four motion series within start < t <= stop, as the kernels take them."""
    r = recording
    series = r.acceleration, r.rotation_rate, r.magnetic_field, r.orientation
    return tuple(columns_within(series, start, stop))


def columns_within(series: tuple[Series, ...], start: float, stop: float) -> list[Array]:
    """Times and values of each of several series in turn, within start < t <= stop, as the kernels take them."""
    out: list[Array] = []
    for one in series:
        part = one.between(start, stop)
        out += [plain(part.t), plain(part.values)]
    return out


def plain(column: Array) -> Array:
    """One memory layout, one compiled version: read-only and strided arrays are copied."""
    if column.flags.carray and column.dtype == np.float64:
        return column
    return np.require(column, np.float64, ("C", "W"))
