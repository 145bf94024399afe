"""Ranges by round-trip time (IEEE 802.11mc): distance, a bias, noise, and the detour through walls.

Every round asks all access points in turn. Each wall on the straight way lengthens the range by an exponential
variable, so that n walls add a gamma variable of mean n times ``wall_m``; a slab counts as several walls. An access
point answers where its mean level at the phone is strong enough.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wayfuse.core.types import Array, IntArray
from wayfuse.sensors.records import Range
from wayfuse.simulator.radio_field import RadioField
from wayfuse.simulator.scanner import level_at
from wayfuse.simulator.toml_tables import no_negative, require
from wayfuse.simulator.walker import Walk

__all__ = ["RangesModel", "measure_ranges", "range_errors"]

_ASK_S = 0.03  # s between one access point and the next
_LEVEL_SIGMA = 1.5  # dB, of the level that goes with a range


@dataclass(frozen=True, slots=True, kw_only=True)
class RangesModel:
    """Ranging; the values are assumed, not measured."""

    period_s: float = 0.0  # s between rounds; 0: the phone does not range
    bias_m: float = 0.2  # of every range
    noise_m: float = 0.4  # standard deviation, in line of sight
    wall_m: float = 0.5  # mean detour of a wall
    slab_walls: float = 3.0  # walls that a slab counts as
    weakest_dbm: float = -82.0  # no answer below
    missed_share: float = 0.1  # of the answers
    stated_sigma_m: float = 0.5  # what the record says of its own accuracy

    def __post_init__(self) -> None:
        no_negative(self, but=("bias_m", "weakest_dbm"))
        require("missed_share", self.missed_share <= 1.0, self.missed_share, "from 0 to 1")


def range_errors(n_walls: Array, model: RangesModel, rng: np.random.Generator) -> Array:
    """Errors (n,) m of ranges through walls (n,)."""
    detour = rng.gamma(np.maximum(n_walls, 1e-12), max(model.wall_m, 1e-12))
    return np.asarray(model.bias_m + detour + rng.normal(0.0, model.noise_m, len(n_walls)))


def measure_ranges(
    walk: Walk, radios: RadioField, model: RangesModel, rng: np.random.Generator
) -> tuple[Range, ...]:
    """What a phone ranges on a walk, in order of time (s from the walk's start); no range is negative."""
    if not model.period_s:
        return ()
    answering = _last_radio(radios)
    rounds = np.arange(rng.uniform(0.0, model.period_s), walk.duration, model.period_s)
    t = (rounds[:, None] + _ASK_S * np.arange(len(answering))).ravel()
    radio = np.tile(answering, len(rounds))
    keep = (t <= walk.duration) & (rng.random(len(t)) >= model.missed_share)
    t, radio = t[keep], radio[keep]
    xy = np.column_stack([np.interp(t, walk.t, walk.xy[:, k]) for k in (0, 1)])
    level = level_at(walk, radios, radio, xy, t) + rng.normal(0.0, _LEVEL_SIGMA, len(t))
    distance, n_walls = _geometry(walk, radios, radios.ap[radio], xy, t, model)
    measured = np.maximum(distance + range_errors(n_walls, model, rng), 0.0)
    network = np.searchsorted(radios.radio, radio)  # the first of each radio
    found = [
        Range(round(at, 4), anchor, round(d, 3), model.stated_sigma_m, float(round(rssi)))
        for at, anchor, d, rssi in zip(
            t.tolist(), radios.bssid[network].tolist(), measured.tolist(), level.tolist(), strict=True
        )
        if rssi >= model.weakest_dbm
    ]
    return tuple(sorted(found, key=lambda one: one.t))


def _last_radio(radios: RadioField) -> IntArray:
    """The radio (a,) of each access point that answers: the 5 GHz one where there is one."""
    last = np.zeros(len(radios.ap_xy), dtype=np.int64)
    np.maximum.at(last, radios.ap, np.arange(radios.n_radios))
    return last


def _geometry(
    walk: Walk, radios: RadioField, ap: IntArray, xy: Array, t: Array, model: RangesModel
) -> tuple[Array, Array]:
    """Distances (n,) m and walls (n,) between access points (n,) and the phone at times t (n,)."""
    grid = np.clip(np.searchsorted(walk.t, t, side="right") - 1, 0, len(walk.t) - 1)
    floor = np.zeros(len(t), dtype=np.int64) if walk.climb is None else walk.climb.floor[grid]
    distance, n_walls = np.empty(len(t)), np.empty(len(t))
    for k in np.unique(floor).tolist():
        here = floor == k
        distance[here] = radios.distance(ap[here], xy[here], k)
        n_walls[here] = radios.walls_between(ap[here], xy[here], k).sum(axis=1)
        n_walls[here] += model.slab_walls * radios.slabs(ap[here], xy[here], k)
    return distance, n_walls
