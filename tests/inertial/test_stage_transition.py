"""Stage transition, step count and stride of he2014: plain formulas, made-up walks, oxford-steps."""

from __future__ import annotations

from pathlib import Path

import made_up_gait
import numpy as np
import pytest

from wayfuse.core.errors import ConfigError, UsageError
from wayfuse.inertial.stage_transition import (
    StageConfig,
    best_autocorrelation,
    find_stages,
    stride,
    uniform_norm,
    walks,
)
from wayfuse.sensors.recording import Series

CONFIG = StageConfig()


def _wave(
    n_steps: int, period: int = 50, still: int = 300, noise: float = 0.002, seed: int = 0
) -> np.ndarray:
    """Standing, n steps of one sine each, standing; g at 100 Hz."""
    t = np.arange(n_steps * period)
    a = np.concatenate([np.zeros(still), 0.3 * np.sin(2 * np.pi * t / period), np.zeros(still)])
    return a + noise * np.random.default_rng(seed).standard_normal(len(a))


def test_the_autocorrelation_is_equation_1() -> None:
    a = np.random.default_rng(4).normal(0.5, 0.2, 160)
    psi, tau = best_autocorrelation(a, 30, 60)
    assert len(psi) == 160 - 120 + 1
    for m in (0, 17, 40):
        kappa = []
        for lag in range(30, 61):
            left, right = a[m : m + lag], a[m + lag : m + 2 * lag]
            spread = lag * left.std() * right.std()
            kappa.append(((left - left.mean()) * (right - right.mean())).sum() / spread)
        assert psi[m] == pytest.approx(max(kappa))
        assert tau[m] == 30 + int(np.argmax(kappa))


def test_standing_and_a_single_jerk_are_no_walk() -> None:
    still = 0.001 * np.random.default_rng(1).standard_normal(1000)
    assert not find_stages(still, CONFIG).is_walking.any()
    jerk = still.copy()
    jerk[500:520] += 0.5
    assert not find_stages(jerk, CONFIG).is_walking.any()
    assert walks(jerk, CONFIG) == []


def test_small_repetitive_motion_is_standing_by_sigma() -> None:
    a = _wave(20, noise=0.0) * 0.03  # sd 0.0064 g, perfectly repetitive
    stages = find_stages(a, CONFIG)
    assert stages.psi.max() > 0.99
    assert not stages.is_walking.any()


@pytest.mark.parametrize("period", [35, 50, 58])
def test_a_walk_is_found_with_its_lag_and_about_its_steps(period: int) -> None:
    (found,) = walks(_wave(40, period), CONFIG)
    assert found.tau == period
    assert 37 <= found.steps <= 40  # as printed, the last two windows do not count
    assert found.first == pytest.approx(300, abs=period)
    assert found.step_length == pytest.approx(0.98 * np.cbrt(0.3 * 2 / np.pi), rel=0.02)


def test_a_period_of_two_steps_counts_both() -> None:
    recording = made_up_gait.walk(steps=60, cadence=1.8)
    config = StageConfig(rate=50.0, steps_per_period=2)
    a = uniform_norm(recording.acceleration, config)
    assert sum(w.steps for w in walks(a, config)) == pytest.approx(60, abs=5)
    assert abs(a[:50]).max() < 0.05  # standing: gravity is gone, in g


def test_stride_is_equation_2() -> None:
    assert stride(np.array([0.1, -0.3, 0.2])) == pytest.approx(0.98 * 0.2 ** (1 / 3))


def test_too_short_or_impossible_is_said() -> None:
    assert walks(np.zeros(50), CONFIG) == []
    with pytest.raises(UsageError, match="acceleration"):
        uniform_norm(Series(np.array([1.0]), np.zeros((1, 3))), CONFIG)
    for wrong in ({"tau_min": 70}, {"rate": 0.0}, {"least_psi": 0.0}, {"still_sigma": -1.0}):
        with pytest.raises(ConfigError, match="StageConfig"):
            StageConfig(**wrong)


@pytest.mark.real_data
def test_steps_of_real_walks_in_the_hand(data_root: Path) -> None:
    from wayfuse.formats.oxford_steps import validation_walks

    folder = data_root / "oxford-steps"
    if not folder.is_dir():
        pytest.skip(f"REAL DATA ABSENT: no folder {folder}; fetch with `wayfuse datasets fetch oxford-steps`")
    errors: dict[str, list[float]] = {}
    pairs: list[float] = []
    for walk in validation_walks(folder):
        for config, kept in (
            (CONFIG, errors.setdefault(walk.position, [])),
            (StageConfig(rate=50.0, steps_per_period=2), pairs),
        ):
            found = walks(uniform_norm(walk.recording.acceleration, config), config)
            kept.append(sum(w.steps for w in found) / walk.steps - 1.0)
    assert np.abs(errors["hand"]).max() <= 0.02  # how the paper holds the phone
    assert np.mean(errors["backpocket"]) < -0.5  # a pocket sees pairs of steps: no period within 0.6 s
    assert np.mean(np.abs(pairs)) <= 0.05
