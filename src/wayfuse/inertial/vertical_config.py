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
    rise_sigma: float = 0.4  # m
    rise_sigma_relative: float = 0.05

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
}
