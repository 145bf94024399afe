"""What a scan says about access points of known places: which of them it heard, and which floor they speak for."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayfuse.core.types import Array
from wayfuse.radio.ap_places import ApPlaces
from wayfuse.radio.path_loss import PathLoss
from wayfuse.radio.survey import Fingerprint, Survey

__all__ = [
    "DEFAULT_BANDS",
    "Heard",
    "Levels",
    "fitted_levels",
    "floor_log_shares",
    "hear",
    "is_5ghz",
    "known_levels",
    "loudest_floor",
]

_N_FLOOR = 3  # loudest readings that tell a floor
_SILENCE = -100.0  # dBm that stands for a reading that is not there
_NEPER = 10.0 / np.log(10.0)  # dB of power per e
_FIRST_5GHZ = 4900  # MHz
_LEAST_READINGS = 30  # of a band, for a fit
_NEAREST = 1.0  # m, as in `path_loss`
_LEAST_SIGMA = 1.0  # dB; a survey that is fitted better is not believed


# of a band that a survey has hardly any reading of: power (dBm at 1 m), attenuation (dB/m), sigma (dB)
DEFAULT_BANDS = (PathLoss(-40.0, 0.2, 6.0), PathLoss(-40.0, 0.2, 6.0))


class Heard(NamedTuple):
    """Readings of placed access points, loudest first: row (k,) of `ApPlaces`, rssi (k,) dBm, frequency (k,) MHz."""

    row: NDArray[np.int64]
    rssi: Array
    frequency: NDArray[np.int32]

    def on(self, places: ApPlaces, floor: int, most: int = 0) -> Heard:
        """Those on a floor, the ``most`` loudest of them; 0 is all."""
        index = np.flatnonzero(places.floor[self.row] == floor)[: most or None]
        return Heard(self.row[index], self.rssi[index], self.frequency[index])


def hear(places: ApPlaces, fingerprint: Fingerprint) -> Heard:
    """The readings of a fingerprint whose access points have a place."""
    row = places.rows(fingerprint.bssid)
    known = np.flatnonzero(row >= 0)
    order = known[np.lexsort((row[known], -fingerprint.rssi[known]))]
    return Heard(row[order], fingerprint.rssi[order].astype(np.float64), fingerprint.frequency[order])


def floor_log_shares(places: ApPlaces, heard: Heard, n_floors: int) -> Array:
    """Log of how far each floor (n_floors,) speaks for itself: its share of the power of its three loudest readings."""
    level = np.full(n_floors, _SILENCE)
    for floor in np.unique(places.floor[heard.row]):
        loudest = heard.on(places, int(floor), _N_FLOOR).rssi
        level[floor] = (loudest.sum() + (_N_FLOOR - len(loudest)) * _SILENCE) / _N_FLOOR
    share = (level - level.max()) / _NEPER
    return np.asarray(share - np.log(np.exp(share).sum()))


def loudest_floor(places: ApPlaces, heard: Heard, n_floors: int) -> int:
    """The floor with the greatest share."""
    return int(np.argmax(floor_log_shares(places, heard, n_floors)))


def is_5ghz(frequency: NDArray[np.int32]) -> NDArray[np.bool_]:
    """Whether channels (k,) MHz are of the upper band; an unknown one (0) counts as 2.4 GHz."""
    return np.asarray(frequency >= _FIRST_5GHZ)


class Levels(NamedTuple):
    """Path loss of 2.4 and 5 GHz for readings less their access point's power, and that power (n,) dBm at 1 m."""

    bands: tuple[PathLoss, ...]
    power: Array


def fitted_levels(survey: Survey, places: ApPlaces, default: tuple[PathLoss, ...]) -> Levels:
    """A power for each access point, alpha and sigma for each band, from the readings made on their own floors.

    Least squares of Eq. 1 of karlsson2015 with a power per access point, so that bands have a power of 0 dBm. A band
    with too few readings has alpha and sigma of its ``default``, an access point without any the mean power.
    """
    row = np.repeat(np.arange(len(survey)), np.diff(survey.indptr))
    place = places.rows(survey.bssid)[survey.indices]
    own = (place >= 0) & (places.floor[place] == survey.floor[row])
    row, place = row[own], place[own]
    away = np.hypot(survey.xy[row, 0] - places.x[place], survey.xy[row, 1] - places.y[place])
    rssi, upper = survey.rssi[own].astype(np.float64), is_5ghz(survey.frequency[survey.indices[own]])
    bands = [replace(band, power=0.0) for band in default]
    power = np.full(len(places), np.nan)
    for b, mine in enumerate((~upper, upper)):
        if mine.sum() < _LEAST_READINGS:
            continue
        bands[b] = _fitted(away[mine], rssi[mine], place[mine])
        of = np.unique(place[mine])
        power[of] = _power(away[mine], rssi[mine], place[mine], bands[b].attenuation)[of]
    heard = np.isfinite(power)
    middle = float(power[heard].mean()) if heard.any() else default[0].power
    return Levels(tuple(bands), np.where(heard, power, middle))


def known_levels(survey: Survey | None, places: ApPlaces, default: tuple[PathLoss, ...]) -> Levels | None:
    """Levels fitted to a survey, else by the powers that came with the places; None where there are neither."""
    if survey is not None:
        return fitted_levels(survey, places, default)
    if places.power is None or not np.isfinite(places.power).any():
        return None
    middle = float(np.nanmean(places.power))
    bands = tuple(replace(band, power=0.0) for band in default)
    return Levels(bands, np.where(np.isfinite(places.power), places.power, middle))


def _fitted(away: Array, rssi: Array, place: NDArray[np.int64]) -> PathLoss:
    """alpha and sigma of readings (k,), each access point with a power of its own."""
    d, spread = _centred(np.maximum(away, _NEAREST), place), rssi - PathLoss(0.0, 0.0, 1.0).at(away)
    alpha = max(-float(d @ spread) / max(float(d @ d), 1e-9), 0.0)
    residual = rssi - _power(away, rssi, place, alpha)[place] - PathLoss(0.0, alpha, 1.0).at(away)
    n_left = max(len(rssi) - len(np.unique(place)) - 1, 1)
    return PathLoss(0.0, alpha, max(math.sqrt(float(residual @ residual) / n_left), _LEAST_SIGMA))


def _power(away: Array, rssi: Array, place: NDArray[np.int64], alpha: float) -> Array:
    """Mean power (dBm at 1 m) of each access point by its readings; 0 for those without."""
    at_1m = rssi - PathLoss(0.0, alpha, 1.0).at(away)
    return np.bincount(place, at_1m) / np.maximum(np.bincount(place), 1)


def _centred(values: Array, place: NDArray[np.int64]) -> Array:
    """Values (k,) minus the mean of their access point."""
    mean = np.bincount(place, values) / np.maximum(np.bincount(place), 1)
    return np.asarray(values - mean[place])
