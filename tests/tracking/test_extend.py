"""Batches give the bits of their records one by one; steps that a phone worked out itself move a track."""

from __future__ import annotations

from collections import Counter
from dataclasses import fields, is_dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from wayfuse.presets import fused
from wayfuse.presets.fused import Config
from wayfuse.sensors.quality import Verdict
from wayfuse.sensors.recording import Recording, Series
from wayfuse.sensors.records import Range, Step
from wayfuse.tracking.estimate import State
from wayfuse.tracking.track_state import Batch, TrackState
from wayfuse.tracking.tracker import Tracker

FEW = Config(n_particles=60)


def between(recording: Recording, low: float, high: float) -> Recording:
    """Records with low < t <= high."""

    def cut(column: Any) -> Any:
        if isinstance(column, Series):
            return column.between(low, high)
        return tuple(r for r in column if low < r.t <= high)

    names = ("acceleration", "rotation_rate", "magnetic_field", "pressure", "orientation", "wifi", "ble", "ranges",
             "steps", "csi", "waypoints")  # fmt: skip
    return replace(recording, **{name: cut(getattr(recording, name)) for name in names})


def by_record(tracker: Tracker[Any], state: TrackState[Any], recording: Recording) -> Batch[Any]:
    out: list[Any] = []
    counts: Counter[Verdict] = Counter()
    for record in recording.records():
        state, said, verdict = tracker.step(state, record)
        out += said
        counts[verdict] += 1
    return Batch(state, out, counts, Counter())


def same(a: Any, b: Any, where: str = "state") -> None:
    """Equal to the bit, all the way down."""
    assert type(a) is type(b), where
    if isinstance(a, np.ndarray):
        np.testing.assert_array_equal(a, b, err_msg=where)
    elif is_dataclass(a):
        for f in fields(a):
            same(getattr(a, f.name), getattr(b, f.name), f"{where}.{f.name}")
    elif isinstance(a, tuple | list):
        assert len(a) == len(b), where
        for k, (x, y) in enumerate(zip(a, b, strict=True)):
            same(x, y, f"{where}[{k}]")
    elif isinstance(a, float):
        assert a == b or (np.isnan(a) and np.isnan(b)), where
    else:
        assert a == b, where


@pytest.fixture(scope="module", params=[0.0, 3.0], ids=["online", "lag"])
def tracker(world: Any, request: pytest.FixtureRequest) -> Tracker[Any]:
    return fused.build(world.site, world.survey, FEW, lag=request.param)


@settings(max_examples=12)
@given(st.lists(st.floats(0.0, 1.0), min_size=0, max_size=12), st.integers(0, 2))
def test_any_batches_give_the_bits_of_single_records(
    tracker: Tracker[Any], world: Any, cuts: list[float], which: int
) -> None:
    recording = world.walks[which]
    start, end = recording.span
    times = [-np.inf, *sorted(start + c * (end - start) for c in cuts), np.inf]
    state = tracker.init(recording.name, 3)
    out = []
    n = 0
    for low, high in pairwise(times):
        part = between(recording, low, high)
        batch = tracker.extend(state, part)
        state = batch.state
        out += batch.estimates
        n += batch.scans.total() + batch.others.total()
        assert n == between(replace(recording, waypoints=()), -np.inf, high).n_records
    one = by_record(tracker, tracker.init(recording.name, 3), replace(recording, waypoints=()))
    same(state, one.state)
    assert out == one.estimates
    rest, other = tracker.flush(state, end)[1], tracker.flush(one.state, end)[1]
    assert out + rest == one.estimates + other == tracker.run(recording, 3).estimates


@pytest.mark.parametrize("pause", [200.0, 299.0, 301.0, 4000.0])
def test_a_pause_between_batches_is_a_pause(tracker: Tracker[Any], world: Any, pause: float) -> None:
    first, second = world.walks[0], world.walks[1]
    shift = first.span[1] + pause - second.span[0]
    moved = shifted(second, shift)
    state = tracker.extend(tracker.init("p", 1), first).state
    batch = tracker.extend(state, moved)
    one = by_record(tracker, by_record(tracker, tracker.init("p", 1), first).state, moved)
    same(batch.state, one.state)
    assert batch.estimates == one.estimates


def shifted(recording: Recording, by: float) -> Recording:
    """The recording so many seconds later, of its motion sensors and scans."""
    series = {
        name: Series(getattr(recording, name).t + by, getattr(recording, name).values)
        for name in ("acceleration", "rotation_rate", "magnetic_field", "pressure", "orientation")
    }
    scans = tuple(replace(s, t=s.t + by, last_seen=s.last_seen + by) for s in recording.wifi)
    return replace(recording, **series, wifi=scans, ble=(), ranges=(), csi=(), waypoints=())


def test_a_batch_of_the_past_is_late_and_changes_nothing(tracker: Tracker[Any], world: Any) -> None:
    recording = world.walks[0]
    state = tracker.extend(tracker.init("x", 0), recording).state
    again = tracker.extend(state, between(recording, -np.inf, recording.span[1] - 5.0))
    same(again.state, state)
    assert not again.estimates
    assert set(again.others) | set(again.scans) <= {Verdict.LATE, Verdict.IGNORED}


def test_an_empty_batch_is_nothing(tracker: Tracker[Any]) -> None:
    state = tracker.init("x", 0)
    assert tracker.extend(state, Recording("x")) == Batch(state, [], Counter(), Counter())


def test_batches_with_ranges_go_record_by_record(tracker: Tracker[Any], world: Any) -> None:
    recording = replace(world.walks[0], ranges=(Range(world.walks[0].wifi[2].t, 1, 4.0),))
    batch = tracker.extend(tracker.init("x", 0), recording)
    one = by_record(tracker, tracker.init("x", 0), replace(recording, waypoints=()))
    assert batch.estimates == one.estimates
    assert batch.others[Verdict.IGNORED] >= 1  # fused without anchors makes nothing of ranges


def steps_of(world: Any, recording: Recording) -> tuple[Step, ...]:
    """The steps that the walker of a simulated recording took, as a phone would send them."""
    truth = world.truth[recording.name]
    toward = np.diff(truth.at(truth.contacts), axis=0)
    rotation = world.site.anchor.rotation if world.site.anchor is not None else 0.0
    return tuple(
        Step(float(t), float(np.hypot(*d)), float(np.arctan2(d[1], d[0]) + rotation))
        for t, d in zip(truth.contacts[1:], toward, strict=True)
    )


def test_steps_of_the_phone_do_for_its_sensors(world: Any) -> None:
    """A phone that sends steps and scans alone is tracked about as well as one that sends all its samples."""
    recording = world.walks[0]
    truth, steps = world.truth[recording.name], steps_of(world, recording)
    tracker = fused.build(world.site, world.survey, Config(n_particles=500))
    told = tracker.run(Recording(recording.name, steps=steps, wifi=recording.wifi), 0).estimates
    felt = tracker.run(recording, 0).estimates

    def error(estimates: list[Any]) -> float:
        said = [e for e in estimates if e.state is not State.INITIALISING]
        places = truth.at(np.array([e.t for e in said]))
        return float(np.mean(np.hypot(*(np.array([(e.x, e.y) for e in said]) - places).T)))

    assert sum(e.n_steps for e in told) == len([s for s in steps if s.t > recording.wifi[0].t])
    assert error(told) < error(felt) + 0.5


def test_a_phone_that_sends_no_steps_any_more_stands(world: Any) -> None:
    """Who told its steps and tells none is standing, though no sample of a sensor says so."""
    recording = world.walks[0]
    steps = steps_of(world, recording)[:20]
    walked = Recording("x", steps=steps, wifi=tuple(s for s in recording.wifi if s.t < steps[-1].t))
    tracker = fused.build(world.site, world.survey, Config(n_particles=500))
    state, out, _, _ = tracker.extend(tracker.init("x", 0), walked)
    _, later = tracker.flush(state, steps[-1].t + 20.0)
    assert later[-1].t > steps[-1].t + 18.0
    assert later[-1].r95 < out[-1].r95 + 0.1


def test_who_tells_its_steps_is_not_moved_by_its_samples_as_well(world: Any) -> None:
    recording = replace(world.walks[0], waypoints=())
    steps = steps_of(world, recording)
    tracker = fused.build(world.site, world.survey, FEW)
    first = tracker.step(tracker.init("x", 0), steps[0])[0]
    batch = tracker.extend(first, recording)
    one = by_record(tracker, first, recording)
    same(batch.state, one.state)
    assert batch.estimates == one.estimates
    assert batch.estimates[-1].n_steps == 0


def test_bad_steps_have_verdicts_and_an_unknown_length_is_the_usual_one(world: Any) -> None:
    tracker = fused.build(world.site, world.survey, FEW)
    state = tracker.init("x", 0)
    nan = float("nan")
    for record, verdict in (
        (Step(1.0, 0.7, nan), Verdict.NOT_FINITE),
        (Step(1.0, float("inf"), 0.0), Verdict.NOT_FINITE),
        (Step(1.0, -0.1, 0.0), Verdict.OUT_OF_RANGE),
        (Step(1.0, 9.0, 0.0), Verdict.OUT_OF_RANGE),
        (Step(1.0, nan, 7.0), Verdict.USED),
        (Step(0.5, 0.7, 0.0), Verdict.LATE),
    ):
        state, _, found = tracker.step(state, record)
        assert found is verdict
    assert state.is_told
