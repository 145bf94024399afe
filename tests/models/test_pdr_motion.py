"""Steps move particles by their own length and heading; the kernel against plain NumPy."""

from __future__ import annotations

import numpy as np
import pytest

from wayfuse.core.errors import ConfigError
from wayfuse.core.philox import Noise
from wayfuse.filters.cloud import Cloud
from wayfuse.models.motion.pdr import PdrMotion, StepInput
from wayfuse.models.motion.random_walk import RandomWalk

EXACT = {"length_sigma": 0.0, "heading_sigma": 0.0, "bias_sigma": 0.0, "scale_sigma": 0.0}


def cloud(n: int = 500, seed: int = 1) -> Cloud:
    rng = np.random.default_rng(seed)
    x, y, bias = (rng.normal(0.0, s, n).astype(np.float32) for s in (10.0, 10.0, 0.2))
    return Cloud.on_floors(
        x, y, bias, rng.normal(1, 0.1, n).astype(np.float32), rng.integers(0, 3, n).astype(np.int32)
    )


def test_a_step_without_noise_is_plain_dead_reckoning() -> None:
    before = cloud()
    after = PdrMotion(**EXACT).propagate(Noise.of(0, "x"), before, StepInput(0.7, 2.0))
    heading = 2.0 + before.heading_bias.astype(np.float64)
    np.testing.assert_allclose(after.x, before.x + 0.7 * before.step_scale * np.cos(heading), atol=1e-5)
    np.testing.assert_allclose(after.y, before.y + 0.7 * before.step_scale * np.sin(heading), atol=1e-5)
    np.testing.assert_array_equal(after.heading_bias, before.heading_bias)
    np.testing.assert_array_equal(after.step_scale, before.step_scale)


def test_the_kernel_is_its_twin() -> None:
    before, motion = cloud(), PdrMotion(scale_sigma=0.5)
    z = Noise.of(0, "x").normals(500).astype(np.float64)
    after = motion.propagate(Noise.of(0, "x"), before, StepInput(0.7, -1.0))
    bias = before.heading_bias + motion.bias_sigma * z[2]
    scale = np.maximum(before.step_scale + motion.scale_sigma * z[3], 0.4)
    d, h = 0.7 * scale * (1.0 + motion.length_sigma * z[0]), -1.0 + bias + motion.heading_sigma * z[1]
    for got, want in zip(
        after[:4], (before.x + d * np.cos(h), before.y + d * np.sin(h), bias, scale), strict=True
    ):
        np.testing.assert_allclose(got, want, atol=1e-5)
    assert after.step_scale.min() == np.float32(0.4)  # nobody walks backwards for long


def test_noise_has_the_spread_of_its_parameters() -> None:
    n = 50_000
    zero = np.zeros(n, np.float32)
    before = Cloud.on_floors(zero, zero, zero, zero + 1, np.zeros(n, np.int32))
    motion = PdrMotion(length_sigma=0.1, heading_sigma=0.02, bias_sigma=0.03, scale_sigma=0.0)
    after = motion.propagate(Noise.of(3, "spread"), before, StepInput(1.0, 0.0))
    relative = 5.0 / np.sqrt(2.0 * n)
    assert np.std(np.hypot(after.x, after.y)) == pytest.approx(0.1, rel=relative + 1e-3)
    assert np.std(np.arctan2(after.y, after.x)) == pytest.approx(np.hypot(0.02, 0.03), rel=relative + 1e-3)
    assert np.std(after.heading_bias) == pytest.approx(0.03, rel=relative)


def test_diffusion_grows_with_the_root_of_time() -> None:
    n = 50_000
    zero = np.zeros(n, np.float32)
    before = Cloud.on_floors(zero, zero, zero, zero + 1, np.zeros(n, np.int32))
    walk = RandomWalk(1.5)
    at_once = walk.propagate(Noise.of(0, "a"), before, 4.0)
    noise, stepwise = Noise.of(0, "b"), before
    for _ in range(8):
        stepwise = walk.propagate(noise, stepwise, 0.5)
    for after in (at_once, stepwise):
        for column in (after.x, after.y):
            assert np.std(column) == pytest.approx(3.0, rel=5.0 / np.sqrt(2.0 * n))
        np.testing.assert_array_equal(after.step_scale, before.step_scale)
    np.testing.assert_array_equal(walk.propagate(Noise.of(0, "a"), before, -1.0).x, before.x)


def test_parameters_out_of_range_are_refused() -> None:
    for name in EXACT:
        with pytest.raises(ConfigError, match=f"{name} must not be negative"):
            PdrMotion(**{name: -0.1})
        with pytest.raises(ConfigError, match=name):
            PdrMotion(**{name: np.nan})
    for sigma in (0.0, -1.0, np.nan):
        with pytest.raises(ConfigError, match="sigma must be positive"):
            RandomWalk(sigma)
