r"""Standing or walking, steps and stride by the autocorrelation of the acceleration (he2014, Section II-A).

The user stands where the standard deviation of the norm of the acceleration is below 0.01, and walks where it is not
and the greatest normalised autocorrelation reaches 0.8:

.. math:: \kappa(m, \tau) = \frac{\sum_{k=0}^{\tau-1} (a(m+k) - \alpha(m, \tau)) (a(m+k+\tau) - \alpha(m+\tau, \tau))}
          {\tau \, \sigma(m, \tau) \, \sigma(m+\tau, \tau)} \quad (Eq. 1), \qquad
          \psi(m) = \max_{30 \le \tau \le 60} \kappa(m, \tau)

Steps of a walk are its duration over the most frequent lag, rounded up; the stride is
:math:`0.98 \sqrt[3]{\sum |a_k| / N}` over the N samples of a period (Eq. 2).

The paper prints no units. Here: the norm less gravity in units of gravity, as the phone of the paper gives it; at
100 Hz, where 30 to 60 samples are the 0.3 to 0.6 s of one step. At 50 Hz they are a pair of steps: set ``rate`` and
``steps_per_period``. As printed, the samples of the last two windows of a walk do not count, about two steps a walk.
An alternative to the streaming `wayfuse.inertial.steps`, on whole arrays; it looks up to 1.2 s ahead.

>>> round(stride(np.full(50, 0.3)), 3)
0.656

References
----------
.. [1] X. He, J. Li, D. Aloi, WiFi based indoor localization with adaptive motion model using smartphone motion
   sensors, ICCVE 2014, Sec. II-A, Eq. 1-2.
.. [2] A. Rai, K. Chintalapudi, V. Padmanabhan, R. Sen, Zee: zero-effort crowdsourcing for indoor localization, MobiCom
   2012 (Eq. 1).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from wayfuse.core.errors import ConfigError, UsageError
from wayfuse.core.types import Array, BoolArray, IntArray
from wayfuse.inertial.autocorrelation_steps import normalised_autocorrelation
from wayfuse.sensors.recording import Series

__all__ = [
    "StageConfig",
    "Stages",
    "Walking",
    "best_autocorrelation",
    "find_stages",
    "stride",
    "uniform_norm",
    "walks",
]

_GRAVITY = 9.80665  # m/s²


@dataclass(frozen=True, slots=True, kw_only=True)
class StageConfig:
    """Parameters of Section II-A; rate and steps_per_period are not printed."""

    still_sigma: float = 0.01  # g
    tau_min: int = 30  # samples
    tau_max: int = 60
    least_psi: float = 0.8
    rate: float = 100.0  # Hz
    steps_per_period: int = 1

    def __post_init__(self) -> None:
        if not (2 <= self.tau_min <= self.tau_max and self.rate > 0.0 and self.steps_per_period >= 1):
            raise ConfigError(
                "2 <= tau_min <= tau_max, rate > 0 and steps_per_period >= 1 are needed", where="StageConfig"
            )
        if not (0.0 < self.least_psi <= 1.0 and self.still_sigma >= 0.0):
            raise ConfigError("least_psi in (0, 1] and still_sigma >= 0 are needed", where="StageConfig")


class Stages(NamedTuple):
    """Per sample that has two whole windows ahead: psi (m,), its lag tau (m,) samples, walking (m,)."""

    psi: Array
    tau: IntArray
    is_walking: BoolArray


class Walking(NamedTuple):
    """One uninterrupted walk: first sample and one past the last, most frequent lag, steps, metres per step."""

    first: int
    last: int
    tau: int
    steps: int
    step_length: float


def uniform_norm(acceleration: Series, config: StageConfig) -> Array:
    """Norm of the acceleration less gravity, in g, at the rate of the configuration, (n,).

    Raises
    ------
    UsageError : fewer than two samples.
    """
    t = acceleration.t
    if len(t) < 2 or not t[-1] > t[0]:
        raise UsageError("too few accelerations", where="acceleration", remedy="give a recording of seconds")
    at = np.arange(t[0], t[-1], 1.0 / config.rate)
    norm = np.sqrt((acceleration.values.astype(np.float64) ** 2).sum(axis=1))
    return np.asarray(np.interp(at, t, norm) / _GRAVITY - 1.0)


def best_autocorrelation(a: Array, tau_min: int, tau_max: int) -> tuple[Array, IntArray]:
    """Psi (m,) and its lag (m,) for the samples of a (n,) with 2 tau_max samples ahead; m = n - 2 tau_max + 1 or 0."""
    m = max(len(a) - 2 * tau_max + 1, 0)
    lags = np.arange(tau_min, tau_max + 1)
    if m == 0:
        return np.zeros(0), lags[:0]
    chi = normalised_autocorrelation(a, lags)
    # Eq. 1 looks ahead from sample m, chi back from the last of the same samples
    kappa = np.stack([of[2 * lag - 1 : 2 * lag - 1 + m] for of, lag in zip(chi, lags.tolist(), strict=True)])
    best = np.argmax(kappa, axis=0)  # of equals the shortest lag
    return kappa[best, np.arange(m)], lags[best]


def find_stages(a: Array, config: StageConfig) -> Stages:
    """Stages of an acceleration a (n,) g; its standard deviation is that of the 2 tau_max samples ahead."""
    psi, tau = best_autocorrelation(a, config.tau_min, config.tau_max)
    if not len(psi):
        return Stages(psi, tau, np.zeros(0, np.bool_))
    span = 2 * config.tau_max
    centred = a - a.mean()
    total, squares = (np.concatenate([[0.0], np.cumsum(v)]) for v in (centred, centred * centred))
    mean = (total[span:] - total[:-span]) / span
    variance = np.maximum((squares[span:] - squares[:-span]) / span - mean * mean, 0.0)
    return Stages(psi, tau, (np.sqrt(variance) >= config.still_sigma) & (psi >= config.least_psi))


def stride(period: Array) -> float:
    """Eq. 2: metres from the accelerations (n,) g of one period of walking."""
    return float(0.98 * np.cbrt(np.abs(period).mean()))


def walks(a: Array, config: StageConfig) -> list[Walking]:
    """The walks in an acceleration a (n,) g, in order; the step length is the mean of Eq. 2 over the periods."""
    stages = find_stages(a, config)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], stages.is_walking, [False]]).astype(np.int8)))
    out = []
    for first, last in edges.reshape(-1, 2).tolist():
        tau = int(np.bincount(stages.tau[first:last]).argmax())
        periods = math.ceil((last - first) / tau)
        lengths = [stride(a[first + p * tau : first + (p + 1) * tau]) for p in range(periods)]
        # where a period is two steps, Eq. 2 still gives the length of one: the mean of |a| is that of both
        out.append(Walking(first, last, tau, periods * config.steps_per_period, float(np.mean(lengths))))
    return out
