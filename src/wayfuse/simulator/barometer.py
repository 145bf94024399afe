"""The barometer of a phone: the air over the feet, weather, draughts, and a sensor behind a small hole.

Everything is made in metres of height and written as pressure by the hydrostatic equation at the building.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wayfuse.core.types import Array
from wayfuse.simulator.toml_tables import no_negative, require
from wayfuse.simulator.walker import GRID_HZ, Walk

__all__ = ["BarometerModel", "PressureSamples", "measure_pressure"]

_SCALE_HEIGHT = 8435.0  # m over which pressure falls by e, air of 15 degrees C (R T / (M g))
_PHONE_HEIGHT = 1.2  # m above the feet


@dataclass(frozen=True, slots=True, kw_only=True)
class BarometerModel:
    """Sensor and air. "measured" marks figures of the public ipin2023 logs."""

    rate_hz: float = 10.0  # measured; 0: the phone has none
    noise_m: float = 0.04  # per sample; measured
    drift_m_per_min: float = 0.1  # weather, standard deviation of its slope; measured median 0.1
    draughts_per_min: float = 0.5  # doors, fans
    draught_m: tuple[float, float] = (0.3, 1.0)  # size of a swing; measured 0.6 to 1.0 on level ground
    draught_s: tuple[float, float] = (4.0, 10.0)  # its length
    lasting_share: float = 0.3  # of the draughts: a door stays open and the level stays changed
    lag_s: float = 0.3  # time constant of case and filter
    sea_hpa: float = 1000.0  # at the lowest storey, mean
    weather_hpa: float = 5.0  # of it, between walks; measured 34 m between sessions
    phone_hpa: float = 0.5  # offset of a phone; measured 4 m between two
    step_hpa: float = 0.000244  # resolution, 1/4096 hPa: usual for MEMS barometers

    def __post_init__(self) -> None:
        no_negative(self)
        require("sea_hpa, step_hpa", min(self.sea_hpa, self.step_hpa) > 0.0, self.sea_hpa, "must be positive")


@dataclass(frozen=True, slots=True, eq=False)
class PressureSamples:
    """Pressure (n,) hPa at t (n,) s from the walk's start."""

    t: Array
    hpa: Array


def measure_pressure(
    walk: Walk, model: BarometerModel, phone_hpa: float, rng: np.random.Generator
) -> PressureSamples:
    """What the barometer records on a walk.

    Parameters
    ----------
    phone_hpa : the phone's own offset, the same on all its walks.
    """
    z = np.zeros(len(walk.t)) if walk.climb is None else walk.climb.z
    slope = model.drift_m_per_min / 60.0 * rng.normal()
    air = _PHONE_HEIGHT + slope * walk.t + _draughts(walk.t, model, rng)
    if not model.rate_hz:
        return PressureSamples(np.empty(0), np.empty(0))
    t = np.round(np.arange(rng.uniform(0.0, 1.0 / model.rate_hz), walk.duration, 1.0 / model.rate_hz), 3)
    height = np.interp(t, walk.t, _lagged(z + air, model.lag_s)) + rng.normal(0.0, model.noise_m, len(t))
    ground = model.sea_hpa + model.weather_hpa * rng.normal() + phone_hpa
    hpa = ground * np.exp(-height / _SCALE_HEIGHT)
    return PressureSamples(t, np.round(hpa / model.step_hpa) * model.step_hpa)


def _draughts(t: Array, model: BarometerModel, rng: np.random.Generator) -> Array:
    """Swings (n,) m of the air: bumps, and steps that last."""
    air = np.zeros(len(t))
    for _ in range(rng.poisson(model.draughts_per_min * t[-1] / 60.0)):
        start, length = rng.uniform(0.0, t[-1]), rng.uniform(*model.draught_s)
        size = rng.uniform(*model.draught_m) * rng.choice((-1.0, 1.0))
        part = np.clip((t - start) / length, 0.0, 1.0)
        turns = 0.5 if rng.random() < model.lasting_share else 1.0
        air += size * 0.5 * (1.0 - np.cos(2.0 * np.pi * turns * part))
    return np.clip(air, -model.draught_m[1], model.draught_m[1])


def _lagged(values: Array, time: float) -> Array:
    """Values (n,) on the walk's grid behind a first-order lag of ``time`` s."""
    keep = float(np.exp(-1.0 / (GRID_HZ * max(time, 1e-6))))
    out = np.empty(len(values))
    level = float(values[0])
    for i, value in enumerate(values.tolist()):
        level = keep * level + (1.0 - keep) * value
        out[i] = level
    return out
