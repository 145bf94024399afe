"""The motion sensors of a cheap phone held flat in the hand of a walker.

Gait moves the phone: up and down as an inverted pendulum with harmonics at every step, forward once per step,
to the side once per stride, and the hand tilts it at the same rates. Orientation comes first; the
accelerometer (with gravity), the gyroscope, the magnetometer in a field that the building bends, and the
phone's own rotation vector, which follows that bent field, are all derived from it, so that they agree as
those of a phone do.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wayfuse.core.types import Array, IntArray
from wayfuse.simulator.fields import WaveField, smooth_field
from wayfuse.simulator.passages import Activity
from wayfuse.simulator.rotation import about_axis, multiply, rates, to_device
from wayfuse.simulator.toml_tables import no_negative, require
from wayfuse.simulator.walker import GRID_HZ, Person, Walk, WalkerModel, smooth

__all__ = ["ImuModel", "ImuSamples", "MagneticField", "magnetic_field", "measure"]

_GRAVITY = 9.80665  # m/s²
_MEAN_BOUNCE = 0.85  # of `WalkerModel.bounce_share`: on stairs a springy walker is springy too
_KNOT_S = 0.1  # s between the values of the heading error
_DRIFT_KNOT_S = 1.0  # s between the values of slow drifts


@dataclass(frozen=True, slots=True, kw_only=True)
class ImuModel:
    """Sensor and hand. "measured" marks figures of the public ms-indoor recordings (BMI160, AK09911)."""

    rate_hz: float = 50.0  # samples a second
    rate_sigma: float = 0.005  # relative, between phones; measured 49.5 to 50.8 Hz
    jitter_s: float = 3e-4  # of a sample's time
    harmonics: tuple[float, ...] = (1.0, 0.37, 0.13)  # vertical, at 1, 2, 3 x the step rate; measured ratios
    stairs_accel: float = (
        2.1  # m/s², amplitude at the step rate on stairs; stairs logs of ipin2023: 1.7 to 2.5
    )
    up_harmonics: tuple[float, ...] = (1.0, 0.17, 0.15)  # climbing; the same logs: 0.10 to 0.21 at 2 x
    down_harmonics: tuple[float, ...] = (1.0, 0.35, 0.25)  # the foot lands hard: 0.14 to 0.33 at 2 x there
    forward_m: float = 0.006  # forward sway once per step: +-6 % of the speed
    lateral_m: float = 0.015  # side sway once per stride: 2 to 4 cm from side to side
    pitch_sway: float = 0.06  # rad at the step rate; measured 0.4 to 1 rad/s rms about x
    roll_sway: float = 0.045  # rad at the stride rate; measured 0.2 rad/s rms about y
    yaw_sway: float = 0.04  # rad at the stride rate
    pitch_sigma: float = 0.06  # rad, between walks: the phone is held flat, measured mean a_y -1.0 to 0.6
    roll: float = 0.06  # rad, mean; measured mean a_x -0.6
    roll_sigma: float = 0.02  # rad, between walks
    tilt_drift: float = 0.03  # rad, slow, within a walk
    hold: float = 0.0  # rad, heading of the phone against the body, mean: 0 its top along the walk
    hold_sigma: float = 0.1  # rad, heading of the phone against the body, between walks
    hold_drift: float = 0.07  # rad, the same, slow, within a walk
    drift_time: float = 8.0  # s, of the slow drifts
    accel_noise: float = 0.009  # m/s²: 180 ug/sqrt(Hz) (BMI160 data sheet) over 25 Hz
    accel_bias: float = 0.1  # m/s², per axis, between walks
    tremor_accel: float = 0.12  # m/s², per sample: the hand
    gyro_noise: float = 6e-4  # rad/s: 0.007 deg/s/sqrt(Hz) (BMI160 data sheet) over 25 Hz
    gyro_bias: float = 0.003  # rad/s, per axis, at the start; measured drift 18 deg/min median
    gyro_walk: float = 2e-4  # rad/s per sqrt(s)
    tremor_gyro: float = 0.02  # rad/s, per sample
    accel_step: float = 0.0023956299  # m/s², resolution in the recordings' headers
    gyro_step: float = 0.0010681152  # rad/s
    field_ut: float = 45.0  # µT of the earth
    dip: float = 0.80  # rad below the horizon: 31 µT level, as measured
    disturbance_ut: float = 4.5  # µT, per axis, of the building
    disturbance_m: float = 2.5  # m over which it changes
    hard_iron_ut: float = 1.0  # µT, per axis, left after the phone's calibration
    field_noise_ut: float = 0.5  # µT
    field_step_ut: float = 0.5996704  # µT, resolution (AK09911)
    compass_time: float = 4.0  # s in which the rotation vector follows the magnetometer
    level_sigma: float = 0.01  # rad, error of its tilt

    def __post_init__(self) -> None:
        no_negative(self, but=("roll", "hold", "dip"))
        steps = self.rate_hz, self.accel_step, self.gyro_step, self.field_step_ut
        require("rate_hz and the resolutions (_step)", min(steps) > 0.0, steps, "must be positive")
        times = self.drift_time, self.compass_time, self.disturbance_m
        require("drift_time, compass_time, disturbance_m", min(times) > 0.0, times, "must be positive")


@dataclass(frozen=True, slots=True, eq=False)
class MagneticField:
    """Flux density in east-north-up: the earth's, bent by fields 3 f to 3 f + 2 on floor f."""

    earth: Array
    disturbance: WaveField

    def at(self, xy: Array, floor: int | IntArray) -> Array:
        """Field (n, 3) µT at places (n, 2) m of a floor, or each of its own (n,)."""
        first = np.broadcast_to(3 * np.asarray(floor), len(xy))
        bent = [self.disturbance.at(first + k, xy) for k in range(3)]
        return np.asarray(self.earth + np.column_stack(bent))


@dataclass(frozen=True, slots=True, eq=False)
class ImuSamples:
    """Samples at t (n,) s from the walk's start: m/s², rad/s, µT (n, 3), quaternions (n, 4) w, x, y, z."""

    t: Array
    acceleration: Array
    rotation_rate: Array
    magnetic_field: Array
    orientation: Array


def magnetic_field(n_floors: int, model: ImuModel, rng: np.random.Generator) -> MagneticField:
    """Draw the magnetic field of a building."""
    earth = model.field_ut * np.array([0.0, np.cos(model.dip), -np.sin(model.dip)])
    return MagneticField(earth, smooth_field(3 * n_floors, model.disturbance_ut, model.disturbance_m, rng))


def measure(
    walk: Walk,
    floor: int,
    person: Person,
    magnetic: MagneticField,
    model: ImuModel,
    walker: WalkerModel,
    rng: np.random.Generator,
) -> ImuSamples:
    """What the phone records on a walk; ``floor`` is of a walk that stays on it."""
    t = _sample_times(walk.duration, model, rng)
    knots = np.arange(0.0, walk.duration + _KNOT_S, _KNOT_S)
    phase = 2.0 * np.pi * np.interp(t, walk.phase_t, walk.phase)
    swing = np.interp(t, walk.t, walk.gait)
    attitude = _orientation(walk, t, phase, swing, model, rng)
    world = _world_acceleration(walk, t, phase, swing, person, model, walker)
    n = len(t)

    force = to_device(attitude, world + np.array([0.0, 0.0, _GRAVITY]))
    force += rng.normal(0.0, model.accel_bias, 3) + rng.normal(0.0, model.accel_noise, (n, 3))
    force += swing[:, None] * rng.normal(0.0, model.tremor_accel, (n, 3))

    drift = np.cumsum(rng.normal(0.0, model.gyro_walk * np.sqrt(_KNOT_S), (len(knots), 3)), axis=0)
    bias = rng.normal(0.0, model.gyro_bias, 3) + drift
    omega = rates(t, attitude) + np.column_stack([np.interp(t, knots, b) for b in bias.T])
    omega += (
        rng.normal(0.0, model.gyro_noise, (n, 3))
        + rng.normal(0.0, model.tremor_gyro, (n, 3)) * swing[:, None]
    )

    xy_knots = np.column_stack([np.interp(knots, walk.t, walk.xy[:, k]) for k in (0, 1)])
    flux_knots = magnetic.at(xy_knots, floor if walk.climb is None else _at(walk, walk.climb.floor, knots))
    flux = to_device(attitude, np.column_stack([np.interp(t, knots, b) for b in flux_knots.T]))
    flux += rng.normal(0.0, model.hard_iron_ut, 3) + rng.normal(0.0, model.field_noise_ut, (n, 3))

    return ImuSamples(
        t=t,
        acceleration=np.round(force / model.accel_step) * model.accel_step,
        rotation_rate=np.round(omega / model.gyro_step) * model.gyro_step,
        magnetic_field=np.round(flux / model.field_step_ut) * model.field_step_ut,
        orientation=_rotation_vector(attitude, t, knots, flux_knots, bias[:, 2], model, rng),
    )


def _sample_times(duration: float, model: ImuModel, rng: np.random.Generator) -> Array:
    """Sample times on whole milliseconds, as the recordings have them, the first 0.1 s into the walk."""
    period = (1.0 + model.rate_sigma * rng.normal()) / model.rate_hz
    regular = np.arange(0.1, duration, period)
    t = np.round(1e3 * (regular + np.clip(rng.normal(0.0, model.jitter_s, len(regular)), -2e-3, 2e-3)))
    return np.asarray(t[(t / 1e3 <= duration) & (np.diff(t, prepend=-1.0) > 0.0)] / 1e3)


def _orientation(
    walk: Walk, t: Array, phase: Array, swing: Array, model: ImuModel, rng: np.random.Generator
) -> Array:
    """Device to east-north-up: the screen up, its top along the walk, turned and tilted by the hand."""
    hold, pitch, roll = rng.normal(0.0, 1.0, 3) * (model.hold_sigma, model.pitch_sigma, model.roll_sigma)
    drifts = [_drift(t, model.drift_time, rng) for _ in range(3)]
    lag = rng.uniform(0.0, 2.0 * np.pi, 3)  # of the hand behind the foot
    yaw = np.interp(t, walk.t, walk.heading) - 0.5 * np.pi + hold + model.hold_drift * drifts[0]
    yaw = yaw + swing * model.yaw_sway * np.sin(0.5 * phase + lag[0])
    pitch = pitch + model.tilt_drift * drifts[1] + swing * model.pitch_sway * np.sin(phase + lag[1])
    roll = (
        model.roll
        + roll
        + model.tilt_drift * drifts[2]
        + swing * model.roll_sway * np.sin(0.5 * phase + lag[2])
    )
    yaw = yaw + model.hold
    return multiply(about_axis(2, yaw), multiply(about_axis(0, pitch), about_axis(1, roll)))


def _world_acceleration(
    walk: Walk, t: Array, phase: Array, swing: Array, person: Person, model: ImuModel, walker: WalkerModel
) -> Array:
    """Acceleration (n, 3) m/s² in east-north-up: of the path, and of the gait on top of it."""
    path = np.gradient(np.gradient(walk.xy, axis=0), axis=0) * GRID_HZ**2
    heading = np.interp(t, walk.t, walk.heading)
    length = np.interp(t, walk.contact, walk.step_length)
    omega = 2.0 * np.pi * person.step_rate
    # An inverted pendulum of leg l rises by L²/(8 l) over a step of length L: half of it is the amplitude.
    lift = person.bounce * length**2 / (16.0 * walker.leg_length) * omega**2
    vertical = sum(a * np.cos((k + 1) * (phase - 0.9)) for k, a in enumerate(model.harmonics))
    forward = swing * model.forward_m * omega**2 * np.sin(phase + 0.6)
    aside = swing * model.lateral_m * (0.5 * omega) ** 2 * np.sin(0.5 * phase)
    c, s = np.cos(heading), np.sin(heading)
    level = np.column_stack([np.interp(t, walk.t, path[:, k]) for k in (0, 1)])
    level += np.column_stack([forward * c - aside * s, forward * s + aside * c])
    return np.column_stack([level, _vertical(walk, t, phase, swing, swing * lift * vertical, person, model)])


def _vertical(
    walk: Walk, t: Array, phase: Array, swing: Array, level: Array, person: Person, model: ImuModel
) -> Array:
    """Vertical acceleration (n,) m/s²: that of level gait, other on stairs, and that of the way up or down."""
    if walk.climb is None:
        return level
    path = np.gradient(np.gradient(walk.climb.z)) * GRID_HZ**2
    stairs = np.interp(t, walk.t, smooth((walk.climb.activity == Activity.STAIRS).astype(np.float64), 0.3))
    down = np.interp(t, walk.t, np.gradient(walk.climb.z)) < 0.0
    size = model.stairs_accel * swing * person.bounce / _MEAN_BOUNCE
    tread = [
        size * sum(a * np.cos((k + 1) * (phase - 0.9)) for k, a in enumerate(harmonics))
        for harmonics in (model.up_harmonics, model.down_harmonics)
    ]
    gait = (1.0 - stairs) * level + stairs * np.where(down, tread[1], tread[0])
    return np.asarray(gait + np.interp(t, walk.t, path))


def _at(walk: Walk, values: IntArray, t: Array) -> IntArray:
    """Values on the walk's grid at times t: those of the grid point before."""
    return values[np.clip(np.searchsorted(walk.t, t, side="right") - 1, 0, len(walk.t) - 1)]


def _rotation_vector(
    attitude: Array,
    t: Array,
    knots: Array,
    flux: Array,
    bias: Array,
    model: ImuModel,
    rng: np.random.Generator,
) -> Array:
    """The phone's own orientation: its heading follows the bent field slowly and the gyro's drift."""
    # A field bent clockwise by p is taken for north: the heading comes out p too far counter-clockwise.
    pull = np.arctan2(flux[:, 0], flux[:, 1])
    error = np.empty(len(knots))
    error[0] = pull[0]
    for k in range(1, len(knots)):
        slope = (pull[k - 1] - error[k - 1]) / model.compass_time + bias[k]
        error[k] = error[k - 1] + _KNOT_S * slope
    q = multiply(about_axis(2, np.interp(t, knots, error)), attitude)
    for axis in (0, 1):
        q = multiply(q, about_axis(axis, model.level_sigma * _drift(t, model.drift_time, rng)))
    return np.where(q[:, :1] < 0.0, -q, q)


def _drift(t: Array, time: float, rng: np.random.Generator) -> Array:
    """A slow random course of unit variance at times t: a Gauss-Markov process of time constant ``time``."""
    knots = np.arange(0.0, t[-1] + _DRIFT_KNOT_S, _DRIFT_KNOT_S)
    keep = float(np.exp(-_DRIFT_KNOT_S / time))
    course = rng.normal(size=len(knots))
    for k in range(1, len(course)):
        course[k] = keep * course[k - 1] + np.sqrt(1.0 - keep * keep) * course[k]
    return np.interp(t, knots, course)
