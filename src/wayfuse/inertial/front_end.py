"""The inertial front end: motion records in, steps out; streaming, causal, one sample or an array at a time.

>>> front_end = InertialFrontEnd()
>>> state = front_end.init()
>>> state, event = front_end.step(state, Acceleration(0.0, 0.0, 0.0, 9.81))
>>> event is None
True
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal, NamedTuple

import numpy as np

from wayfuse.core.errors import ConfigError
from wayfuse.core.types import Array
from wayfuse.inertial import _kernels as k
from wayfuse.inertial.step_length import DEFAULT, StepLengthModel
from wayfuse.sensors.recording import Recording, Series
from wayfuse.sensors.records import Acceleration, MagneticField, Orientation, Record, RotationRate

__all__ = ["FrontEndState", "InertialConfig", "InertialFrontEnd", "StepEvent", "StepEvents"]

_KIND = {
    Acceleration: k.ACCELERATION,
    RotationRate: k.ROTATION_RATE,
    MagneticField: k.MAGNETIC_FIELD,
    Orientation: k.ORIENTATION,
}


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
    """Steps of a stretch of a recording, each field (n,) float64.

    t : time at which the step is declared (s); nothing later is used.
    length : m. heading : walking direction, rad counter-clockwise from east, in (-pi, pi].
    duration : time since the previous step (s). peak, valley : extremes of the band-passed \\|a\\| (m/s²).
    mean_abs : mean of its absolute value (m/s²). turn : gyro yaw since the previous step (rad).
    confidence : 0 to 1.
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
    """What the next record needs: one vector, never changed in place."""

    memory: Array


@dataclass(frozen=True, slots=True, kw_only=True)
class InertialConfig:
    """Parameters of the front end (SI units)."""

    low_hz: float = 0.7
    high_hz: float = 3.0
    threshold: float = 0.6
    relative_threshold: float = 0.3
    level_rate: float = 0.2
    min_interval: float = 0.28
    max_gap: float = 1.0
    heading_delay: float = 0.2
    heading_source: Literal["orientation", "pulled"] = "pulled"
    heading_tau: float = 10.0
    tilt_tau: float = 3.0
    tilt_tau_no_gyro: float = 0.5
    magnetic_tau: float = 5.0
    magnetic_tau_no_gyro: float = 0.5
    magnetic_tolerance: float = 5.0
    stale_after: float = 0.5
    max_peak: float = 9.0

    def __post_init__(self) -> None:
        if not 0.0 < self.low_hz < self.high_hz:
            raise ConfigError("low_hz and high_hz must satisfy 0 < low_hz < high_hz", where="InertialConfig")
        for name in ("threshold", "min_interval", "max_gap", "heading_tau", "tilt_tau", "magnetic_tau"):
            if not getattr(self, name) > 0.0:
                raise ConfigError(f"{name} must be positive", where="InertialConfig")

    def parameters(self, model: StepLengthModel) -> Array:
        """The vector the kernels read."""
        p = np.zeros(k.N_PARAM)
        p[k.P_LOW], p[k.P_HIGH], p[k.P_THRESHOLD] = self.low_hz, self.high_hz, self.threshold
        p[k.P_RELATIVE], p[k.P_INTERVAL], p[k.P_GAP] = (
            self.relative_threshold,
            self.min_interval,
            self.max_gap,
        )
        p[k.P_LEVEL_RATE], p[k.P_DELAY] = self.level_rate, self.heading_delay
        p[k.P_SOURCE], p[k.P_TAU_HEADING] = float(self.heading_source == "pulled"), self.heading_tau
        p[k.P_TAU_TILT], p[k.P_TAU_TILT_NO_GYRO] = self.tilt_tau, self.tilt_tau_no_gyro
        p[k.P_TAU_MAG], p[k.P_TAU_MAG_NO_GYRO] = self.magnetic_tau, self.magnetic_tau_no_gyro
        p[k.P_MAG_TOLERANCE], p[k.P_STALE] = self.magnetic_tolerance, self.stale_after
        p[k.P_MAX_PEAK], p[k.P_MODEL] = self.max_peak, model.code
        coefficients = model.coefficients
        p[k.P_COEFFICIENT : k.P_COEFFICIENT + len(coefficients)] = coefficients
        return p


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
        s = np.zeros(k.N_STATE)
        s[k.S_Q] = 1.0
        s[k.S_RV] = 1.0
        s[k.S_T_ACC : k.S_T_RV + 1] = -np.inf
        s[k.S_T_STEP] = -np.inf
        return FrontEndState(s)

    def step(self, state: FrontEndState, record: Record) -> tuple[FrontEndState, StepEvent | None]:
        """Feed one record; a step where the record completes one. Records of other kinds are ignored."""
        kind = _KIND.get(type(record))
        if kind is None:
            return state, None
        t, a, b, c, d = (*record, 0.0)[:5]  # type: ignore[misc]
        memory, event = state.memory.copy(), np.empty(k.N_EVENT)
        if k.consume(memory, self._parameters, kind, t, a, b, c, d, event):
            return FrontEndState(memory), StepEvent(*event[: k.E_CONFIDENCE + 1].tolist())
        return FrontEndState(memory), None

    def run(
        self, state: FrontEndState, recording: Recording, start: float = -np.inf, stop: float = np.inf
    ) -> tuple[FrontEndState, StepEvents]:
        """Feed the records with start < t <= stop; the same bits as feeding them to `step` one by one."""
        state, rows = self.run_features(state, recording, start, stop)
        return state, StepEvents(*(np.ascontiguousarray(rows[:, i]) for i in range(k.E_CONFIDENCE + 1)))

    def run_features(
        self, state: FrontEndState, recording: Recording, start: float = -np.inf, stop: float = np.inf
    ) -> tuple[FrontEndState, Array]:
        """As `run`, but the raw rows of the kernel (n, N_EVENT): for fitting step-length models."""
        memory = state.memory.copy()
        series = (
            recording.acceleration,
            recording.rotation_rate,
            recording.magnetic_field,
            recording.orientation,
        )
        columns = [column for s in series for column in _columns(s.between(start, stop))]
        events = np.empty((len(columns[0]) + 1, k.N_EVENT))
        n = k.consume_series(memory, self._parameters, *columns, events)
        return FrontEndState(memory), events[:n].copy()


def _columns(series: Series) -> tuple[Array, Array]:
    return (
        np.require(series.t, np.float64, ("C", "W")),
        np.require(series.values, np.float64, ("C", "W")),
    )
