"""Kendall's tau of one scan with many places, by population counts over packed signs of pairs."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from wayfuse.core.jit import inline_kernel, kernel, uncounted_kernel
from wayfuse.core.types import Array

__all__ = ["tau_of_places"]

_WORD = 64  # bits
_GROUP = 8  # words of a place that are compared in one pass


@uncounted_kernel
def tau_of_places(keys: NDArray[np.floating], orders: NDArray[np.uint64], numbers: Array, out: Array) -> None:
    """shift + scale tau (m,) of sign times keys (n,), smallest first, with m sequences; 0 by 0 is a tau of 0.

    A key of NaN comes after all others, tied with its like. orders (rows, m): the words of "first before second", where
       bit p of word w is pair 64 w + p of (0, 1), (0, 2) .. (n - 2, n - 1); if any sequence has a tie, as many words of
       "first after second" and the number of pairs that are not tied. numbers (4,): sign, 1 for tau-b or 0 for tau-a,
       scale, shift.
    """
    # the arrays of the caller need not be counted: of a scan's time that takes a part as great as that of its packing
    _tau_with_scratch(keys, orders, numbers, out)


@kernel
def _tau_with_scratch(
    keys: NDArray[np.floating], orders: NDArray[np.uint64], numbers: Array, out: Array
) -> None:
    n, rows = len(keys), len(orders)
    pairs = n * (n - 1) // 2
    words = max(-(-pairs // _WORD), 1)
    groups = -(-words // _GROUP)
    scratch = np.empty(n + 2 * _GROUP * groups)
    sorted_last, bits = scratch[:n], scratch[n:].view(np.uint64)
    one, told = bits[: _GROUP * groups], bits[_GROUP * groups :]
    for i in range(n):
        sorted_last[i] = np.inf if np.isnan(keys[i]) else numbers[0] * keys[i]
    _pack(sorted_last, one, told)
    used = np.int64(0)
    for w in range(words):
        used += np.int64(_ones(told[w]))
    corrected, scale, shift = numbers[1] > 0.0, numbers[2], numbers[3]
    if rows == words:
        divisor = math.sqrt(np.float64(used * pairs)) if corrected else np.float64(pairs)
        out[:] = used
        for g in range(groups):
            last = g == groups - 1
            _take_opposites(
                one, told, orders, _GROUP * g,
                max(divisor, 1.0) if last else 1.0, scale if last else 1.0, shift if last else 0.0, out,
            )  # fmt: skip
        return
    out[:] = 0.0
    for w in range(words):
        _add_agreements(one[w], one[w] ^ told[w], orders[w], orders[words + w], out)
    ordered = orders[rows - 1]
    for k in range(len(out)):
        divisor = math.sqrt(np.float64(used * np.int64(ordered[k]))) if corrected else np.float64(pairs)
        out[k] = shift + scale * (out[k] / max(divisor, 1.0))


@uncounted_kernel
def _pack(keys: Array, one: NDArray[np.uint64], told: NDArray[np.uint64]) -> None:
    """The bits of the pairs of keys (n,) without NaN: "first before second", and "not tied"."""
    n = len(keys)
    one[:], told[:] = 0, 0
    pair = 0
    for i in range(n - 1):
        for first in range(i + 1, n, _WORD):
            others = keys[first : min(first + _WORD, n)]
            before, apart = np.uint64(0), np.uint64(0)
            for j in range(len(others)):
                before |= np.uint64(keys[i] < others[j]) << np.uint64(j)
                apart |= np.uint64(keys[i] != others[j]) << np.uint64(j)
            w, bit = pair // _WORD, pair % _WORD
            one[w] |= before << np.uint64(bit)
            told[w] |= apart << np.uint64(bit)
            if bit + len(others) > _WORD:
                one[w + 1] = before >> np.uint64(_WORD - bit)
                told[w + 1] = apart >> np.uint64(_WORD - bit)
            pair += len(others)


@inline_kernel
def _ones(word: np.uint64) -> np.uint64:
    """Number of bits set; compilers know this form as one instruction."""
    word = word - ((word >> np.uint64(1)) & np.uint64(0x5555555555555555))
    word = (word & np.uint64(0x3333333333333333)) + ((word >> np.uint64(2)) & np.uint64(0x3333333333333333))
    word = (word + (word >> np.uint64(4))) & np.uint64(0x0F0F0F0F0F0F0F0F)
    return np.uint64((word * np.uint64(0x0101010101010101)) >> np.uint64(56))


@uncounted_kernel
def _take_opposites(
    one: NDArray[np.uint64],
    told: NDArray[np.uint64],
    ahead: NDArray[np.uint64],
    first: int,
    divisor: float,
    scale: float,
    shift: float,
    out: Array,
) -> None:
    """Take 2 from ``out`` (m,) for each pair that a place has the other way round in 8 words; divide, scale, shift.

    Of words beyond the last of ``ahead`` (words, m) no pair is told: whatever is read for them does not count.
    """
    last = len(ahead) - 1
    a, b, c, d = one[first], one[first + 1], one[first + 2], one[first + 3]
    e, f, g, h = one[first + 4], one[first + 5], one[first + 6], one[first + 7]
    ta, tb, tc, td = told[first], told[first + 1], told[first + 2], told[first + 3]
    te, tf, tg, th = told[first + 4], told[first + 5], told[first + 6], told[first + 7]
    pa, pb = ahead[first], ahead[min(first + 1, last)]
    pc, pd = ahead[min(first + 2, last)], ahead[min(first + 3, last)]
    pe, pf = ahead[min(first + 4, last)], ahead[min(first + 5, last)]
    pg, ph = ahead[min(first + 6, last)], ahead[min(first + 7, last)]
    for k in range(len(out)):
        n = (
            _ones((a ^ pa[k]) & ta)
            + _ones((b ^ pb[k]) & tb)
            + _ones((c ^ pc[k]) & tc)
            + _ones((d ^ pd[k]) & td)
        )
        n += (
            _ones((e ^ pe[k]) & te)
            + _ones((f ^ pf[k]) & tf)
            + _ones((g ^ pg[k]) & tg)
            + _ones((h ^ ph[k]) & th)
        )
        out[k] = shift + scale * ((out[k] - 2.0 * np.float64(np.int64(n))) / divisor)


@uncounted_kernel
def _add_agreements(
    before: np.uint64, after: np.uint64, ahead: NDArray[np.uint64], behind: NDArray[np.uint64], out: Array
) -> None:
    """Add to ``out`` (m,) how many more pairs of a word a place has the same way round than the other way."""
    for k in range(len(out)):
        same = (before & ahead[k]) | (after & behind[k])
        other = (before & behind[k]) | (after & ahead[k])
        out[k] += np.float64(np.int64(_ones(same)) - np.int64(_ones(other)))
