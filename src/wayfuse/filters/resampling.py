r"""Resampling: draw N ancestors so that particle i has N w_i offspring on average.

Systematic resampling (one uniform for all) is the default: least work, and least variance in practice. Stratified
draws one uniform per stratum, residual keeps the integer part of N w_i and draws the rest, multinomial draws
everything independently (the reference of theory). All use a float64 running sum with the index clamped: a
float32 sum picks other ancestors from N = 1e5 on and may run past the end.

References
----------
.. [1] Douc, Cappé, Moulines, Comparison of resampling schemes for particle filtering, ISPA 2005.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from wayfuse.core.errors import ConfigError
from wayfuse.core.jit import kernel
from wayfuse.core.philox import Noise
from wayfuse.core.types import Array

__all__ = ["RESAMPLERS", "Resampler", "multinomial", "residual", "stratified", "systematic"]


class Resampler(Protocol):
    """Draws n ancestors (n,) int64, ascending, from normalised weights (N,)."""

    def __call__(self, noise: Noise, weights: Array, n: int, /) -> NDArray[np.int64]:
        """Draw."""


@kernel
def _invert(weights: Array, positions: Array, out: NDArray[np.int64]) -> None:
    # positions ascend in (0, 1); the total is taken as the last running sum, so rounding cannot run past the end
    total = 0.0
    for i in range(weights.shape[0]):
        total += weights[i]
    j = 0
    cumulative = weights[0]
    for k in range(positions.shape[0]):
        p = positions[k] * total
        while cumulative < p and j < weights.shape[0] - 1:
            j += 1
            cumulative += weights[j]
        out[k] = j


def _inverse_cdf(weights: Array, positions: Array) -> NDArray[np.int64]:
    out = np.empty(len(positions), dtype=np.int64)
    _invert(np.ascontiguousarray(weights, dtype=np.float64), positions, out)
    return out


def systematic(noise: Noise, weights: Array, n: int) -> NDArray[np.int64]:
    """One uniform u, positions (k + u) / n."""
    u = noise.uniforms(1)[0, 0]
    return _inverse_cdf(weights, (np.arange(n) + u) / n)


def stratified(noise: Noise, weights: Array, n: int) -> NDArray[np.int64]:
    """One uniform per stratum: positions (k + u_k) / n."""
    return _inverse_cdf(weights, (np.arange(n) + noise.uniforms(n)[0]) / n)


def multinomial(noise: Noise, weights: Array, n: int) -> NDArray[np.int64]:
    """Independent draws (sorted)."""
    return _inverse_cdf(weights, np.sort(noise.uniforms(n)[0]))


def residual(noise: Noise, weights: Array, n: int) -> NDArray[np.int64]:
    """floor(n w_i) copies each, the rest multinomially from the remainders n w_i - floor(n w_i)."""
    w = weights / np.sum(weights)
    copies = np.floor(n * w + 1e-9).astype(np.int64)  # n * (1 / n) may fall short of 1
    kept = np.repeat(np.arange(len(w)), copies)
    rest = n - len(kept)
    if rest > 0:
        drawn = multinomial(noise, np.maximum(n * w - copies, 0.0), rest)
        kept = np.sort(np.concatenate([kept, drawn]))
    return kept


RESAMPLERS: dict[str, Resampler] = {
    "systematic": systematic,
    "stratified": stratified,
    "residual": residual,
    "multinomial": multinomial,
}


def resampler(name: str) -> Resampler:
    """The scheme of a name; ConfigError lists the names."""
    if name not in RESAMPLERS:
        raise ConfigError(f"resampling '{name}' is unknown", remedy=f"one of {', '.join(RESAMPLERS)}")
    return RESAMPLERS[name]
