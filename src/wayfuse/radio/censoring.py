"""Unheard access points: below the receiver's limit, or dropped by a scan.

A latent strength f + noise is heard when it is above a limit, and even then lost with some probability. Not
hearing an access point is thus evidence of a weak signal, but not proof. Two functions follow: the chance of
silence, for the likelihood of a query, and the expected latent strength given silence, which completes a
survey so that all access points share the same training places (the expectation step of EM for a Tobit
model).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wayfuse.core.types import Array

__all__ = ["expected_when_silent", "log_silence"]


def log_silence(
    mean: NDArray[np.floating], sigma: NDArray[np.floating], limit: float, dropout: float
) -> NDArray[np.floating]:
    """Log of the probability of not hearing: log(dropout + (1 - dropout) Phi((limit - mean) / sigma))."""
    from scipy.special import ndtr

    return np.asarray(np.log(dropout + (1.0 - dropout) * ndtr((limit - mean) / sigma)))


def expected_when_silent(mean: Array, sigma: Array, limit: float, dropout: float) -> Array:
    """Expected latent strength (dBm) given silence and a Gaussian belief (mean, sigma) about it.

    A mixture of the belief itself (the scan dropped it) and of the belief truncated above at ``limit``; the
    truncated mean is mean - sigma phi(a) / Phi(a), a = (limit - mean) / sigma.
    """
    from scipy.special import log_ndtr

    a = (limit - mean) / sigma
    log_below = log_ndtr(a)
    truncated = mean - sigma * np.exp(-0.5 * a * a - 0.5 * np.log(2.0 * np.pi) - log_below)
    dropped = dropout / (dropout + (1.0 - dropout) * np.exp(log_below))
    return np.asarray(dropped * mean + (1.0 - dropped) * truncated)
