r"""Range from the power of the direct path by nonlinear regression (li2015, Section 5.1).

.. math:: d = \alpha \exp(\beta p)

with p in dB is the log-distance law turned round; it is fitted to distances by least squares, not to powers, since the
range is what is wanted. One regression per anchor (and antenna, as antennas differ); the range of an anchor is the mean
over its antennas, which face different multipath.

References
----------
.. [1] Li, Burbano, Zhao, Carrera, Braun, Fine-grained Indoor Tracking by Fusing Inertial Sensor and Physical Layer
   Information in WLANs, University of Bern, INF-15-004, 2015.
.. [2] Li, Braun, Dimitrova, A passive WiFi source localization system based on fine-grained power-based trilateration,
   WoWMoM 2015.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from wayfuse.core.errors import RadioMapError
from wayfuse.core.types import Array

__all__ = ["RangeRegression", "fit_antennas", "fit_range", "mean_range"]

_N_ITERATIONS = 50
_DAMPING = (1e-3, 10.0)  # Levenberg-Marquardt: first damping, factor by which it changes
_SETTLED = 1e-12  # relative gain in the sum of squares at which to stop


class RangeRegression(NamedTuple):
    """d = exp(log_scale + rate p): log_scale (log m), rate (1/dB, negative); p in dBm."""

    log_scale: float
    rate: float

    def distance(self, power: ArrayLike) -> Array:
        """Range (m) of powers (dBm) of any shape; NaN stays NaN."""
        return np.asarray(np.exp(self.log_scale + self.rate * np.asarray(power, dtype=np.float64)))

    @property
    def path_loss_exponent(self) -> float:
        """The exponent of the log-distance law it is the inverse of."""
        return -math.log(10.0) / (10.0 * self.rate)


def fit_range(power: ArrayLike, distance: ArrayLike) -> RangeRegression:
    """Least squares of distances (n,) m on powers (n,) dBm; NaN powers are left out.

    Levenberg-Marquardt from the straight line through log d.

    Raises
    ------
    RadioMapError : fewer than two different powers, or a distance that is not positive.
    """
    p, d = np.asarray(power, dtype=np.float64), np.asarray(distance, dtype=np.float64)
    heard = np.isfinite(p)
    p, d = p[heard], d[heard]
    if len(np.unique(p)) < 2 or not (d > 0.0).all():
        raise RadioMapError(
            "a range regression needs two different powers and positive distances",
            where="fit_range",
            remedy="survey the anchor at more distances",
        )
    centre = float(p.mean())  # scale and rate are hardly correlated about the mean power
    a = np.column_stack([np.ones_like(p), p - centre])
    b = np.linalg.lstsq(a, np.log(d), rcond=None)[0]
    damping, factor = _DAMPING
    cost = float(((d - np.exp(a @ b)) ** 2).sum())
    for _ in range(_N_ITERATIONS):
        fitted = np.exp(a @ b)
        jacobian = fitted[:, None] * a
        normal = jacobian.T @ jacobian
        step = np.linalg.solve(normal + damping * np.diag(np.diag(normal)), jacobian.T @ (d - fitted))
        with np.errstate(over="ignore"):
            tried = float(((d - np.exp(a @ (b + step))) ** 2).sum())
        if not tried < cost:
            damping *= factor
            continue
        b, damping = b + step, damping / factor
        settled = cost - tried <= _SETTLED * cost
        cost = tried
        if settled:
            break
    return RangeRegression(float(b[0] - b[1] * centre), float(b[1]))


def fit_antennas(power: Array, distance: Array) -> tuple[RangeRegression, ...]:
    """One regression for each antenna: powers (n, n_antennas) dBm, distances (n,) m."""
    return tuple(fit_range(column, distance) for column in power.T)


def mean_range(models: Sequence[RangeRegression], power: Array) -> Array:
    """Mean over antennas of their ranges (...,) m; powers (..., n_antennas) dBm, NaN where not heard.

    NaN where no antenna heard anything.
    """
    each = np.stack([model.distance(power[..., k]) for k, model in enumerate(models)], axis=-1)
    heard = np.isfinite(each)
    count = heard.sum(axis=-1)
    total = np.where(heard, each, 0.0).sum(axis=-1)
    return np.asarray(np.where(count > 0, total / np.maximum(count, 1), np.nan))
