r"""The step counter and the turns of karlsson2015, section IV.

Steps: the time derivative of the norm of the acceleration, low-passed by a Butterworth filter of fourth order at 3 Hz
(nobody steps faster), counts a step wherever it rises through a threshold. The derivative removes gravity and what
changes slowly; the threshold keeps a resting phone from counting. It is not printed. On the validation walks of
oxford-steps anything from 4 to 16 m/s³ counts within 1 % in the hand, as the authors say; phones in trouser pockets,
of which they say the same, count 12 % (front) and 34 % (back) too many at the 8 chosen with these walks in view.

Turns: the angular velocity projected on the direction of gravity, which the accelerometer gives, integrated over time.

Offline: whole columns in, times out. `steps.detect_steps` is the causal one of this package.

References
----------
.. [1] F. Karlsson, M. Karlsson, B. Bernhardsson, F. Tufvesson and M. Persson, Sensor fused indoor positioning using
   dual band WiFi signal measurements, European Control Conference 2015, 10.1109/ECC.2015.7330777.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wayfuse.core.errors import ConfigError
from wayfuse.core.types import Array
from wayfuse.sensors.recording import Series

__all__ = ["DerivativeConfig", "count_steps", "filtered_derivative", "turns_about_gravity"]


@dataclass(frozen=True, slots=True, kw_only=True)
class DerivativeConfig:
    """rate : Hz, to which the column is resampled. cut_off : Hz. order. threshold : m/s³. gravity_cut_off : Hz."""

    rate: float = 20.0  # Section IV: "approximately 20 Hz"
    cut_off: float = 3.0  # Section IV
    order: int = 4  # Section IV
    threshold: float = 8.0  # not printed; see above
    gravity_cut_off: float = 0.3  # not printed: below the step frequency, above that of a change of grip

    def __post_init__(self) -> None:
        if not (0.0 < self.cut_off < self.rate / 2.0 and 0.0 < self.gravity_cut_off < self.rate / 2.0):
            raise ConfigError(
                f"cut-offs must lie between 0 and half the rate, got {self}", where="DerivativeConfig"
            )
        if self.order < 1 or not self.threshold > 0.0:
            raise ConfigError(f"order and threshold must be positive, got {self}", where="DerivativeConfig")


def filtered_derivative(acceleration: Series, config: DerivativeConfig | None = None) -> tuple[Array, Array]:
    """Times (n,) s at the configured rate and the low-passed derivative of the norm (n,) m/s³ there."""
    from scipy.signal import butter, sosfilt

    config = config or DerivativeConfig()
    t, norm = _resampled(acceleration.t, np.linalg.norm(acceleration.values, axis=1), config.rate)
    if len(t) < 2:
        return t, np.zeros(len(t))
    derivative = np.concatenate([[0.0], np.diff(norm) * config.rate])
    sections = butter(config.order, config.cut_off, fs=config.rate, output="sos")
    return t, np.asarray(sosfilt(sections, derivative))


def count_steps(acceleration: Series, config: DerivativeConfig | None = None) -> Array:
    """Times (k,) s at which the filtered derivative rises through the threshold: one per step."""
    config = config or DerivativeConfig()
    t, wave = filtered_derivative(acceleration, config)
    rises = np.flatnonzero((wave[:-1] <= config.threshold) & (wave[1:] > config.threshold)) + 1
    return np.asarray(t[rises])


def turns_about_gravity(
    acceleration: Series, rotation: Series, times: Array, config: DerivativeConfig | None = None
) -> Array:
    r"""Change of heading (rad, counter-clockwise positive) from each time to the next.

    Parameters
    ----------
    acceleration : m/s². rotation : angular velocity, rad/s, same device frame. times : (k,) s, ascending.

    Returns
    -------
    (k - 1,) rad: the integral of :math:`\omega \cdot \hat g`, where up is the low-passed acceleration; 0 outside
    the columns, and everywhere for columns of fewer than two samples.
    """
    config = config or DerivativeConfig()
    if len(acceleration) < 2 or len(rotation) < 2:
        return np.zeros(max(len(times) - 1, 0))
    up = _gravity(acceleration, rotation.t, config)
    rate = (rotation.values * up).sum(axis=1) / np.maximum(np.linalg.norm(up, axis=1), 1e-9)
    steps = 0.5 * (rate[1:] + rate[:-1]) * np.diff(rotation.t)
    angle = np.concatenate([[0.0], np.cumsum(steps)])
    return np.diff(np.interp(times, rotation.t, angle))


def _gravity(acceleration: Series, times: Array, config: DerivativeConfig) -> Array:
    """Specific force at rest (n, 3) m/s², upwards, at some times (n,) s: the slow part of the column."""
    from scipy.signal import butter, sosfiltfilt

    sections = butter(2, config.gravity_cut_off, fs=config.rate, output="sos")
    columns = []
    for values in acceleration.values.T:
        t, even = _resampled(acceleration.t, values, config.rate)
        # offline, so there and back: no delay between gravity and gyroscope
        padding = min(len(even) - 1, int(config.rate / config.gravity_cut_off))
        columns.append(np.interp(times, t, sosfiltfilt(sections, even, padlen=padding)))
    return np.column_stack(columns)


def _resampled(t: Array, values: Array, rate: float) -> tuple[Array, Array]:
    """Linear interpolation to even times."""
    if len(t) == 0:
        return t, values
    even = t[0] + np.arange(int((t[-1] - t[0]) * rate + 1e-9) + 1) / rate
    return even, np.interp(even, t, values)
