r"""Step length from the shape of a step.

With the band-passed norm of the acceleration :math:`a` (extremes :math:`a_{max}`, :math:`a_{min}` and mean
:math:`\overline{|a|}` over the step), the low-passed vertical acceleration :math:`a_v` and the duration
:math:`T`:

* ``constant``: :math:`l = k`
* ``weinberg``: :math:`l = k (a_{max} - a_{min})^{1/4}` [1]_
* ``kim``: :math:`l = k\, \overline{|a|}^{1/3}` [2]_
* ``kakiuchi``: :math:`l = k (a_{v,max} - a_{v,min})^{1/4}` [3]_, as in [4]_, Eq. 14
* ``regression``: linear in 1, :math:`1/T`, :math:`\overline{|a|}^{1/3}`, :math:`a_{max} / (a_{max} -
  a_{min})`, :math:`\overline{|a|} / (a_{max} - a_{min})`

Every model is linear in its coefficients and is fitted by robust least squares to walked distances. Fitted
to the ms-indoor survey walks, the models err on segments of 7 m by (median / 90 %, in per cent; right: the
same coefficients on the other people, phones and floors of ipin2023-track3, with the mean error):

============ =========== ===================
constant     11.6 / 29.4  9.0 / 21.6 (+9)
weinberg      9.6 / 26.3 17.2 / 27.6 (-17)
kim           9.0 / 25.9 23.0 / 33.9 (-24)
kakiuchi      9.6 / 26.2 16.4 / 26.1 (-17)
regression    8.5 / 24.1  5.9 / 16.2 (-2)
============ =========== ===================

A regression on strengths alone (mean, peak, valley) reaches 7.7 / 21.9 at home and errs by -35 % there: how
strongly a phone is shaken tells the person and the phone, step rate and wave shape tell the step. The
features of the regression were chosen with both data sets in view, so the right column flatters it a little;
its coefficients have seen ms-indoor only.

>>> model = StepLengthModel("weinberg", (0.4,))
>>> step = StepFeatures(*(np.array([v]) for v in (0.5, 3.0, -2.0, 1.5, 4.0)))
>>> model.length(step).round(3)
array([0.598])

References
----------
.. [1] H. Weinberg, Using the ADXL202 in pedometer and personal navigation applications, Analog Devices
   AN-602, 2002.
.. [2] J. W. Kim et al., A step, stride and heading determination for the pedestrian navigation system,
   Journal of Global Positioning Systems 3 (2004).
.. [3] N. Kakiuchi and S. Kamijo, Pedestrian dead reckoning for mobile phones through walking and running
   mode recognition, ITSC 2013.
.. [4] Z. Li et al., indoor tracking by CSI ranging and PDR in a particle filter, 2015.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from wayfuse.core.errors import ConfigError, UsageError
from wayfuse.core.types import Array

__all__ = [
    "DEFAULT",
    "DEFAULTS",
    "MODELS",
    "StepFeatures",
    "StepLengthModel",
    "coefficient_count",
    "design",
    "fit",
]

MODELS = ("constant", "weinberg", "kim", "kakiuchi", "regression")
_HUBER = 0.15  # relative error of a segment beyond which its weight falls: 1.5 to 2 times the median error
_SEGMENTS_PER_COEFFICIENT = 5


class StepFeatures(NamedTuple):
    """Shape of n steps, each (n,): duration (s), peak, valley, mean_abs and vertical range (m/s²)."""

    duration: Array
    peak: Array
    valley: Array
    mean_abs: Array
    vertical: Array


@dataclass(frozen=True, slots=True)
class StepLengthModel:
    """A model and its coefficients.

    Parameters
    ----------
    name : one of `MODELS`.
    coefficients : 1, or 5 of ``regression``; m and m per unit of the features.
    bounds : shortest and longest length given out (m): shuffling and running.
    """

    name: str
    coefficients: tuple[float, ...]
    bounds: tuple[float, float] = (0.25, 1.3)

    def __post_init__(self) -> None:
        if self.name not in MODELS:
            raise ConfigError(f"no step-length model {self.name!r}", remedy=f"one of {', '.join(MODELS)}")
        n = coefficient_count(self.name)
        if len(self.coefficients) != n or not np.all(np.isfinite(self.coefficients)):
            raise ConfigError(f"the {self.name} model takes {n} finite coefficients, got {self.coefficients}")
        if not 0.0 < self.bounds[0] < self.bounds[1]:
            raise ConfigError(f"step-length bounds {self.bounds} are not 0 < shortest < longest")

    @property
    def code(self) -> float:
        """Number by which the kernels know the model."""
        return float(MODELS.index(self.name))

    def length(self, features: StepFeatures) -> Array:
        """Lengths of steps (m), (n,)."""
        length = design(self.name, features) @ np.asarray(self.coefficients)
        return np.asarray(np.clip(length, *self.bounds))


def coefficient_count(name: str) -> int:
    """Number of coefficients of a model."""
    return 5 if name == "regression" else 1


def design(name: str, features: StepFeatures) -> Array:
    """Columns that a model is linear in, (n, number of coefficients)."""
    f = features
    if name == "constant":
        columns = [np.ones_like(f.peak)]
    elif name == "weinberg":
        columns = [(f.peak - f.valley) ** 0.25]
    elif name == "kim":
        columns = [np.cbrt(f.mean_abs)]
    elif name == "kakiuchi":
        columns = [f.vertical**0.25]
    else:
        span = f.peak - f.valley
        columns = [np.ones_like(span), 1 / f.duration, np.cbrt(f.mean_abs), f.peak / span, f.mean_abs / span]
    return np.column_stack(columns)


def fit(name: str, summed: Array, distance: Array) -> StepLengthModel:
    """Fit a model to walked distances, minimising relative errors with Huber's weights.

    Parameters
    ----------
    name : one of `MODELS`.
    summed : (m, number of coefficients) sum over the steps of each segment of `design`.
    distance : (m,) length of each segment, m.

    Raises
    ------
    UsageError : fewer than five segments per coefficient.
    """
    needed = _SEGMENTS_PER_COEFFICIENT * summed.shape[1]
    if len(distance) < needed:
        raise UsageError(
            f"{len(distance)} segments are too few to fit the {name} model",
            remedy=f"give walks with at least {needed} straight segments, or a model of one coefficient",
        )
    a = summed / distance[:, None]
    weight = np.ones(len(distance))
    for _ in range(20):
        b = np.linalg.lstsq(a * weight[:, None], weight, rcond=None)[0]
        weight = np.sqrt(_HUBER / np.maximum(np.abs(a @ b - 1.0), _HUBER))
    return StepLengthModel(name, tuple(float(v) for v in b))


# Fitted by `python -m benchmarks.inertial` on the 452 survey walks of ms-indoor site1 (hand-held).
DEFAULTS = {
    "constant": StepLengthModel("constant", (0.6536,)),
    "weinberg": StepLengthModel("weinberg", (0.3876,)),
    "kim": StepLengthModel("kim", (0.4857,)),
    "kakiuchi": StepLengthModel("kakiuchi", (0.3874,)),
    "regression": StepLengthModel("regression", (0.3422, -0.2659, 0.375, -0.0164, 1.076)),
}
DEFAULT = DEFAULTS["regression"]
