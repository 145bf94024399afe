"""Both ways of feeding the vertical front end, checkpoints, the order of equal times, and bad data."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from made_up_vertical import gait, recording, trapezoid_speed

from wayfuse.core.errors import ConfigError
from wayfuse.inertial.front_end import InertialFrontEnd, StepEvents
from wayfuse.inertial.vertical import Behaviour, VerticalEvent
from wayfuse.inertial.vertical_front_end import VerticalConfig, VerticalFrontEnd, VerticalState
from wayfuse.sensors.recording import Recording, Series
from wayfuse.sensors.records import Acceleration, MagneticField, Pressure, Waypoint


def steps_of(r: Recording) -> StepEvents:
    front_end = InertialFrontEnd()
    return front_end.run(front_end.init(), r)[1]


def eventful(seed: int = 0) -> Recording:
    """Walk, climb 3 m, walk, stand, ride 6 m down; times rounded so that many coincide."""
    t = np.round(np.arange(0.0, 75.0, 0.02), 2)
    speed = trapezoid_speed(t, 15.0, 3.0, 0.3, 0.6) + trapezoid_speed(t, 48.0, -6.0, 0.8, 1.5)
    r = recording(t, speed, seed=seed, sway=gait(t, 5.0, 33.0))
    return replace(r, rotation_rate=Series(t, r.rotation_rate.values))


def one_by_one(
    front_end: VerticalFrontEnd, r: Recording, steps: StepEvents, steps_first: bool = False
) -> tuple[VerticalState, list[VerticalEvent]]:
    state, out = front_end.init(), []
    left = [type("Step", (), {"t": t})() for t in steps.t]
    for record in r.records():
        while left and (left[0].t < record.t or (steps_first and left[0].t <= record.t)):
            state, event = front_end.on_step(state, left.pop(0))
            out.append(event)
        state, event = front_end.step(state, record)
        out.append(event)
    for step in left:
        state, event = front_end.on_step(state, step)
        out.append(event)
    return state, [e for e in out if e is not None]


def same(a: list[VerticalEvent], b: list[VerticalEvent]) -> bool:
    return len(a) == len(b) and all(np.array_equal(x, y, equal_nan=True) for x, y in zip(a, b, strict=True))


@pytest.mark.parametrize("use_pressure", [True, False])
@pytest.mark.parametrize("steps_first", [True, False])
def test_records_one_by_one_give_the_same_bits(use_pressure, steps_first):
    r = eventful()
    steps = steps_of(r)
    front_end = VerticalFrontEnd(VerticalConfig(use_pressure=use_pressure))
    state, events = front_end.run(front_end.init(), r, steps)
    state_1, events_1 = one_by_one(front_end, r, steps, steps_first)
    assert len(events) > 10
    assert same(events, events_1)
    assert np.array_equal(state.memory, state_1.memory, equal_nan=True)


@settings(max_examples=20)
@given(
    cuts=st.lists(st.floats(0.0, 75.0), max_size=5),
    seed=st.integers(0, 5),
    use_pressure=st.booleans(),
)
def test_pieces_give_the_same_bits_and_states_are_values(cuts, seed, use_pressure):
    r = eventful(seed)
    steps = steps_of(r)
    front_end = VerticalFrontEnd(VerticalConfig(use_pressure=use_pressure))
    whole_state, whole = front_end.run(front_end.init(), r, steps)
    state, pieces = front_end.init(), []
    for start, stop in pairwise([-np.inf, *sorted(cuts), np.inf]):
        before = state.memory.copy()
        after, events = front_end.run(state, r, steps, start, stop)
        assert np.array_equal(state.memory, before, equal_nan=True)
        state, pieces = after, pieces + events
    assert same(pieces, whole)
    assert np.array_equal(state.memory, whole_state.memory, equal_nan=True)


def test_reports_of_a_movement_come_each_second_and_end_once():
    r = eventful()
    front_end = VerticalFrontEnd()
    state, events = front_end.run(front_end.init(), r, steps_of(r))
    assert [(e.behaviour, np.sign(e.rise)) for e in events if e.is_over] == [
        (Behaviour.STAIRS, 1),
        (Behaviour.LIFT, -1),
    ]
    for began in {e.began for e in events}:
        one = [e for e in events if e.began == began]
        assert [e.is_over for e in one] == [False] * (len(one) - 1) + [True]
        assert all(1.0 <= b.t - a.t <= 1.3 for a, b in pairwise(one[:-1]))
        assert np.isnan([e.ended for e in one[:-1]]).all()
        assert one[0].began < one[-1].ended < one[-1].t
        assert all(e.has_pressure and e.sigma > 0.0 for e in one)
    assert front_end.flush(state, 80.0)[1] is None


@pytest.mark.parametrize("use_pressure", [True, False])
def test_flush_ends_what_is_under_way_once(use_pressure):
    r = eventful()
    front_end = VerticalFrontEnd(VerticalConfig(use_pressure=use_pressure))
    state, events = front_end.run(front_end.init(), r, steps_of(r), stop=54.0)
    assert not events[-1].is_over
    flushed, event = front_end.flush(state, 54.0)
    assert (event.is_over, event.began) == (True, events[-1].began)
    assert event.rise < -1.0
    assert front_end.flush(flushed, 54.0)[1] is None
    assert front_end.flush(front_end.init(), 0.0)[1] is None


def test_altitude_follows_the_barometer_and_is_nan_without():
    r = eventful()
    steps = steps_of(r)
    for use_pressure, expected in ((True, -3.0), (False, np.nan)):
        front_end = VerticalFrontEnd(VerticalConfig(use_pressure=use_pressure))
        assert np.isnan(front_end.altitude(front_end.init()))
        state, _ = front_end.run(front_end.init(), r, steps)
        # 0.12 hPa per metre of the made-up air against the standard atmosphere: 2 %
        assert front_end.altitude(state) == pytest.approx(expected, abs=0.25, nan_ok=True)


def test_other_records_change_nothing():
    front_end = VerticalFrontEnd()
    state = front_end.init()
    for record in (MagneticField(0.0, 1.0, 2.0, 3.0), Waypoint(0.0, 1.0, 2.0, "0")):
        after, event = front_end.step(state, record)
        assert (after is state, event) == (True, None)


@pytest.mark.parametrize("use_pressure", [True, False])
def test_bad_records_leave_the_reports_as_they_are(use_pressure):
    """NaN, infinite, absurd and late records between the good ones."""
    r = eventful()
    steps = steps_of(r)
    front_end = VerticalFrontEnd(VerticalConfig(use_pressure=use_pressure))
    _, expected = front_end.run(front_end.init(), r, steps)
    state, out = front_end.init(), []
    left = list(steps.t)
    bad = [Acceleration(np.nan, 0.0, 0.0, 9.8), Pressure(np.inf, 1000.0)]
    for n, record in enumerate(r.records()):
        while left and left[0] < record.t:
            state, event = front_end.on_step(state, type("Step", (), {"t": left.pop(0)})())
            out.append(event)
        late = max(record.t - 1.5, 0.0)
        for extra in (
            *bad,
            Acceleration(record.t, np.inf, 0.0, 0.0),
            Acceleration(record.t, 1e7, 0.0, 0.0),
            Pressure(record.t, -5.0),
            Pressure(record.t, np.nan),
        ):
            state, event = front_end.step(state, extra)
            out.append(event)
        state, event = front_end.step(state, record)
        out.append(event)
        if n > 500 and n % 50 == 0 and isinstance(record, Acceleration):
            state, event = front_end.step(state, Acceleration(late, 30.0, 30.0, 30.0))
            out.append(event)
    assert same([e for e in out if e is not None], expected)


def test_a_gap_ends_the_movement_and_a_clock_set_back_starts_afresh():
    r = eventful()
    steps = steps_of(r)
    keep = (r.acceleration.t < 54.0) | (r.acceleration.t > 70.0)
    cut = replace(
        r,
        acceleration=Series(r.acceleration.t[keep], r.acceleration.values[keep]),
        rotation_rate=r.rotation_rate.between(-np.inf, 54.0),
        pressure=r.pressure.between(-np.inf, 54.0),
    )
    front_end = VerticalFrontEnd()
    state, events = front_end.run(front_end.init(), cut, steps)
    assert (events[-1].is_over, events[-1].behaviour) == (True, Behaviour.LIFT)
    assert events[-1].ended == pytest.approx(54.0, abs=0.5)
    assert events[-1].t > 70.0
    _, again = front_end.run(state, r, steps)  # the same walk again: the clock jumps back by 75 s
    assert [e.behaviour for e in again if e.is_over] == [Behaviour.STAIRS, Behaviour.LIFT]


def test_settings_that_make_no_sense_are_refused():
    for name in ("least_rise", "belief", "tilt_tau"):
        with pytest.raises(ConfigError, match=name):
            VerticalConfig(**{name: -1.0})
