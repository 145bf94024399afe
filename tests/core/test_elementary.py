"""The short polynomials of `core.elementary` against the library functions, over their whole ranges."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wayfuse.core.elementary import exp32, log32, sincos32, sincos_turn32
from wayfuse.core.jit import kernel
from wayfuse.core.types import Array32


@kernel
def _exp(x: Array32, out: Array32) -> None:
    for i in range(x.shape[0]):
        out[i] = exp32(x[i])


@kernel
def _log(x: Array32, out: Array32) -> None:
    for i in range(x.shape[0]):
        out[i] = log32(x[i])


@kernel
def _sincos(word: NDArray[np.uint32], sine: Array32, cosine: Array32) -> None:
    for i in range(word.shape[0]):
        sine[i], cosine[i] = sincos_turn32(word[i])


def test_exp() -> None:
    x = np.linspace(-80.0, 80.0, 200_001).astype(np.float32)
    got = np.empty_like(x)
    _exp(x, got)
    np.testing.assert_allclose(got, np.exp(x.astype(np.float64)), rtol=2e-6)
    out = np.empty(3, np.float32)
    _exp(np.float32([-1e30, 1e30, 0.0]), out)
    assert out[0] == np.float32(got[0])
    assert np.isfinite(out[1])
    assert out[2] == 1.0


def test_log() -> None:
    x = np.exp(np.linspace(-87.0, 88.0, 200_001)).astype(np.float32)
    got = np.empty_like(x)
    _log(x, got)
    want = np.log(x.astype(np.float64))
    assert np.max(np.abs(got - want) / np.maximum(1.0, np.abs(want))) < 1e-6
    near = np.float32(1.0) + np.float32(1e-4) * np.linspace(-1, 1, 1001).astype(np.float32)
    got = np.empty_like(near)
    _log(near, got)
    np.testing.assert_allclose(got, np.log(near.astype(np.float64)), atol=1e-9, rtol=2e-6)


def test_sincos() -> None:
    edges = np.array([0, 1, 2**30 - 1, 2**30, 2**31 - 1, 2**31, 3 * 2**30, 2**32 - 1], np.uint64)
    even = np.linspace(0, 2**32 - 1, 100_001).astype(np.uint64)
    word = np.concatenate([edges, even]).astype(np.uint32)
    sine, cosine = np.empty(len(word), np.float32), np.empty(len(word), np.float32)
    _sincos(word, sine, cosine)
    angle = 2.0 * np.pi * (word.astype(np.float64) + 0.5) / 2.0**32
    assert np.max(np.abs(sine - np.sin(angle))) < 3e-6
    assert np.max(np.abs(cosine - np.cos(angle))) < 3e-6


@kernel
def _sincos_of_angles(x: Array32, sine: Array32, cosine: Array32) -> None:
    for i in range(x.shape[0]):
        sine[i], cosine[i] = sincos32(x[i])


def test_sincos_of_angles() -> None:
    x = np.concatenate([np.linspace(-100, 100, 200_001), np.pi * np.arange(-8, 9) / 4]).astype(np.float32)
    sine, cosine = np.empty_like(x), np.empty_like(x)
    _sincos_of_angles(x, sine, cosine)
    np.testing.assert_allclose(sine, np.sin(x.astype(np.float64)), atol=4e-6, rtol=0)
    np.testing.assert_allclose(cosine, np.cos(x.astype(np.float64)), atol=4e-6, rtol=0)
