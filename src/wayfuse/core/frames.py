"""The building frame and its anchor on the earth.

Inside the package a place is (x, y) in metres of its site plus a floor. `GeoAnchor` is the affine map between that
frame and WGS84 longitude and latitude: over a building (hundreds of metres) the tangent plane differs from the
ellipsoid by less than a millimetre, so an affine map is exact enough and needs no geodesy library.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from wayfuse.core.errors import MapError
from wayfuse.core.types import Array

__all__ = ["GeoAnchor", "metres_per_degree"]


def metres_per_degree(latitude: float) -> tuple[float, float]:
    """Metres per degree of longitude and of latitude on the WGS84 ellipsoid at a latitude (degrees)."""
    a, e2 = 6378137.0, 6.69437999014e-3  # WGS84 semi-major axis (m) and first eccentricity squared
    phi = np.deg2rad(latitude)
    w = np.sqrt(1.0 - e2 * np.sin(phi) ** 2)
    east = np.deg2rad(a * np.cos(phi) / w)
    north = np.deg2rad(a * (1.0 - e2) / w**3)
    return float(east), float(north)


@dataclass(frozen=True, slots=True)
class GeoAnchor:
    """Affine map from the building frame (m) to WGS84 degrees.

    ``(lon, lat) = origin + matrix @ (x, y)``; ``origin`` is (lon, lat) of x = y = 0 in degrees, ``matrix`` is
    ((dlon/dx, dlon/dy), (dlat/dx, dlat/dy)) in degrees per metre.
    """

    origin: tuple[float, float]
    matrix: tuple[tuple[float, float], tuple[float, float]]

    def __post_init__(self) -> None:
        m = self.matrix
        if abs(m[0][0] * m[1][1] - m[0][1] * m[1][0]) < 1e-16:
            raise MapError(
                "the geographic anchor is singular", remedy="give control points that span an area"
            )

    @classmethod
    def from_origin(cls, lon: float, lat: float, rotation: float = 0.0, scale: float = 1.0) -> GeoAnchor:
        """Anchor x = y = 0 at (lon, lat) degrees, +x turned ``rotation`` rad counter-clockwise from east."""
        east, north = metres_per_degree(lat)
        c, s = float(np.cos(rotation)) * scale, float(np.sin(rotation)) * scale
        return cls((lon, lat), ((c / east, -s / east), (s / north, c / north)))

    @property
    def rotation(self) -> float:
        """Heading of building +x, rad counter-clockwise from east."""
        east, north = metres_per_degree(self.origin[1])
        return float(np.arctan2(self.matrix[1][0] * north, self.matrix[0][0] * east))

    def to_lonlat(self, xy: ArrayLike) -> Array:
        """Longitude and latitude (degrees), shape (..., 2), of building places (m), shape (..., 2)."""
        p = np.asarray(xy, dtype=np.float64)
        return np.asarray(np.asarray(self.origin) + p @ np.asarray(self.matrix).T)

    def to_xy(self, lonlat: ArrayLike) -> Array:
        """Building places (m), shape (..., 2), of longitudes and latitudes (degrees), shape (..., 2)."""
        d = np.asarray(lonlat, dtype=np.float64) - np.asarray(self.origin)
        return np.asarray(d @ np.linalg.inv(np.asarray(self.matrix)).T)
