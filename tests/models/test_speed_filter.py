"""The speed filter of chu2009: its example, who is filtered, and what happens to somebody who stands."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wayfuse.core.errors import ConfigError
from wayfuse.core.philox import Noise
from wayfuse.filters.cloud import Cloud
from wayfuse.filters.particle_filter import FilterState, ParticleFilter
from wayfuse.models.constraint.speed_filter import SpeedDisc, SpeedFilter, SpeedState, confident_size
from wayfuse.models.motion.pdr import PdrMotion, StepInput


def ring(*radii: float, x: float = 0.0, y: float = 0.0, floor: int = 0) -> Cloud:
    """A particle at each distance, in directions of their own."""
    angle = 2.4 * np.arange(len(radii))
    columns = x + radii * np.cos(angle), y + radii * np.sin(angle), 0.0 * angle, 1.0 + 0.0 * angle
    return Cloud.on_floors(
        *(c.astype(np.float32) for c in columns), np.full(len(radii), floor, dtype=np.int32)
    )


def filtered(disc: SpeedDisc, cloud: Cloud) -> tuple[list[bool], int]:
    log_weights = np.zeros(cloud.n)
    after, n = disc.restrict(cloud, cloud, log_weights)
    assert after is cloud
    assert set(log_weights.tolist()) <= {0.0, -disc.penalty}
    return (log_weights < 0.0).tolist(), n


def test_the_example_of_the_paper() -> None:
    """Eq. 3.5, whose arithmetic is right: [5 + 4 + 0 + 1.2 + 0.4] / 3; only "from t to t - 5" counts one too many."""
    assert confident_size((5.0, 5.0, 0.0, 3.0, 2.0), 5) == pytest.approx(10.6 / 3.0, rel=1e-12)


@given(speeds=st.lists(st.floats(0.0, 10.0), min_size=1, max_size=12), k=st.integers(1, 12))
def test_the_size_is_a_mean_that_the_newest_sway_most(speeds: list[float], k: int) -> None:
    size = confident_size(tuple(speeds), k)
    used = speeds[:k]
    assert min(used) - 1e-9 <= size <= max(used) + 1e-9
    assert size == confident_size((*used, 99.0), k) if len(used) == k else True
    faster = [*speeds]
    faster[0] += 1.0
    gains = [confident_size(tuple(faster), k) - size]
    for j in range(1, len(used)):
        other = [*speeds]
        other[j] += 1.0
        gains.append(confident_size(tuple(other), k) - size)
    assert all(a > b - 1e-12 for a, b in pairwise(gains))
    assert sum(gains) == pytest.approx(1.0)


def test_without_a_speed_the_size_has_no_bound() -> None:
    assert confident_size((), 5) == math.inf


def walk(speeds: list[float], how: SpeedFilter, dt: float = 1.0) -> SpeedState:
    """Estimates every dt s of somebody who goes east at these speeds, the last of them still without estimate."""
    state, x = how.estimated(SpeedState(), 0.0, 0.0, 0.0, 0), 0.0
    for i, v in enumerate(speeds[:-1]):
        state = how.stepped(state, 0.5 * v * dt, 0.0)
        state = how.stepped(state, 0.5 * v * dt, 0.0)
        x += v * dt
        state = how.estimated(state, (i + 1) * dt, x, 0.0, 0)
    return how.stepped(state, speeds[-1] * dt, 0.0)


def test_the_disc_is_of_the_last_estimate_moved_by_the_steps() -> None:
    how = SpeedFilter(least=0.1)
    state = walk([2.0, 3.0, 0.0, 5.0, 5.0], how)
    assert state.speeds == pytest.approx((5.0, 0.0, 3.0, 2.0))
    disc = how.disc(state, 5.0)
    assert disc is not None
    assert (disc.x, disc.y, disc.floor) == (pytest.approx(15.0), 0.0, 0)
    assert disc.radius == pytest.approx(10.6 / 3.0)  # the example again, over a second
    turned = how.stepped(how.estimated(SpeedState(), 0.0, 1.0, 2.0, 1), 2.0, math.pi / 2)
    there = how.disc(turned, 1.0)
    assert there is not None
    assert (there.x, there.y, there.floor) == (pytest.approx(1.0), pytest.approx(4.0), 1)


def test_the_radius_is_a_way_not_a_speed() -> None:
    how = SpeedFilter(least=0.01)
    for dt in (0.5, 1.0, 4.0):
        disc = how.disc(walk([1.2] * 6, how, dt), 6 * dt)
        assert disc is not None
        assert disc.radius == pytest.approx(1.2 * dt)
    wide = SpeedFilter(least=0.01, scale=3.0)
    disc = wide.disc(walk([1.2] * 6, wide), 6.0)
    assert disc is not None
    assert disc.radius == pytest.approx(3.6)


def test_before_an_estimate_and_before_a_speed_nothing_is_said() -> None:
    how = SpeedFilter()
    assert how.disc(SpeedState(), 1.0) is None
    assert how.disc(how.stepped(SpeedState(), 0.7, 0.0), 1.0) is None
    first = how.estimated(SpeedState(), 5.0, 1.0, 2.0, 0)
    assert how.disc(first, 5.0) is None
    assert how.disc(first, 6.0) is not None


def test_somebody_who_stands_keeps_a_cloud_of_the_least_radius() -> None:
    """As printed the radius is 0 after k halted periods, which filters every particle."""
    how = SpeedFilter(least=2.0)
    state = walk([1.0] + [0.0] * 20, how)
    disc = how.disc(state, 21.0)
    assert disc is not None
    assert confident_size(state.speeds, how.k) == 0.0
    assert disc.radius == 2.0
    assert filtered(disc, ring(0.0, 1.9, 2.1, 9.0, x=1.0)) == ([False, False, True, True], 2)


def test_who_runs_is_looked_for_farther_than_who_walks_or_stands() -> None:
    how = SpeedFilter(least=0.5)
    radii = []
    for v in (0.0, 1.0, 3.0):
        disc = how.disc(walk([v] * 6, how), 6.0)
        assert disc is not None
        radii.append(disc.radius)
    assert radii == pytest.approx([0.5, 1.0, 3.0])


def test_only_particles_that_walk_the_floor_of_the_estimate_are_judged() -> None:
    disc = SpeedDisc(0.0, 0.0, 1, 3.0)
    cloud = ring(1.0, 5.0, 5.0, 5.0, floor=1)
    cloud = cloud._replace(
        floor=np.array([1, 1, 0, 1], np.int32), connector=np.array([-1, -1, -1, 2], np.int32)
    )
    assert filtered(disc, cloud) == ([False, True, False, False], 1)


def test_never_all_are_filtered() -> None:
    disc = SpeedDisc(0.0, 0.0, 0, 3.0)
    assert filtered(disc, ring(4.0, 5.0, 6.0)) == ([False] * 3, 0)
    some = ring(4.0, 5.0, 6.0)._replace(floor=np.array([0, 0, 1], np.int32))
    assert filtered(disc, some) == ([False] * 3, 0)  # nor left to those who were not asked
    assert filtered(disc, ring(1.0, 2.0, floor=3)) == ([False] * 2, 0)


@given(
    radii=st.lists(st.floats(0.0, 50.0), min_size=1, max_size=40),
    radius=st.floats(0.1, 60.0),
    penalty=st.floats(0.0, 700.0),
)
def test_the_disc_is_its_twin_and_weights_stay_finite(
    radii: list[float], radius: float, penalty: float
) -> None:
    cloud = ring(*radii)
    kept = [column.copy() for column in cloud]
    log_weights = np.zeros(cloud.n)
    _, n = SpeedDisc(0.0, 0.0, 0, radius, penalty).restrict(cloud, cloud, log_weights)
    far = [math.hypot(float(x), float(y)) > radius for x, y in zip(cloud.x, cloud.y, strict=True)]
    want = sum(far) if not all(far) else 0
    near_the_edge = np.abs(np.hypot(cloud.x, cloud.y) - radius) < 1e-5
    assert abs(n - want) <= near_the_edge.sum() or (n == 0 and all(far))
    assert np.all(np.isfinite(log_weights))
    assert np.count_nonzero(log_weights) == (n if penalty else 0)
    for now, then in zip(cloud, kept, strict=True):
        np.testing.assert_array_equal(now, then)


def test_two_estimates_of_one_moment_and_a_clock_that_stands_do_not_divide_by_zero() -> None:
    how = SpeedFilter()
    state = walk([1.0, 1.0, 1.0], how)
    once = how.estimated(state, 3.0, 3.0, 0.0, 0)
    twice = how.estimated(once, 3.0, 3.4, 0.2, 0)
    assert (twice.speeds, twice.t, twice.x, twice.y) == (once.speeds, 3.0, 3.4, 0.2)
    for t in (3.0, 2.0):
        disc = how.disc(twice, t)
        assert disc is not None
        assert disc.radius == how.least


def test_states_are_values() -> None:
    how = SpeedFilter()
    state = walk([1.0, 2.0], how)
    kept = tuple(state)
    how.stepped(state, 1.0, 0.3)
    how.estimated(state, 9.0, 0.0, 0.0, 1)
    how.disc(state, 9.0)
    assert tuple(state) == kept
    assert len(walk([1.0] * 40, how).speeds) == how.k


def test_it_keeps_a_cloud_of_bad_steps_together() -> None:
    """Headings far too noisy: the disc cuts away what scatters, and the filter goes on."""
    how, motion, pf = SpeedFilter(least=1.0), PdrMotion(heading_sigma=1.5), ParticleFilter()
    spread = {}
    for name in ("filtered", "free"):
        zero = np.zeros(500, np.float32)
        state = FilterState(
            Cloud.on_floors(zero, zero, zero, zero + 1, np.zeros(500, np.int32)), np.zeros(500), 0
        )
        speed = how.estimated(SpeedState(), 0.0, 0.0, 0.0, 0)
        for i in range(20):
            speed = how.stepped(speed, 0.7, 0.0)
            t = 0.5 * (i + 1)
            state, _ = pf.predict(
                (1, 2), state, motion, StepInput(0.7, 0.0), how.disc(speed, t) if name == "filtered" else None
            )
            state, _ = pf.update((1, 2), state, np.zeros(500))
            speed = how.estimated(speed, t, 0.7 * (i + 1), 0.0, 0)
        off = np.hypot(state.cloud.x - 14.0, state.cloud.y)
        spread[name] = float(state.weights @ off)
        assert np.all(np.isfinite(state.log_weights))
    assert spread["filtered"] < 1.5
    assert spread["filtered"] < 0.4 * spread["free"]


@pytest.mark.parametrize(
    ("name", "value"),
    [("k", 0), ("least", 0.0), ("scale", 0.0), ("least", np.nan), ("penalty", -1.0), ("penalty", math.inf)],
)
def test_parameters_out_of_range_are_refused(name: str, value: Any) -> None:
    with pytest.raises(ConfigError, match=name):
        SpeedFilter(**{name: value})


def test_discs_out_of_range_are_refused() -> None:
    for radius, penalty in ((0.0, 1.0), (np.nan, 1.0), (1.0, math.inf), (1.0, np.nan)):
        with pytest.raises(ConfigError, match="radius"):
            SpeedDisc(0.0, 0.0, 0, radius, penalty)


def test_the_noise_is_left_alone() -> None:
    noise = Noise.of(1, "x")
    SpeedDisc(0.0, 0.0, 0, 1.0).restrict(ring(2.0), ring(2.0), np.zeros(1))
    assert noise.draw == 0
