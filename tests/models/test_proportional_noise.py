"""Steps and turns with noise in proportion: Eq. 5 to 7 of liu2017 by hand, and their moments."""

from __future__ import annotations

import math

import numpy as np
import pytest

from wayfuse.core.errors import ConfigError
from wayfuse.core.philox import Noise
from wayfuse.filters.cloud import Cloud
from wayfuse.models.motion.pdr import StepInput
from wayfuse.models.motion.proportional_noise import Poses, ProportionalNoise, Report


def motion(distance: float = 0.4, turn: float = 0.01) -> ProportionalNoise:
    return ProportionalNoise(step_length=0.7, distance_sigma=distance, turn_sigma=turn)


def cloud(n: int, heading: float = 0.0) -> Cloud:
    zero = np.zeros(n, np.float32)
    return Cloud.on_floors(zero, zero, zero + np.float32(heading), zero + 1.0, np.zeros(n, np.int32))


def test_without_noise_it_is_dead_reckoning_with_the_heading_before_the_turn() -> None:
    before = Poses(np.array([1.0]), np.array([2.0]), np.array([math.pi / 6.0]))
    x, y, heading = motion(0.0, 0.0).move(Noise.of(0, "a"), before, Report(3.0, 0.5))
    assert x[0] == pytest.approx(1.0 + 2.1 * math.cos(math.pi / 6.0))
    assert y[0] == pytest.approx(2.0 + 1.05)
    assert heading[0] == pytest.approx(math.pi / 6.0 + 0.5)


def test_noise_grows_with_steps_and_turns_and_is_nought_without() -> None:
    n = 20_000
    before = Poses(np.zeros(n), np.zeros(n), np.full(n, math.pi / 4.0))
    x, y, heading = motion().move(Noise.of(0, "b"), before, Report(5.0, 2.0))
    along = 3.5 * math.cos(math.pi / 4.0)
    for axis in (x, y):
        assert axis.mean() == pytest.approx(along, rel=0.02)
        assert axis.std() == pytest.approx(0.4 * along, rel=0.03)
    assert abs(np.corrcoef(x, y)[0, 1]) < 0.03  # a noise for each axis
    assert heading.std() == pytest.approx(0.02, rel=0.03)
    still = motion().move(Noise.of(0, "c"), before, Report(0.0, 0.0))
    for moved, was in zip(still, before, strict=True):
        np.testing.assert_array_equal(moved, was)


def test_a_step_of_a_tracker_moves_along_the_measured_heading_and_its_bias() -> None:
    moved = motion(0.0, 0.0).propagate(Noise.of(0, "d"), cloud(3, 0.5), StepInput(9.0, math.pi / 2.0 - 0.5))
    np.testing.assert_allclose(moved.x, 0.0, atol=1e-6)
    np.testing.assert_allclose(moved.y, 0.7, rtol=1e-6)  # the length is the model's, not the measured one
    np.testing.assert_allclose(moved.heading_bias, 0.5, atol=1e-6)
    drifted = motion().propagate(Noise.of(0, "e"), cloud(20_000), StepInput(0.7, 3.0))
    assert float(drifted.heading_bias.std()) == pytest.approx(0.01, rel=0.03)
    assert drifted.x.dtype == drifted.heading_bias.dtype == np.float32


@pytest.mark.parametrize("wrong", [{"step_length": 0.0}, {"distance_sigma": -1.0}, {"turn_sigma": math.nan}])
def test_impossible_steps_are_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(ConfigError):
        ProportionalNoise(**({"step_length": 0.7, "distance_sigma": 0.4, "turn_sigma": 0.01} | wrong))
