"""Floor changes of a track against the true ones: found, missed, too many, how late."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wayfuse.evaluation.floor_changes import (
    EARLY,
    SaidChange,
    TrueChange,
    match_changes,
    said_changes,
    true_changes,
)

TRUTHS = (TrueChange(10.0, 30.0, 2, 0), TrueChange(50.0, 70.0, 0, 2))


def test_true_changes_lie_between_points_on_different_floors() -> None:
    t, floor = np.array([0.0, 10.0, 30.0, 50.0, 70.0]), np.array([2, 2, 0, 0, 2])
    assert true_changes(t, floor) == TRUTHS
    assert true_changes(t[:1], floor[:1]) == ()


def test_said_changes_begin_after_the_first_point() -> None:
    t, floor = np.array([0.0, 1.0, 2.0, 3.0, 4.0]), np.array([0, 1, 1, 0, 2])
    assert said_changes(t, floor, 1.0) == (SaidChange(3.0, 1, 0), SaidChange(4.0, 0, 2))
    assert said_changes(t, floor, -1.0)[0] == SaidChange(1.0, 0, 1)
    assert said_changes(t[:0], floor[:0], 0.0) == ()


def test_each_said_once_is_right_and_timed_from_the_arrival() -> None:
    score = match_changes(TRUTHS, [SaidChange(25.0, 2, 0), SaidChange(73.5, 0, 2)])
    assert (score.n_right, score.n_missed, score.n_extra) == (2, 0, 0)
    assert score.delays.tolist() == [-5.0, 3.5]


def test_a_trip_over_a_floor_between_is_found_but_not_right() -> None:
    score = match_changes(TRUTHS, [SaidChange(20.0, 2, 1), SaidChange(25.0, 1, 0), SaidChange(60.0, 0, 2)])
    assert (score.n_right, score.n_missed, score.n_extra) == (1, 0, 1)
    assert score.delays.tolist() == [-5.0, -10.0]


def test_a_wrong_way_is_found_but_not_right() -> None:
    """From a floor that was wrong before, the right one is reached the wrong way."""
    truth = TrueChange(10.0, 20.0, 0, 1)
    score = match_changes([truth], [SaidChange(15.0, 2, 1)])
    assert (score.n_right, score.n_missed, score.n_extra) == (0, 0, 0)


def test_flicker_and_changes_too_early_or_missing_are_counted() -> None:
    early = match_changes(TRUTHS, [SaidChange(10.0 - EARLY - 0.1, 2, 0), SaidChange(60.0, 0, 2)])
    assert (early.n_right, early.n_missed, early.n_extra, early.n_before) == (1, 1, 1, 1)
    assert early.delays.tolist() == [np.inf, -10.0]
    flicker = [SaidChange(t, a, b) for t, a, b in ((20, 2, 0), (21, 0, 2), (22, 2, 0), (60, 0, 2))]
    assert (match_changes(TRUTHS, flicker).n_right, match_changes(TRUTHS, flicker).n_extra) == (1, 2)
    nothing = match_changes(TRUTHS, [])
    assert (nothing.n_right, nothing.n_missed, nothing.n_extra) == (0, 2, 0)
    invented = match_changes([], [SaidChange(5.0, 0, 1), SaidChange(6.0, 1, 0)])
    assert (invented.n_right, invented.n_missed, invented.n_extra) == (0, 0, 2)
    assert invented.delays.shape == (0,)


@given(
    st.lists(st.integers(0, 2), min_size=1, max_size=12),
    st.lists(st.tuples(st.integers(0, 2), st.floats(0.1, 20.0)), max_size=12),
)
def test_every_change_said_is_counted_once(points: list[int], steps: list[tuple[int, float]]) -> None:
    truths = true_changes(10.0 * np.arange(len(points)), np.array(points))
    t = np.cumsum([0.0, *(dt for _, dt in steps)])
    floor = np.array([points[0], *(f for f, _ in steps)])
    said = said_changes(t, floor, 0.0)
    score = match_changes(truths, said)
    n_found = len(truths) - score.n_missed
    assert n_found + score.n_extra == len(said)
    assert 0 <= score.n_right <= n_found <= len(truths)
    assert np.sum(np.isfinite(score.delays)) == n_found


@given(st.lists(st.integers(0, 3), min_size=2, max_size=12), st.floats(-2.9, 6.9))
def test_the_truth_said_with_a_delay_is_right(points: list[int], delay: float) -> None:
    t = 20.0 * np.arange(len(points))
    truths = true_changes(t, np.array(points))
    said = [SaidChange(c.arrived + delay - 10.0, c.before, c.after) for c in truths]
    score = match_changes(truths, said)
    assert (score.n_right, score.n_extra) == (len(truths), 0)
    assert score.delays == pytest.approx([delay - 10.0] * len(truths))
