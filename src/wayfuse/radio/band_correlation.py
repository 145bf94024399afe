"""Are the errors of two bands correlated? Coefficient and Fisher interval per series (Table I of karlsson2015).

The model error of a band is a reading minus the fitted path loss; the coefficient is Pearson's, the interval comes
from Fisher's z = atanh r, whose deviation is 1 / sqrt(n - 3) for independent pairs [1]_. Readings of one place
in quick succession are not independent: pass ``n_effective`` (see `effective_pairs`), or the interval is too narrow.

>>> study = correlate([1.0, 2.0, 3.0, 4.0, 5.0], [1.1, 1.9, 3.2, 3.8, 5.1])
>>> round(study.r, 3), study.n
(0.995, 5)

References
----------
.. [1] R. A. Fisher, On the "probable error" of a coefficient of correlation deduced from a small sample, Metron 1,
   1921.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from wayfuse.core.errors import ConfigError
from wayfuse.core.types import Array, IntArray
from wayfuse.radio.path_loss import fit_path_loss

__all__ = [
    "Correlation",
    "SplitErrors",
    "correlate",
    "effective_pairs",
    "fisher_interval",
    "model_errors",
    "split_errors",
]

_TWO_SIDED_95 = 1.959963984540054  # quantile 0.975 of the normal distribution
_N_LEAST = 4  # n - 3 is to be positive


@dataclass(frozen=True, slots=True)
class Correlation:
    """Coefficient r, the ends of its 95 % interval, and the number of pairs it counts as."""

    r: float
    low: float
    high: float
    n: int


def fisher_interval(r: float, n: float) -> tuple[float, float]:
    """95 % interval of a coefficient r from n independent pairs (n > 3)."""
    if not (-1.0 <= r <= 1.0 and n >= _N_LEAST):
        raise ConfigError(
            f"r must lie in [-1, 1] and n be at least {_N_LEAST}, got {r}, {n}", where="fisher_interval"
        )
    z = math.atanh(min(max(r, -1.0 + 1e-15), 1.0 - 1e-15))
    half = _TWO_SIDED_95 / math.sqrt(n - 3.0)
    return math.tanh(z - half), math.tanh(z + half)


def model_errors(distance: Array, rssi: Array) -> Array:
    """Readings (n,) dBm minus their own fitted path loss over distance (n,) m; NaN where not heard."""
    band = fit_path_loss(distance, rssi)
    return np.asarray(rssi - band.at(distance))


def correlate(a: ArrayLike, b: ArrayLike, *, n_effective: float | None = None) -> Correlation:
    """Correlation of the errors of two bands (n,), pairs with a NaN left out.

    Raises
    ------
    ConfigError : fewer than 4 pairs, or a band whose errors do not vary.
    """
    first, second = np.asarray(a, dtype=np.float64), np.asarray(b, dtype=np.float64)
    both = np.isfinite(first) & np.isfinite(second)
    n = int(both.sum())
    if n < _N_LEAST:
        raise ConfigError(f"{n} pairs are too few", where="correlate", remedy=f"at least {_N_LEAST}")
    x, y = first[both] - first[both].mean(), second[both] - second[both].mean()
    power = float(x @ x) * float(y @ y)
    if power <= 0.0:
        raise ConfigError("the errors of a band do not vary", where="correlate")
    r = float(np.clip(float(x @ y) / math.sqrt(power), -1.0, 1.0))
    low, high = fisher_interval(r, n if n_effective is None else max(float(_N_LEAST), n_effective))
    return Correlation(r, low, high, n)


class SplitErrors(NamedTuple):
    """Errors of two bands (2, k): of the means of each place, and of each reading about the mean of its place."""

    across: Array
    within: Array


def split_errors(distance: Array, first: Array, second: Array, place: IntArray) -> SplitErrors:
    """Model errors split into what belongs to a place and what changes while one stays there.

    A walk sees both at once; walls and furniture make the first, people and fading the second. Only if both are
    uncorrelated between bands does a second band bring a second, independent place.

    Parameters
    ----------
    distance : (n,) m to the access point. first, second : (n,) dBm of the two bands, NaN where not heard (the pair
    is left out). place : (n,) which place.
    """
    both = np.isfinite(first) & np.isfinite(second)
    _, which, count = np.unique(place[both], return_inverse=True, return_counts=True)
    away = np.bincount(which, distance[both]) / count
    means = [np.bincount(which, band[both]) / count for band in (first, second)]
    across = np.array([model_errors(away, mean) for mean in means])
    within = np.array([band[both] - mean[which] for band, mean in zip((first, second), means, strict=True)])
    return SplitErrors(across, within)


def effective_pairs(a: Array, b: Array) -> float:
    """How many independent pairs two series (n,), in the order of time and without gaps, are worth.

    Bartlett's n / (1 + 2 sum_k rho_a(k) rho_b(k)), the sum cut at the first lag where either autocorrelation is not
    positive; never more than n.
    """
    n = len(a)
    first, second = _autocorrelation(a), _autocorrelation(b)
    ends = np.flatnonzero((first <= 0.0) | (second <= 0.0))
    last = int(ends[0]) if len(ends) else n
    lags = np.arange(1, last)
    return float(n / (1.0 + 2.0 * np.sum((1.0 - lags / n) * first[1:last] * second[1:last])))


def _autocorrelation(x: Array) -> Array:
    centred = np.asarray(x, dtype=np.float64) - np.mean(x)
    n = len(centred)
    spectrum = np.abs(np.fft.rfft(centred, 2 * n)) ** 2
    covariance = np.fft.irfft(spectrum, 2 * n)[:n]
    return np.asarray(covariance / max(float(covariance[0]), 1e-300))
