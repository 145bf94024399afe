"""The ride of a lift: height over time with limited speed, acceleration and jerk."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wayfuse.core.types import Array
from wayfuse.simulator.toml_tables import no_negative, require

__all__ = ["LiftModel", "ride"]


@dataclass(frozen=True, slots=True, kw_only=True)
class LiftModel:
    """A lift of a public building. Ranges are drawn from evenly."""

    speed: float = 1.0  # m/s, rated: usual for lifts of few floors
    acceleration: tuple[float, float] = (0.5, 0.9)  # m/s², between rides: loads differ
    jerk: float = 1.0  # m/s³, what riders find comfortable
    wait_s: tuple[float, float] = (3.0, 12.0)  # until it comes
    doors_s: tuple[float, float] = (
        2.5,
        4.5,
    )  # from standing in the cabin to the start, and from the stop to the exit
    escalator_speed: float = 0.5  # m/s along its slope: usual
    loss_db: tuple[float, float] = (12.0, 15.0)  # of the closed cabin, at 2.4 and 5 GHz

    def __post_init__(self) -> None:
        no_negative(self)
        moved = self.speed, self.acceleration[0], self.jerk, self.escalator_speed
        require("speeds, acceleration and jerk", min(moved) > 0.0, moved, "must be positive")


def ride(rise: float, acceleration: float, model: LiftModel, step: float) -> Array:
    """Heights (n,) m above the start at times 0, step, 2 step ... until the lift stands ``rise`` m higher (or lower).

    The acceleration is a trapezoid: it grows by the jerk, stays, and falls, mirrored at the end of the ride.
    """
    size = abs(rise)
    a, j = min(acceleration, (size * model.jerk**2 / 2.0) ** (1.0 / 3.0)), model.jerk
    # a ride too short for the rated speed: v (v / a + a / j) = rise
    v = min(model.speed, a * (-a / j + np.sqrt((a / j) ** 2 + 4.0 * size / a)) / 2.0)
    grow, keep = a / j, v / a - a / j
    start = grow + max(keep, 0.0) + grow
    level = max(size / v - start, 0.0)
    corners = np.cumsum([0.0, grow, max(keep, 0.0), grow, level, grow, max(keep, 0.0), grow])
    t = np.arange(0.0, corners[-1] + step, step)
    pushed = np.interp(t, corners, [0.0, a, a, 0.0, 0.0, -a, -a, 0.0])
    speed = np.concatenate([[0.0], np.cumsum(0.5 * (pushed[1:] + pushed[:-1]) * step)])
    height = np.concatenate([[0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]) * step)])
    return np.asarray(height * (rise / height[-1]))  # the grid misses the corners by less than a step
