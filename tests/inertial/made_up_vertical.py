"""Made-up rides, climbs and nuisances with a barometer: formulas only, none of the package's own filters."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from wayfuse.sensors.recording import Recording, Series

G = 9.80665
PA_PER_METRE = 0.12  # hPa per metre at sea level


def trapezoid_speed(t: np.ndarray, start: float, rise: float, speed: float, ramp: float) -> np.ndarray:
    """Vertical speed of a ride: up to ``speed`` within ``ramp`` seconds, constant, and down again."""
    sign, cruise = np.sign(rise), abs(rise) / speed - ramp
    x = t - start
    up, down = np.clip(x / ramp, 0.0, 1.0), np.clip((x - cruise - ramp) / ramp, 0.0, 1.0)
    return sign * speed * (up - down)


def recording(
    t: np.ndarray,
    speed: np.ndarray,
    *,
    seed: int = 0,
    sway: np.ndarray | float = 0.0,
    pitch: float = 0.6,
    noise: float = 0.03,
    pressure_noise: float = 0.005,
    pressure_rate: float = 6.0,
    extra_altitude: np.ndarray | float = 0.0,
) -> Recording:
    """A phone held at a pitch that moves vertically at a speed; sway : vertical acceleration of the gait on top."""
    rng = np.random.default_rng(seed)
    dt = np.diff(t, append=2 * t[-1] - t[-2])
    vertical = np.gradient(speed, t) + sway + G
    world = np.column_stack([np.zeros_like(t), np.zeros_like(t), vertical])
    device = Rotation.from_euler("X", pitch).inv().apply(world) + noise * rng.standard_normal((len(t), 3))
    altitude = np.cumsum(speed * dt) + extra_altitude
    every = max(1, round(1.0 / (pressure_rate * float(np.median(dt)))))
    hpa = 1000.0 - PA_PER_METRE * altitude[::every]
    hpa = hpa + pressure_noise * rng.standard_normal(len(hpa))
    return Recording(
        "made up",
        acceleration=Series(t, device),
        rotation_rate=Series(t + 0.003, 0.01 * rng.standard_normal((len(t), 3))),
        pressure=Series(t[::every], hpa[:, None]),
    )


def gait(t: np.ndarray, start: float, stop: float, cadence: float = 1.8, size: float = 2.0) -> np.ndarray:
    """Vertical acceleration of whole steps between two times: no mean, and no mean speed."""
    n = np.floor((stop - start) * cadence)
    phase = (t - start) * cadence
    return np.where((phase >= 0) & (phase < n), size * np.cos(2 * np.pi * phase), 0.0)
