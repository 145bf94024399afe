"""With a lag an estimate waits for what comes after it, is for the time it names, and is better."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from wayfuse.presets import fused
from wayfuse.sensors.records import WifiScan
from wayfuse.tracking.estimate import State

FEW = fused.Config(n_particles=400)


def mean_error(world: Any, lag: float) -> float:
    off = []
    for recording in world.walks:
        truth = world.truth[recording.name]
        first = recording.wifi[0].t
        for seed in range(2):
            said = [
                e
                for e in fused.build(world.site, world.survey, FEW, lag=lag).run(recording, seed).estimates
                if e.t >= first
            ]
            at = truth.at(np.array([e.t for e in said]))
            off += np.hypot(*(np.array([(e.x, e.y) for e in said]) - at).T).tolist()
    return float(np.mean(off))


def test_a_lag_makes_estimates_better(world: Any) -> None:
    assert mean_error(world, 5.0) < mean_error(world, 0.0)


@pytest.mark.parametrize("lag", [0.5, 5.0])
def test_estimates_come_once_their_lag_is_over_and_not_before(world: Any, lag: float) -> None:
    recording = world.walks[0]
    tracker = fused.build(world.site, world.survey, FEW, lag=lag)
    state, n, marked = tracker.init("x"), 0, 0
    for record in recording.records():
        before = state.pending
        state, out, _ = tracker.step(state, record)
        n += len(out)
        if out:
            assert all(e.t + lag < record.t for e in out)
            assert [e.t for e in out] == list(before + state.pending)[: len(out)]
        assert all(t + lag >= record.t for t in state.pending)
        marked = max(marked, len(state.pending))
    state, rest = tracker.flush(state, state.now)
    assert n > 20
    assert len(rest) > 0
    assert state.pending == ()
    assert state.engine.marks == ()
    assert marked < 60  # what is kept does not grow with the track


def test_moments_before_the_first_fix_stay_unknown(world: Any) -> None:
    recording = world.walks[0]
    late = replace(recording, wifi=tuple(s for s in recording.wifi if s.t > recording.span[0] + 10.0))
    first = late.wifi[0].t
    prior = fused.prior_estimate(world.site)
    for e in fused.build(world.site, world.survey, FEW, lag=5.0).run(late).estimates:
        if e.t < first:
            assert (e.x, e.y, e.state) == (prior.x, prior.y, State.INITIALISING)
        else:
            assert (e.x, e.y) != (prior.x, prior.y)


def test_two_scans_of_one_moment_keep_their_order(world: Any) -> None:
    recording = world.walks[0]
    first = recording.wifi[0]
    foreign = WifiScan(first.t, np.uint64([3]), np.float32([-50]), np.int32([0]), np.array([first.t]))
    both = replace(recording, wifi=(foreign, *recording.wifi))
    said = [
        e for e in fused.build(world.site, world.survey, FEW, lag=3.0).run(both).estimates if e.t == first.t
    ]
    prior = fused.prior_estimate(world.site)
    assert [(e.x, e.y) == (prior.x, prior.y) for e in said] == [True, False]
