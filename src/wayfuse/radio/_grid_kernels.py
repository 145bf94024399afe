"""Compiled loop of the Gaussian-process map: interpolate the field and sum the likelihood in one pass."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from wayfuse.core.jit import kernel
from wayfuse.core.types import Array, Array32

__all__ = ["field_log_likelihood"]

_LARGE = 1e100  # a running product beyond this is turned into its logarithm


@kernel
def field_log_likelihood(
    node: NDArray[np.int64],
    weight: Array,
    mean: Array32,
    sigma: Array32,
    silence: Array32,
    total_silence: Array,
    heard: NDArray[np.int64],
    z: Array,
    dof: float,
    out: Array,
) -> None:
    """Write the log-likelihood of readings z (h,) of columns ``heard`` at places between nodes.

    node, weight (N, 4): corners and bilinear weights; mean, silence (nodes, a); sigma, total_silence (nodes,).
    The product of 1 + r^2 / dof is carried along, so that a logarithm is rare.
    """
    for i in range(node.shape[0]):
        a, b, c, d = node[i, 0], node[i, 1], node[i, 2], node[i, 3]
        p, q, r, s = weight[i, 0], weight[i, 1], weight[i, 2], weight[i, 3]
        total = p * total_silence[a] + q * total_silence[b] + r * total_silence[c] + s * total_silence[d]
        spread = p * sigma[a] + q * sigma[b] + r * sigma[c] + s * sigma[d]
        total -= heard.shape[0] * math.log(spread)
        tails = 1.0
        for k in range(heard.shape[0]):
            j = heard[k]
            total -= p * silence[a, j] + q * silence[b, j] + r * silence[c, j] + s * silence[d, j]
            centre = p * mean[a, j] + q * mean[b, j] + r * mean[c, j] + s * mean[d, j]
            x = (z[k] - centre) / spread
            tails *= 1.0 + x * x / dof
            if tails > _LARGE:
                total -= 0.5 * (dof + 1.0) * math.log(tails)
                tails = 1.0
        out[i] = total - 0.5 * (dof + 1.0) * math.log(tails)
