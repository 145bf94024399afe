"""The office of liu2017: nine access points, a walk around a rectangle, and a compass that two sides deceive.

From the paper: an office of 25 m x 14 m, nine access points of known position, 648.2 m in 831 s along a rectangle,
415 measurements (one in 2 s), 41 surveyed places of 3 minutes each. The paper prints neither the rectangle nor the
positions nor any noise: those of `World` are ours.

Dead reckoning of the paper ends up 27.5 m off on average although it starts right and its steps are fair. A constant
error of the orientation would only turn the rectangle about, so the error must depend on where the phone points:
here the magnetic field of the building turns the reading by one angle on one short side and back on the other, which
shifts every lap by the same few metres.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayfuse.core.types import Array
from wayfuse.simulator.fields import WaveField, exponential_field

__all__ = ["Office", "Survey", "Walk", "World", "office", "survey", "walk"]


@dataclass(frozen=True, slots=True, kw_only=True)
class World:
    """What is given (cited) and what is chosen (the rest)."""

    size: tuple[float, float] = (25.0, 14.0)  # m, Sec. IV-A
    length: float = 648.2  # m, Sec. IV-A
    duration: float = 831.0  # s, Sec. IV-A
    period: float = 2.0  # s, 0.5 Hz, Sec. IV-A
    rectangle: tuple[float, float] = (19.0, 8.0)  # m, centred
    step_length: float = 0.7  # m: the best of Sec. IV-D is taken for the true one
    distortion: float = 0.296  # rad, of the orientation on the short sides, one way and the other
    compass_sigma: float = 0.02  # rad, of each reading
    ap_columns: tuple[float, float, float] = (1.0, 12.5, 24.0)  # m, x of the 3 x 3 access points
    ap_rows: tuple[float, float, float] = (1.0, 7.0, 13.0)  # m, y
    power: float = -40.0  # dBm at 1 m
    exponent: float = 3.0
    shadow_sigma: float = 6.0  # dB
    shadow_m: float = 3.0  # m
    scan_sigma: float = 3.0  # dB, of each reading
    n_survey: int = 41  # places, Sec. IV-A
    survey_s: float = 180.0  # s at each, Sec. IV-A
    device_sigma: float = 0.0  # dB, between the access points as another phone hears them
    speed_factor: float = 1.0  # of the walking speed, Sec. IV-F


class Office(NamedTuple):
    """Access points (9, 2) m and the shadowing of each."""

    ap_xy: Array
    shadow: WaveField


class Walk(NamedTuple):
    """One walk: t (T,) s, truth (T, 2) m, heading (T,) rad, step count (T,), orientation (T,) rad, rssi (T, 9) dBm."""

    t: Array
    truth: Array
    heading: Array
    step_count: Array
    orientation: Array
    rssi: Array


class Survey(NamedTuple):
    """Places (41, 2) m and the mean strength at each (41, 9) dBm."""

    xy: Array
    rssi: Array


def office(world: World, rng: np.random.Generator) -> Office:
    """Draw the shadowing of an office."""
    gx, gy = np.meshgrid(world.ap_columns, world.ap_rows)
    ap_xy = np.column_stack([gx.ravel(), gy.ravel()])
    return Office(ap_xy, exponential_field(len(ap_xy), world.shadow_sigma, world.shadow_m, rng))


def walk(world: World, place: Office, rng: np.random.Generator) -> Walk:
    """Walk around the rectangle, counter-clockwise from its lower left corner."""
    speed = world.speed_factor * world.length / world.duration
    t: Array = world.period * np.arange(int(world.length / speed / world.period) + 1, dtype=np.float64)
    travelled = speed * t
    truth, side = _along(world, travelled)
    heading: Array = np.asarray(0.5 * np.pi * side)
    deceived = world.distortion * np.array([0.0, 1.0, 0.0, -1.0])[side]
    orientation = heading + deceived + rng.normal(0.0, world.compass_sigma, len(t))
    step_count = np.floor(travelled / world.step_length)
    gain = rng.normal(0.0, world.device_sigma, len(place.ap_xy)) if world.device_sigma > 0.0 else 0.0
    rssi = np.round(_mean_rssi(world, place, truth) + gain + rng.normal(0.0, world.scan_sigma, (len(t), 9)))
    return Walk(t, truth, heading, step_count, np.angle(np.exp(1j * orientation)), rssi)


def survey(world: World, place: Office, rng: np.random.Generator) -> Survey:
    """Stand at evenly spread places of the rectangle and average the readings of three minutes at each."""
    lap = 2.0 * sum(world.rectangle)
    xy, _ = _along(world, lap * np.arange(world.n_survey) / world.n_survey)
    mean = _mean_rssi(world, place, xy)
    n = int(world.survey_s / world.period)
    readings = np.round(mean + rng.normal(0.0, world.scan_sigma, (n, *mean.shape)))
    return Survey(xy, readings.mean(axis=0))


def _along(world: World, travelled: Array) -> tuple[Array, NDArray[np.int64]]:
    """Places (T, 2) m and side (T,) 0 to 3 after metres (T,) along the rectangle."""
    a, b = world.rectangle
    x0, y0 = (world.size[0] - a) / 2.0, (world.size[1] - b) / 2.0
    corners = np.array([[x0, y0], [x0 + a, y0], [x0 + a, y0 + b], [x0, y0 + b], [x0, y0]])
    ends = np.cumsum([0.0, a, b, a, b])
    place = np.mod(travelled, ends[-1])
    xy = np.column_stack([np.interp(place, ends, corners[:, axis]) for axis in (0, 1)])
    return xy, np.minimum(np.searchsorted(ends, place, side="right") - 1, 3)


def _mean_rssi(world: World, place: Office, xy: Array) -> Array:
    n_aps = len(place.ap_xy)
    apart = xy[:, None] - place.ap_xy
    distance = np.hypot(apart[..., 0], apart[..., 1])
    member = np.tile(np.arange(n_aps), len(xy))
    shadow = place.shadow.at(member, np.repeat(xy, n_aps, axis=0)).reshape(len(xy), n_aps)
    loss = 10.0 * world.exponent * np.log10(np.maximum(distance, 1.0))
    return np.asarray(world.power - loss + shadow, dtype=np.float64)
