r"""Where a track is looked for that only ranges speak of: at its start, and while it goes on.

Between moments people move as the motion model says, but now and then they are on another floor, by stairs or a lift
that no sensor noticed, or somewhere else altogether. With rates :math:`\lambda_f` and :math:`\lambda_a` (1/s) of the
two, and E the mean likelihood of a moment's ranges (by the likeliest line of the phone) among the particles (c), the
same ones on other floors (f), and places all over the building (a), the share of the weight that belongs to the latter
two is

.. math:: \frac{\lambda_f \Delta t\, E_f}{E_c + \lambda_f \Delta t\, E_f + \lambda_a \Delta t\, E_a}, \quad
   \frac{\lambda_a \Delta t\, E_a}{E_c + \lambda_f \Delta t\, E_f + \lambda_a \Delta t\, E_a}

and so many particles are drawn there, in proportion to their likelihood (as the mixture proposals and the sensor
resetting of Monte Carlo localisation do). While the particles are where the ranges say, that is none.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayfuse.core.errors import ConfigError
from wayfuse.core.philox import Noise
from wayfuse.core.types import Array, BoolArray
from wayfuse.filters.cloud import NO_CONNECTOR, Cloud
from wayfuse.filters.particle_filter import FilterState, spread_slots
from wayfuse.filters.resampling import systematic
from wayfuse.models.initial import Anywhere
from wayfuse.sensors.records import Range
from wayfuse.tracking.engine import Known
from wayfuse.tracking.range_parts import Moment, Ranging, RangingState

__all__ = ["Elsewhere", "Fresh"]

_TRIED = 16  # places per particle where ranges begin a track
_LONGEST = 60.0  # s; after a longer silence the rates are those of so long a one
_OWN = 0x77A7_F05E  # of the random numbers here: particles that nobody replaces draw as if nobody had looked
_LEAST = 1e-300  # of a likelihood, against log(0)


class Fresh(NamedTuple):
    """Particles to draw afresh: the slots that they take, (n,), and what they are."""

    slots: NDArray[np.int64]
    cloud: Cloud


class _Proposal(NamedTuple):
    """Where else: how often (1/s), as many particles as there are, and their log-likelihood (N,)."""

    rate: float
    cloud: Cloud
    log_p: Array


@dataclass(frozen=True, slots=True, kw_only=True)
class Elsewhere:
    """Draws particles where ranges say that a track is and its particles are not.

    Parameters
    ----------
    anywhere : draws places all over the building. floor_rate, jump_rate : 1/s, how often somebody is on another floor,
    and anywhere, unnoticed. every : s between looks. most : share of the particles that one look may draw afresh.
    """

    anywhere: Anywhere
    floor_rate: float = 0.002
    jump_rate: float = 0.001
    every: float = 1.0
    most: float = 0.5

    def __post_init__(self) -> None:
        if not (min(self.floor_rate, self.jump_rate) >= 0.0 and self.every > 0.0 and 0.0 < self.most <= 1.0):
            raise ConfigError(
                "rates must not be negative, every must be positive, most a share above 0", where="Elsewhere"
            )

    def begin(
        self, ranging: Ranging, key: tuple[int, int], n: int, ranges: Sequence[Range], t: float, known: Known
    ) -> tuple[RangingState, FilterState | None]:
        """The first n particles: the best of many that are anywhere; None where no anchor is known."""
        first = ranging.init()
        moment = ranging.moment(first, ranges, t)
        if moment is None:
            return first, None
        noise, many = Noise(key), _TRIED * n
        cloud = self.anywhere.draw(noise, many, heading_known=known.heading)
        even = FilterState(cloud, np.zeros(many), noise.draw)
        state, log_likelihood = ranging.look(first, cloud, even.weights, moment)
        chosen = cloud.take(systematic(noise, even._replace(log_weights=log_likelihood).weights, n))
        return state._replace(looked=t), FilterState(chosen, np.zeros(n), noise.draw)

    def look(
        self,
        ranging: Ranging,
        key: tuple[int, int],
        state: RangingState,
        now: FilterState,
        moment: Moment,
        known: Known,
        *,
        is_watched: bool,
    ) -> tuple[RangingState, Array, Fresh | None]:
        """`Ranging.look`, and what to draw afresh; None where nothing.

        ``is_watched`` : whether a change of floors would not go unnoticed, so that there was none.
        """
        weights = now.weights
        after, log_likelihood = ranging.look(state, now.cloud, weights, moment)
        dt = moment.t - state.looked
        if dt < self.every:
            return after, log_likelihood, None
        noise = Noise((key[0] ^ _OWN, key[1]), state.looks)
        mine = ranging.at_best_line(state, now.cloud, moment)
        places = self.anywhere.draw(noise, now.cloud.n, heading_known=known.heading)
        proposals = [_Proposal(self.jump_rate, places, ranging.at_best_line(state, places, moment))]
        floors = np.unique(ranging.ranges.places.floor)
        if len(floors) > 1 and not is_watched:
            other, is_there = self._other_floors(noise, now.cloud, floors, ranging.ranges.offsets)
            there = np.where(is_there, ranging.at_best_line(state, other, moment), -np.inf)
            with np.errstate(divide="ignore"):
                proposals.append(_Proposal(self.floor_rate, other, there + np.log(now.cloud.n * weights)))
        fresh = self._drawn(noise, weights, mine, proposals, min(dt, _LONGEST))
        return after._replace(looked=moment.t, looks=noise.draw), log_likelihood, fresh

    def _drawn(
        self, noise: Noise, weights: Array, mine: Array, proposals: Sequence[_Proposal], dt: float
    ) -> Fresh | None:
        n = len(weights)
        top = max(float(mine.max()), *(float(p.log_p.max()) for p in proposals))
        here = max(float(weights @ np.exp(mine - top)), _LEAST)
        mass = np.array([p.rate * dt * float(np.exp(p.log_p - top).mean()) for p in proposals])
        share = mass / (here + mass.sum())
        share *= self.most / max(float(share.sum()), self.most)
        chosen = [
            (p, k) for p, k in zip(proposals, np.rint(n * share).astype(int).tolist(), strict=True) if k
        ]
        if not chosen:
            return None
        clouds = [
            p.cloud.take(systematic(noise, FilterState(p.cloud, p.log_p, 0).weights, k)) for p, k in chosen
        ]
        fresh = Cloud(*(np.concatenate(columns) for columns in zip(*clouds, strict=True)))
        return Fresh(spread_slots(noise, n, fresh.n), fresh)

    def _other_floors(
        self, noise: Noise, cloud: Cloud, floors: NDArray[np.integer], offsets: Array
    ) -> tuple[Cloud, BoolArray]:
        """The same particles on another of the floors that have anchors, and which of them can be there, (N,).

        Who is on a floor without anchors hears those of others and is none the less where they are.
        """
        u = noise.uniforms(cloud.n)[0]
        at = np.searchsorted(floors, cloud.floor).clip(0, len(floors) - 1)
        is_there = (floors[at] == cloud.floor) & (cloud.connector == NO_CONNECTOR)
        other = floors[(at + 1 + (u * (len(floors) - 1)).astype(np.int64)) % len(floors)]
        shift = offsets[cloud.floor] - offsets[other]
        x, y = (cloud.x + shift[:, 0]).astype(np.float32), (cloud.y + shift[:, 1]).astype(np.float32)
        for floor in floors.tolist():
            on = other == floor
            is_there[on] &= self.anywhere.walkable[floor].contains(x[on], y[on])
        return cloud._replace(x=x, y=y, floor=other.astype(np.int32)), is_there
