r"""Path loss of two bands with an attenuation per metre, for access points whose places are known.

.. math:: P(d) = P(d_0) - 20 \log_{10} (d / d_0) - \alpha d + X_\sigma \quad\text{in dB(m)}, d_0 = 1\,\text{m}

Eq. 1 of [1]_ prints :math:`\log_{10} P` on both sides where its terms are decibels: as printed it is off by a factor of
ten, and :math:`10 \log_{10} P` is meant. Free space (the 20) is kept, alpha stands for all that is in the way; it is
fitted. The noise is Gaussian and each band has its own; bands and access points count as independent, which for bands
is the finding of [1]_ (see `band_correlation`). A reading that is not there says nothing: the paper knows no cut-off.

Use it where places and powers of access points are known; `log_distance` estimates places instead.

>>> band = PathLoss(power=-35.0, attenuation=0.15, sigma=3.6)
>>> float(band.at(np.array([10.0]))[0])
-56.5
>>> round(float(band.distance(np.array([-56.5]))[0]), 6)
10.0

References
----------
.. [1] F. Karlsson, M. Karlsson, B. Bernhardsson, F. Tufvesson and M. Persson, Sensor fused indoor positioning using
   dual band WiFi signal measurements, European Control Conference 2015, 10.1109/ECC.2015.7330777.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from wayfuse.core.errors import ConfigError
from wayfuse.core.types import Array

__all__ = ["PathLoss", "distances", "fit_path_loss", "log_likelihood"]

_PER_NEPER = 20.0 / math.log(10.0)  # dB per unit of ln d: free space
_NEAREST = 1.0  # m; the reference distance: nearer, the model is not defined
_N_NEWTON = 12  # quadratic from the start used: 6 reach 1e-9 at 500 m, the rest is spare
_LEAST_SIGMA = 0.1  # dB; readings are rounded to 1 dB, whose own deviation is 0.29


@dataclass(frozen=True, slots=True)
class PathLoss:
    """One band. power : dBm at 1 m. attenuation : alpha, dB/m, >= 0. sigma : dB, > 0."""

    power: float
    attenuation: float
    sigma: float

    def __post_init__(self) -> None:
        if not (math.isfinite(self.power) and self.attenuation >= 0.0 and self.sigma > 0.0):
            raise ConfigError(
                f"power must be finite, attenuation >= 0 and sigma > 0, got {self}", where="PathLoss"
            )

    def at(self, distance: Array) -> Array:
        """Expected readings (dBm) at distances (m) of any shape; below 1 m as at 1 m (Eq. 1)."""
        d = np.maximum(distance, _NEAREST)
        return np.asarray(self.power - _PER_NEPER * np.log(d) - self.attenuation * d)

    def distance(self, rssi: Array) -> Array:
        """Distances (m, >= 1) at which readings (dBm) are expected: the inverse of `at`; NaN stays NaN.

        With u = ln d the loss is 20 u / ln 10 + alpha exp(u): convex and rising, so Newton's method from the value
        without attenuation comes down to the root.
        """
        loss = self.power - np.asarray(rssi, dtype=np.float64)
        u = loss / _PER_NEPER
        if self.attenuation > 0.0:
            # the root is below both bounds: each term alone would make up the whole loss
            u = np.minimum(u, np.log(np.maximum(loss, 1e-9)) - math.log(self.attenuation))
        for _ in range(_N_NEWTON):
            grown = self.attenuation * np.exp(u)
            u = u - (_PER_NEPER * u + grown - loss) / (_PER_NEPER + grown)
        return np.asarray(np.maximum(np.exp(u), _NEAREST))


def fit_path_loss(distance: Array, rssi: Array, *, power: float | None = None) -> PathLoss:
    """Least squares of Eq. 1: power and alpha, or alpha alone where the power is known.

    Parameters
    ----------
    distance, rssi : (n,) m and dBm, of one band; NaN readings are left out. power : dBm at 1 m, if known.

    Returns
    -------
    alpha is cut off at 0; sigma is the residual deviation.

    Raises
    ------
    ConfigError : fewer readings than unknowns and one more.
    """
    heard = np.isfinite(rssi) & np.isfinite(distance)
    d = np.maximum(np.asarray(distance, dtype=np.float64)[heard], _NEAREST)
    excess = np.asarray(rssi, dtype=np.float64)[heard] + _PER_NEPER * np.log(d)  # = power - alpha d + X
    unknowns = 1 if power is not None else 2
    if len(d) < unknowns + 1:
        raise ConfigError(
            f"{len(d)} readings cannot fit {unknowns} unknowns",
            where="fit_path_loss",
            remedy="give more readings",
        )
    if power is None:
        centred = d - d.mean()
        spread = float(centred @ centred)
        # at one distance only the two are one unknown: the attenuation is then left at 0
        attenuation = max(-float(centred @ excess) / spread, 0.0) if spread > 1e-9 else 0.0
        power = float(excess.mean() + attenuation * d.mean())
    else:
        attenuation = max(float(d @ (power - excess)) / float(d @ d), 0.0)
    residual = excess - power + attenuation * d
    sigma = math.sqrt(float(residual @ residual) / (len(d) - unknowns))
    return PathLoss(power, attenuation, max(sigma, _LEAST_SIGMA))


def distances(xy: Array, ap_xy: Array) -> Array:
    """(N, m) m from places (N, 2) to access points (m, 2)."""
    return np.hypot(xy[:, None, 0] - ap_xy[None, :, 0], xy[:, None, 1] - ap_xy[None, :, 1])


def log_likelihood(
    bands: Sequence[PathLoss], ap_xy: Array, rssi: Array, xy: Array, *, offset_sigma: float = 0.0
) -> Array:
    """Log-likelihood of one scan at candidate places: a Gaussian per access point and band, in the log domain.

    Parameters
    ----------
    bands : of length b. ap_xy : (m, 2) m, where the access points are. rssi : (b, m) dBm, NaN where not heard (says
    nothing). xy : (N, 2) m. offset_sigma : dB, of an offset that all readings of the scan share, integrated out; not
    in [1]_, whose phone is the one that the parameters were fitted with.

    Returns
    -------
    (N,) natural log; constants over N are dropped; finite: the sum of 40 densities of 10 sigma is no underflow here.
    """
    total, shared = np.zeros(len(xy)), np.zeros(len(xy))
    precision = 0.0
    heard_any = np.isfinite(rssi).any(axis=0)
    distance = distances(xy, ap_xy[heard_any])
    for band, reading in zip(bands, rssi[:, heard_any], strict=True):
        heard = np.isfinite(reading)
        z = (reading[heard] - band.at(distance[:, heard])) / band.sigma
        total -= 0.5 * (z * z).sum(axis=1)
        shared += z.sum(axis=1) / band.sigma
        precision += float(heard.sum()) / band.sigma**2
    if offset_sigma > 0.0:
        # the covariance sigma^2 I + offset_sigma^2 1 1' by the formula of Sherman and Morrison
        total += 0.5 * shared**2 / (precision + offset_sigma**-2)
    return total
