r"""Nobody is farther from where the steps lead than somebody of this speed can be: chu2009 Section 3.3.1.

Around the last estimate, moved by the displacement of the steps since, lies a disc whose radius follows the speed: the
*confident size*, the weighted mean of the last k speeds with weights that decrease,

.. math:: c = \frac{\sum_{j=0}^{k-1} \alpha_j |v_{t-j}|}{\sum_j \alpha_j}, \quad \alpha_j = 1 - j / k  \quad (3.4)

Particles outside are filtered: they lose so many nats that the next resampling leaves them out. Who runs is looked for
far around, who stands is not.

Departures from the paper. Its sum has k + 1 terms, its example (3.5) k = 5 of them ("from time t to t - 5" are six):
here they are k. c is a speed which the paper takes for a radius, its period being 1 s: here the radius is c times the
time since the estimate. As printed c is 0 for somebody who has stood for k periods, and every particle is deleted: here
the radius is never below ``least``, and where the disc holds no particle at all none is filtered, for it is the disc
that is wrong then. Particles on connectors and on other floors than the estimate's pass: a disc is of one floor.

References
----------
.. [1] Chu, Wireless location tracking by a sensor-enhanced particle filter in 2.5D buildings, thesis, National
   Chiao Tung University, 2009.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from wayfuse.core.errors import ConfigError
from wayfuse.core.types import Array
from wayfuse.filters.cloud import NO_CONNECTOR, Cloud

__all__ = ["SpeedDisc", "SpeedFilter", "SpeedState", "confident_size"]


def confident_size(speeds: tuple[float, ...], k: int) -> float:
    """Weighted mean (m/s) of the newest k speeds (m/s, newest first) by Eq. 3.4; infinite where there are none."""
    newest = np.abs(speeds[:k])
    if not len(newest):
        return math.inf
    alpha = 1.0 - np.arange(len(newest)) / k
    return float(alpha @ newest / alpha.sum())  # Eq. 3.4


class SpeedState(NamedTuple):
    """What is known of somebody's speed. A value.

    speeds : m/s, between past estimates, newest first. t : s, x, y : m, floor : the last estimate, NaN before the
    first. dx, dy : m, displacement of the steps since.
    """

    speeds: tuple[float, ...] = ()
    t: float = math.nan
    x: float = math.nan
    y: float = math.nan
    floor: int = 0
    dx: float = 0.0
    dy: float = 0.0


@dataclass(frozen=True, slots=True)
class SpeedDisc:
    """A constraint: where somebody can be now. x, y, radius : m. penalty : nats for a particle outside.

    A penalty takes the place of the paper's deletion, so that weights stay finite; 30 nats leave 1e-13 of a weight.
    """

    x: float
    y: float
    floor: int
    radius: float
    penalty: float = 30.0

    def __post_init__(self) -> None:
        if not (self.radius > 0.0 and 0.0 <= self.penalty < math.inf):
            raise ConfigError(
                f"radius must be positive, penalty finite and not negative, got {self.radius}, {self.penalty}",
                where="SpeedDisc",
            )

    def restrict(self, _before: Cloud, after: Cloud, log_weights: Array) -> tuple[Cloud, int]:
        """Lower the weights of those outside; nobody is moved, and only where they are now counts."""
        judged = (after.floor == self.floor) & (after.connector == NO_CONNECTOR)
        d2 = (after.x.astype(np.float64) - self.x) ** 2 + (after.y.astype(np.float64) - self.y) ** 2
        outside = judged & (d2 > self.radius**2)
        n = int(np.count_nonzero(outside))
        if n == np.count_nonzero(
            judged
        ):  # none is where all should be: the disc is wrong, or there is nobody
            return after, 0
        log_weights[outside] -= self.penalty
        return after, n


@dataclass(frozen=True, slots=True, kw_only=True)
class SpeedFilter:
    """Keeps the speed of a track and says where its particles can be.

    Parameters
    ----------
    k : speeds in the mean. least : m, radius for somebody who stands: the error of an estimate and of a step. scale :
    multiplies the radius, 1 as printed. penalty : nats, see `SpeedDisc`.
    """

    k: int = 5
    least: float = 3.0
    scale: float = 1.0
    penalty: float = 30.0

    def __post_init__(self) -> None:
        if self.k < 1 or not (self.least > 0.0 and self.scale > 0.0):
            raise ConfigError(
                f"k must be at least 1, least and scale positive, got {self.k}, {self.least}, {self.scale}",
                where="SpeedFilter",
            )
        if not 0.0 <= self.penalty < math.inf:
            raise ConfigError(
                f"penalty must be finite and not negative, got {self.penalty}", where="SpeedFilter"
            )

    def stepped(self, state: SpeedState, length: float, heading: float) -> SpeedState:
        """A step was made: length (m), heading (rad, building frame)."""
        return state._replace(
            dx=state.dx + length * math.cos(heading), dy=state.dy + length * math.sin(heading)
        )

    def estimated(self, state: SpeedState, t: float, x: float, y: float, floor: int) -> SpeedState:
        """An estimate was made; the way stepped since the one before gives a speed."""
        speeds = self._speeds(state, t)
        if t <= state.t:  # a second estimate of one moment: the better place, the same time
            return state._replace(x=x, y=y, floor=floor, dx=0.0, dy=0.0)
        return SpeedState(speeds, t, x, y, floor)

    def disc(self, state: SpeedState, t: float) -> SpeedDisc | None:
        """Where the particles of time t (s) can be; None before the first estimate."""
        if not math.isfinite(state.t):
            return None
        size = confident_size(self._speeds(state, t), self.k)
        if not math.isfinite(size):
            return None
        radius = max(self.scale * size * max(t - state.t, 0.0), self.least)
        return SpeedDisc(state.x + state.dx, state.y + state.dy, state.floor, radius, self.penalty)

    def _speeds(self, state: SpeedState, t: float) -> tuple[float, ...]:
        """The speeds with that since the last estimate, newest first, no more than k."""
        dt = t - state.t
        if not dt > 0.0:
            return state.speeds[: self.k]
        return (math.hypot(state.dx, state.dy) / dt, *state.speeds)[: self.k]
