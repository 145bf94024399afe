"""Ranges with exponents, the velocity term, and constant-velocity motion (li2015 Eq. 3-12)."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wayfuse.core.errors import ConfigError
from wayfuse.core.philox import Noise
from wayfuse.core.types import Array
from wayfuse.models.motion.constant_velocity import ConstantVelocity, MovingCloud
from wayfuse.models.observation.ranges import Exponents, RangeLikelihood, VelocityLikelihood, range_exponents

ANCHORS = np.array([[0.0, 0.0], [10.0, 0.0], [0.0, 8.0]])


def cloud(n: int = 50) -> MovingCloud:
    return MovingCloud.around(Noise.of(1, "cloud"), n, (4.0, 3.0), 2.0, 1.0)


def added(model: RangeLikelihood, particles: MovingCloud, ranges: Array) -> Array:
    out = np.zeros(particles.n)
    model.log_likelihood(particles, ranges, out)
    return out


@given(st.lists(st.floats(0.0, 100.0), min_size=1, max_size=8))
def test_exponents_sum_to_one_and_favour_the_near(distances: list[float]) -> None:
    d = np.array(distances)
    m = range_exponents(d)
    assert m.sum() == pytest.approx(1.0)
    assert (np.diff(m[np.argsort(d, kind="stable")]) <= 1e-12).all()


def test_an_anchor_without_a_range_has_no_say() -> None:
    assert range_exponents(np.array([2.0, np.nan, 6.0])).tolist() == pytest.approx([0.75, 0.0, 0.25])
    assert range_exponents(np.array([2.0, np.nan]), Exponents.ONE).tolist() == [1.0, 0.0]
    everywhere = added(RangeLikelihood(ANCHORS, 1.0), cloud(), np.full(3, np.nan))
    assert not everywhere.any()
    two = added(RangeLikelihood(ANCHORS[:2], 1.0), cloud(), np.array([5.0, 7.0]))
    assert added(RangeLikelihood(ANCHORS, 1.0), cloud(), np.array([5.0, 7.0, np.nan])) == pytest.approx(two)


@pytest.mark.parametrize("kind", list(Exponents))
def test_likelihood_is_equations_10_and_11_written_out(kind: Exponents) -> None:
    ranges, sigma, particles = np.array([5.0, 7.5, 4.0]), 1.7, cloud()
    inverse = 1.0 / ranges
    m = {Exponents.INVERSE_RANGE: inverse / inverse.sum(), Exponents.EQUAL: np.full(3, 1 / 3)}.get(
        kind, np.ones(3)
    )
    expected = np.zeros(particles.n)
    for i in range(particles.n):
        for j in range(3):
            distance = np.hypot(particles.x[i] - ANCHORS[j, 0], particles.y[i] - ANCHORS[j, 1])
            expected[i] += m[j] * -((ranges[j] - distance) ** 2) / (2.0 * sigma**2)
    assert added(RangeLikelihood(ANCHORS, sigma, kind), particles, ranges) == pytest.approx(expected)


def test_velocity_likelihood_is_equation_7() -> None:
    particles, out = cloud(), np.full(50, 3.0)
    VelocityLikelihood(0.5).log_likelihood(particles, np.array([0.4, -0.2]), out)
    expected = 3.0 - ((particles.vx - 0.4) ** 2 + (particles.vy + 0.2) ** 2) / 0.5
    assert out == pytest.approx(expected)


def test_motion_is_equation_4_in_the_mean_and_in_its_spread() -> None:
    n, dt, w = 40_000, 2.0, 0.5
    still = MovingCloud(np.full(n, 1.0), np.full(n, 2.0), np.full(n, 0.5), np.full(n, -1.0))
    moved = ConstantVelocity(w).propagate(Noise.of(3, "move"), still, dt)
    for column, mean, sigma in zip(
        moved, (2.0, 0.0, 0.5, -1.0), (w * dt**2 / 2, w * dt**2 / 2, w * dt, w * dt), strict=True
    ):
        assert column.mean() == pytest.approx(mean, abs=5.0 * sigma / np.sqrt(n))
        assert column.std() == pytest.approx(sigma, rel=5.0 / np.sqrt(2 * n))
    # one acceleration moves the place and changes the velocity: rank 1 per axis
    assert moved.x - 2.0 == pytest.approx((moved.vx - 0.5) * dt / 2, abs=1e-12)
    assert still.x[0] == 1.0


def test_same_noise_same_bits() -> None:
    a, b = (ConstantVelocity(0.5).propagate(Noise.of(3, "m"), cloud(), 1.0) for _ in range(2))
    assert all((p == q).all() for p, q in zip(a, b, strict=True))


def test_wrong_use_is_said() -> None:
    with pytest.raises(ConfigError, match="sigma"):
        RangeLikelihood(ANCHORS, 0.0)
    with pytest.raises(ConfigError, match=r"\(n, 2\)"):
        RangeLikelihood(ANCHORS[:, :1], 1.0)
    with pytest.raises(ConfigError, match="3 anchors"):
        added(RangeLikelihood(ANCHORS, 1.0), cloud(), np.ones(2))
    with pytest.raises(ConfigError, match="sigma"):
        VelocityLikelihood(-1.0)
    with pytest.raises(ConfigError, match="acceleration_sigma"):
        ConstantVelocity(-0.1)
