"""Sequences of access points: Kendall's tau against SciPy, the rules for ties and silence, the kernel far away."""

from __future__ import annotations

from typing import Literal

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import kendalltau

from wayfuse.core.errors import ConfigError, UsageError
from wayfuse.core.types import Array
from wayfuse.radio.ap_sequence import (
    Neighbours,
    from_positions,
    grid_places,
    kendall_tau,
    kernel_log_likelihood,
    location_sequence,
    nearest,
    rss_sequence,
)

SQUARE = np.array([[0.0, 0.0], [10.0, 0.0], [10.0, 10.0], [0.0, 10.0]])
EXTENT = (0.0, 0.0, 10.0, 10.0)


def pairs_of_sequences(n: int) -> st.SearchStrategy[tuple[Array, Array]]:
    values = st.lists(st.integers(-5, 5), min_size=n, max_size=n).map(lambda v: np.array(v, dtype=np.float64))
    return st.tuples(values, values)


@settings(deadline=None, max_examples=150)
@given(st.integers(2, 20).flatmap(pairs_of_sequences))
def test_tau_b_is_scipys(pair: tuple[Array, Array]) -> None:
    first, second = pair
    constant = len(set(first)) == 1 or len(set(second)) == 1
    expected = 0.0 if constant else float(kendalltau(first, second).statistic)
    assert kendall_tau(first, second[None], "b")[0] == pytest.approx(expected, abs=1e-12)


@settings(deadline=None, max_examples=150)
@given(st.integers(2, 20).flatmap(lambda n: st.tuples(st.permutations(range(n)), st.permutations(range(n)))))
def test_without_ties_tau_a_is_scipys_too(pair: tuple[list[int], list[int]]) -> None:
    first, second = (np.array(p, dtype=np.float64) for p in pair)
    assert kendall_tau(first, second[None])[0] == pytest.approx(
        kendalltau(first, second).statistic, abs=1e-12
    )


@settings(deadline=None, max_examples=150)
@given(st.integers(2, 20).flatmap(pairs_of_sequences))
def test_tau_a_counts_pairs_and_divides_by_all_of_them(pair: tuple[Array, Array]) -> None:
    first, second = pair
    n = len(first)
    apart = sum(
        np.sign(first[i] - first[j]) * np.sign(second[i] - second[j]) for i in range(n) for j in range(i)
    )
    assert kendall_tau(first, second[None])[0] == pytest.approx(apart / (0.5 * n * (n - 1)), abs=1e-12)


def test_packing_holds_over_many_words() -> None:
    rng = np.random.default_rng(3)
    first, others = rng.integers(0, 30, 105).astype(np.float64), rng.normal(size=(7, 105))
    expected = [kendalltau(first, other).statistic for other in others]
    np.testing.assert_allclose(kendall_tau(first, others, "b"), expected, atol=1e-12)


def test_the_sequences_of_figures_1_and_3() -> None:
    ap_xy = np.array([[6.0, 0.0], [8.0, 0.0], [3.0, 0.0], [1.0, 0.0]])
    assert location_sequence(ap_xy, np.zeros((1, 2))).tolist() == [[3, 4, 2, 1]]
    assert rss_sequence(np.array([[-50.0, -60.0, -70.0, -40.0]])).tolist() == [[2, 3, 4, 1]]


def test_equal_distances_and_the_unheard_tie() -> None:
    assert location_sequence(SQUARE, np.array([[5.0, 5.0]])).tolist() == [[1, 1, 1, 1]]
    assert rss_sequence(np.array([[-50.0, np.nan, -40.0, np.nan]])).tolist() == [[2, 3, 1, 3]]


def test_the_unheard_come_after_all_heard() -> None:
    sequences = from_positions(SQUARE, EXTENT, 2.5)
    partly = sequences.similarity(np.array([-50.0, -80.0, np.nan, np.nan]))
    best = sequences.places[np.argmax(partly)]
    assert best[0] < 5.0
    assert best[1] < 5.0  # nearest to the first, then the second access point
    assert np.ptp(sequences.similarity(np.full(4, np.nan))) == 0.0  # a scan that heard nothing says nothing


def test_no_offset_of_the_phone_matters() -> None:
    ap_xy = SQUARE + np.array([[0.1, 0.2], [0.3, 0.0], [0.0, 0.4], [0.2, 0.3]])
    sequences = from_positions(ap_xy, EXTENT, 1.0)
    scan = np.array([-50.0, -61.0, -72.0, -55.0])
    np.testing.assert_array_equal(sequences.similarity(scan), sequences.similarity(scan - 7.0))
    assert sequences.similarity(scan).max() == 1.0


def test_a_scan_in_the_order_of_a_cell_finds_it() -> None:
    rng = np.random.default_rng(1)
    ap_xy = rng.uniform(0.0, 20.0, (9, 2))
    sequences = from_positions(ap_xy, (0.0, 0.0, 20.0, 20.0), 2.0)
    for place, cell in zip(sequences.places, range(len(sequences.places)), strict=True):
        scan = -30.0 * np.log10(np.linalg.norm(ap_xy - place, axis=1))
        assert sequences.similarity(scan)[cell] == 1.0


def test_places_that_tie_for_the_last_rank_share_it() -> None:
    places = np.arange(10.0).reshape(5, 2)
    found = nearest(places, np.array([0.5, 0.9, 0.5, 0.2, 0.5]), 2)
    np.testing.assert_array_equal(found.xy, places[[0, 1, 2, 4]])
    np.testing.assert_allclose(np.exp(found.log_weight), [0.5 / 3, 0.9, 0.5 / 3, 0.5 / 3])
    assert len(nearest(places, np.linspace(0.1, 0.9, 5), 99).xy) == 5
    assert np.isfinite(nearest(places, np.zeros(5), 2).log_weight).all()


def test_the_kernel_is_that_of_equation_2_and_finite_where_it_underflows() -> None:
    neighbours = Neighbours(np.array([[0.0, 0.0], [4.0, 1.0]]), np.log([0.8, 0.6]))
    xy = np.array([[1.0, 1.0], [300.0, -400.0]])
    near = 0.8 * np.exp(-0.5 * 0.01 * 2.0) + 0.6 * np.exp(-0.5 * 0.01 * 9.0)
    assert kernel_log_likelihood(neighbours, xy, 0.01)[0] == pytest.approx(np.log(near))
    far = kernel_log_likelihood(neighbours, xy, 100.0)
    assert np.isfinite(far).all()
    assert far[0] > far[1]


def test_the_grid_covers_the_area() -> None:
    places = grid_places((0.0, 0.0, 25.0, 14.0), 2.0)
    assert len(places) == 13 * 7
    assert places.min(axis=0).tolist() == [1.0, 1.0]
    assert places.max(axis=0).tolist() == [25.0, 13.0]


def test_wrong_use_says_so() -> None:
    with pytest.raises(ConfigError, match="two or more"):
        from_positions(SQUARE[:1], EXTENT, 1.0)
    with pytest.raises(ConfigError, match="grid"):
        from_positions(SQUARE, EXTENT, 0.0)
    with pytest.raises(ConfigError, match="k 0"):
        nearest(SQUARE, np.ones(4), 0)
    with pytest.raises(UsageError, match="one value per access point"):
        from_positions(SQUARE, EXTENT, 1.0).similarity(np.zeros(3))
    with pytest.raises(UsageError, match=r"\(5,\) and \(2, 4\)"):
        kendall_tau(np.zeros(5), np.zeros((2, 4)))


def counted_in_numpy(first: Array, second: Array, tau: str) -> Array:
    """The twin of the kernel: signs of all pairs, one product."""
    i, j = np.triu_indices(len(first), 1)
    one, many = np.sign(first[i] - first[j]), np.sign(second[:, i] - second[:, j])
    apart, tied = many @ one, np.sqrt((one**2).sum() * (many**2).sum(axis=1))
    divisor = np.full(len(second), 0.5 * len(first) * (len(first) - 1)) if tau == "a" else tied
    return np.divide(apart, divisor, out=np.zeros(len(second)), where=divisor > 0.0)


@pytest.mark.parametrize("tau", ["a", "b"])
@pytest.mark.parametrize(
    "n", [1, 2, 11, 12, 30, 100]
)  # 0, 1, 55, 66, 435 and 4950 pairs: words partly and wholly used, one pass and several
def test_the_kernel_is_its_twin_to_the_bit(n: int, tau: Literal["a", "b"]) -> None:
    rng = np.random.default_rng(n)
    first, second = rng.integers(0, n, n).astype(np.float64), rng.integers(0, n, (70, n)).astype(np.float64)
    second[0] = first
    second[1] = 1.0  # all tied
    np.testing.assert_array_equal(kendall_tau(first, second, tau), counted_in_numpy(first, second, tau))
    untied = np.argsort(rng.random((70, n)), axis=1).astype(np.float64)
    np.testing.assert_array_equal(kendall_tau(first, untied, tau), counted_in_numpy(first, untied, tau))
