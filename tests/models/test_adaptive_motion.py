"""The motion model of he2014: Eq. 4-5 while walking, a disc while standing."""

from __future__ import annotations

import numpy as np
import pytest

from wayfuse.core.errors import ConfigError
from wayfuse.core.philox import Noise
from wayfuse.filters.cloud import Cloud
from wayfuse.models.motion.adaptive import AdaptiveMotion, Walked

N = 20_000


def _cloud(x: float, y: float) -> Cloud:
    zero = np.zeros(N, np.float32)
    return Cloud.on_floors(zero + np.float32(x), zero + np.float32(y), zero, zero + 1, np.zeros(N, np.int32))


def test_a_standing_cloud_fills_the_disc_evenly() -> None:
    after = AdaptiveMotion(radius=2.0).propagate(Noise.of(1, "disc"), _cloud(3.0, -1.0), None)
    dx, dy = after.x - 3.0, after.y + 1.0
    r = np.hypot(dx, dy)
    assert r.max() <= 2.0 + 1e-5
    assert np.mean(r < 1.0) == pytest.approx(0.25, abs=5 * np.sqrt(0.25 * 0.75 / N))  # a quarter of the area
    for axis in (dx, dy):  # variance R² / 4 per axis
        assert abs(axis.mean()) < 5 / np.sqrt(N)
        assert axis.var() == pytest.approx(1.0, rel=0.05)


def test_a_walking_cloud_makes_the_move_with_noise_in_length_and_heading() -> None:
    motion = AdaptiveMotion(length_sigma=0.2, heading_sigma=0.1)
    after = motion.propagate(Noise.of(2, "move"), _cloud(1.0, 2.0), Walked(4.0, np.pi / 2))
    dx, dy = after.x - 1.0, after.y - 2.0
    length, heading = np.hypot(dx, dy), np.arctan2(dy, dx)
    assert length.mean() == pytest.approx(4.0, abs=5 * 0.2 / np.sqrt(N))
    assert length.std() == pytest.approx(0.2, rel=0.05)
    assert heading.mean() == pytest.approx(np.pi / 2, abs=5 * 0.1 / np.sqrt(N))
    assert heading.std() == pytest.approx(0.1, rel=0.05)
    assert abs(np.corrcoef(length, heading)[0, 1]) < 0.04


def test_the_cloud_is_left_alone_and_the_same_noise_gives_the_same_bits() -> None:
    cloud, motion = _cloud(0.0, 0.0), AdaptiveMotion()
    for event in (None, Walked(1.0, 0.3)):
        first = motion.propagate(Noise.of(5, "a"), cloud, event)
        again = motion.propagate(Noise.of(5, "a"), cloud, event)
        assert np.array_equal(first.x, again.x)
        assert np.array_equal(first.y, again.y)
        assert first.x.dtype == np.float32
        assert first.x.std() > 0
    assert not cloud.x.any()


def test_impossible_parameters_are_refused() -> None:
    for wrong in ({"radius": 0.0}, {"length_sigma": -0.1}, {"heading_sigma": -0.1}):
        with pytest.raises(ConfigError, match="AdaptiveMotion"):
            AdaptiveMotion(**wrong)
