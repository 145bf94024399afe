r"""Phones measure long: the line of a phone's ranges, measured = offset + slope * distance, estimated while it tracks.

What `radio.range_correction` fits where true distances are known, a track has to find for itself. The line is one of a
grid, and each has a probability. The ranges of a moment are unlike all places under a wrong line and like one place
under the right one, so a line gains by how likely it makes them under the cloud of particles:

.. math:: p(l) \propto p_0(l)^{1 - f} \, p(l)^f \Big(\sum_i w_i \, p(z \mid x_i, l)\Big)^\eta

f lets old evidence fade, for the line is not the phone's alone: it is also the mean over the walls of a room. The
exponent is small, for the errors that walls make last as long as one stays: many ranges of one place are about one
piece of evidence. The cloud in turn is weighed by the mixture of all lines (`mixed`), not by the best.

Place and line are taken as independent given the ranges, which they are not where all anchors are on one side; the
prior keeps what nobody can tell there within reason.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from wayfuse.core.errors import ConfigError
from wayfuse.core.types import Array

__all__ = ["LineGrid", "Spread", "mixed"]


@dataclass(frozen=True, slots=True)
class Spread:
    """Values of a parameter, with a normal prior: ``n`` from mean - reach sigma to mean + reach sigma.

    >>> Spread(1.0, 0.5, n=3).values.tolist()
    [0.0, 1.0, 2.0]
    """

    mean: float
    sigma: float
    n: int = 7
    reach: float = 2.0

    def __post_init__(self) -> None:
        if not (self.sigma > 0.0 and self.reach > 0.0 and self.n >= 1):
            raise ConfigError("sigma, reach and n must be positive", where="Spread")

    @property
    def values(self) -> Array:
        """(n,), ascending; the mean alone where n is 1."""
        if self.n == 1:
            return np.array([self.mean])
        return self.mean + self.sigma * np.linspace(-self.reach, self.reach, self.n)


@dataclass(frozen=True, slots=True, kw_only=True)
class LineGrid:
    """Lines (n,) and what is thought of them before the first range.

    The priors are of phones indoors: all measure long, by a metre and a tenth of the distance, more or less.

    Parameters
    ----------
    offset : m. slope : of the measured range over the distance. learning : eta, exponent of the evidence of a moment.
    memory : s, after which old evidence has faded to 1/e. negligible : nats below the best line at which one is not
    looked at; it shares the fate of the worst that is, and comes back as the prior does.
    """

    offset: Spread = field(default_factory=lambda: Spread(1.0, 0.5))
    slope: Spread = field(default_factory=lambda: Spread(1.08, 0.04))
    learning: float = 0.3
    memory: float = 120.0
    negligible: float = 7.0
    offsets: Array = field(init=False, repr=False, compare=False)
    slopes: Array = field(init=False, repr=False, compare=False)
    prior: Array = field(init=False, repr=False, compare=False)  # (n,) log-probability

    def __post_init__(self) -> None:
        if not (self.slope.values[0] > 0.0 and min(self.memory, self.negligible) > 0.0 <= self.learning):
            raise ConfigError(
                "slopes, memory and negligible must be positive, learning not negative", where="LineGrid"
            )
        a, b = (g.ravel() for g in np.meshgrid(self.offset.values, self.slope.values, indexing="ij"))
        off, steep = (a - self.offset.mean) / self.offset.sigma, (b - self.slope.mean) / self.slope.sigma
        for name, value in (
            ("offsets", a),
            ("slopes", b),
            ("prior", _normalised(-0.5 * (off**2 + steep**2))),
        ):
            value.flags.writeable = False
            object.__setattr__(self, name, value)

    def live(self, log_p: Array) -> NDArray[np.int64]:
        """Rows of the lines that are not negligible, of log-probabilities (n,)."""
        return np.flatnonzero(log_p >= log_p.max() - self.negligible)

    def learned(self, log_p: Array, rows: NDArray[np.int64], evidence: Array, spacing: float) -> Array:
        """Log-probabilities (n,) after a moment.

        Parameters
        ----------
        log_p : (n,) before. rows : (k,), lines that were looked at. evidence : (k,), log-likelihood of the moment
        under each. spacing : s since the moment before.
        """
        kept = float(np.exp(-max(spacing, 0.0) / self.memory))
        gain = np.full(len(log_p), evidence.min())
        gain[rows] = evidence
        return _normalised(self.prior + kept * (log_p - self.prior) + self.learning * gain)


def mixed(log_p: Array, table: Array) -> Array:
    """Log-likelihood (N,) under a mixture: log-probabilities (k,) of lines, log-likelihoods (k, N) under each."""
    total = table + _normalised(log_p)[:, None]
    top = total.max(axis=0)
    return np.asarray(top + np.log(np.exp(total - top).sum(axis=0)))


def _normalised(log_p: Array) -> Array:
    top = float(log_p.max())
    return np.asarray(log_p - top - np.log(np.exp(log_p - top).sum()))
