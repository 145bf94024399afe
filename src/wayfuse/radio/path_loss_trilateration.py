r"""Least squares on path-loss ranges, the "conventional" fix that karlsson2015 compares with.

Each reading gives a range through the inverse of its band's path loss. Two ways of solving |x - p_i| = r_i:

* linearised: the squared equations minus the mean of them are linear in x and solved in closed form. It is not
  weighted: the square of a far and hence uncertain range counts most.
* Gauss-Newton on sum (|x - p_i| - r_i)^2 / s_i^2, s_i the range error that a band's sigma makes at r_i, from the
  linearised fix.

The paper does not say which it means; its 4.8 m are met by the linearised one (docs/papers/karlsson2015.md).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from wayfuse.core.types import Array
from wayfuse.radio.path_loss import PathLoss

__all__ = ["gauss_newton_fix", "linearised_fix", "ranges"]

_N_LEAST = 3  # ranges to different access points that a fix in the plane takes
_N_ITERATIONS = 15
_LARGEST_STEP = 20.0  # m, of one iteration: a bad start does not throw the fix out of the building
_NEPER = 20.0 / np.log(10.0)


def ranges(bands: Sequence[PathLoss], ap_xy: Array, rssi: Array) -> tuple[Array, Array, Array]:
    """Ranges of one scan.

    Parameters
    ----------
    bands : of length b. ap_xy : (m, 2) m. rssi : (b, m) dBm, NaN where not heard.

    Returns
    -------
    Places of the access points (k, 2) m, ranges (k,) m, and their standard errors (k,) m to first order; an access
    point heard on two bands is there twice.
    """
    heard = np.isfinite(rssi)
    place = np.concatenate([ap_xy[h] for h in heard])
    r = np.concatenate([band.distance(x[h]) for band, x, h in zip(bands, rssi, heard, strict=True)])
    alpha = np.concatenate([np.full(h.sum(), band.attenuation) for band, h in zip(bands, heard, strict=True)])
    sigma = np.concatenate([np.full(h.sum(), band.sigma) for band, h in zip(bands, heard, strict=True)])
    return place, r, sigma / (_NEPER / r + alpha)


def linearised_fix(place: Array, r: Array) -> Array | None:
    """Fix (2,) m from ranges (k,) m to places (k, 2) m; None with fewer than 3 places or places in one line."""
    if len(np.unique(place, axis=0)) < _N_LEAST:
        return None
    # |p|^2 - r^2 - mean = 2 (p - mean p) . x
    design = 2.0 * (place - place.mean(axis=0))
    known = (place**2).sum(axis=1) - r**2
    found, _, rank, _ = np.linalg.lstsq(design, known - known.mean(), rcond=1e-9)
    return np.asarray(found) if rank == 2 else None


def gauss_newton_fix(place: Array, r: Array, r_sigma: Array, start: Array) -> Array:
    """Fix (2,) m that minimises the weighted squares of the range residuals, from a start (2,) m."""
    x = np.array(start, dtype=np.float64)
    for _ in range(_N_ITERATIONS):
        away = x - place
        distance = np.maximum(np.hypot(away[:, 0], away[:, 1]), 1e-6)
        jacobian = away / (distance * r_sigma)[:, None]
        # a small ridge: with all access points in one direction the normal matrix is singular
        normal = jacobian.T @ jacobian + 1e-9 * np.eye(2)
        step = np.linalg.solve(normal, jacobian.T @ ((r - distance) / r_sigma))
        length = float(np.hypot(*step))
        x = x + step * min(1.0, _LARGEST_STEP / max(length, 1e-12))
        if length < 1e-6:
            break
    return x
