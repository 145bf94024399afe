"""Made-up walks with known steps, turns and attitude: formulas only, none of the package's own filters."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from wayfuse.sensors.recording import Recording, Series

G = 9.80665


def times(duration: float, rate: float, rng: np.random.Generator, jitter: float = 0.0) -> np.ndarray:
    t = np.arange(0.0, duration, 1.0 / rate)
    return np.sort(t + jitter / rate * rng.uniform(-1, 1, len(t)))


def bounce(t: np.ndarray, steps: int, cadence: float, start: float = 3.0, size: float = 3.0) -> np.ndarray:
    """Vertical acceleration of exactly ``steps`` steps: one sine period each, with a second harmonic."""
    phase = (t - start) * cadence
    wave = size * np.sin(2 * np.pi * phase) + 0.3 * size * np.sin(4 * np.pi * phase + 0.5)
    return np.where((phase >= 0) & (phase < steps), wave, 0.0)


def walk(
    seed: int = 0,
    *,
    steps: int = 40,
    cadence: float = 1.8,
    rate: float = 50.0,
    heading: float = 0.3,
    turn_rate: float = 0.0,
    pitch: float = 0.5,
    gyro_bias: float = 0.0,
    noise: float = 0.05,
    jitter: float = 0.0,
) -> Recording:
    """A phone held at a pitch, its top edge in walking direction; the four sensors at their own rates."""
    rng = np.random.default_rng(seed)
    duration = 6.0 + steps / cadence

    def attitude(t: np.ndarray) -> Rotation:
        yaw = heading - np.pi / 2 + turn_rate * t
        return Rotation.from_euler("ZX", np.column_stack([yaw, np.full(len(t), pitch)]))

    def series(
        rate: float, world: np.ndarray | None, sd: float, per_time: np.ndarray | None = None
    ) -> Series:
        t = times(duration, rate, rng, jitter)
        vectors = np.tile(world if world is not None else np.zeros(3), (len(t), 1))
        if per_time is not None:
            vectors = vectors + bounce(t, steps, cadence)[:, None] * per_time
        return Series(t, attitude(t).inv().apply(vectors) + sd * rng.standard_normal((len(t), 3)))

    t = times(duration, rate * 0.9, rng, jitter)
    q = attitude(t).as_quat(scalar_first=True)
    spin = series(rate * 1.3, np.array([0.0, 0.0, turn_rate + gyro_bias]), 0.1 * noise)
    return Recording(
        "made up",
        acceleration=series(rate, np.array([0.0, 0.0, G]), noise, np.array([0.0, 0.0, 1.0])),
        rotation_rate=spin,
        magnetic_field=series(rate * 0.7, np.array([0.0, 22.0, -40.0]), noise),
        orientation=Series(t, q),
    )
