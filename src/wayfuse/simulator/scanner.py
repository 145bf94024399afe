"""A phone's Wi-Fi scanner: sweeps over the channels, misses, and lists that repeat what was heard before.

Android delivers a list of everything it still remembers, each network with the time it was last heard. About
half of such a list is stale, and a weak network is heard in few sweeps but listed in most. Sweeps go on
before the recording starts, so the first list already has a past.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wayfuse.core.types import Array, BoolArray, IntArray
from wayfuse.simulator.radio_field import RadioField
from wayfuse.simulator.toml_tables import no_negative, require
from wayfuse.simulator.walker import Walk

__all__ = ["ScannerModel", "Sweep", "between_floors", "level_at", "scan"]

_NO_SHARE = 1e-9  # of a storey in what is heard: less is rounding


@dataclass(frozen=True, slots=True, kw_only=True)
class ScannerModel:
    """The scanner. "measured" marks figures of the public ms-indoor recordings."""

    period_s: float = (
        2.1  # s between lists; measured 1.9 to 3.7. Throttled Android: 30 (4 scans in 2 minutes)
    )
    period_jitter_s: float = 0.1  # of it, standard deviation
    sweep_s: float = 1.4  # s from the first channel to the last
    latency_s: float = 0.6  # s from the last channel to the list; measured age of the freshest tenth 0.73 s
    memory_s: float = 30.0  # s a network stays listed; measured 99 % younger than 29 s
    before_s: float = 30.0  # s of sweeps before the recording, at its first place
    sensitivity_dbm: float = -89.0  # where half of the strong networks' hits are left; measured 5 % below -90
    weakest_dbm: float = -93.0  # nothing weaker is reported; measured
    softness_db: float = 1.5  # logistic edge of the sensitivity
    hit_rate: float = (
        0.55  # chance that a strong network is heard in a sweep; gives the measured share of stale
    )
    fading_db: float = 5.0  # per sweep and radio: multipath; a Rayleigh channel has 5.6 dB
    walk_db: float = 4.0  # per walk and radio: crowds, doors, the hour; another day than the survey's
    twin_db: float = 0.7  # per reading: networks of one radio
    body_db: float = 7.0  # behind the walker's back
    device_offset_db: tuple[float, float] = (0.0, 0.0)  # of this phone's receiver, at 2.4 and 5 GHz
    throttle_scans: int = 0  # most scans in throttle_s; Android grants an app in front 4; 0: no limit
    throttle_s: float = 120.0  # s
    missed_share: float = 0.0  # of the scans asked for: nothing is heard, nothing is delivered
    stale_repeats: bool = False  # a scan refused or missed delivers the last list again

    def __post_init__(self) -> None:
        no_negative(self, but=("sensitivity_dbm", "weakest_dbm", "device_offset_db"))
        require("period_s", self.period_s > 0.0, self.period_s, "must be positive")
        require("softness_db", self.softness_db > 0.0, self.softness_db, "must be positive")
        shares = self.hit_rate, self.missed_share
        require("hit_rate, missed_share", max(shares) <= 1.0, shares, "from 0 to 1")


@dataclass(frozen=True, slots=True, eq=False)
class Sweep:
    """One delivered list: time t (s from the walk's start), networks (n,), dBm (n,), last heard (n,) s."""

    t: float
    network: IntArray
    rssi: Array
    last_seen: Array


def scan(
    walk: Walk,
    floor: int,
    radios: RadioField,
    model: ScannerModel,
    rng: np.random.Generator,
    loss: Array | None = None,
) -> tuple[Sweep, ...]:
    """The lists a phone delivers on a walk.

    Parameters
    ----------
    floor : of a walk that stays on it; others carry theirs.
    loss : (n, 2) dB at 2.4 and 5 GHz on the walk's grid, where something is about the phone: a lift's cabin.
    """
    delivered = _delivery_times(walk.duration, model, rng)
    granted = _granted(delivered, model, rng)
    n_radios, n_sweeps = radios.n_radios, len(delivered)
    order = np.argsort(np.argsort(radios.frequency, kind="stable")) / max(1, n_radios - 1)
    heard_at = delivered[:, None] - model.latency_s - model.sweep_s * (1.0 - order)  # (sweeps, radios)
    level = _levels(walk, floor, radios, heard_at, model)
    if loss is not None:
        grid = np.clip(np.searchsorted(walk.t, heard_at.ravel()), 0, len(walk.t) - 1).reshape(heard_at.shape)
        level -= loss[grid, radios.band[None, :]]
    offset = np.array(model.device_offset_db)[radios.band]
    level += rng.normal(0.0, model.fading_db, (n_sweeps, n_radios)) + offset
    level += rng.normal(0.0, model.walk_db, n_radios)

    n = len(radios.bssid)
    rssi = np.round(level[:, radios.radio] + rng.normal(0.0, model.twin_db, (n_sweeps, n)))
    edge = (rssi - model.sensitivity_dbm) / model.softness_db
    heard = rng.random((n_sweeps, n)) < model.hit_rate / (1.0 + np.exp(-edge))
    heard &= (rssi >= model.weakest_dbm) & granted[:, None]
    times = heard_at[:, radios.radio]

    last_seen, last_rssi = np.full(n, -np.inf), np.zeros(n)
    sweeps = []
    for k, t in enumerate(delivered.tolist()):
        last_seen = np.where(heard[k], times[k], last_seen)
        last_rssi = np.where(heard[k], rssi[k], last_rssi)
        listed = np.flatnonzero(t - last_seen <= model.memory_s)
        is_delivered = bool(granted[k]) or model.stale_repeats
        if is_delivered and 0.0 <= t <= walk.duration and len(listed):
            listed = listed[np.argsort(-last_rssi[listed], kind="stable")]
            sweeps.append(Sweep(t, listed, last_rssi[listed], last_seen[listed]))
    return tuple(sweeps)


def _delivery_times(duration: float, model: ScannerModel, rng: np.random.Generator) -> Array:
    n = int(np.ceil((duration + model.before_s) / (0.5 * model.period_s))) + 2
    gaps = np.maximum(rng.normal(model.period_s, model.period_jitter_s, n), 0.5 * model.period_s)
    t = -model.before_s + rng.uniform(0.0, model.period_s) + np.cumsum(gaps)
    return np.asarray(t[t <= duration])


def _granted(t: Array, model: ScannerModel, rng: np.random.Generator) -> BoolArray:
    """Which of the scans asked for at times t (n,) s take place: those missed and those refused do not."""
    granted = np.ones(len(t), dtype=bool)
    if model.missed_share:
        granted &= rng.random(len(t)) >= model.missed_share
    if model.throttle_scans:
        scans: list[float] = []
        for k in np.flatnonzero(granted).tolist():
            if len(scans) >= model.throttle_scans and t[k] - scans[-model.throttle_scans] < model.throttle_s:
                granted[k] = False
            else:
                scans.append(float(t[k]))
    return granted


def _levels(walk: Walk, floor: int, radios: RadioField, heard_at: Array, model: ScannerModel) -> Array:
    """RSSI (sweeps, radios) dBm at the places and headings of the moments each radio is heard."""
    shape = heard_at.shape
    flat = heard_at.ravel()
    xy = np.column_stack([np.interp(flat, walk.t, walk.xy[:, k]) for k in (0, 1)])
    heading = np.interp(flat, walk.t, walk.heading)
    radio = np.tile(np.arange(shape[1]), shape[0])
    level = level_at(walk, radios, radio, xy, flat, floor)
    away = radios.ap_xy[radios.ap[radio]] - xy
    ahead = np.cos(np.arctan2(away[:, 1], away[:, 0]) - heading)
    return np.asarray((level - 0.5 * model.body_db * (1.0 - ahead)).reshape(shape))


def level_at(walk: Walk, radios: RadioField, radio: IntArray, xy: Array, t: Array, floor: int = 0) -> Array:
    """Mean RSSI (m,) dBm of radios (m,) at places (m, 2) m and times (m,) s of a walk; ``floor`` of one on a floor."""
    if walk.climb is None:
        return radios.rssi(radio, xy, floor)
    return between_floors(radios, radio, xy, np.interp(t, walk.t, walk.climb.z))


def between_floors(radios: RadioField, radio: IntArray, xy: Array, z: Array) -> Array:
    """RSSI (m,) dBm at heights z (m,) m: between two storeys it goes over from one's to the other's in dB."""
    if len(radios.storeys) == 1:
        return radios.rssi(radio, xy, 0)
    elevation = np.array([storey.elevation for storey in radios.storeys])
    lower = np.clip(np.searchsorted(elevation, z, side="right") - 1, 0, len(elevation) - 2)
    share = np.clip((z - elevation[lower]) / (elevation[lower + 1] - elevation[lower]), 0.0, 1.0)
    level = np.zeros(len(z))
    for floor in range(len(elevation)):
        weight = np.where(lower == floor, 1.0 - share, np.where(lower + 1 == floor, share, 0.0))
        here = weight > _NO_SHARE
        if here.any():
            level[here] += weight[here] * radios.rssi(radio[here], xy[here], floor)
    return level
