"""The series of chu2009, its walking direction and its stride regression."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from wayfuse.core.angles import wrap
from wayfuse.core.errors import ConfigError, UsageError
from wayfuse.inertial.front_end import InertialFrontEnd, StepEvents
from wayfuse.inertial.series import (
    floor_counts,
    floor_probabilities,
    horizontal_series,
    ride_series,
    stair_series,
)
from wayfuse.inertial.stride_regression import (
    StrideRegression,
    fit_stride_regression,
    pulse_features,
)
from wayfuse.inertial.vertical import Behaviour, VerticalEvent
from wayfuse.inertial.walking_direction import horizontal_acceleration, walking_direction


def steps(t: np.ndarray, length: np.ndarray, heading: np.ndarray) -> StepEvents:
    empty = np.zeros_like(t)
    return StepEvents(t, length, heading, empty, empty, empty, empty, empty, empty)


def event(
    t: float, began: float, behaviour: Behaviour, rise: float, n_steps: int, over: bool
) -> VerticalEvent:
    return VerticalEvent(t, began, behaviour, rise, 0.5, n_steps, over, t - 3 if over else np.nan, True)


@given(seed=st.integers(0, 1000), period=st.floats(0.3, 5.0))
def test_the_horizontal_series_adds_up_to_the_walk(seed, period):
    rng = np.random.default_rng(seed)
    t = np.sort(rng.uniform(0.0, 20.0, 30))
    s = steps(t, rng.uniform(0.4, 0.8, 30), rng.uniform(-np.pi, np.pi, 30))
    h = horizontal_series(s, 2.0, 17.0, period)
    assert 17.0 - 1e-6 <= h.t[-1] < 17.0 + period
    for i, (start, stop) in enumerate(pairwise([2.0, *h.t])):
        inside = (t > start) & (t <= min(stop, 17.0))
        expected = (s.length * np.exp(1j * s.heading))[inside].sum()
        assert h.displacement[i] == pytest.approx([expected.real, expected.imag])


def test_series_of_nothing_are_empty_or_zero():
    none = steps(np.empty(0), np.empty(0), np.empty(0))
    assert np.array_equal(horizontal_series(none, 0.0, 3.0).displacement, np.zeros((3, 2)))
    assert len(stair_series([]).t) == len(ride_series([], 3.0).t) == 0
    with pytest.raises(UsageError, match="periods"):
        horizontal_series(none, 3.0, 3.0)


def test_the_stair_series_counts_each_stair_once_and_takes_back():
    events = [
        event(5.0, 1.0, Behaviour.STAIRS, 0.9, 5, False),
        event(6.0, 1.0, Behaviour.STAIRS, 1.2, 7, False),
        event(9.0, 1.0, Behaviour.STAIRS, 1.6, 9, True),
        event(20.0, 15.0, Behaviour.LIFT, -3.0, 0, True),
        event(30.0, 25.0, Behaviour.STAIRS, -0.9, 6, False),
        event(35.0, 25.0, Behaviour.STAIRS, 0.0, 0, True),
        event(45.0, 40.0, Behaviour.STAIRS, -0.9, 6, False),
        event(46.0, 40.0, Behaviour.LIFT, -1.9, 6, True),
    ]
    s = stair_series(events)
    assert s.stairs.tolist() == [5, 2, 2, -6, 6, -6, 6]
    assert s.t.tolist() == [5.0, 6.0, 9.0, 30.0, 35.0, 45.0, 46.0]


@given(st.floats(-20.0, 20.0), st.floats(0.2, 3.0), st.floats(2.5, 5.0))
def test_floor_probabilities_are_those_of_a_normal_rise(rise, sigma, height):
    counts = floor_counts(8)
    p = floor_probabilities(rise, sigma, height, 8)
    log = -0.5 * ((rise - counts * height) / sigma) ** 2
    assert p.sum() == pytest.approx(1.0)
    assert p == pytest.approx(np.exp(log - np.logaddexp.reduce(log)))
    assert 0 not in counts


def test_the_ride_series_tells_floors_at_the_end_only():
    events = [
        event(5.0, 1.0, Behaviour.LIFT, -2.0, 0, False),
        event(15.0, 1.0, Behaviour.LIFT, -6.2, 0, True),
        event(40.0, 30.0, Behaviour.LIFT, 9.5, 0, True),
        event(60.0, 50.0, Behaviour.STAIRS, 3.0, 18, True),
    ]
    ride = ride_series(events, storey_height=3.1, most=5)
    assert ride.t.tolist() == [15.0, 40.0]
    assert ride.floors.tolist() == [-2, 3]
    assert ride.probabilities.shape == (2, 10)
    with pytest.raises(UsageError, match="positive"):
        floor_probabilities(3.0, 0.0, 3.0)


# --- walking direction ------------------------------------------------------------------------------------
@given(angle=st.floats(-3.1, 3.1), off=st.floats(-1.4, 1.4), seed=st.integers(0, 1000))
def test_the_direction_is_the_axis_of_the_sway_and_the_guess_its_end(angle, off, seed):
    rng = np.random.default_rng(seed)
    along, across = 1.5 * np.sin(np.arange(400) * 0.35), 0.2 * rng.standard_normal(400)
    c, s = np.cos(angle), np.sin(angle)
    a = np.column_stack([along * c - across * s, along * s + across * c])
    found = walking_direction(a, angle + off)
    assert abs(wrap(found - angle)) < 0.05
    # the fixed point of the definition: the sum of the forward and the reversed backward vectors
    centred = a - a.mean(axis=0)
    way = np.array([np.cos(found), np.sin(found)])
    total = centred[centred @ way >= 0].sum(axis=0) - centred[centred @ way < 0].sum(axis=0)
    assert abs(wrap(np.arctan2(total[1], total[0]) - found)) < 1e-9


def test_nothing_to_go_by_gives_the_guess():
    assert walking_direction(np.zeros((5, 2)), 0.7) == pytest.approx(0.7)
    assert walking_direction(np.full((5, 2), np.nan), -0.7) == pytest.approx(-0.7)


def test_horizontal_acceleration_is_the_rotation_of_the_vector():
    rng = np.random.default_rng(3)
    q = Rotation.random(20, rng)
    v = rng.standard_normal((20, 3))
    assert np.allclose(
        horizontal_acceleration(v, q.as_quat(scalar_first=True)), q.apply(v)[:, :2], atol=1e-12
    )


# --- stride regression ------------------------------------------------------------------------------------
def test_features_of_a_pulse_of_known_shape():
    """A triangle from -1 up to 3 in 0.2 s and down to -2 in 0.3 s; a cosine of 4 m/s²."""
    t = np.arange(0.0, 0.5001, 0.01)
    a = np.interp(t, [0.0, 0.2, 0.5], [-1.0, 3.0, -2.0])
    slopes, x = pulse_features(t, a, np.array([0.5]))[0]
    assert slopes == pytest.approx(4 / 0.2 + 5 / 0.3)
    assert x == pytest.approx(2 / len(a) * abs(np.fft.fft(a)[1]))
    t = np.arange(0.0, 2.0, 0.01)
    features = pulse_features(t, 4.0 * np.cos(4 * np.pi * t), np.array([0.495, 0.995, 1.495]))
    assert features[:, 1] == pytest.approx([4.0] * 3, rel=1e-6)


def test_a_pulse_without_samples_has_no_features_and_a_length_all_the_same():
    features = pulse_features(np.array([0.0, 0.1]), np.array([1.0, 2.0]), np.array([0.2, 5.0]))
    assert np.isnan(features).all()
    assert (
        StrideRegression((0, 0, 0, 0, 0, 0.6), (0.4, 0.8)).length(features).tolist()
        == [pytest.approx(0.6)] * 2
    )


def test_the_fit_recovers_the_quadratic_of_eq_3_1():
    rng = np.random.default_rng(0)
    true = StrideRegression((-0.01, 0.0002, -1e-6, 0.05, 0.001, 0.4))
    features = np.column_stack([rng.uniform(10, 60, 600), rng.uniform(1, 5, 600)])
    segment = np.repeat(np.arange(60), 10)
    distance = np.bincount(segment, true.length(features))
    found = fit_stride_regression(features, segment, distance)
    assert found.length(features) == pytest.approx(true.length(features), rel=1e-6)
    assert found.coefficients == pytest.approx(true.coefficients, rel=1e-4)
    features[::10] = np.nan  # a pulse that could not be read is as long as the mean of its segment
    again = fit_stride_regression(features, segment, distance)
    assert again.length(features[1:2]) == pytest.approx(true.length(features[1:2]), rel=0.05)


def test_what_cannot_be_fitted_or_is_no_model_is_refused():
    with pytest.raises(UsageError, match="too few"):
        fit_stride_regression(np.ones((10, 2)), np.arange(10), np.ones(10))
    with pytest.raises(ConfigError, match="six finite"):
        StrideRegression((1.0, 2.0, 3.0, 4.0, 5.0, float("nan")))
    with pytest.raises(ConfigError, match="bounds"):
        StrideRegression((0, 0, 0, 0, 0, 0.6), (0.8, 0.4))


# --- on real walks ----------------------------------------------------------------------------------------
@pytest.mark.slow
@pytest.mark.real_data
def test_direction_and_stride_on_straight_legs(data_root: Path, read_log):
    """Legs of 5 m and more between points of the single-floor trials; strides are fitted on floor 0 only.

    Measured: direction 10.0 deg (median; the phone's heading 8.8), stride 6.2 % (median, floor -2; a constant 5.9).
    """
    folder = data_root / "ipin2023-track3" / "logs"
    if not folder.is_dir():
        pytest.skip(
            f"REAL DATA ABSENT: no folder {folder}; fetch with `wayfuse datasets fetch ipin2023-track3`"
        )
    front_end = InertialFrontEnd()
    turned, legs = [], {"0": [], "-2": []}
    for path in sorted(folder.glob("*Trial[02]*.txt")):
        r = read_log(path)
        _, s = front_end.run(front_end.init(), r)
        a, q = r.acceleration, r.orientation
        attitude = q.values[np.clip(np.searchsorted(q.t, a.t, side="right") - 1, 0, None)]
        horizontal = horizontal_acceleration(a.values, attitude)
        vertical = Rotation.from_quat(attitude, scalar_first=True).apply(a.values)[:, 2]
        features = pulse_features(a.t, vertical, s.t)
        for p, n in pairwise(r.waypoints):
            metres = np.array([(n.lon - p.lon) * np.cos(np.radians(p.lat)), n.lat - p.lat]) * 111_200.0
            inside = (s.t > p.t) & (s.t <= n.t)
            if np.hypot(*metres) < 5.0 or inside.sum() < 6:
                continue
            guess = float(np.angle(np.exp(1j * s.heading[inside]).mean()))
            found = walking_direction(horizontal[(a.t > p.t + 0.5) & (a.t < n.t - 0.5)], guess)
            turned.append(abs(wrap(found - np.arctan2(metres[1], metres[0]))))
            legs[p.floor].append((features[inside], float(np.hypot(*metres))))
    assert len(turned) > 200
    assert np.degrees(np.median(turned)) < 13.0
    segment = np.repeat(np.arange(len(legs["0"])), [len(f) for f, _ in legs["0"]])
    model = fit_stride_regression(
        np.concatenate([f for f, _ in legs["0"]]), segment, np.array([d for _, d in legs["0"]])
    )
    error = [abs(model.length(f).sum() / d - 1.0) for f, d in legs["-2"]]
    assert np.median(error) < 0.09
