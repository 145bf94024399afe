"""The two walks and the measurement series of karlsson2015, as far as the paper tells them.

Printed: 7 access points, about 100 m, a scan every 0.5 m (Table II); 20 access points, 273 m from (109, 10) back to
it, first towards -x, a scan every 4 s, a step of 0.83 m (Table III); model errors of two bands along a distance that
varies or stays (Table I). Not printed, and made up here: the corridors, the places of the access points, how strong
they transmit, attenuation and noise. Everything drawn comes from the generator that is passed in.

References
----------
.. [1] F. Karlsson, M. Karlsson, B. Bernhardsson, F. Tufvesson and M. Persson, Sensor fused indoor positioning using
   dual band WiFi signal measurements, European Control Conference 2015, 10.1109/ECC.2015.7330777.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.random import Generator

from wayfuse.core.types import Array

__all__ = [
    "LONG_WALK",
    "OTHER_BUILDINGS",
    "SERIES",
    "SHORT_WALK",
    "BandWorld",
    "ErrorSeries",
    "PlaceWorld",
    "RadioWorld",
    "StepWorld",
    "Walk",
    "draw_readings",
    "draw_series",
    "draw_steps",
    "draw_survey",
    "scan_distances",
]


@dataclass(frozen=True, slots=True)
class BandWorld:
    """One band as it is: power at 1 m (dBm), attenuation (dB/m), sigma (dB), weakest reading (dBm)."""

    power: float
    attenuation: float
    sigma: float
    cut_off: float


@dataclass(frozen=True, slots=True, kw_only=True)
class RadioWorld:
    """Both bands; ``shared`` of the variance varies over ``length`` metres of walk, the rest anew with each scan.

    correlation : of the errors of the two bands of one access point.
    """

    bands: tuple[BandWorld, ...] = (BandWorld(-35.0, 0.15, 3.5, -90.0), BandWorld(-40.0, 0.25, 4.5, -85.0))
    shared: float = 0.5
    length: float = 3.0
    correlation: float = 0.0


@dataclass(frozen=True, slots=True)
class PlaceWorld:
    """Corners of a walk (k, 2) m, access points (m, 2) m, and the rectangle (low, high corner) of the building."""

    corners: tuple[tuple[float, float], ...]
    ap_xy: tuple[tuple[float, float], ...]
    low: tuple[float, float]
    high: tuple[float, float]

    @property
    def length(self) -> float:
        """Of the walk, m."""
        return float(np.hypot(*np.diff(np.array(self.corners), axis=0).T).sum())

    def at(self, walked: Array) -> Array:
        """Places (n, 2) m after some distances walked (n,) m."""
        corners = np.array(self.corners)
        ends = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(corners, axis=0).T))])
        return np.column_stack([np.interp(walked, ends, corners[:, k]) for k in range(2)])


SHORT_WALK = PlaceWorld(
    corners=((4.0, 5.0), (36.0, 5.0), (36.0, 20.0), (12.0, 20.0), (12.0, 12.0), (33.0, 12.0)),
    ap_xy=((2.0, 2.0), (20.0, 8.0), (38.0, 3.0), (6.0, 15.0), (26.0, 16.0), (38.0, 23.0), (14.0, 23.0)),
    low=(0.0, 0.0),
    high=(40.0, 25.0),
)
"""About 100 m among 7 access points (Table II)."""

LONG_WALK = PlaceWorld(
    corners=(
        (109.0, 10.0), (39.0, 10.0), (39.0, 36.0), (70.0, 36.0), (70.0, 10.0), (55.5, 10.0), (55.5, 36.0),
        (109.0, 36.0), (109.0, 10.0),
    ),
    ap_xy=(
        (40.0, 6.0), (57.0, 10.0), (74.0, 6.0), (91.0, 10.0), (108.0, 6.0),
        (40.0, 16.0), (57.0, 20.0), (74.0, 16.0), (91.0, 20.0), (108.0, 16.0),
        (40.0, 26.0), (57.0, 30.0), (74.0, 26.0), (91.0, 30.0), (108.0, 26.0),
        (40.0, 36.0), (57.0, 40.0), (74.0, 36.0), (91.0, 40.0), (108.0, 36.0),
    ),
    low=(35.0, 4.0),
    high=(113.0, 42.0),
)  # fmt: skip
"""273 m from (109, 10) round the corridors, the first leg towards -x, among 20 access points (Table III)."""


OTHER_BUILDINGS = {
    "ring of 90 m by 46.5 m": replace(
        LONG_WALK,
        corners=(
            (109.0, 10.0), (19.0, 10.0), (19.0, 40.0), (60.0, 40.0), (60.0, 56.5), (109.0, 56.5), (109.0, 10.0),
        ),
        ap_xy=(
            (15.0, 7.0), (30.0, 13.0), (45.0, 6.0), (60.0, 14.0), (75.0, 7.0), (90.0, 13.0), (105.0, 6.0),
            (16.0, 24.0), (22.0, 37.0), (36.0, 44.0), (48.0, 36.0), (57.0, 48.0), (63.0, 32.0), (70.0, 60.0),
            (82.0, 53.0), (94.0, 60.0), (106.0, 52.0), (112.0, 36.0), (105.0, 24.0), (84.0, 34.0),
        ),
        low=(10.0, 0.0), high=(115.0, 65.0),
    ),
    "serpentine of 50 m by 36 m": replace(
        LONG_WALK,
        corners=(
            (109.0, 10.0), (58.75, 10.0), (58.75, 22.0), (109.0, 22.0), (109.0, 34.0), (58.75, 34.0), (58.75, 46.0),
            (109.0, 46.0), (109.0, 10.0),
        ),
        ap_xy=tuple(
            (60.0 + 12.0 * i, 7.0 + 14.0 * j + (2.0 if i % 2 else -2.0)) for j in range(4) for i in range(5)
        ),
        low=(55.0, 4.0), high=(113.0, 52.0),
    ),
}  # fmt: skip
"""The same 273 m and 20 access points otherwise: how much of Table III hangs on the building, which is not printed."""


def scan_distances(place: PlaceWorld, spacing: float) -> Array:
    """Distances walked (n,) m at which a scan is taken, ``spacing`` m apart, the first at the start."""
    return np.arange(0.0, place.length + 1e-9, spacing)


def draw_readings(rng: Generator, radio: RadioWorld, place: PlaceWorld, walked: Array) -> Array:
    """Readings (n, bands, m) dBm after distances walked (n,) m; NaN where too weak to be heard.

    The power falls with 20 log10 d + attenuation d (Eq. 1 of [1]_ in decibels); the errors of an access point and band
    have the band's sigma, are a Gauss-Markov process along the walk in their shared part, and are rounded to 1 dB.
    """
    error = _errors(rng, radio, walked, len(place.ap_xy))
    return _readings(radio, place, place.at(walked), error)


def draw_survey(rng: Generator, radio: RadioWorld, place: PlaceWorld, n: int) -> tuple[Array, Array]:
    """Places (n, 2) m anywhere in the rectangle and readings (n, bands, m) dBm there, errors independent."""
    xy = rng.uniform(place.low, place.high, (n, 2))
    apart = 1e3 * radio.length * np.arange(n, dtype=np.float64)
    return xy, _readings(radio, place, xy, _errors(rng, radio, apart, len(place.ap_xy)))


def _readings(radio: RadioWorld, place: PlaceWorld, xy: Array, error: Array) -> Array:
    """Readings (n, bands, m) dBm at places (n, 2) m, errors (n, bands, m) of unit variance."""
    difference = xy[:, None] - np.array(place.ap_xy)[None]
    distance = np.maximum(np.hypot(difference[..., 0], difference[..., 1]), 1.0)
    out = np.empty_like(error)
    for b, band in enumerate(radio.bands):
        mean = band.power - 20.0 * np.log10(distance) - band.attenuation * distance
        reading = np.round(mean + band.sigma * error[:, b])
        out[:, b] = np.where(reading >= band.cut_off, reading, np.nan)
    return out


def _errors(rng: Generator, radio: RadioWorld, walked: Array, n_aps: int) -> Array:
    """Errors (n, bands, m) of unit variance, correlated between the bands and, in part, along the walk."""
    n, b = len(walked), len(radio.bands)
    white = rng.standard_normal((2, n, b, n_aps))
    markov = white[0]
    for k in range(1, n):
        keep = np.exp(-(walked[k] - walked[k - 1]) / radio.length)
        markov[k] = keep * markov[k - 1] + np.sqrt(1.0 - keep**2) * markov[k]
    error = np.sqrt(radio.shared) * markov + np.sqrt(1.0 - radio.shared) * white[1]
    between = np.full((b, b), radio.correlation) + (1.0 - radio.correlation) * np.eye(b)
    return np.asarray(np.einsum("bc,ncm->nbm", np.linalg.cholesky(between), error))


@dataclass(frozen=True, slots=True, kw_only=True)
class StepWorld:
    """The walker and the phone: speed (m/s), nominal step (m), how far a walk's steps differ from it (relative).

    heading_drift : rad per step, its direction drawn per walk. heading_noise : rad per root step. start_noise : rad,
    error of a start heading that is told.
    """

    speed: float = 1.4
    step_length: float = 0.83
    length_sigma: float = 0.02
    heading_drift: float = 0.0009
    heading_noise: float = 0.005
    start_noise: float = 0.03


class Walk(NamedTuple):
    """Steps of a walk: truth and what the phone says of it.

    xy : (n + 1, 2) m, before the first step and after each. turn : (n,) rad, measured change of heading from step k to
    k + 1 (0 after the last). told_heading : rad, of the first step, with its error. walked : (n + 1,) m.
    """

    xy: Array
    turn: Array
    told_heading: float
    walked: Array


def draw_steps(rng: Generator, world: StepWorld, place: PlaceWorld) -> Walk:
    """One walk round a place."""
    length = world.step_length * (1.0 + world.length_sigma * rng.standard_normal())
    walked = np.arange(0.0, place.length + 1e-9, length)
    xy = place.at(walked)
    legs = np.diff(xy, axis=0)
    heading = np.arctan2(legs[:, 1], legs[:, 0])
    n = len(heading)
    drift = world.heading_drift * rng.choice([-1.0, 1.0])
    turn = np.append(np.diff(heading), 0.0) + drift + world.heading_noise * rng.standard_normal(n)
    told = heading[0] + world.start_noise * rng.standard_normal()
    return Walk(xy, np.arctan2(np.sin(turn), np.cos(turn)), float(told), walked)


class ErrorSeries(NamedTuple):
    """One measurement series of Table I: what it is called, how many readings, from where to where (m)."""

    name: str
    n: int
    near: float
    far: float


# the counts are not printed: they follow from the widths of the printed intervals, 1.96 / sqrt(n - 3) in Fisher's z
SERIES = (
    ErrorSeries("LOS near AP", 105, 2.0, 15.0),
    ErrorSeries("NLOS near AP", 89, 2.0, 15.0),
    ErrorSeries("LOS far from AP", 34, 15.0, 30.0),
    ErrorSeries("NLOS far from AP", 95, 15.0, 30.0),
    ErrorSeries("LOS stationary", 779, 8.0, 8.0),
    ErrorSeries("NLOS stationary", 1036, 8.0, 8.0),
)


def draw_series(
    rng: Generator, radio: RadioWorld, series: ErrorSeries, correlation: float, memory: float = 0.0
) -> tuple[Array, Array]:
    """Distances (n,) m and readings (2, n) dBm of both bands of one access point.

    correlation : of the errors of the bands. memory : of each error and the next, 0 = independent in time.
    """
    distance = np.linspace(series.near, series.far, series.n)
    white = rng.standard_normal((series.n, 2))
    white[:, 1] = correlation * white[:, 0] + np.sqrt(1.0 - correlation**2) * white[:, 1]
    errors = white.copy()
    for k in range(1, series.n):
        errors[k] = memory * errors[k - 1] + np.sqrt(1.0 - memory**2) * white[k]
    mean = [b.power - 20.0 * np.log10(distance) - b.attenuation * distance for b in radio.bands]
    return distance, np.array([m + b.sigma * e for m, b, e in zip(mean, radio.bands, errors.T, strict=True)])
