"""Both paths of the front end, its robustness and its steps, on made-up walks."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from made_up_gait import walk
from scipy.spatial.transform import Rotation

from wayfuse.core.angles import wrap
from wayfuse.core.errors import ConfigError
from wayfuse.formats import ms_indoor as ms_indoor_format
from wayfuse.inertial.behaviour import behaviour_at, is_walking, walking_bouts
from wayfuse.inertial.front_end import InertialConfig, InertialFrontEnd, StepEvents
from wayfuse.inertial.step_length import DEFAULTS, MODELS
from wayfuse.inertial.steps import detect_steps
from wayfuse.sensors.recording import Recording, Series
from wayfuse.sensors.records import Acceleration, Orientation, Pressure

SENSORS = ("acceleration", "rotation_rate", "magnetic_field", "orientation")


def run(recording: Recording, front_end: InertialFrontEnd | None = None) -> StepEvents:
    f = front_end or InertialFrontEnd()
    return f.run(f.init(), recording)[1]


def one_by_one(recording: Recording, front_end: InertialFrontEnd) -> tuple[np.ndarray, np.ndarray]:
    state, rows = front_end.init(), []
    for record in recording.records():
        state, event = front_end.step(state, record)
        if event is not None:
            rows.append(event)
    return state.memory, np.array(rows).reshape(-1, 9)


def without(recording: Recording, *names: str) -> Recording:
    return replace(recording, **{n: Series.empty(4 if n == "orientation" else 3) for n in names})


def spoiled(recording: Recording, seed: int) -> Recording:
    """NaN samples, a gap, repeated times and equal times across sensors."""
    rng = np.random.default_rng(seed)
    columns = {}
    for name in SENSORS:
        s = getattr(recording, name)
        t, v = np.round(s.t, 2), s.values.copy()  # rounding makes times coincide
        v[rng.integers(0, len(v), 5)] = np.nan
        keep = (t < 8.0) | (t > 9.7)
        columns[name] = Series(t[keep], v[keep])
    return replace(recording, **columns)


@settings(max_examples=25, deadline=None)
@given(
    seed=st.integers(0, 99),
    cuts=st.lists(st.floats(-1.0, 30.0), max_size=4),
    model=st.sampled_from(MODELS),
    missing=st.sets(st.sampled_from(SENSORS), max_size=3),
    source=st.sampled_from(["pulled", "orientation"]),
)
def test_arrays_in_any_pieces_equal_records_one_by_one(seed, cuts, model, missing, source):
    recording = without(spoiled(walk(seed, steps=20, turn_rate=0.2, jitter=0.3), seed), *missing)
    front_end = InertialFrontEnd(InertialConfig(heading_source=source), DEFAULTS[model])
    memory, rows = one_by_one(recording, front_end)
    state, pieces = front_end.init(), []
    edges = [-np.inf, *sorted(cuts), np.inf]
    for start, stop in pairwise(edges):
        before = state.memory.copy()
        after, events = front_end.run(state, recording, start, stop)
        assert np.array_equal(state.memory, before)
        state = after
        pieces.append(np.column_stack(events))
    assert np.array_equal(np.concatenate(pieces), rows)
    assert np.array_equal(state.memory, memory)


@pytest.mark.real_data
def test_arrays_equal_records_on_a_real_walk(ms_indoor: Path):
    path = sorted(ms_indoor.glob("F1/path_data_files/*.txt"))[0]
    recording = ms_indoor_format.read(path)
    front_end = InertialFrontEnd()
    memory, rows = one_by_one(recording, front_end)
    state, events = front_end.run(front_end.init(), recording)
    assert len(rows) > 10
    assert np.array_equal(np.column_stack(events), rows)
    assert np.array_equal(state.memory, memory)


@pytest.mark.parametrize("rate", [20.0, 50.0, 100.0, 400.0])
@pytest.mark.parametrize("cadence", [1.4, 1.8, 2.4])
def test_counts_the_steps_of_a_known_gait(rate, cadence):
    found = len(run(walk(1, steps=60, cadence=cadence, rate=rate, jitter=0.2)).t)
    assert abs(found - 60) <= 1


def test_counts_steps_as_scipy_does_away_from_the_edges():
    from scipy import signal

    recording = walk(3, steps=80, jitter=0.0)
    norm = np.linalg.norm(recording.acceleration.values, axis=1)
    high = signal.butter(2, 0.7, "highpass", fs=50, output="sos")
    low = signal.butter(2, 3.0, fs=50, output="sos")
    band = signal.sosfilt(low, signal.sosfilt(high, norm - norm[0]))
    falls = np.flatnonzero((band[:-1] > 0) & (band[1:] <= 0)) + 1
    t = recording.acceleration.t[falls]
    t = t[(t > 8) & (t < 40)]
    ours = run(recording).t
    np.testing.assert_allclose(ours[(ours > 8) & (ours < 40)], t, atol=1e-9)


def test_standing_and_tilting_make_no_steps():
    assert len(run(walk(2, steps=0)).t) == 0
    t = np.arange(0, 60, 0.02)
    tilt = Rotation.from_euler("X", 0.6 * np.sin(2 * np.pi * 0.3 * t)[:, None]).apply([0.0, 0.0, 9.81])
    assert len(detect_steps(Series(t, tilt))) == 0


def test_shaking_makes_no_steps_and_the_walk_after_it_counts():
    still, shaken = walk(4, steps=30), walk(4, steps=30)
    g, a = shaken.rotation_rate, shaken.acceleration
    wild = np.sin(2 * np.pi * 2.5 * g.t)[:, None] * np.array([6.0, 9.0, 3.0]) * (g.t < 10)[:, None]
    jolts = np.sin(2 * np.pi * 2.5 * a.t)[:, None] * 8.0 * (a.t < 10)[:, None]
    shaken = replace(
        shaken, rotation_rate=Series(g.t, g.values + wild), acceleration=Series(a.t, a.values + jolts)
    )
    times = run(shaken).t
    assert not np.any((times > 1.5) & (times < 10.0))
    assert abs(np.sum(times > 13.0) - np.sum(run(still).t > 13.0)) <= 1


@settings(max_examples=20, deadline=None)
@given(angle=st.floats(-3.1, 3.1), start=st.floats(-3.1, 3.1))
def test_turning_the_world_turns_the_headings_only(angle, start):
    one = run(walk(5, steps=12, heading=start, turn_rate=0.1))
    two = run(walk(5, steps=12, heading=start + angle, turn_rate=0.1))
    assert len(one.t) == len(two.t)
    assert 12 <= len(one.t) <= 13
    np.testing.assert_allclose(wrap(two.heading - one.heading - angle), 0.0, atol=1e-6)
    np.testing.assert_allclose(two.turn, one.turn, atol=1e-6)
    np.testing.assert_allclose(two.length, one.length, rtol=1e-6)


@settings(max_examples=20, deadline=None)
@given(x=st.floats(-3.0, 3.0), y=st.floats(-3.0, 3.0), z=st.floats(-3.0, 3.0))
def test_the_way_the_phone_is_held_changes_no_step(x, y, z):
    held = Rotation.from_rotvec([x, y, z])
    recording = walk(6, steps=12)
    turned = replace(
        recording,
        **{n: Series(s.t, held.apply(s.values)) for n in SENSORS[:3] for s in (getattr(recording, n),)},
        orientation=Series(
            recording.orientation.t,
            (Rotation.from_quat(recording.orientation.values, scalar_first=True) * held.inv()).as_quat(
                scalar_first=True
            ),
        ),
    )
    one, two = run(recording), run(turned)
    np.testing.assert_array_equal(one.t, two.t)
    np.testing.assert_allclose(one.peak, two.peak, rtol=1e-6)
    np.testing.assert_allclose(one.turn, two.turn, atol=1e-6)
    np.testing.assert_allclose(one.length, two.length, rtol=1e-6)


@pytest.mark.parametrize(
    "missing",
    [
        (),
        ("orientation",),
        ("rotation_rate",),
        ("rotation_rate", "magnetic_field"),
        ("orientation", "rotation_rate"),
    ],
    ids="-".join,
)
def test_heading_survives_missing_sensors(missing):
    recording = without(walk(7, steps=60, heading=-2.0, turn_rate=0.05), *missing)
    events = run(recording)
    late = events.t > 10.0
    truth = -2.0 + 0.05 * (events.t - 0.2)
    limit = 0.03 if "orientation" not in missing else 0.12
    assert np.max(np.abs(wrap(events.heading - truth))[late]) < limit
    assert np.sum(events.turn[late]) == pytest.approx(
        0.05 * (events.t[-1] - events.t[late][0] + 0.55), abs=0.15
    )


def test_without_any_absolute_heading_the_gyro_gives_a_relative_one():
    front_end = InertialFrontEnd()
    recording = without(walk(8, turn_rate=0.1), "orientation", "magnetic_field")
    state, events = front_end.run(front_end.init(), recording)
    assert not state.is_heading_absolute
    np.testing.assert_allclose(np.diff(events.heading), 0.1 * np.diff(events.t), atol=0.01)
    assert front_end.run(front_end.init(), walk(8))[0].is_heading_absolute


def test_without_accelerations_there_are_no_steps():
    assert len(run(without(walk(9), "acceleration")).t) == 0
    assert len(run(Recording("empty")).t) == 0


def test_a_biased_gyro_is_noticed():
    recording = walk(10, steps=200, heading=1.0, gyro_bias=0.1)
    kept = run(recording, InertialFrontEnd(InertialConfig(bias_drift=1e9)))
    events = run(recording)
    late = events.t > 40.0
    assert np.max(np.abs(wrap(events.heading - 1.0))[late]) < 0.15
    assert np.min(np.abs(wrap(kept.heading - 1.0))[late]) > 1.0


def test_late_and_foreign_records_change_nothing():
    front_end = InertialFrontEnd()
    state, _ = front_end.run(front_end.init(), walk(11), stop=10.0)
    t = state.memory[6]
    for record in (
        Acceleration(t - 0.5, 1.0, 2.0, 3.0),
        Acceleration(t + 0.01, np.nan, 0.0, 9.8),
        Orientation(t - 0.2, 1.0, 0.0, 0.0, 0.0),
        Orientation(t + 0.1, 0.0, 0.0, 0.0, 0.0),
        Pressure(t + 0.1, 1000.0),
    ):
        after, event = front_end.step(state, record)
        assert event is None
        np.testing.assert_array_equal(after.memory, state.memory)


def test_a_clock_set_back_starts_afresh():
    front_end = InertialFrontEnd()
    recording = walk(12, steps=30)
    state, first = front_end.run(front_end.init(), recording)
    _, again = front_end.run(state, recording)
    assert abs(len(again.t) - len(first.t)) <= 1


def test_nothing_after_a_step_is_used_for_it():
    recording = walk(13, steps=30, turn_rate=0.2)
    events = run(recording)
    front_end = InertialFrontEnd()
    _, cut = front_end.run(front_end.init(), recording, stop=float(events.t[14]))
    np.testing.assert_array_equal(np.column_stack(cut), np.column_stack(events)[:15])


def test_walking_and_standing():
    front_end = InertialFrontEnd()
    state, events = front_end.run(front_end.init(), walk(14, steps=20))
    assert is_walking(state, events.t[-1] + 1.9)
    assert not is_walking(state, events.t[-1] + 2.1)
    np.testing.assert_array_equal(walking_bouts(events.t), [[events.t[0], events.t[-1]]])
    assert walking_bouts([]).shape == (0, 2)
    assert behaviour_at(events.t, events.t).all()
    assert not behaviour_at([events.t[0] - 0.1], events.t).any()


@pytest.mark.parametrize(
    "wrong",
    [
        {"low_hz": 3.0},
        {"threshold": 0.0},
        {"heading_tau": float("nan")},
        {"heading_source": "compass"},
        {"heading_delay": 0.6},
        {"relative_threshold": 1.0},
    ],
)
def test_wrong_parameters_are_refused_by_name(wrong):
    with pytest.raises(ConfigError, match=next(iter(wrong))):
        InertialConfig(**wrong)


@pytest.mark.parametrize("sensor", ["acceleration", "rotation_rate", "magnetic_field", "orientation"])
def test_one_absurd_sample_costs_that_sample(sensor):
    recording = walk(steps=40)
    series: Series = getattr(recording, sensor)
    values = series.values.copy()
    values[len(values) // 3] = 1e200
    spoilt = run(replace(recording, **{sensor: Series(series.t, values)}))
    clean = run(recording)
    assert abs(len(spoilt.t) - len(clean.t)) <= 1
    assert np.all(np.isfinite(spoilt.heading))
    assert np.max(np.abs(wrap(spoilt.heading[-5:] - clean.heading[-5:]))) < 0.05
