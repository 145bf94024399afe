"""UTM coordinates to WGS84 degrees: the inverse of the transverse Mercator projection.

Krueger's series to the third power of the flattening, good to a millimetre within a zone.

References
----------
.. [1] Karney, Transverse Mercator with an accuracy of a few nanometers, J. Geodesy 2011, Eqs. 11, 13, 36.
"""

from __future__ import annotations

import numpy as np

from wayfuse.core.types import Array

__all__ = ["utm_to_lonlat"]

SEMI_MAJOR, FLATTENING = 6378137.0, 1.0 / 298.257223563  # m, WGS84
SCALE, FALSE_EAST, FALSE_NORTH = 0.9996, 5e5, 1e7  # of UTM; m, the latter in the south only


def utm_to_lonlat(points: Array, zone: int, *, south: bool = False) -> Array:
    """Longitude and latitude (..., 2) degrees of eastings and northings (..., 2) m of a zone (1 to 60)."""
    n = FLATTENING / (2.0 - FLATTENING)
    radius = SCALE * SEMI_MAJOR / (1.0 + n) * (1.0 + n**2 / 4.0 + n**4 / 64.0)
    xi = (points[..., 1] - (FALSE_NORTH if south else 0.0)) / radius
    eta = (points[..., 0] - FALSE_EAST) / radius
    beta = (n / 2 - 2 * n**2 / 3 + 37 * n**3 / 96, n**2 / 48 + n**3 / 15, 17 * n**3 / 480)
    u, v = xi.copy(), eta.copy()
    for j, b in enumerate(beta, 1):  # Eq. 11
        u -= b * np.sin(2 * j * xi) * np.cosh(2 * j * eta)
        v -= b * np.cos(2 * j * xi) * np.sinh(2 * j * eta)
    chi = np.arcsin(np.sin(u) / np.cosh(v))  # conformal latitude
    delta = (2 * n - 2 * n**2 / 3 - 2 * n**3, 7 * n**2 / 3 - 8 * n**3 / 5, 56 * n**3 / 15)
    lat = chi + sum(d * np.sin(2 * j * chi) for j, d in enumerate(delta, 1))
    lon = np.deg2rad(6.0 * zone - 183.0) + np.arctan2(np.sinh(v), np.cos(u))
    return np.asarray(np.rad2deg(np.stack([lon, lat], axis=-1)))
