r"""Step counting by normalised autocorrelation of the acceleration's norm, after Zee, as liu2017 uses it.

Two steps repeat. The norm of the last :math:`\tau` samples is compared with that of the :math:`\tau` before:

.. math:: \chi(m, \tau) = \frac{\frac1\tau \sum_{k=0}^{\tau-1} (a_{m-k} - \mu_1)(a_{m-\tau-k} - \mu_2)}
          {\sigma_1 \sigma_2}

with mean and standard deviation of each half. Where the greatest :math:`\chi` over the lags of two steps exceeds a
threshold and the norm varies at all, the phone's owner walks, and a sample counts for :math:`2 / \tau` steps. What
repeats but does not look like a wave of one step (a phone in a pocket: one strong peak in two steps) is counted too;
fewer than four steps in a row are not.

Causal: a count at time t uses nothing later. Walking is found two gait cycles after it began, and the samples of these
cycles are then counted at once, so the count jumps by about four.

Departs from [1]_: among lags that do nearly as well as the best the shortest is taken, for four steps repeat as two do
(there the range of lags follows the last one found).

References
----------
.. [1] A. Rai, K. Chintalapudi, V. Padmanabhan, R. Sen, Zee: zero-effort crowdsourcing for indoor localization, MobiCom
   2012, 10.1145/2348543.2348580, Section 4; reference [9] of liu2017.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayfuse.core.errors import ConfigError
from wayfuse.core.types import Array, BoolArray, IntArray
from wayfuse.sensors.recording import Series

__all__ = ["AutocorrelationSteps", "StepCounts", "count_steps", "normalised_autocorrelation"]

_RATE = 50.0  # Hz, of the norm that is correlated: that of liu2017, Sec. IV-A, and about that of [1]_
_GRAVITY = 9.81  # m/s²
_TINY = 1e-12  # (m/s²)² or g², a variance below is rounding


@dataclass(frozen=True, slots=True, kw_only=True)
class AutocorrelationSteps:
    """Parameters."""

    shortest: float = 0.8  # s, two steps; [1]_: lags 40 to 100 at 50 Hz
    longest: float = 2.0  # s
    similarity: float = 0.7  # of chi; [1]_
    sigma: float = 0.01 * _GRAVITY  # m/s², least deviation of who moves; [1]_: 0.01 g
    nearly: float = 0.9  # of the best chi, for a shorter lag to be preferred

    def __post_init__(self) -> None:
        if not 0.0 < self.shortest < self.longest:
            raise ConfigError(f"lags {self.shortest} to {self.longest} s", remedy="0 < shortest < longest")
        if not (0.0 < self.similarity < 1.0 and 0.0 < self.nearly <= 1.0 and self.sigma >= 0.0):
            raise ConfigError("similarity, nearly or sigma out of range", remedy="(0, 1), (0, 1] and >= 0")


class StepCounts(NamedTuple):
    """The count as it stood at each moment: t (n,) s, steps (n,) since the start, walking (n,)."""

    t: Array
    steps: IntArray
    walking: BoolArray


def normalised_autocorrelation(norm: Array, lags: NDArray[np.integer]) -> Array:
    """chi(m, tau), (lags, n), of a norm (n,) sampled evenly, at lags in samples; 0 where two cycles do not fit.

    Samples m - 2 tau + 1 to m are used: none is later than m. The norm may be in m/s² or g: 0 where it is constant.
    """
    a = norm - norm.mean()  # sums of what is near zero keep their digits
    sums, squares = _cumulated(a), _cumulated(a * a)
    out = np.zeros((len(lags), len(a)))
    for row, lag in enumerate(lags.tolist()):
        if 2 * lag > len(a):
            continue
        product = _cumulated(a[lag:] * a[:-lag])
        end = np.arange(2 * lag, len(a) + 1)  # one past the last sample of the later half
        mean_late = (sums[end] - sums[end - lag]) / lag
        mean_early = (sums[end - lag] - sums[end - 2 * lag]) / lag
        late = (squares[end] - squares[end - lag]) / lag - mean_late**2
        early = (squares[end - lag] - squares[end - 2 * lag]) / lag - mean_early**2
        both = (product[end - lag] - product[end - 2 * lag]) / lag - mean_late * mean_early
        varies = (late > _TINY) & (early > _TINY)
        scale = np.sqrt(np.where(varies, late * early, 1.0))
        out[row, end - 1] = np.where(varies, both / scale, 0.0)
    return out


def count_steps(acceleration: Series, config: AutocorrelationSteps | None = None) -> StepCounts:
    """Running count of the steps in a column of accelerations (device frame, m/s²), at 50 Hz.

    Gaps are bridged by straight lines, which do not repeat; fewer than two samples hold no steps.
    """
    settings = config or AutocorrelationSteps()
    t, norm = _even(acceleration)
    if len(t) < 2:
        return StepCounts(t, np.zeros(len(t), dtype=np.int64), np.zeros(len(t), dtype=np.bool_))
    lags = np.arange(int(np.ceil(settings.shortest * _RATE)), int(settings.longest * _RATE) + 1)
    chi = normalised_autocorrelation(norm, lags)
    row = _shortest_of_the_best(chi, settings.nearly)
    column = np.arange(len(norm))
    lag = lags[row]
    walking = (chi[row, column] > settings.similarity) & (_deviation(norm, lag) > settings.sigma)
    return StepCounts(t, _accumulated(lag, walking), walking)


def _accumulated(lag: IntArray, walking: BoolArray) -> IntArray:
    """Steps (n,): each sample of the two cycles up to a walking one counts once, for 2 / lag."""
    counted = np.zeros(len(lag))
    covered, total = -1, 0.0  # last sample counted
    for m, (tau, walks) in enumerate(zip(lag.tolist(), walking.tolist(), strict=True)):
        if walks:
            total += (m - max(m - 2 * tau, covered)) * 2.0 / tau
            covered = m
        counted[m] = total
    return np.asarray(np.floor(counted + 1e-9), dtype=np.int64)


def _shortest_of_the_best(chi: Array, nearly: float) -> IntArray:
    """Row (n,) of the shortest lag that is a local maximum and nearly as good as the best."""
    padded = np.pad(chi, ((1, 1), (0, 0)), constant_values=-np.inf)
    peak = (chi >= padded[:-2]) & (chi >= padded[2:]) & (chi >= nearly * chi.max(axis=0))
    return np.asarray(np.argmax(peak, axis=0))


def _deviation(norm: Array, lag: IntArray) -> Array:
    """Standard deviation (n,) of the last ``lag`` samples at each sample; fewer at the start."""
    a = norm - norm.mean()
    sums, squares = _cumulated(a), _cumulated(a * a)
    end = np.arange(1, len(a) + 1)
    first = np.maximum(end - lag, 0)
    n = end - first
    mean = (sums[end] - sums[first]) / n
    return np.asarray(np.sqrt(np.maximum((squares[end] - squares[first]) / n - mean**2, 0.0)))


def _even(acceleration: Series) -> tuple[Array, Array]:
    """Times (n,) at the rate of this file and the norm at them."""
    norm = np.linalg.norm(np.asarray(acceleration.values, dtype=np.float64), axis=1)
    t: Array = np.asarray(acceleration.t, dtype=np.float64)
    if len(t) < 2:
        return t, norm
    even = t[0] + np.arange(int((t[-1] - t[0]) * _RATE) + 1) / _RATE
    return even, np.interp(even, t, norm)


def _cumulated(values: Array) -> Array:
    return np.concatenate([[0.0], np.cumsum(values)])
