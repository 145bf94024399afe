"""Where every particle is blocked, the motion is sampled again and more widely."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wayfuse.core.errors import ConfigError
from wayfuse.core.philox import Noise
from wayfuse.core.types import Array
from wayfuse.filters.cloud import Cloud
from wayfuse.filters.particle_filter import FilterState, ParticleFilter
from wayfuse.filters.widening import WideningFilter, scaling
from wayfuse.models.motion.pdr import PdrMotion, StepInput
from wayfuse.models.motion.random_walk import RandomWalk
from wayfuse.presets import fused

KEY = (3, 4)
N = 200


@dataclass(frozen=True)
class Gap:
    """A wall at x = 1 with an opening for |y| > ``start``: the straight way is blocked."""

    start: float
    penalty: float = 1.0

    def restrict(self, before: Cloud, after: Cloud, log_weights: Array) -> tuple[Cloud, int]:
        share = (1.0 - before.x) / (after.x - before.x)
        y = before.y + share * (after.y - before.y)
        blocked = (after.x <= 1.0) | (np.abs(y) < self.start)  # who has not come through is no way out
        log_weights[blocked] -= self.penalty
        x, y = np.where(blocked, before.x, after.x), np.where(blocked, before.y, after.y)
        return after._replace(x=x, y=y), int(blocked.sum())


def start(n: int = N) -> FilterState:
    zero = np.zeros(n, np.float32)
    return FilterState(Cloud.on_floors(zero, zero, zero, zero + 1, np.zeros(n, np.int32)), np.zeros(n), 7)


STEP = StepInput(2.0, 0.0)
MOTION = PdrMotion(heading_sigma=0.02)
WIDENING = WideningFilter(wider=scaling("heading_sigma"))


def equal(a: FilterState, b: FilterState) -> None:
    assert a.draw == b.draw
    for one, other in zip((*a.cloud, a.log_weights), (*b.cloud, b.log_weights), strict=True):
        np.testing.assert_array_equal(one, other)


def test_somebody_gets_through_where_all_were_blocked() -> None:
    plain, n = ParticleFilter().predict(KEY, start(), MOTION, STEP, Gap(0.3))
    assert n == N
    assert np.all(plain.cloud.x == 0.0)
    after, n = WIDENING.predict(KEY, start(), MOTION, STEP, Gap(0.3))
    assert 0 < N - n < N
    passed = after.cloud.x > 1.0
    assert np.count_nonzero(passed) == N - n
    np.testing.assert_array_equal(after.log_weights[~passed], -1.0)  # once, not once per round
    np.testing.assert_array_equal(after.log_weights[passed], 0.0)
    assert after.draw > start().draw + 1


def test_the_disturbance_grows_no_further_than_is_needed() -> None:
    """The factors asked for are 2, 4, 8, ... and end with the first that lets one through."""
    asked = []

    def wider(motion: PdrMotion, factor: float) -> PdrMotion:
        asked.append(factor)
        return replace(motion, heading_sigma=factor * motion.heading_sigma)

    after, n = WideningFilter(wider=wider).predict(KEY, start(), MOTION, STEP, Gap(0.3))
    assert asked == [2.0**k for k in range(1, len(asked) + 1)]
    assert n < N
    assert len(asked) >= 2
    short, n = WideningFilter(wider=wider, rounds=len(asked) - 1).predict(
        KEY, start(), MOTION, STEP, Gap(0.3)
    )
    assert n == N
    assert short.draw == after.draw - 1  # each round has one draw of its own


def test_where_somebody_passes_at_once_it_is_the_plain_filter() -> None:
    for constraint in (None, Gap(0.0), Gap(0.02)):
        plain, n = ParticleFilter().predict(KEY, start(), MOTION, STEP, constraint)
        assert n < N
        again, m = WIDENING.predict(KEY, start(), MOTION, STEP, constraint)
        assert m == n
        equal(again, plain)


def test_a_cloud_that_cannot_move_is_left_as_the_constraint_leaves_it() -> None:
    shut = Gap(1e9)
    after, n = WIDENING.predict(KEY, start(), MOTION, STEP, shut)
    assert n == N
    np.testing.assert_array_equal(after.cloud.x, 0.0)
    np.testing.assert_array_equal(after.log_weights, -1.0)
    assert after.draw == start().draw + 1 + WIDENING.rounds
    none = WideningFilter(wider=scaling("heading_sigma"), rounds=0)
    plain, _ = ParticleFilter().predict(KEY, start(), MOTION, STEP, shut)
    equal(none.predict(KEY, start(), MOTION, STEP, shut)[0], plain)


@given(gap=st.floats(0.0, 3.0), seed=st.integers(0, 1000))
def test_equal_states_give_equal_bits_and_are_left_alone(gap: float, seed: int) -> None:
    state = start(30)._replace(draw=seed)
    kept = [column.copy() for column in (*state.cloud, state.log_weights)]
    one, n = WIDENING.predict(KEY, state, MOTION, STEP, Gap(gap))
    two, m = WIDENING.predict(KEY, state, MOTION, STEP, Gap(gap))
    assert n == m
    equal(one, two)
    for now, then in zip((*state.cloud, state.log_weights), kept, strict=True):
        np.testing.assert_array_equal(now, then)
    assert np.all(np.isfinite(one.cloud.x) & np.isfinite(one.log_weights))
    assert seed < one.draw <= seed + 1 + WIDENING.rounds


def test_any_motion_model_can_be_widened() -> None:
    wide = WideningFilter(wider=scaling("sigma"), growth=4.0)
    after, n = wide.predict(KEY, start(), RandomWalk(0.2), 1.0, Gap(0.1))
    assert n < N
    assert np.any(after.cloud.x > 1.0)
    both = scaling("length_sigma", "heading_sigma")(MOTION, 3.0)
    assert (both.length_sigma, both.heading_sigma) == pytest.approx((0.45, 0.06))
    assert both.bias_sigma == MOTION.bias_sigma


def test_history_and_updates_are_those_of_the_filter_inside() -> None:
    state = start()
    log_likelihood = -np.linspace(0.0, 30.0, N)
    a, told = WIDENING.update(KEY, state, log_likelihood)
    b, want = ParticleFilter().update(KEY, state, log_likelihood)
    equal(a, b)
    assert told == want
    assert told.resampled
    assert WIDENING.update(KEY, state, np.zeros(N), always_resample=True)[1].resampled


def test_it_takes_the_place_of_the_filter_of_a_track(world: Any) -> None:
    tracker = fused.build(world.site, world.survey, fused.Config(n_particles=60, map_constraint="barriers"))
    wide = WideningFilter(wider=scaling("length_sigma", "heading_sigma"))
    other = replace(tracker, engine=replace(tracker.engine, filter=wide))
    recording = world.walks[0]
    truth = world.truth[recording.name]
    off = []
    for one in (tracker, other):
        said = [e for e in one.run(recording, 1).estimates if e.t >= recording.wifi[0].t]
        at = truth.at(np.array([e.t for e in said]))
        off.append(np.hypot(*(np.array([(e.x, e.y) for e in said]) - at[:, :2]).T).mean())
    assert np.all(np.isfinite(off))
    assert off[1] < off[0] + 1.0


@pytest.mark.parametrize(("name", "value"), [("growth", 1.0), ("growth", np.nan), ("rounds", -1)])
def test_parameters_out_of_range_are_refused(name: str, value: Any) -> None:
    with pytest.raises(ConfigError, match=name):
        replace(WIDENING, **{name: value})


def test_the_noise_of_a_round_does_not_depend_on_the_number_of_particles() -> None:
    few, _ = WIDENING.predict(KEY, start(5), MOTION, STEP, Gap(1e9))
    many, _ = WIDENING.predict(KEY, start(50), MOTION, STEP, Gap(1e9))
    assert few.draw == many.draw
    np.testing.assert_array_equal(Noise(KEY, few.draw).normals(5), Noise(KEY, many.draw).normals(50)[:, :5])
