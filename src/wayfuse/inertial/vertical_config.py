"""Parameters of the vertical front end."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wayfuse.core.errors import ConfigError
from wayfuse.core.types import Array
from wayfuse.inertial import _vertical_layout as at

__all__ = ["VerticalConfig"]


@dataclass(frozen=True, slots=True, kw_only=True)
class VerticalConfig:
    """Parameters of the detectors of stairs, lifts and escalators (SI units)."""

    use_pressure: bool = True  # False: as a phone without a barometer
    pressure_stale: float = (
        3.0  # s after which a silent barometer counts as absent: it delivers at 1 to 25 Hz
    )
    max_gap: float = 5.0  # s without any record after which a movement is over
    mean_ticks: int = 8  # running mean of the altitude: 1.6 s
    rise_window: float = 6.0  # s
    least_rise: float = 1.5  # m
    jump_share: float = 0.75
    end_time: float = 3.0  # s
    end_speed: float = 0.1  # m/s
    stair_rate: float = 0.4  # steps per second
    lift_speed: float = 0.39  # m/s
    agreed_rise: float = 0.8  # m
    rise_sigma: float = 0.4  # m
    rise_sigma_relative: float = 0.05
    # --- without a barometer
    tilt_tau: float = 1.0  # s
    shake_rate: float = 2.0  # rad/s
    speed_noise: float = 0.93
    drift_walk: float = 0.003
    reading_sigma: float = 0.015
    outlier: float = 9.0
    stair_speed: float = 0.26
    stair_speed_sigma: float = 0.09
    ride_speed: float = 0.9
    ride_speed_sigma: float = 0.6
    ride_ramp: float = 0.3
    ride_wander: float = 0.03
    start_rate: float = 0.02
    stop_rate: float = 0.125
    landing_rate: float = 0.3
    belief: float = 0.75
    least_time: float = 2.5
    riser: float = 0.15
    speed_rise_sigma: float = 0.5
    speed_rise_sigma_relative: float = 0.25

    def __post_init__(self) -> None:
        for name in _OFFSETS.values():
            if not getattr(self, name) > 0.0:
                raise ConfigError(f"{name} must be positive", where="VerticalConfig")

    def parameters(self) -> Array:
        """The vector the kernels read, (N_PARAM,)."""
        p = np.zeros(at.N_PARAM)
        for offset, name in _OFFSETS.items():
            p[offset] = getattr(self, name)
        p[at.P_USE_PRESSURE] = float(self.use_pressure)
        return p


_OFFSETS = {
    at.P_STALE: "pressure_stale",
    at.P_GAP: "max_gap",
    at.P_WINDOW: "mean_ticks",
    at.P_RISE_WINDOW: "rise_window",
    at.P_RISE: "least_rise",
    at.P_JUMP: "jump_share",
    at.P_END_TIME: "end_time",
    at.P_END_SPEED: "end_speed",
    at.P_STAIR_RATE: "stair_rate",
    at.P_LIFT_SPEED: "lift_speed",
    at.P_SIGMA: "rise_sigma",
    at.P_SIGMA_RELATIVE: "rise_sigma_relative",
    at.P_TILT: "tilt_tau",
    at.P_SHAKE: "shake_rate",
    at.P_NOISE: "speed_noise",
    at.P_BIAS: "drift_walk",
    at.P_READING: "reading_sigma",
    at.P_OUTLIER: "outlier",
    at.P_STAIR_MEAN: "stair_speed",
    at.P_STAIR_SPREAD: "stair_speed_sigma",
    at.P_LIFT_MEAN: "ride_speed",
    at.P_LIFT_SPREAD: "ride_speed_sigma",
    at.P_RAMP: "ride_ramp",
    at.P_WANDER: "ride_wander",
    at.P_START: "start_rate",
    at.P_STOP: "stop_rate",
    at.P_LANDING: "landing_rate",
    at.P_BELIEF: "belief",
    at.P_LEAST_TIME: "least_time",
    at.P_RISER: "riser",
    at.P_SPEED_SIGMA: "speed_rise_sigma",
    at.P_SPEED_SIGMA_RELATIVE: "speed_rise_sigma_relative",
    at.P_RISE_AGREED: "agreed_rise",
}
