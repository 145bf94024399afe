"""The compiled loops of the filter against plain NumPy."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from wayfuse.filters._kernels import floor_masses, geometric_median, normalise, scatter

LOG_WEIGHTS = hnp.arrays(np.float64, st.integers(1, 50), elements=st.floats(-800.0, 800.0))


@given(LOG_WEIGHTS)
def test_weights_sum_to_one_and_keep_their_ratios(log_weights: np.ndarray) -> None:
    weights = np.empty_like(log_weights)
    top, evidence, ess = normalise(log_weights, weights)
    want = np.exp(log_weights - log_weights.max())
    want /= want.sum()
    np.testing.assert_allclose(weights, want, rtol=1e-12, atol=1e-300)
    assert top == log_weights.max()
    assert evidence == pytest.approx(top + np.log(np.mean(np.exp(log_weights - top))), abs=1e-9)
    assert ess == pytest.approx(1.0 / np.sum(want**2))
    assert 1.0 - 1e-9 <= ess <= len(weights) + 1e-9


def test_a_particle_of_weight_zero_does_no_harm() -> None:
    weights = np.empty(3)
    _, _, ess = normalise(np.array([-np.inf, 0.0, 0.0]), weights)
    np.testing.assert_array_equal(weights, [0.0, 0.5, 0.5])
    assert ess == 2.0


def cloud(n: int = 300) -> tuple[np.ndarray, ...]:
    rng = np.random.default_rng(8)
    x, y = (rng.normal(20.0, 5.0, (2, n))).astype(np.float32)
    return x, y, rng.integers(0, 3, n).astype(np.int32), rng.dirichlet(np.ones(n))


def test_floor_masses() -> None:
    _, _, floor, weights = cloud()
    out = np.full(4, 7.0)
    floor_masses(floor, weights, out)
    np.testing.assert_allclose(out, np.bincount(floor, weights, minlength=4), rtol=1e-12)


def median_twin(x: np.ndarray, y: np.ndarray, w: np.ndarray, n_iterations: int, smooth: float) -> np.ndarray:
    p = np.column_stack([x, y]).astype(np.float64)
    at = w @ p / w.sum()
    for _ in range(n_iterations):
        v = w / np.sqrt(np.sum((p - at) ** 2, axis=1) + smooth**2)
        at = v @ p / v.sum()
    return at


@pytest.mark.parametrize("n_iterations", [0, 1, 8])
def test_median_is_that_of_the_twin(n_iterations: int) -> None:
    x, y, floor, weights = cloud()
    got = geometric_median(x, y, floor, weights, 1, n_iterations, 0.5)
    on = floor == 1
    np.testing.assert_allclose(got, median_twin(x[on], y[on], weights[on], n_iterations, 0.5), rtol=1e-9)


@settings(max_examples=30)
@given(st.integers(0, 10_000))
def test_the_median_has_a_smaller_sum_of_distances_than_the_mean(seed: int) -> None:
    rng = np.random.default_rng(seed)
    x, y = rng.normal(0.0, 1.0, (2, 40)).astype(np.float32)
    x[:8] += 50.0  # a lump elsewhere
    floor, w = np.zeros(40, np.int32), rng.dirichlet(np.ones(40))
    mean, median = (geometric_median(x, y, floor, w, 0, k, 1e-3) for k in (0, 60))
    far = [float(w @ np.hypot(x - a, y - b)) for a, b in (mean, median)]
    assert far[1] <= far[0] + 1e-9


def test_scatter_is_that_of_the_twin() -> None:
    x, y, floor, weights = cloud()
    radius = np.empty_like(x)
    got = scatter(x, y, floor, weights, 2, 19.0, 21.0, radius)
    on = floor == 2
    d = np.column_stack([x[on] - 19.0, y[on] - 21.0])
    moments = (weights[on, None, None] * d[:, :, None] * d[:, None, :]).sum(axis=0) / weights[on].sum()
    np.testing.assert_allclose(got, (moments[0, 0], moments[0, 1], moments[1, 1]), rtol=1e-6)
    np.testing.assert_allclose(radius, np.hypot(x - 19.0, y - 21.0), rtol=1e-6)
