"""The derivative step counter and the turns about gravity: made-up gaits with known answers, real walks in the hand."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from wayfuse.core.errors import ConfigError
from wayfuse.core.types import Array
from wayfuse.formats.oxford_steps import validation_walks
from wayfuse.inertial.derivative_steps import (
    DerivativeConfig,
    count_steps,
    filtered_derivative,
    turns_about_gravity,
)
from wayfuse.sensors.recording import Series

G = 9.81


def gait(steps: int, frequency: float, rate: float = 20.0, amplitude: float = 2.0) -> Series:
    """Rest of 2 s, then so many bounces, then rest."""
    t = np.arange(0.0, 4.0 + steps / frequency, 1.0 / rate)
    phase = np.clip(t - 2.0, 0.0, steps / frequency) * frequency
    bounce = amplitude * (1.0 - np.cos(2.0 * np.pi * phase))  # starts and ends without a jerk
    return Series(t, np.column_stack([0.1 * bounce, 0.0 * t, G + bounce]))


@pytest.mark.parametrize("steps", [5, 17, 60])
@pytest.mark.parametrize("frequency", [1.5, 1.9, 2.4])
@pytest.mark.parametrize("rate", [20.0, 100.0])
def test_every_bounce_is_one_step(steps: int, frequency: float, rate: float) -> None:
    found = count_steps(gait(steps, frequency, rate))
    assert len(found) == steps
    assert np.all(np.abs(np.diff(found) - 1.0 / frequency) < 0.1)


def test_a_resting_phone_counts_nothing_however_it_lies() -> None:
    rng = np.random.default_rng(1)
    lying = np.array([3.0, -5.0, 7.9]) + 0.05 * rng.standard_normal((400, 3))
    assert len(count_steps(Series(np.arange(400) / 20.0, lying))) == 0


def test_above_the_cut_off_nothing_passes() -> None:
    t = np.arange(0.0, 10.0, 0.05)
    for hz, low, high in ((1.5, 0.9, 1.1), (3.0, 0.6, 0.8), (7.0, 0.0, 0.02)):
        _, wave = filtered_derivative(
            Series(t, np.column_stack([0.0 * t, 0.0 * t, G + np.sin(2.0 * np.pi * hz * t)]))
        )
        # of a difference over one sample: 2 rate sin(pi f / rate); at 3 Hz a Butterworth filter leaves 1 / sqrt 2
        gain = np.abs(wave[100:]).max() / (40.0 * np.sin(np.pi * hz / 20.0))
        assert low < gain < high


def test_a_recording_without_samples_or_with_one_has_no_steps() -> None:
    assert len(count_steps(Series(np.empty(0), np.empty((0, 3))))) == 0
    assert len(count_steps(Series(np.zeros(1), np.full((1, 3), G)))) == 0


def held(tilt: float, rate: Array, t: Array) -> tuple[Series, Series]:
    """A phone tilted about its x axis by ``tilt`` that turns about the vertical."""
    up = np.array([0.0, np.sin(tilt), np.cos(tilt)])
    return Series(t, np.tile(G * up, (len(t), 1))), Series(t, rate[:, None] * up)


@pytest.mark.parametrize("tilt", [0.0, 0.7, 1.57, 3.0])
def test_turns_do_not_depend_on_how_the_phone_is_held(tilt: float) -> None:
    t = np.arange(0.0, 20.0, 0.01)
    acceleration, rotation = held(tilt, np.where((t >= 5.0) & (t < 6.0), np.pi / 2.0, 0.0), t)
    turns = turns_about_gravity(acceleration, rotation, np.array([0.0, 4.0, 8.0, 19.0]))
    np.testing.assert_allclose(turns, [0.0, np.pi / 2.0, 0.0], atol=1e-3)


def test_rolling_the_phone_about_a_level_axis_is_no_turn() -> None:
    t = np.arange(0.0, 10.0, 0.01)
    level = Series(t, np.tile([0.0, 0.0, G], (len(t), 1)))
    rolled = Series(t, np.column_stack([np.ones_like(t), 0.0 * t, 0.0 * t]))
    np.testing.assert_allclose(turns_about_gravity(level, rolled, np.array([1.0, 9.0])), 0.0, atol=1e-9)


def test_turns_without_samples_are_zero() -> None:
    empty = Series(np.empty(0), np.empty((0, 3)))
    np.testing.assert_array_equal(turns_about_gravity(empty, empty, np.arange(4.0)), np.zeros(3))


@pytest.mark.parametrize(
    "wrong",
    [{"cut_off": 10.0}, {"cut_off": 0.0}, {"gravity_cut_off": 11.0}, {"order": 0}, {"threshold": 0.0}],
)
def test_impossible_filters_are_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(ConfigError):
        DerivativeConfig(**wrong)  # type: ignore[arg-type]


@pytest.mark.real_data
def test_real_walks_in_the_hand_are_counted_within_two_percent(data_root: Path) -> None:
    root = data_root / "oxford-steps"
    if not root.is_dir():
        pytest.skip(f"REAL DATA ABSENT: no folder {root}")
    walks = [walk for walk in validation_walks(root) if walk.position == "hand"]
    assert walks
    for walk in walks:
        assert abs(len(count_steps(walk.recording.acceleration)) / walk.steps - 1.0) < 0.02, (
            walk.recording.name
        )
