r"""The radio irregularity model of chu2009, Eq. 4.1-4.5: a transmitter that is stronger one way than another.

.. math:: P_r = P_t (1 + N(0, VSP)) - PL(d) K_i - \min(N_{obs}, maxW) \, WAF, \qquad
          K_0 = 1, \quad K_i = K_{i-1} \pm W \cdot DOI, \quad |K_0 - K_{359}| \le DOI

i is the azimuth in whole degrees (interpolated between), W a Weibull variable. Eq. 4.4 calls W zero-mean, which no
Weibull variable is: it gets a random sign; its parameters are not given: shape and scale 1. A pattern is drawn until
it closes (`wayfuse.simulator.chu2009_world.draw_pattern`). The noise of a reading, the last term of Eq. 4.5, is the
scanner's (`ScannerModel.fading_db`).

References
----------
.. [1] Chu, S. M., Particle filter and indoor map matching, 2009, Section 4.1; see docs/papers/chu2009.md.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wayfuse.core.types import Array
from wayfuse.simulator.toml_tables import no_negative, require

__all__ = ["RimModel", "pattern_at", "rim_level"]

_DEGREES = 360


@dataclass(frozen=True, slots=True, kw_only=True)
class RimModel:
    """Parameters of Section 4.1; pairs are (2.4 GHz, 5 GHz), of which the paper has the first."""

    power_dbm: tuple[float, float] = (15.0, 9.0)  # P_t
    vsp: float = 0.02  # of P_t, between transmitters
    doi: float = 0.004  # change of the path loss per degree, relative
    waf: float = 3.0  # dB, each wall
    max_walls: int = 4  # maxW
    reference_db: float = 37.3  # path loss at 1 m
    exponent: float = 3.3  # of the path loss

    def __post_init__(self) -> None:
        no_negative(self, but=("power_dbm",))
        require("doi", self.doi <= 0.1, self.doi, "at most 0.1: beyond it a pattern means nothing")


def pattern_at(pattern: Array, azimuth: Array) -> Array:
    """K (n,) of patterns (n, 360) at azimuths (n,) rad, linear between whole degrees."""
    degree = np.degrees(azimuth) % _DEGREES
    before = np.floor(degree).astype(np.int64) % _DEGREES
    row = np.arange(len(pattern))
    low, high = pattern[row, before], pattern[row, (before + 1) % _DEGREES]
    return np.asarray(low + (degree - np.floor(degree)) * (high - low))


def rim_level(power: Array, distance: Array, k: Array, n_walls: Array, model: RimModel) -> Array:
    """Level (n,) dBm (Eq. 4.1-4.3) of transmitters of power (n,) dBm at distances (n,) m, by K (n,) and walls (n,)."""
    loss = model.reference_db + 10.0 * model.exponent * np.log10(np.maximum(distance, 1.0))
    return np.asarray(power - loss * k - model.waf * np.minimum(n_walls, model.max_walls))
