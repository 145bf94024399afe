"""Kendall's tau of one scan with many places, by population counts over packed signs of pairs."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from wayfuse.core.jit import inline_kernel, kernel
from wayfuse.core.types import Array

__all__ = ["tau_of_places"]


@inline_kernel
def _ones(word: np.uint64) -> np.uint64:
    """Number of bits set; compilers know this form as one instruction."""
    word = word - ((word >> np.uint64(1)) & np.uint64(0x5555555555555555))
    word = (word & np.uint64(0x3333333333333333)) + ((word >> np.uint64(2)) & np.uint64(0x3333333333333333))
    word = (word + (word >> np.uint64(4))) & np.uint64(0x0F0F0F0F0F0F0F0F)
    return np.uint64((word * np.uint64(0x0101010101010101)) >> np.uint64(56))


@kernel
def tau_of_places(
    keys: Array,
    ahead: NDArray[np.uint64],
    behind: NDArray[np.uint64],
    ordered: NDArray[np.int64],
    corrected: bool,
    scale: float,
    shift: float,
    out: Array,
) -> None:
    """shift + scale tau (m,) of keys (n,), smallest first, with m sequences; 0 by 0 is a tau of 0.

       ``corrected``: tau-b, else tau-a.
    A key of NaN comes after all others, tied with its like. ahead, behind (words, m): bit p of word w is pair 64 w + p
       of (0, 1), (0, 2) .. (n - 2, n - 1), set where its first comes before, after its second; ordered (m,): how many
       pairs are not tied.
    """
    words, m, n = ahead.shape[0], ahead.shape[1], len(keys)
    sorted_last = np.empty(n)
    for i in range(n):
        sorted_last[i] = np.inf if np.isnan(keys[i]) else keys[i]
    one, two = np.zeros(words, np.uint64), np.zeros(words, np.uint64)
    a, b, pair = np.uint64(0), np.uint64(0), 0
    for i in range(n):
        key = sorted_last[i]
        for other_key in sorted_last[i + 1 :]:
            bit = np.uint64(1) << np.uint64(pair & 63)
            a |= bit if key < other_key else np.uint64(0)
            b |= bit if key > other_key else np.uint64(0)
            one[pair >> 6], two[pair >> 6] = a, b
            pair += 1
            if pair & 63 == 0:
                a, b = np.uint64(0), np.uint64(0)
    counts = np.zeros(m, np.int64)
    used = np.int64(0)
    for w in range(words):
        a, b = one[w], two[w]
        used += np.int64(_ones(a | b))
        place_ahead, place_behind = ahead[w], behind[w]
        for k in range(m):
            same = (a & place_ahead[k]) | (b & place_behind[k])
            other = (a & place_behind[k]) | (b & place_ahead[k])
            counts[k] += np.int64(_ones(same)) - np.int64(_ones(other))
    for k in range(m):
        divisor = math.sqrt(np.float64(used * ordered[k])) if corrected else 0.5 * n * (n - 1)
        out[k] = shift + scale * (np.float64(counts[k]) / divisor if divisor > 0.0 else 0.0)
