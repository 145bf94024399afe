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


@inline_kernel
def _bits_of_bytes(word: np.uint64) -> np.uint64:
    """Eight bytes of 0 or 1, the first the lowest, as eight bits."""
    return np.uint64((word * np.uint64(0x0102040810204080)) >> np.uint64(56))


@kernel
def _take_opposites(
    one: NDArray[np.uint64], two: NDArray[np.uint64], ahead: NDArray[np.uint64], counts: NDArray[np.int64]
) -> None:
    """Take 2 from ``counts`` (m,) for each pair that a place has the other way round; four words in a pass."""
    words, m = ahead.shape
    fours = words - words % 4
    for w in range(0, fours, 4):
        a, b, c, d = one[w], one[w + 1], one[w + 2], one[w + 3]
        e, f, g, h = a | two[w], b | two[w + 1], c | two[w + 2], d | two[w + 3]
        p, q, r, s = ahead[w], ahead[w + 1], ahead[w + 2], ahead[w + 3]
        for k in range(m):
            first = _ones((a ^ p[k]) & e) + _ones((b ^ q[k]) & f)
            last = _ones((c ^ r[k]) & g) + _ones((d ^ s[k]) & h)
            counts[k] -= np.int64(2) * np.int64(first + last)
    for w in range(fours, words):
        a, e, p = one[w], one[w] | two[w], ahead[w]
        for k in range(m):
            counts[k] -= np.int64(2) * np.int64(_ones((a ^ p[k]) & e))


@kernel
def tau_of_places(
    keys: NDArray[np.floating],
    sign: float,
    ahead: NDArray[np.uint64],
    behind: NDArray[np.uint64],
    ordered: NDArray[np.int64],
    corrected: bool,
    scale: float,
    shift: float,
    out: Array,
) -> None:
    """shift + scale tau (m,) of sign times keys (n,), smallest first, with m sequences; 0 by 0 is a tau of 0.

       ``corrected``: tau-b, else tau-a.
    A key of NaN comes after all others, tied with its like. ahead, behind (words, m): bit p of word w is pair 64 w + p
       of (0, 1), (0, 2) .. (n - 2, n - 1), set where its first comes before, after its second; ordered (m,): how many
       pairs are not tied.
    """
    words, m, n = ahead.shape[0], ahead.shape[1], len(keys)
    sorted_last = np.empty(n)
    for i in range(n):
        sorted_last[i] = np.inf if np.isnan(keys[i]) else sign * keys[i]
    less_more = np.zeros((2, 64 * words), np.uint8)
    less, more = less_more[0], less_more[1]
    pair = 0
    for i in range(n - 1):
        key, others = sorted_last[i], sorted_last[i + 1 :]
        less_here, more_here = less[pair : pair + len(others)], more[pair : pair + len(others)]
        for j in range(len(others)):
            less_here[j] = np.uint8(key < others[j])
            more_here[j] = np.uint8(key > others[j])
        pair += len(others)
    bits = np.zeros((2, words), np.uint64)
    one, two = bits[0], bits[1]
    less_eight, more_eight = less.view(np.uint64), more.view(np.uint64)
    for w in range(words):
        for p in range(8):
            one[w] |= _bits_of_bytes(less_eight[8 * w + p]) << np.uint64(8 * p)
            two[w] |= _bits_of_bytes(more_eight[8 * w + p]) << np.uint64(8 * p)
    used = np.int64(0)
    for w in range(words):
        used += np.int64(_ones(one[w] | two[w]))
    counts = np.empty(m, np.int64)
    if len(behind) == 0:
        counts[:] = used
        _take_opposites(one, two, ahead, counts)
    else:
        counts[:] = 0
        for w in range(words):
            a, b, place_ahead, place_behind = one[w], two[w], ahead[w], behind[w]
            for k in range(m):
                same = (a & place_ahead[k]) | (b & place_behind[k])
                other = (a & place_behind[k]) | (b & place_ahead[k])
                counts[k] += np.int64(_ones(same)) - np.int64(_ones(other))
    if corrected:
        for k in range(m):
            divisor = math.sqrt(np.float64(used * ordered[k]))
            out[k] = shift + scale * (np.float64(counts[k]) / divisor if divisor > 0.0 else 0.0)
        return
    pairs = max(0.5 * n * (n - 1), 1.0)
    for k in range(m):
        out[k] = shift + scale * (np.float64(counts[k]) / pairs)
