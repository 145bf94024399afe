r"""Stride length by quadratic regression on the shape of the pulse (chu2009, Eq. 3.1).

.. math:: l = a X^2 + b X A + c A^2 + d X + e A + f

with A the sum of the magnitudes of the left and the right slope of the pulse that a step leaves in the vertical
acceleration and X the norm of the first component of its discrete Fourier transform; the constants come from the
method of least squares. An alternative to the models of `step_length`, on arrays: it needs the samples of a step,
not only its extremes.

The paper does not say what a slope is nor how the transform is scaled. Here: the slope of a flank is its height over
its time (m/s³), from the lowest sample before the peak to the peak and from there to the lowest after; the transform
is divided by half the number of samples, which makes X the amplitude of the fundamental (m/s²).

Measured: fitted to the legs of floor 0 of ipin2023-track3 (114), legs of floor -2 (168) err by 6.2 / 15.8 % (median /
90 %); a constant length 5.9 / 17.1 %: no gain there.

>>> fit = StrideRegression((0.0, 0.0, 0.0, 0.05, 0.0, 0.4))
>>> fit.length(np.array([[30.0, 4.0]]))
array([0.6])

References
----------
.. [1] H.-T. Chu, master's thesis, National Chiao Tung University, 2009, Section 3.1.1, Eq. 3.1.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wayfuse.core.errors import ConfigError, UsageError
from wayfuse.core.types import Array

__all__ = ["StrideRegression", "fit_stride_regression", "pulse_features"]

_LEAST_SAMPLES = 6  # of a pulse: a step of 0.3 s at 20 Hz
_SEGMENTS_PER_COEFFICIENT = 5


@dataclass(frozen=True, slots=True)
class StrideRegression:
    """Eq. 3.1 with its constants.

    coefficients : a, b, c, d, e, f. bounds : shortest and longest length given out (m).
    """

    coefficients: tuple[float, float, float, float, float, float]
    bounds: tuple[float, float] = (0.25, 1.3)

    def __post_init__(self) -> None:
        if len(self.coefficients) != 6 or not np.all(np.isfinite(self.coefficients)):
            raise ConfigError(
                f"coefficients = {self.coefficients}", remedy="give six finite numbers a, b, c, d, e, f"
            )
        if not 0.0 < self.bounds[0] < self.bounds[1]:
            raise ConfigError(f"bounds {self.bounds} are not 0 < shortest < longest")

    def length(self, features: Array) -> Array:
        """Lengths (n,) m of steps by their (n, 2) features A, X; NaN features give the middle of the bounds."""
        length = _design(features) @ np.asarray(self.coefficients)
        length = np.where(np.isfinite(length), length, np.mean(self.bounds))
        return np.asarray(np.clip(length, *self.bounds))


def pulse_features(t: Array, vertical: Array, step_times: Array) -> Array:
    """Features A (m/s³) and X (m/s²) of each step, (n, 2).

    Parameters
    ----------
    t, vertical : (m,) s, not decreasing, and vertical acceleration, m/s².
    step_times : (n,) s; a pulse reaches from the step before to the step, at most 1 s back. A pulse of fewer than
        six samples has NaN features.
    """
    features = np.full((len(step_times), 2), np.nan)
    since = np.maximum(np.concatenate([[-np.inf], step_times[:-1]]), step_times - 1.0)
    first = np.searchsorted(t, since, side="right")
    last = np.searchsorted(t, step_times, side="right")
    for k, (i, j) in enumerate(zip(first, last, strict=True)):
        if j - i >= _LEAST_SAMPLES:
            features[k] = _pulse(t[i:j], vertical[i:j])
    return features


def _pulse(t: Array, a: Array) -> tuple[float, float]:
    peak = int(np.argmax(a))
    left = int(np.argmin(a[: peak + 1]))
    right = peak + int(np.argmin(a[peak:]))
    slopes = 0.0
    for foot in (left, right):
        if t[foot] != t[peak]:
            slopes += abs((a[peak] - a[foot]) / (t[peak] - t[foot]))
    turn = np.exp(-2j * np.pi * np.arange(len(a)) / len(a))
    return slopes, float(2.0 / len(a) * abs(turn @ a))


def fit_stride_regression(features: Array, segment: Array, distance: Array) -> StrideRegression:
    """Constants by least squares of relative errors over walked segments.

    Parameters
    ----------
    features : (n, 2) of the steps. segment : (n,) number of the segment of each step, or -1.
    distance : (m,) length of each segment, m; segments without a step are left out.

    Raises
    ------
    UsageError : fewer than five segments per constant.
    """
    rows = _design(features)
    use = (segment >= 0) & np.all(np.isfinite(rows), axis=1)
    summed = np.zeros((len(distance), 6))
    np.add.at(summed, segment[use], rows[use])
    # a step whose pulse could not be read is as long as the mean of its segment
    total = np.bincount(segment[segment >= 0], minlength=len(distance))
    known = np.bincount(segment[use], minlength=len(distance))
    keep = (known > 0) & (distance > 0.0)
    if keep.sum() < 6 * _SEGMENTS_PER_COEFFICIENT:
        raise UsageError(
            f"{keep.sum()} segments are too few to fit Eq. 3.1",
            remedy=f"give at least {6 * _SEGMENTS_PER_COEFFICIENT} walked segments with steps",
        )
    a = summed[keep] * (total[keep] / known[keep] / distance[keep])[:, None]
    scale = np.abs(a).max(axis=0)
    scale[scale == 0.0] = 1.0
    b = np.linalg.lstsq(a / scale, np.ones(len(a)), rcond=None)[0] / scale
    return StrideRegression((float(b[0]), float(b[1]), float(b[2]), float(b[3]), float(b[4]), float(b[5])))


def _design(features: Array) -> Array:
    slopes, x = features[:, 0], features[:, 1]
    return np.column_stack([x * x, x * slopes, slopes * slopes, x, slopes, np.ones_like(x)])
