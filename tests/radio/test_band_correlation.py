"""Correlation of the bands: Table I's intervals, coverage by simulation, what autocorrelation does to it."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wayfuse.core.errors import ConfigError
from wayfuse.core.types import Array
from wayfuse.radio.band_correlation import (
    correlate,
    effective_pairs,
    fisher_interval,
    model_errors,
    split_errors,
)
from wayfuse.radio.path_loss import PathLoss


def test_an_interval_by_hand() -> None:
    # series 1 of Table I: atanh(-0.10) = -0.10034, 1.95996 / sqrt(102) = 0.19406
    low, high = fisher_interval(-0.10, 105)
    assert (low, high) == pytest.approx(
        (math.tanh(-0.10034 - 0.19406), math.tanh(-0.10034 + 0.19406)), abs=1e-5
    )


@given(st.floats(-1.0, 1.0), st.integers(4, 10_000))
def test_an_interval_holds_its_coefficient(r: float, n: int) -> None:
    low, high = fisher_interval(r, n)
    assert -1.0 <= low <= r + 1e-12
    assert r - 1e-12 <= high <= 1.0


def test_the_coefficient_is_numpys_and_silence_is_left_out() -> None:
    rng = np.random.default_rng(2)
    a, b = rng.standard_normal((2, 50))
    b += 0.5 * a
    a[3] = b[7] = np.nan
    keep = ~np.isnan(a + b)
    found = correlate(a, b)
    assert found.n == 48
    assert found.r == pytest.approx(np.corrcoef(a[keep], b[keep])[0, 1], abs=1e-12)
    assert (found.low, found.high) == fisher_interval(found.r, 48)


@pytest.mark.parametrize("rho", [-0.4, 0.0, 0.6])
def test_the_interval_holds_the_truth_19_times_of_20(rho: float) -> None:
    rng = np.random.default_rng(4)
    held = 0
    for _ in range(1000):
        a, noise = rng.standard_normal((2, 40))
        found = correlate(a, rho * a + math.sqrt(1.0 - rho**2) * noise)
        held += found.low <= rho <= found.high
    assert abs(held - 950) < 5.0 * math.sqrt(1000 * 0.95 * 0.05)


def markov(rng: np.random.Generator, n: int, memory: float) -> Array:
    x = rng.standard_normal(n)
    for k in range(1, n):
        x[k] = memory * x[k - 1] + math.sqrt(1.0 - memory**2) * x[k]
    return x


def test_effective_pairs_are_bartletts() -> None:
    rng = np.random.default_rng(6)
    memory = 0.8
    found = [effective_pairs(markov(rng, 2000, memory), markov(rng, 2000, memory)) for _ in range(20)]
    expected = 2000.0 * (1.0 - memory**2) / (1.0 + memory**2)
    assert np.mean(found) == pytest.approx(expected, rel=0.15)
    assert effective_pairs(*rng.standard_normal((2, 2000))) == pytest.approx(2000, rel=0.15)
    alternating = np.resize([1.0, -1.0], 100)
    assert effective_pairs(alternating, alternating) == 100.0


def test_counting_every_pair_is_overconfident_when_errors_last() -> None:
    rng = np.random.default_rng(8)
    plain = honest = 0
    for _ in range(200):
        a, b = markov(rng, 500, 0.9), markov(rng, 500, 0.9)
        found, corrected = correlate(a, b), correlate(a, b, n_effective=effective_pairs(a, b))
        plain += found.low <= 0.0 <= found.high
        honest += corrected.low <= 0.0 <= corrected.high
    assert plain < 140  # of 200
    assert honest > 176


def test_model_errors_are_what_the_path_loss_leaves() -> None:
    rng = np.random.default_rng(9)
    d = np.linspace(2.0, 15.0, 300)
    noise = 3.0 * rng.standard_normal(300)
    error = model_errors(d, PathLoss(-38.0, 0.2, 3.0).at(d) + noise)
    assert abs(float(error.mean())) < 1e-9
    assert np.corrcoef(error, noise)[0, 1] > 0.98


@pytest.mark.parametrize("arguments", [(1.5, 10), (0.0, 3), (math.nan, 10)])
def test_impossible_coefficients_are_refused(arguments: tuple[float, int]) -> None:
    with pytest.raises(ConfigError):
        fisher_interval(*arguments)


def test_too_few_pairs_or_errors_that_do_not_vary_are_refused() -> None:
    with pytest.raises(ConfigError, match="too few"):
        correlate([1.0, 2.0, 3.0, math.nan], [1.0, 2.0, 4.0, 1.0])
    with pytest.raises(ConfigError, match="do not vary"):
        correlate([1.0, 1.0, 1.0, 1.0], [1.0, 2.0, 4.0, 1.0])


def test_what_belongs_to_a_place_and_what_changes_there_are_told_apart() -> None:
    rng = np.random.default_rng(10)
    places, samples = 400, 20
    distance = np.repeat(rng.uniform(2.0, 30.0, places), samples)
    place = np.repeat(np.arange(places), samples)
    walls = np.repeat(6.0 * rng.standard_normal(places), samples)
    first, second = (
        PathLoss(-38.0, alpha, 3.0).at(distance) + walls + 2.0 * rng.standard_normal(len(place))
        for alpha in (0.1, 0.2)
    )
    first[:5] = np.nan
    across, within = split_errors(distance, first, second, place)
    assert across.shape == (2, places)
    assert within.shape == (2, places * samples - 5)
    assert correlate(*across).r > 0.97
    assert abs(correlate(*within).r) < 5.0 / math.sqrt(places * samples)
    assert within.std(axis=1) == pytest.approx(2.0 * math.sqrt(1.0 - 1.0 / samples), rel=0.03)
