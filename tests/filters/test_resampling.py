"""Each scheme draws particle i N w_i times on average: the one property that makes it a resampler."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from wayfuse.core.errors import ConfigError
from wayfuse.core.philox import Noise
from wayfuse.filters.resampling import RESAMPLERS, resampler

SCHEMES = pytest.mark.parametrize("scheme", RESAMPLERS)
WEIGHTS = np.array([0.001, 0.3, 0.0, 0.05, 0.249, 0.2, 0.1, 0.0, 0.06, 0.04])


def offspring(scheme: str, weights: np.ndarray, n: int, repeats: int) -> np.ndarray:
    """(repeats, N) counts."""
    noise = Noise.of(7, scheme)
    draw = RESAMPLERS[scheme]
    return np.array([np.bincount(draw(noise, weights, n), minlength=len(weights)) for _ in range(repeats)])


@given(
    weights=hnp.arrays(np.float64, st.integers(1, 40), elements=st.floats(0.01, 1.0)), seed=st.integers(0, 99)
)
def test_ancestors_are_those_of_the_running_sum(weights: np.ndarray, seed: int) -> None:
    n, total = 25, np.cumsum(weights)
    for scheme, positions in {
        "systematic": (np.arange(n) + Noise.of(seed, "x").uniforms(1)[0, 0]) / n,
        "stratified": (np.arange(n) + Noise.of(seed, "x").uniforms(n)[0]) / n,
        "multinomial": np.sort(Noise.of(seed, "x").uniforms(n)[0]),
    }.items():
        got = RESAMPLERS[scheme](Noise.of(seed, "x"), weights, n)
        np.testing.assert_array_equal(got, np.searchsorted(total, positions * total[-1]))


@SCHEMES
@pytest.mark.parametrize("n", [10, 37])
def test_mean_offspring_is_n_w(scheme: str, n: int) -> None:
    # the residual scheme of a well-known library draws the rest by weight instead of by remainder: caught here
    repeats = 4000
    counts = offspring(scheme, WEIGHTS, n, repeats)
    # the spread of independent draws bounds that of all four schemes
    sigma = np.sqrt(n * WEIGHTS * (1.0 - WEIGHTS) / repeats)
    off = np.abs(counts.mean(axis=0) - n * WEIGHTS)
    assert np.all(off <= 5.0 * sigma + 1e-12)
    assert np.all(counts.sum(axis=1) == n)


@SCHEMES
def test_the_test_above_would_notice_the_wrong_remainder(scheme: str) -> None:
    n, repeats = 10, 4000
    copies = np.floor(n * WEIGHTS)
    wrong = copies + (n - copies.sum()) * WEIGHTS  # the rest by weight: what the bug's mean would be
    sigma = np.sqrt(n * WEIGHTS * (1.0 - WEIGHTS) / repeats)
    off = np.abs(offspring(scheme, WEIGHTS, n, repeats).mean(axis=0) - wrong)
    assert np.any(off > 10.0 * sigma + 1e-12)


def test_variances_are_ordered_as_theory_says() -> None:
    weights = np.random.default_rng(3).dirichlet(np.ones(50))
    spread = {s: offspring(s, weights, 50, 2000).var(axis=0).sum() for s in RESAMPLERS}
    assert spread["stratified"] < spread["multinomial"]
    assert spread["residual"] < spread["multinomial"]
    assert spread["systematic"] < spread["residual"]


@pytest.mark.parametrize("scheme", ["systematic", "residual"])
def test_counts_stay_near_n_w(scheme: str) -> None:
    counts = offspring(scheme, WEIGHTS, 10, 500)
    assert np.all(counts >= np.floor(10 * WEIGHTS))
    if scheme == "systematic":
        assert np.all(counts <= np.ceil(10 * WEIGHTS))


@SCHEMES
def test_all_weight_on_one_particle(scheme: str) -> None:
    for i in (0, 3, 9):
        weights = np.zeros(10)
        weights[i] = 1.0
        np.testing.assert_array_equal(RESAMPLERS[scheme](Noise.of(0, "x"), weights, 25), i)


@SCHEMES
@given(
    weights=hnp.arrays(np.float64, st.integers(1, 60), elements=st.floats(0.0, 1.0)),
    seed=st.integers(0, 1000),
    n=st.integers(1, 80),
)
def test_ancestors_ascend_and_have_weight(scheme: str, weights: np.ndarray, seed: int, n: int) -> None:
    total = weights.sum()
    weights = weights / total if total > 0.0 else np.full(len(weights), 1.0 / len(weights))
    before = weights.copy()
    ancestors = RESAMPLERS[scheme](Noise.of(seed, scheme), weights, n)
    assert ancestors.shape == (n,)
    assert ancestors.dtype == np.int64
    assert np.all(np.diff(ancestors) >= 0)
    assert np.all(weights[ancestors] > 0.0)
    np.testing.assert_array_equal(weights, before)


@SCHEMES
def test_many_particles_do_not_run_past_the_end(scheme: str) -> None:
    n = 300_000
    weights = np.full(n, 1.0 / n)
    ancestors = RESAMPLERS[scheme](Noise.of(1, "many"), weights, n)
    assert ancestors.max() < n
    if scheme in {"systematic", "residual"}:  # equal weights: everybody once, but for rounding of the sum
        assert len(np.unique(ancestors)) > 0.999 * n


def test_an_unknown_scheme_is_refused() -> None:
    assert resampler("residual") is RESAMPLERS["residual"]
    with pytest.raises(ConfigError, match="one of systematic, stratified, residual, multinomial"):
        resampler("branching")
