"""The radii of a cloud: weighted quantiles, against sorting and summing with NumPy."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wayfuse.tracking.summary import _weighted_quantiles


def written_out(values: np.ndarray, weights: np.ndarray, share: float) -> float:
    order = np.argsort(values, kind="stable")
    total = np.cumsum(weights[order])
    return float(values[order[min(int(np.searchsorted(total, share * total[-1])), len(values) - 1)]])


RADII = st.sampled_from([0.0, 1e-42, 0.1, 0.5, 0.5000001, 1.0, 3.7, 40.0, 1e4])


@given(
    st.lists(st.tuples(RADII, st.floats(0.0, 1.0)), min_size=1, max_size=60),
    st.floats(0.0, 1.0),
    st.floats(0.0, 1.0),
)
def test_quantiles_are_those_of_sorted_and_summed_weights(
    cloud: list[tuple[float, float]], one: float, other: float
) -> None:
    values = np.array([v for v, _ in cloud], np.float32)
    weights = np.array([w for _, w in cloud])
    low, high = min(one, other), max(one, other)
    got = _weighted_quantiles(values, weights, (low, high))
    assert got == (written_out(values, weights, low), written_out(values, weights, high))


@pytest.mark.parametrize("seed", range(20))
def test_quantiles_of_a_whole_cloud_are_the_same_to_the_last_bit(seed: int) -> None:
    rng = np.random.default_rng(seed)
    values = rng.gamma(2.0, 3.0, 1000).astype(np.float32)
    weights = rng.random(1000) ** 8
    weights /= weights.sum()
    got = _weighted_quantiles(values, weights, (0.68, 0.95))
    assert got == (written_out(values, weights, 0.68), written_out(values, weights, 0.95))
