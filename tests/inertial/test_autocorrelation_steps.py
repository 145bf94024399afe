"""Steps by autocorrelation: against its own definition, on made waves, and on counted walks."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from wayfuse.core.errors import ConfigError
from wayfuse.core.types import Array
from wayfuse.formats.oxford_steps import validation_walks
from wayfuse.inertial.autocorrelation_steps import (
    AutocorrelationSteps,
    count_steps,
    normalised_autocorrelation,
)
from wayfuse.sensors.recording import Series


def upright(t: Array, bounce: Array, seed: int = 0) -> Series:
    """A phone lying still but for a bounce along the vertical, with noise."""
    noise = np.random.default_rng(seed).normal(0.0, 0.05, (len(t), 3))
    return Series(t, noise + np.column_stack([np.zeros((len(t), 2)), 9.81 + bounce]))


def gait(t: Array, step_period: float, uneven: float = 0.4) -> Array:
    """A wave per step, and one per two steps for the foot that treads harder."""
    return 2.0 * np.sin(2 * np.pi * t / step_period) + uneven * np.sin(np.pi * t / step_period)


@settings(deadline=None, max_examples=40)
@given(st.integers(0, 10_000), st.integers(2, 9), st.integers(0, 40))
def test_chi_is_its_definition(seed: int, lag: int, m: int) -> None:
    norm = 9.81 + np.random.default_rng(seed).normal(size=41)
    found = normalised_autocorrelation(norm, np.array([lag]))[0, m]
    if m + 1 < 2 * lag:
        assert found == 0.0
        return
    late, early = norm[m - lag + 1 : m + 1], norm[m - 2 * lag + 1 : m - lag + 1]
    assert found == pytest.approx(np.corrcoef(late, early)[0, 1], abs=1e-9)


def test_what_does_not_vary_does_not_repeat() -> None:
    assert not normalised_autocorrelation(np.full(50, 9.81), np.array([5, 10])).any()


@pytest.mark.parametrize("rate", [25.0, 50.0, 200.0])
@pytest.mark.parametrize("period", [0.45, 0.55, 0.7])
def test_a_walk_is_counted_at_any_rate(period: float, rate: float) -> None:
    t = np.arange(0.0, 60.0, 1.0 / rate)
    counts = count_steps(upright(t, gait(t, period)))
    assert counts.steps[-1] == pytest.approx(60.0 / period, rel=0.03)


def test_the_count_only_grows_and_knows_nothing_of_the_future() -> None:
    t = np.arange(0.0, 40.0, 0.02)
    series = upright(t, np.where(t < 25.0, gait(t, 0.55), 0.0))
    whole = count_steps(series)
    assert (np.diff(whole.steps) >= 0).all()
    half = count_steps(Series(t[:1000], series.values[:1000]))
    np.testing.assert_array_equal(half.steps, whole.steps[: len(half.steps)])


def test_standing_holds_no_steps() -> None:
    t = np.arange(0.0, 60.0, 0.02)
    assert count_steps(upright(t, np.zeros_like(t))).steps[-1] == 0


def test_shaking_without_a_rhythm_holds_hardly_any() -> None:
    t = np.arange(0.0, 60.0, 0.02)
    shaken = np.random.default_rng(4).normal(0.0, 2.0, len(t))
    assert count_steps(upright(t, shaken)).steps[-1] <= 4


def test_two_walks_with_a_rest_are_both_counted() -> None:
    t = np.arange(0.0, 60.0, 0.02)
    walks = (t < 20.0) | (t >= 40.0)
    counts = count_steps(upright(t, np.where(walks, gait(t, 0.5), 0.0)))
    assert counts.steps[-1] == pytest.approx(80, abs=6)
    resting = (counts.t > 23.0) & (counts.t < 40.0)
    assert np.ptp(counts.steps[resting]) == 0


@pytest.mark.parametrize("n", [0, 1, 2])
def test_hardly_any_samples_are_no_error(n: int) -> None:
    counts = count_steps(Series(np.arange(n) * 0.02, np.full((n, 3), 5.0)))
    assert not counts.steps.any()


def test_wrong_parameters_are_refused() -> None:
    with pytest.raises(ConfigError, match="shortest < longest"):
        AutocorrelationSteps(shortest=2.0, longest=1.0)
    with pytest.raises(ConfigError, match="out of range"):
        AutocorrelationSteps(similarity=1.5)


@pytest.mark.real_data
def test_counted_walks_are_counted_within_two_percent(data_root: Path) -> None:
    root = data_root / "oxford-steps"
    if not root.is_dir():
        pytest.skip("oxford-steps is not there")
    error = [
        count_steps(walk.recording.acceleration).steps[-1] / walk.steps - 1.0
        for walk in validation_walks(root)
    ]
    assert len(error) >= 10
    assert np.mean(np.abs(error)) < 0.02
