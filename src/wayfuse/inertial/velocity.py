r"""Velocity of a walker from vertical acceleration and azimuth: Eq. 13-17 of li2015 [1]_.

The vertical acceleration is smoothed by a low pass of first order,

.. math:: \hat a_i = (1 - \beta) a_i + \beta \hat a_{i-1} \quad (13)

in which every step leaves a peak and a dip. Their difference gives the length of the step, the time from peak to peak
its duration, and the phone's azimuth :math:`\alpha` its direction in the building:

.. math:: l = K (\hat a_{max} - \hat a_{min})^{1/4}, \quad |v| = l / \Delta T, \quad
          \theta = (90° - \alpha) + \varphi \quad (14-16)

with :math:`\varphi` the direction of east seen from building +x (the negative of a site's rotation). K is calibrated
per person (`calibrate`).

:math:`\beta = 0.9` belongs to the 100 Hz of the paper; at another rate it is taken to the power that gives the same
time constant (95 ms). Not printed, and chosen here: how large a swing is a step, how long after the last step a walker
is still walking.

Causal: a stride is known at its dip, when the next rise has begun; the low pass is late by its time constant. The paper
calls a step a stride.

>>> round(float(building_heading(0.5 * np.pi, east=0.25)), 2)  # the phone points east
0.25

References
----------
.. [1] Li, Burbano, Zhao, Carrera, Braun, Fine-grained Indoor Tracking by Fusing Inertial Sensor and Physical Layer
   Information in WLANs, University of Bern, INF-15-004, 2015, Section 5.2.
.. [2] N. Kakiuchi and S. Kamijo, Pedestrian dead reckoning for mobile phones through walking and running mode
   recognition, ITSC 2013.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from wayfuse.core.angles import azimuth_from_heading, heading_from_azimuth, wrap
from wayfuse.core.errors import ConfigError, UsageError
from wayfuse.core.types import Array
from wayfuse.inertial.attitude import rotate
from wayfuse.inertial.heading import device_heading
from wayfuse.inertial.step_length import DEFAULTS
from wayfuse.sensors.recording import Series

__all__ = [
    "Strides",
    "Velocities",
    "VelocityConfig",
    "azimuths",
    "building_heading",
    "calibrate",
    "find_strides",
    "low_pass",
    "velocities",
    "vertical_acceleration",
]

_RATE = 100.0  # Hz, of the paper's phone: beta belongs to it


@dataclass(frozen=True, slots=True, kw_only=True)
class VelocityConfig:
    """beta : Eq. 13, at 100 Hz. k : m per (m/s²)^(1/4), Eq. 14. swing : m/s², least difference of peak and dip.

    shortest, longest : s, time from peak to peak of a step; after ``longest`` without a peak the walker stands.
    """

    beta: float = 0.9  # Section 5.2.1
    k: float = DEFAULTS["kakiuchi"].coefficients[0]  # for another low pass: see `calibrate`
    swing: float = 0.8  # not printed; sway of a standing hand stays below it
    shortest: float = 0.3  # not printed; running
    longest: float = 1.2  # not printed; strolling

    def __post_init__(self) -> None:
        if not 0.0 <= self.beta < 1.0:
            raise ConfigError(f"beta must lie in [0, 1), got {self.beta}", where="VelocityConfig")
        if not (self.k > 0.0 and self.swing > 0.0 and 0.0 < self.shortest < self.longest):
            raise ConfigError(
                f"k, swing and times must be positive, shortest < longest, got {self}", where="VelocityConfig"
            )


class Strides(NamedTuple):
    """Steps found: t (n,) s, when each is known; start (n,) s, its peak; duration (n,) s; swing (n,) m/s²."""

    t: Array
    start: Array
    duration: Array
    swing: Array


class Velocities(NamedTuple):
    """Velocity over time: t (n,) s, speed (n,) m/s, heading (n,) rad, velocity (n, 2) m/s, building frame."""

    t: Array
    speed: Array
    heading: Array
    velocity: Array


def vertical_acceleration(acceleration: Series, orientation: Series) -> Array:
    """Upward specific force (n,) m/s² at the times of the accelerations, by the orientation that was last known."""
    if not len(orientation):
        raise UsageError(
            "no orientation",
            where="vertical_acceleration",
            remedy="make one with inertial.attitude.estimate_attitude",
        )
    at = np.searchsorted(orientation.t, acceleration.t, side="right") - 1
    return np.asarray(rotate(orientation.values[np.maximum(at, 0)], acceleration.values)[:, 2])


def azimuths(orientation: Series) -> Array:
    """Azimuth (n,) rad, clockwise from north, in which the phone points at each orientation."""
    return azimuth_from_heading(device_heading(orientation.values))


def building_heading(azimuth: ArrayLike, east: float) -> Array:
    """Heading (rad from building +x) of an azimuth (rad), Eq. 16; east : rad, counter-clockwise from +x to east."""
    return wrap(heading_from_azimuth(azimuth) + east)


def low_pass(t: Array, raw: Array, beta: float) -> Array:
    """Eq. 13 over samples (n,) at times (n,) s; the first one starts it."""
    out = np.empty(len(raw))
    keep = beta ** (np.diff(t, prepend=t[:1]) * _RATE)
    last = float(raw[0]) if len(raw) else 0.0
    for i, (value, part) in enumerate(zip(raw.tolist(), keep.tolist(), strict=True)):
        last = (1.0 - part) * value + part * last  # Eq. 13
        out[i] = last
    return out


def find_strides(t: Array, smooth: Array, config: VelocityConfig | None = None) -> Strides:
    """Steps in a smoothed vertical acceleration (n,) m/s² at times (n,) s.

    A peak or dip counts once the curve has turned back by half the least swing. A step is a peak with the dip after
    it; its duration counts from the peak before, or, for the first of a walk, to the peak after.
    """
    c = config or VelocityConfig()
    rows: list[tuple[float, float, float, float]] = []
    peak: tuple[float, float] | None = None  # time and height of the last peak
    before = -np.inf  # time of the peak of the step before
    top = low = (float(t[0]), float(smooth[0])) if len(t) else (0.0, 0.0)
    is_rising = True
    for now, value in zip(t.tolist(), smooth.tolist(), strict=True):
        if is_rising:
            top = max(top, (now, value), key=lambda at: at[1])
            if top[1] - value > 0.5 * c.swing:
                peak, low, is_rising = top, (now, value), False
        else:
            low = min(low, (now, value), key=lambda at: at[1])
            if value - low[1] > 0.5 * c.swing:
                top, is_rising = (now, value), True
                if peak is not None and peak[1] - low[1] >= c.swing and peak[0] - before >= c.shortest:
                    rows.append((now, peak[0], peak[0] - before, peak[1] - low[1]))
                    before = peak[0]
    known, start, duration, swing = np.array(rows).reshape(-1, 4).T
    # the first of a walk has no peak before it: it is known with the second; a single peak is no walk
    is_first = duration > c.longest
    known = np.where(is_first, np.append(known[1:], np.inf), known)
    duration = np.where(is_first, np.append(duration[1:], np.inf), duration)
    is_walk = duration <= c.longest
    return Strides(known[is_walk], start[is_walk], duration[is_walk], swing[is_walk])


def calibrate(strides: Strides, distance: float) -> float:
    """K of Eq. 14 from a way of known length (m) walked with these steps.

    Raises
    ------
    UsageError : there is no step.
    """
    if not len(strides.t):
        raise UsageError("no step in this walk", where="calibrate", remedy="walk on, the phone in the hand")
    return float(distance / (strides.swing**0.25).sum())


def velocities(
    times: Array, strides: Strides, azimuth: Series, east: float = 0.0, config: VelocityConfig | None = None
) -> Velocities:
    """Velocity at times (n,) s: speed of the last step, direction of the last azimuth; rest where neither is new.

    Parameters
    ----------
    strides : of `find_strides`. azimuth : (m, 1) rad, clockwise from north. east : rad, from building +x to east.

    Notes
    -----
    The azimuth is the mean direction of the last step's duration, not one sample: a walker sways.
    """
    c = config or VelocityConfig()
    times = np.asarray(times, dtype=np.float64)
    at = np.searchsorted(strides.t, times, side="right") - 1
    known, last = at >= 0, np.maximum(at, 0)
    speed, duration = np.zeros(len(times)), np.full(len(times), c.shortest)
    if len(strides.t):
        length = c.k * strides.swing[last] ** 0.25  # Eq. 14
        is_walking = known & (times - strides.t[last] <= c.longest)
        speed = np.where(is_walking, length / strides.duration[last], 0.0)  # Eq. 15
        duration = np.where(known, strides.duration[last], c.shortest)
    heading = building_heading(_mean_azimuth(azimuth, times, duration), east)
    velocity = speed[:, None] * np.column_stack([np.cos(heading), np.sin(heading)])  # Eq. 17
    return Velocities(times, speed, heading, velocity)


def _mean_azimuth(azimuth: Series, times: Array, duration: Array) -> Array:
    """Direction (n,) of the mean of the azimuths of the last ``duration`` (n,) s, at least the last one; 0 for none."""
    if not len(azimuth):
        return np.zeros(len(times))
    angle = azimuth.values[:, 0]
    sums = np.vstack([np.zeros(2), np.cumsum(np.column_stack([np.cos(angle), np.sin(angle)]), axis=0)])
    end = np.maximum(np.searchsorted(azimuth.t, times, side="right"), 1)
    start = np.minimum(np.searchsorted(azimuth.t, times - duration, side="right"), end - 1)
    c, s = (sums[end] - sums[start]).T
    return np.asarray(np.arctan2(s, c))
