"""Philox4x32-10 against its published vectors, its normals against a twin in NumPy and their moments."""

from __future__ import annotations

import os
import subprocess
import sys

import numpy as np
import pytest

from wayfuse.core.philox import Noise, philox_words, track_key

# Known-answer vectors published with Random123 (kat_vectors): counter, key, result.
VECTORS = [
    ((0, 0, 0, 0), (0, 0), (0x6627E8D5, 0xE169C58D, 0xBC57AC4C, 0x9B00DBD8)),
    ((0xFFFFFFFF,) * 4, (0xFFFFFFFF,) * 2, (0x408F276D, 0x41C83B0E, 0xA20BC7C6, 0x6D5451FD)),
    (
        (0x243F6A88, 0x85A308D3, 0x13198A2E, 0x03707344),
        (0xA4093822, 0x299F31D0),
        (0xD16CFE09, 0x94FDCCEB, 0x5001E420, 0x24126EA1),
    ),
]


def plain(counter: tuple[int, ...], key: tuple[int, ...]) -> tuple[int, ...]:
    """Philox4x32-10 of one counter in whole numbers (Salmon et al. 2011, Fig. 2 and Sec. 3.3)."""
    (a, b, c, d), (k, m) = counter, key
    for _ in range(10):
        p, q = 0xD2511F53 * a, 0xCD9E8D57 * c
        a, b, c, d = (q >> 32) ^ b ^ k, q & 0xFFFFFFFF, (p >> 32) ^ d ^ m, p & 0xFFFFFFFF
        k, m = (k + 0x9E3779B9) & 0xFFFFFFFF, (m + 0xBB67AE85) & 0xFFFFFFFF
    return a, b, c, d


@pytest.mark.parametrize(("counter", "key", "result"), VECTORS)
def test_the_twin_gives_the_published_vectors(
    counter: tuple[int, ...], key: tuple[int, ...], result: tuple[int, ...]
) -> None:
    assert plain(counter, key) == result


def test_the_kernel_gives_the_published_vector_of_zeros() -> None:
    out = np.empty((4, 1), np.uint32)
    philox_words(*np.zeros(4, np.uint64), out)
    assert tuple(out[:, 0].tolist()) == VECTORS[0][2]


@pytest.mark.parametrize("key", [(0, 0), (0xFFFFFFFF, 0xFFFFFFFF), (0xA4093822, 0x299F31D0)])
@pytest.mark.parametrize("draw", [0, 1, 0xFFFFFFFF, 0x13198A2E03707344])
def test_words_are_those_of_the_twin(key: tuple[int, int], draw: int) -> None:
    words = Noise(key, draw).words(5)
    want = [plain((i, 0, draw & 0xFFFFFFFF, draw >> 32), key) for i in range(5)]
    assert words.dtype == np.uint32
    assert words.T.tolist() == [list(w) for w in want]


def test_a_number_depends_on_seed_track_draw_and_particle_alone() -> None:
    noise = Noise.of(3, "walk")
    first, second = noise.words(100), noise.words(40)
    assert noise.draw == 2
    np.testing.assert_array_equal(Noise.of(3, "walk").words(7), first[:, :7])  # whatever the batch
    np.testing.assert_array_equal(Noise(track_key(3, "walk"), 1).words(40), second)  # from any point
    for other in (Noise.of(4, "walk"), Noise.of(3, "walk2"), Noise(track_key(3, "walk"), 5)):
        assert np.mean(other.words(100) == first) < 0.01


def test_keys_do_not_depend_on_the_process() -> None:
    code = "from wayfuse.core.philox import track_key; print(track_key(3, 'walk'))"
    environment = {**os.environ, "PYTHONHASHSEED": "77"}
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, env=environment
    )
    assert done.stdout.strip() == str(track_key(3, "walk"))
    keys = {track_key(seed, track) for seed in range(200) for track in ("", "a", "b", "0a")}
    assert len(keys) == 800


def test_normals_have_the_moments_of_a_normal() -> None:
    n = 200_000
    z = Noise.of(0, "moments").normals(n).astype(np.float64)
    assert z.shape == (4, n)
    assert np.all(np.isfinite(z))
    for moment, want, variance in ((1, 0.0, 1.0), (2, 1.0, 2.0), (3, 0.0, 15.0), (4, 3.0, 96.0)):
        off = np.mean(z**moment, axis=1) - want
        assert np.all(np.abs(off) < 5.0 * np.sqrt(variance / n)), moment
    correlation = np.corrcoef(z) - np.eye(4)
    assert np.all(np.abs(correlation) < 5.0 / np.sqrt(n))
    lagged = np.mean(z[:, 1:] * z[:, :-1], axis=1)
    assert np.all(np.abs(lagged) < 5.0 / np.sqrt(n))
    share = np.mean(np.abs(z) > 3.0, axis=1)  # tails: 0.27 %
    assert np.all(np.abs(share - 0.0026998) < 5.0 * np.sqrt(0.0027 / n))


def test_normals_are_those_of_box_and_muller() -> None:
    words = Noise.of(1, "twin").words(4096)
    got = Noise.of(1, "twin").normals(4096)
    assert got.dtype == np.float32
    # u is the middle of one of 2^24 parts, as float32 holds it
    u = ((words[0::2] >> 8).astype(np.float32) + np.float32(0.5)).astype(np.float64) * 2.0**-24
    r = np.sqrt(-2.0 * np.log(np.minimum(u, 1.0 - 2.0**-24)))
    turn = 2.0 * np.pi * (words[1::2].astype(np.float64) + 0.5) * 2.0**-32
    np.testing.assert_allclose(got[0::2], r * np.cos(turn), atol=2e-5)
    np.testing.assert_allclose(got[1::2], r * np.sin(turn), atol=2e-5)


def test_uniforms_are_uniform_and_never_reach_the_ends() -> None:
    u = Noise.of(2, "uniform").uniforms(100_000)
    assert u.dtype == np.float64
    assert u.min() > 0.0
    assert u.max() < 1.0
    counts = np.array([np.histogram(row, 20, (0.0, 1.0))[0] for row in u])
    chi = np.sum((counts - 5000.0) ** 2 / 5000.0, axis=1)
    assert np.all(np.abs(chi - 19.0) < 5.0 * np.sqrt(38.0))


@pytest.mark.parametrize("extreme", [0, 1, 0xFF, 0xFFFFFFFF, 0x3FFFFFFF, 0x40000000, 0x80000000, 0xC0000000])
def test_normals_of_extreme_words_are_finite(extreme: int) -> None:
    from wayfuse.core import philox

    out = np.empty((4, 1), np.float32)
    philox.box_muller(np.full((4, 1), extreme, np.uint32), out)
    assert np.all(np.isfinite(out))
    assert np.all(np.abs(out) < 7.0)
