r"""The empty room of he2014, ray-traced by images: 40 m by 40 m, four access points, flat reflecting walls.

A wave that is reflected by the walls of a box arrives on a straight line from an image of its source. Along an axis
of length L the images of a source at s lie at 2 m L + s, after \|2 m\| reflections, and at 2 m L - s, after
\|2 m - 1\|. An image at a distance d brings the amplitude

.. math:: a = \frac{\lambda}{4 \pi d} \prod_{axes} \Gamma_{axis}^{n_{axis}}

with the reflection coefficients of a flat dielectric [1]_ for vertical polarisation: across the plane of incidence at
the side walls, in it at floor and ceiling. The strength is the sum of the powers of the rays (what a receiver over a
band of many wavelengths' spread reports, and what a survey of metres can resolve) or the power of their sum.

The paper took its signals from a commercial ray tracer and prints neither the places of the access points nor the
survey nor the noise; those here are of docs/papers/he2014.md.

References
----------
.. [1] C. Balanis, Advanced Engineering Electromagnetics, 2nd ed., Wiley 2012, Sec. 5.3.
.. [2] X. He, J. Li, D. Aloi, WiFi based indoor localization with adaptive motion model using smartphone motion
   sensors, ICCVE 2014, Sec. III.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from wayfuse.core.errors import ConfigError
from wayfuse.core.types import Array
from wayfuse.simulator.free_space import LIGHT

__all__ = ["Room", "Sensed", "Walk", "sense", "strength", "survey_places", "true_walk"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Room:
    """The room and its access points (m, corner at the origin)."""

    size: tuple[float, float, float] = (40.0, 40.0, 3.0)  # [2] Sec. III; the height is not printed
    ap_xy: tuple[tuple[float, float], ...] = ((2.0, 2.0), (38.0, 38.0), (38.0, 2.0), (2.0, 38.0))
    ap_height: float = 2.5
    device_height: float = 1.2
    permittivity: float = 5.0  # relative, of all walls, floor and ceiling
    frequency: float = 2.437e9  # Hz, channel 6
    power_dbm: float = 15.0  # radiated; without influence, for it shifts survey and readings alike
    reflections: int = 2  # most reflections of a ray
    coherent: bool = False  # False: the sum of powers
    noise_db: float = 2.2  # of each reading on the walk; fitted to the whole of Table 1
    survey_noise_db: float = 0.0  # of each survey reading: the survey is the ray tracer's own output
    length_sigma: float = 0.1  # m, of the measured length of a move
    compass_sigma: float = 0.1  # rad, of the first heading
    yaw_sigma: float = 0.02  # rad, of the gyro's yaw at an epoch
    survey_step: float = 3.0
    survey_first: float = 1.5
    path: tuple[tuple[float, float], ...] = (
        (4.5, 4.5),
        (15.0, 4.5),
        (15.0, 10.5),
        (25.5, 10.5),
    )  # ends: Fig. 9

    def __post_init__(self) -> None:
        inside = all(0.0 < c < s for ap in self.ap_xy for c, s in zip(ap, self.size[:2], strict=True))
        if not (inside and 0.0 < self.ap_height < self.size[2] and 0.0 < self.device_height < self.size[2]):
            raise ConfigError("access points and device must be inside the room", where="Room")
        if self.permittivity < 1.0 or min(self.noise_db, self.survey_noise_db, self.reflections) < 0:
            raise ConfigError(
                "permittivity >= 1 and no negative noise or number of reflections are needed", where="Room"
            )


class Walk(NamedTuple):
    """Places (T + 1, 2) m of the user at the epochs; length (T,) m and heading (T,) rad of the moves between them."""

    xy: Array
    length: Array
    heading: Array


class Sensed(NamedTuple):
    """What the phone gives on one walk.

    survey : readings (n, a) dBm at the survey places. rssi : readings (T + 1, a) dBm at the epochs. length : (T,) m,
    measured moves. compass : rad, building frame, at the first move. yaw : (T,) rad, of the gyro, from any zero.
    """

    survey: Array
    rssi: Array
    length: Array
    compass: float
    yaw: Array


def strength(room: Room, xy: Array) -> Array:
    """Strength (N, a) dBm of the access points at places (N, 2) m, without noise."""
    device = np.column_stack([xy, np.full(len(xy), room.device_height)])
    wavelength = LIGHT / room.frequency
    out = np.empty((len(xy), len(room.ap_xy)))
    for a, ap in enumerate(room.ap_xy):
        image, count = _images(np.array([*ap, room.ap_height]), np.array(room.size), room.reflections)
        apart = device[:, None, :] - image[None]
        d = np.sqrt((apart * apart).sum(axis=-1))
        amplitude = wavelength / (4.0 * np.pi * d)
        for axis in range(3):
            gamma = _reflection(np.abs(apart[..., axis]) / d, room.permittivity, in_plane=axis == 2)
            amplitude = amplitude * gamma ** count[:, axis]
        if room.coherent:
            power = np.abs((amplitude * np.exp(-2j * np.pi * d / wavelength)).sum(axis=1)) ** 2
        else:
            power = (amplitude * amplitude).sum(axis=1)
        out[:, a] = room.power_dbm + 10.0 * np.log10(power)
    return out


def _images(source: Array, size: Array, most: int) -> tuple[Array, Array]:
    # images (k, 3) m of a source (3,) with at most so many reflections, and how often each axis' walls reflect (k, 3)
    sides = []
    for s, length in zip(source, size, strict=True):
        one = [(2 * m * length + s, abs(2 * m)) for m in range(-most, most + 1)]
        one += [(2 * m * length - s, abs(2 * m - 1)) for m in range(-most, most + 1)]
        sides.append([(at, n) for at, n in one if n <= most])
    rays = [(x, y, z) for x in sides[0] for y in sides[1] for z in sides[2] if x[1] + y[1] + z[1] <= most]
    table = np.array(rays, dtype=np.float64)
    return table[..., 0], table[..., 1]


def _reflection(cosine: Array, permittivity: float, *, in_plane: bool) -> Array:
    # Fresnel's coefficient by the cosine of the angle to the wall's normal
    root = np.sqrt(permittivity - 1.0 + cosine * cosine)
    near = permittivity * cosine if in_plane else cosine
    return np.asarray((near - root) / (near + root))


def survey_places(room: Room) -> Array:
    """Survey places (n, 2) m: a square grid."""
    x, y = (np.arange(room.survey_first, side, room.survey_step) for side in room.size[:2])
    return np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)


def true_walk(room: Room, epoch: float = 1.0) -> Walk:
    """The walk along the path, ``epoch`` m of it per epoch; a move around a corner is the chord."""
    path = np.array(room.path)
    along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(path, axis=0).T))])
    s = np.arange(0.0, along[-1] + 1e-9, epoch)
    xy = np.column_stack([np.interp(s, along, path[:, 0]), np.interp(s, along, path[:, 1])])
    dx, dy = np.diff(xy, axis=0).T
    return Walk(xy, np.hypot(dx, dy), np.arctan2(dy, dx))


def sense(room: Room, survey: Array, on_walk: Array, walk: Walk, rng: np.random.Generator) -> Sensed:
    """One walk of given true strengths (survey (n, a), on_walk (T + 1, a) dBm), each sensor with its own noise."""
    n = len(walk.length)
    return Sensed(
        survey=survey + room.survey_noise_db * rng.standard_normal(survey.shape),
        rssi=on_walk + room.noise_db * rng.standard_normal(on_walk.shape),
        length=walk.length + room.length_sigma * rng.standard_normal(n),
        compass=float(walk.heading[0] + room.compass_sigma * rng.standard_normal()),
        yaw=walk.heading - walk.heading[0] + room.yaw_sigma * rng.standard_normal(n),
    )
