"""After a silence in which the person can have gone anywhere, no method claims a place it cannot know."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from test_plain_engine import STEP, Louder, engine
from test_tracker import FEW, make, paused

from wayfuse.models.motion.random_walk import RandomWalk
from wayfuse.presets import fused
from wayfuse.tracking.dead_reckoning import Start
from wayfuse.tracking.estimate import Estimate, State
from wayfuse.tracking.tracker import Tracker

START, SILENCE = Start(20.0, 11.0, 0), 3600.0


def before_and_after(tracker: Tracker[Any], recording: Any) -> tuple[list[Estimate], list[Estimate]]:
    said = tracker.run(paused(recording, 12.0, SILENCE)).estimates
    gap = int(np.argmax(np.diff([e.t for e in said])))
    assert said[gap + 1].t - said[gap].t > SILENCE - 10.0
    return said[: gap + 1], said[gap + 1 :]


def test_dead_reckoning_goes_on_from_the_last_place_and_is_lost(world: Any) -> None:
    before, after = before_and_after(make(world, "pdr"), world.walks[0])
    last, first = before[-1], after[0]
    assert np.hypot(last.x - START.x, last.y - START.y) > 3.0
    # the last place it knew, not the start; at most a step may have been made since
    assert np.hypot(first.x - last.x, first.y - last.y) < 1.5
    assert {e.state for e in before} == {State.TRACKING}
    assert {e.state for e in after} == {State.LOST}
    assert min(e.r95 for e in after) > 1.0 * SILENCE  # a person walks a metre a second and more


def test_without_wifi_a_track_is_lost_in_the_whole_building(world: Any) -> None:
    tracker = fused.build_from_start(world.site, START, FEW)
    before, after = before_and_after(tracker, world.walks[0])
    assert {e.state for e in before} == {State.TRACKING}
    prior = fused.prior_estimate(world.site)
    assert sum(e.n_steps for e in after) == 0
    assert {(e.x, e.y, e.r95, e.state) for e in after} == {(prior.x, prior.y, prior.r95, State.LOST)}


@pytest.mark.parametrize("lag", [0.0, 5.0])
def test_a_start_that_was_told_is_not_told_again(world: Any, lag: float) -> None:
    recording, prior = world.walks[0], fused.prior_estimate(world.site)
    tracker = fused.build(world.site, world.survey, FEW, start=START, lag=lag)
    _, after = before_and_after(tracker, recording)
    unstarted = fused.build(world.site, world.survey, FEW, lag=lag)
    _, want = before_and_after(unstarted, recording)
    assert (after[0].state, after[0].r95) == (State.INITIALISING, prior.r95)
    assert after[-1].state is State.TRACKING
    assert [(e.t, e.x, e.y, e.floor) for e in after] == [(e.t, e.x, e.y, e.floor) for e in want]


def test_the_engine_of_the_papers_widens_where_its_start_was_told() -> None:
    plain = engine(starts_unseen=True, quiet=RandomWalk(1.0))
    state = plain.init("a", 0)
    for _ in range(50):
        state = plain.on_step(state, STEP)
    before = plain.estimate(state, 30.0)[1]
    after = plain.estimate(plain.resume(state, "a@930", 0, 900.0), 930.0)[1]
    assert before.x > 25.0  # it began in the square of 20 m
    assert np.hypot(after.x - before.x, after.y - before.y) < 5.0
    assert after.r95 > 60.0 > 3.0 * before.r95  # 30 m an axis


def test_the_engine_of_the_papers_begins_again_where_its_start_was_seen() -> None:
    plain = engine(observation=Louder(), ranging=None)
    assert plain.resume(plain.init("a", 0), "a@930", 0, 900.0) == plain.init("a@930", 0)
