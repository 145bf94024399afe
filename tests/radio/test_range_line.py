"""The line of a phone's ranges: its prior, what evidence and time do to it, the mixture of lines."""

from __future__ import annotations

import numpy as np
import pytest

from wayfuse.core.errors import ConfigError
from wayfuse.radio.range_line import LineGrid, Spread, mixed

GRID = LineGrid(offset=Spread(1.0, 0.5), slope=Spread(1.1, 0.05), learning=0.5)


def mean(log_p: np.ndarray) -> tuple[float, float]:
    p = np.exp(log_p)
    assert p.sum() == pytest.approx(1.0)
    return float(p @ GRID.offsets), float(p @ GRID.slopes)


def evidence(offset: float) -> np.ndarray:
    return -(((GRID.offsets - offset) / 0.3) ** 2)


def learned(log_p: np.ndarray, gain: np.ndarray, spacing: float) -> np.ndarray:
    return GRID.learned(log_p, np.arange(len(GRID.offsets)), gain, spacing)


def test_before_the_first_range_it_is_the_prior() -> None:
    assert mean(GRID.prior) == pytest.approx((1.0, 1.1))
    p = np.exp(GRID.prior)
    assert 0.35 < float(np.sqrt(p @ (GRID.offsets - 1.0) ** 2)) < 0.5  # cut at two sigma


def test_evidence_moves_it_and_time_brings_it_back() -> None:
    log_p = GRID.prior
    for _ in range(20):
        log_p = learned(log_p, evidence(0.2), 0.5)
    offset, slope = mean(log_p)
    assert offset == pytest.approx(0.17, abs=0.2)
    assert slope == pytest.approx(1.1)  # of which nothing was said
    late = learned(log_p, np.zeros(len(log_p)), 20.0 * GRID.memory)
    np.testing.assert_allclose(late, GRID.prior, atol=1e-5)


def test_what_was_not_looked_at_has_the_evidence_of_the_worst_and_can_come_back() -> None:
    log_p = GRID.prior
    for _ in range(40):
        log_p = learned(log_p, evidence(2.0), 0.1)
    rows = GRID.live(log_p)
    assert mean(log_p)[0] > 1.6
    assert 0 < len(rows) < len(log_p)
    for _ in range(400):
        rows = GRID.live(log_p)
        log_p = GRID.learned(log_p, rows, evidence(0.2)[rows], 5.0)
    assert mean(log_p)[0] < 0.9


def test_a_mixture_is_the_logarithm_of_the_mean_likelihood() -> None:
    table = np.array([[-1.0, -800.0], [-2.0, -900.0]])
    found = mixed(np.log([0.25, 0.75]), table)
    assert found[0] == pytest.approx(np.log(0.25 * np.exp(-1.0) + 0.75 * np.exp(-2.0)))
    assert found[1] == pytest.approx(-800.0 + np.log(0.25))


def test_what_makes_no_line_is_refused() -> None:
    for bad in (
        lambda: Spread(1.0, 0.0),
        lambda: LineGrid(slope=Spread(0.1, 0.1)),
        lambda: LineGrid(learning=-0.1),
        lambda: LineGrid(memory=0.0),
    ):
        with pytest.raises(ConfigError):
            bad()
    assert Spread(1.0, 0.5, n=1).values.tolist() == [1.0]
