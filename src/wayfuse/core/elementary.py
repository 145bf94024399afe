"""exp, log and sincos in float32, as short polynomials that kernels can inline and vectorise.

The numba of the package index has no vector mathematics library: `math.exp` in a loop is a scalar call. These are
accurate to a few units in 1e-6, ample for weights and noise, and do not depend on the libm of a machine.
"""

from __future__ import annotations

import numpy as np

from wayfuse.core.jit import inline_kernel

__all__ = ["exp32", "log32", "sincos32", "sincos_turn32"]


@inline_kernel
def exp32(x: np.float32) -> np.float32:
    """exp(x) for x in [-80, 80], relative error below 1e-6; clamped outside."""
    x = min(max(x, np.float32(-80.0)), np.float32(80.0))
    y = x * np.float32(1.44269504)
    k = np.floor(y + np.float32(0.5))
    r = (x - k * np.float32(0.693359375)) - k * np.float32(-2.12194440e-4)  # ln 2 in two parts
    p = np.float32(1.0 / 720.0)
    p = p * r + np.float32(1.0 / 120.0)
    p = p * r + np.float32(1.0 / 24.0)
    p = p * r + np.float32(1.0 / 6.0)
    p = p * r + np.float32(0.5)
    p = p * r + np.float32(1.0)
    p = p * r + np.float32(1.0)
    bits = (np.int32(k) + np.int32(127)) << np.int32(23)
    return np.float32(p * np.int32(bits).view(np.float32))


@inline_kernel
def log32(x: np.float32) -> np.float32:
    """log(x) for normal x > 0, error below 1e-6 of max(1, |log x|)."""
    bits = np.float32(x).view(np.int32)
    e = (bits >> np.int32(23)) - np.int32(127)
    m = np.int32((bits & np.int32(0x7FFFFF)) | np.int32(0x3F800000)).view(np.float32)
    high = m > np.float32(1.41421356)
    m = m * np.float32(0.5) if high else m
    k = np.float32(e) + (np.float32(1.0) if high else np.float32(0.0))
    s = (m - np.float32(1.0)) / (m + np.float32(1.0))  # log m = 2 artanh s, |s| <= 0.172
    z = s * s
    p = np.float32(2.0 / 9.0)
    p = p * z + np.float32(2.0 / 7.0)
    p = p * z + np.float32(2.0 / 5.0)
    p = p * z + np.float32(2.0 / 3.0)
    p = p * z + np.float32(2.0)
    return s * p + k * np.float32(0.69314718)


@inline_kernel
def sincos32(x: np.float32) -> tuple[np.float32, np.float32]:
    """Sine and cosine of x (rad), |x| < 1e4, absolute error below 4e-6 for |x| < 10; without a branch."""
    k = np.floor(x * np.float32(0.15915494) + np.float32(0.5))
    t = (x - k * np.float32(6.28125)) - k * np.float32(1.9353072e-3)  # 2 pi in two parts
    t *= np.float32(0.25)
    z = t * t
    s = t * (
        np.float32(1.0)
        + z * (np.float32(-1.0 / 6.0) + z * (np.float32(1.0 / 120.0) - z * np.float32(1.0 / 5040.0)))
    )
    c = z * (
        np.float32(0.5)
        + z * (np.float32(-1.0 / 24.0) + z * (np.float32(1.0 / 720.0) - z * np.float32(1.0 / 40320.0)))
    )  # 1 - cos
    s2 = np.float32(2.0) * s * (np.float32(1.0) - c)
    c2 = np.float32(1.0) - np.float32(2.0) * s * s
    return np.float32(2.0) * s2 * c2, np.float32(1.0) - np.float32(2.0) * s2 * s2


@inline_kernel
def sincos_turn32(word: np.uint32) -> tuple[np.float32, np.float32]:
    """Sine and cosine of 2 pi (word + 0.5) / 2^32, absolute error below 3e-6."""
    quadrant = np.int32(word >> np.uint32(30))
    # numba takes the difference of two int32 for an int64, which takes eight instructions to convert
    rest = np.float32(np.int32(np.int32(word & np.uint32(0x3FFFFFFF)) - np.int32(0x20000000)))
    t = rest * np.float32(1.4629180792671596e-09)  # pi / 2^31: angle from the middle of the quadrant
    z = t * t
    s = t * (
        np.float32(1.0)
        + z * (np.float32(-1.0 / 6.0) + z * (np.float32(1.0 / 120.0) - z * np.float32(1.0 / 5040.0)))
    )
    c = np.float32(1.0) + z * (np.float32(-0.5) + z * (np.float32(1.0 / 24.0) - z * np.float32(1.0 / 720.0)))
    # rotate by 45 degrees to the start of the quadrant, then by whole quadrants
    half = np.float32(0.70710678)
    a = half * (s + c)
    b = half * (c - s)
    # choices between two values each: a chain of four is not vectorised
    odd = (quadrant & np.int32(1)) != np.int32(0)
    sine = b if odd else a
    cosine = a if odd else b
    sine = -sine if quadrant >= np.int32(2) else sine
    cosine = -cosine if (quadrant == np.int32(1)) | (quadrant == np.int32(2)) else cosine
    return sine, cosine
