"""Representations of signal strengths for distances between fingerprints (Torres-Sospedra et al. 2015).

dBm are a poor scale for distances: a difference at -90 dBm is mostly noise, one at -50 dBm is a few metres.
Each representation maps dBm, NaN where unheard, to numbers >= 0 in which unheard is 0 (``raw`` keeps dBm and
puts the missing value in). Readings at or below the missing value count as unheard.

>>> powed = Representation("powed", missing=-100.0, parameter=2.0)
>>> powed(np.array([-50.0, -90.0, np.nan])).round(4).tolist()
[0.25, 0.01, 0.0]

References
----------
.. [1] J. Torres-Sospedra et al., Comprehensive analysis of distance and similarity measures for Wi-Fi
   fingerprinting indoor positioning systems, Expert Systems with Applications 42, 2015,
   10.1016/j.eswa.2015.08.013.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from wayfuse.core.types import Array
from wayfuse.radio.radio_map import require

__all__ = ["KINDS", "Kind", "Representation"]

Kind = Literal["raw", "positive", "exponential", "powed"]
KINDS: tuple[Kind, ...] = ("raw", "positive", "exponential", "powed")
_DEFAULT = {"raw": 0.0, "positive": 0.0, "exponential": 24.0, "powed": float(np.e)}  # [1]_ Sec. 3.3


@dataclass(frozen=True, slots=True)
class Representation:
    """A map from dBm to the numbers that are compared.

    kind : ``raw`` x; ``positive`` x - missing; ``exponential`` exp(positive / parameter) scaled to (0, 1] and
    0 where unheard; ``powed`` (positive / -missing) ** parameter.
    missing : dBm that stands for "not heard" (< 0).
    parameter : alpha of ``exponential`` (dB), exponent of ``powed``; None takes those of [1]_, 24 and e.
    """

    kind: Kind = "powed"
    missing: float = -104.0
    parameter: float | None = None

    def __post_init__(self) -> None:
        require(self.kind in KINDS, f"representation {self.kind!r}", f"one of {', '.join(KINDS)}")
        require(self.missing < 0, f"missing {self.missing}", "dBm below 0")
        require(self.parameter is None or self.parameter > 0, f"parameter {self.parameter}", "above 0")

    def __call__(self, rssi: NDArray[np.floating]) -> Array:
        """Represent dBm of any shape, NaN where unheard; the result has the same shape."""
        x = np.asarray(rssi, dtype=np.float64)
        if self.kind == "raw":
            return np.where(np.isfinite(x), x, self.missing)
        positive = np.maximum(np.where(np.isfinite(x), x - self.missing, 0.0), 0.0)
        value = _DEFAULT[self.kind] if self.parameter is None else self.parameter
        if self.kind == "positive":
            return positive
        if self.kind == "exponential":
            scaled = np.exp((positive + self.missing) / value)
            return np.where(positive > 0.0, scaled, 0.0)
        return np.asarray((positive / -self.missing) ** value)
