"""Counter-based random numbers: Philox4x32-10 and Box-Muller normals.

The number of a particle at a draw depends on (seed, track, draw, particle) and on nothing else: no state to store,
the same bits whatever the batch, process or machine (own polynomials, no libm), replay from any point.

References
----------
.. [1] Salmon, Moraes, Dror, Shaw, Parallel random numbers: as easy as 1, 2, 3, SC'11, doi:10.1145/2063384.2063405.
"""

from __future__ import annotations

import hashlib
import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wayfuse.core.elementary import log32, sincos_turn32
from wayfuse.core.jit import uncounted_kernel
from wayfuse.core.types import Array, Array32

__all__ = ["Noise", "box_muller", "philox_words", "track_key"]

_M0 = np.uint64(0xD2511F53)
_M1 = np.uint64(0xCD9E8D57)
_W0 = np.uint64(0x9E3779B9)
_W1 = np.uint64(0xBB67AE85)
_LOW = np.uint64(0xFFFFFFFF)
_SHIFT = np.uint64(32)


@uncounted_kernel
def philox_words(
    key0: int | np.uint64,
    key1: int | np.uint64,
    c2: int | np.uint64,
    c3: int | np.uint64,
    out: NDArray[np.uint32],
) -> None:
    """Fill ``out`` (4, n) with the Philox4x32-10 words of the counters (i, 0, c2, c3), i = 0 .. n - 1."""
    for i in range(out.shape[1]):
        a = np.uint64(i)
        b = np.uint64(0)
        c = np.uint64(c2) & _LOW
        d = np.uint64(c3) & _LOW
        k0 = np.uint64(key0) & _LOW
        k1 = np.uint64(key1) & _LOW
        for _ in range(10):
            p0 = _M0 * a
            p1 = _M1 * c
            a = ((p1 >> _SHIFT) ^ b ^ k0) & _LOW
            b = p1 & _LOW
            c = ((p0 >> _SHIFT) ^ d ^ k1) & _LOW
            d = p0 & _LOW
            k0 = (k0 + _W0) & _LOW
            k1 = (k1 + _W1) & _LOW
        out[0, i] = np.uint32(a)
        out[1, i] = np.uint32(b)
        out[2, i] = np.uint32(c)
        out[3, i] = np.uint32(d)


@uncounted_kernel
def box_muller(words: NDArray[np.uint32], out: Array32) -> None:
    """Fill ``out`` (4, n) with the standard normals of uniform words (4, n)."""
    # u lies on the middles of 2^24 equal parts of (0, 1), so the largest normal is 5.9
    scale = np.float32(2.0**-24)
    for pair in range(2):
        for i in range(words.shape[1]):
            u = (np.float32(words[2 * pair, i] >> np.uint32(8)) + np.float32(0.5)) * scale
            r = np.float32(math.sqrt(np.float32(-2.0) * log32(min(u, np.float32(1.0 - 2.0**-24)))))
            sine, cosine = sincos_turn32(words[2 * pair + 1, i])
            out[2 * pair, i] = r * cosine
            out[2 * pair + 1, i] = r * sine


def track_key(seed: int, track: str) -> tuple[int, int]:
    """Two 32-bit keys of a (seed, track name): a digest, so that they never depend on the process."""
    digest = hashlib.blake2b(f"{seed}\0{track}".encode(), digest_size=8).digest()
    return int.from_bytes(digest[:4], "little"), int.from_bytes(digest[4:], "little")


@dataclass(slots=True)
class Noise:
    """The random numbers of one track: a key and a count of draws so far.

    ``draw`` is the only state: storing it with a filter's state makes a replay continue with the same bits.
    """

    key: tuple[int, int]
    draw: int = 0

    @classmethod
    def of(cls, seed: int, track: str) -> Noise:
        """Noise of a track under a seed."""
        return cls(track_key(seed, track))

    def words(self, n: int) -> NDArray[np.uint32]:
        """(4, n) uniform 32-bit words; advances the draw."""
        out = np.empty((4, n), dtype=np.uint32)
        draw = self.draw
        self.draw += 1
        philox_words(*self.key, draw & 0xFFFFFFFF, draw >> 32, out)
        return out

    def normals(self, n: int) -> Array32:
        """(4, n) float32 standard normals; advances the draw."""
        out = np.empty((4, n), dtype=np.float32)
        box_muller(self.words(n), out)
        return out

    def uniforms(self, n: int) -> Array:
        """(4, n) float64 uniforms in (0, 1); advances the draw."""
        return np.asarray((self.words(n).astype(np.float64) + 0.5) * 2.0**-32)
