"""Parameters of the inertial front end.

Figures are of the survey walks of ms-indoor, of ipin2023-track3 ("ipin") and of the optimisation walks of
oxford-steps, whose unrecorded counts were taken from their cadence (autocorrelation, not causal). Those of
headings and step lengths are printed by ``python -m benchmarks.inertial``.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from wayfuse.core.errors import ConfigError
from wayfuse.core.types import Array
from wayfuse.inertial import _layout as at
from wayfuse.inertial.step_length import StepLengthModel

__all__ = ["InertialConfig"]


@dataclass(frozen=True, slots=True, kw_only=True)
class InertialConfig:
    """Parameters of attitude, heading and step detection (SI units; angles in rad).

    One set serves a phone in the hand, in a pocket, a bag, a pouch or on the arm.
    """

    # Band of the norm of the acceleration, Hz: steps come at 1.4 to 2.5 Hz and "no larger than 3 Hz"
    # (Karlsson et al. 2015, Sec. IV); 0.7 Hz keeps slow walkers and stops tilting of the hand.
    low_hz: float = 0.7
    high_hz: float = 3.0
    # Least peak, m/s²: 0.5, 0.6, 0.7 give 0.54, 0.38, 0.15 false steps per 19 s of standing (ipin) at the
    # same counts on oxford-steps optimisation walks and the same step lengths on ms-indoor.
    threshold: float = 0.7
    # Least peak relative to the mean of accepted peaks; 0 to 0.3 count alike, 0.4 loses steps in pockets.
    relative_threshold: float = 0.2
    level_rate: float = 0.2  # weight of a new peak in that mean: five steps
    min_interval: float = 0.28  # s, a run of 3.6 steps per second; 0.33 counts no better
    max_gap: float = 1.0  # s without a sample after which filters and integrals start afresh
    stale_after: float = 0.5  # s after which a silent sensor counts as absent: 25 samples at 50 Hz
    heading_delay: float = (
        0.2  # s before a step is declared at which its heading is read: delay of the filters
    )
    # "pulled": the gyro's yaw, drawn to the absolute heading; "orientation": the absolute heading itself.
    # Turn error between successive straight segments, median: pulled 4.9 deg, rotation vector 8.8 deg (ipin);
    # 9.0 and 10.7 deg (ms-indoor), at the same absolute error (table in `heading`).
    heading_source: Literal["pulled", "orientation"] = "pulled"
    heading_tau: float = 20.0  # s; 10 s: turn error 6.1 deg (ipin); 40 s: absolute error 9.0 instead of 7.8
    bias_time: float = 15.0  # s, least span over which a bias of the gyro is judged
    bias_drift: float = (
        1.0  # rad of drift in a block that is no disturbed field but a bias: 0.7 harms good gyros
    )
    shake_rate: float = (
        4.0  # rad/s, r.m.s. over 1 s: shaking 5 to 10, walking with turns at most 3.8 (ms-indoor)
    )
    # s; against the phone's own vertical, r.m.s.: 2, 3, 5, 8 s give 2.2, 1.8, 1.5, 1.5 deg (ms-indoor) but
    # 1.6, 2.3, 3.7, 5.6 deg with the partly biased gyros of ipin
    tilt_tau: float = 3.0
    tilt_tau_no_gyro: float = 0.5  # s; follows the hand, leaves half of the sway
    magnetic_tau: float = (
        5.0  # s; own attitude towards magnetic north (2 to 20 s: same heading error +-0.4 deg)
    )
    magnetic_tau_no_gyro: float = 0.5  # s
    magnetic_tolerance: float = (
        10.0  # µT off the running mean of \|B\| that halves the trust; within a walk sd 4 to 8
    )

    def __post_init__(self) -> None:
        if not 0.0 < self.low_hz < self.high_hz <= 5.0:
            raise ConfigError(
                f"low_hz = {self.low_hz}, high_hz = {self.high_hz}",
                where="InertialConfig",
                remedy="0 < low_hz < high_hz <= 5",
            )
        if self.heading_source not in ("pulled", "orientation"):
            raise ConfigError(
                f"heading_source = {self.heading_source!r}",
                where="InertialConfig",
                remedy="pulled or orientation",
            )
        for name in _POSITIVE:
            if not getattr(self, name) > 0.0:
                raise ConfigError(f"{name} must be positive", where="InertialConfig")
        if not (0.0 <= self.relative_threshold < 1.0 and 0.0 <= self.heading_delay <= 0.5):
            raise ConfigError(
                "relative_threshold must lie in [0, 1) and heading_delay in [0, 0.5] s",
                where="InertialConfig",
            )

    def parameters(self, step_length: StepLengthModel) -> Array:
        """The vector the kernels read, (N_PARAM,)."""
        p = np.zeros(at.N_PARAM)
        for offset, name in _OFFSETS.items():
            p[offset] = getattr(self, name)
        p[at.P_PULLED] = float(self.heading_source == "pulled")
        p[at.P_MODEL] = step_length.code
        p[at.P_COEFFICIENT : at.P_COEFFICIENT + len(step_length.coefficients)] = step_length.coefficients
        p[at.P_COEFFICIENT + 6 : at.P_COEFFICIENT + 8] = step_length.bounds
        return p


_OFFSETS = {
    at.P_LOW: "low_hz",
    at.P_HIGH: "high_hz",
    at.P_THRESHOLD: "threshold",
    at.P_RELATIVE: "relative_threshold",
    at.P_LEVEL_RATE: "level_rate",
    at.P_INTERVAL: "min_interval",
    at.P_GAP: "max_gap",
    at.P_STALE: "stale_after",
    at.P_DELAY: "heading_delay",
    at.P_TAU_HEADING: "heading_tau",
    at.P_TAU_TILT: "tilt_tau",
    at.P_TAU_TILT_NO_GYRO: "tilt_tau_no_gyro",
    at.P_TAU_MAG: "magnetic_tau",
    at.P_TAU_MAG_NO_GYRO: "magnetic_tau_no_gyro",
    at.P_MAG_TOLERANCE: "magnetic_tolerance",
    at.P_BIAS_TIME: "bias_time",
    at.P_BIAS_DRIFT: "bias_drift",
    at.P_SHAKE: "shake_rate",
}
_POSITIVE = tuple(n for n in _OFFSETS.values() if n not in ("relative_threshold", "heading_delay"))
