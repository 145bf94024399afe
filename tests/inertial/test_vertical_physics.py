"""Rides, climbs, escalators and nuisances of known physics; the compiled filter against plain NumPy."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from made_up_vertical import PA_PER_METRE, gait, recording, trapezoid_speed

from wayfuse.inertial import _speed_kernels as kernels
from wayfuse.inertial import _vertical_layout as at
from wayfuse.inertial.front_end import InertialFrontEnd
from wayfuse.inertial.vertical import Behaviour, VerticalEvent
from wayfuse.inertial.vertical_front_end import VerticalConfig, VerticalFrontEnd
from wayfuse.inertial.vertical_speed import speed_noise
from wayfuse.sensors.recording import Recording, Series

T = np.arange(0.0, 80.0, 0.02)


def detect(r: Recording, use_pressure: bool) -> list[VerticalEvent]:
    inertial, vertical = InertialFrontEnd(), VerticalFrontEnd(VerticalConfig(use_pressure=use_pressure))
    _, steps = inertial.run(inertial.init(), r)
    state, events = vertical.run(vertical.init(), r, steps)
    _, last = vertical.flush(state, r.span[1])
    return events + ([last] if last else [])


@pytest.mark.parametrize("use_pressure", [True, False])
@pytest.mark.parametrize(
    ("rise", "speed", "ramp"),
    [
        (rise, speed, ramp)
        for rise in (3.0, -3.0, 6.0, -12.0, 30.0)
        for speed, ramp in ((0.45, 1.5), (1.0, 1.2), (1.6, 1.6))
        if 2.9 < abs(rise) / speed < 45.0
    ],
)
def test_a_ride_is_found_with_its_rise(rise, speed, ramp, use_pressure):
    walks = gait(T, 5.0, 15.0)
    over = [
        e
        for e in detect(recording(T, trapezoid_speed(T, 25.0, rise, speed, ramp), sway=walks), use_pressure)
        if e.is_over
    ]
    assert [e.behaviour for e in over] == [Behaviour.LIFT]
    assert abs(over[0].rise - rise) < 2.0 * over[0].sigma
    assert over[0].n_steps == 0
    assert over[0].began == pytest.approx(25.0, abs=2.0)
    assert over[0].ended == pytest.approx(25.0 + abs(rise) / speed + ramp, abs=2.5)


@pytest.mark.parametrize("use_pressure", [True, False])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_flight_is_found_with_its_steps(sign, use_pressure):
    """16 steps of 0.17 m at 1.8 Hz, between walks on the level."""
    seconds = 16 / 1.8
    speed = trapezoid_speed(T, 25.0, sign * 16 * 0.17, 16 * 0.17 / (seconds - 0.5), 0.5)
    over = [e for e in detect(recording(T, speed, sway=gait(T, 8.0, 60.0)), use_pressure) if e.is_over]
    assert [e.behaviour for e in over] == [Behaviour.STAIRS]
    assert abs(over[0].rise - sign * 16 * 0.17) < 2.0 * over[0].sigma
    assert over[0].rise * sign > 0.0
    assert abs(over[0].n_steps - 16) <= 3


def test_an_escalator_is_stepped_onto_while_it_runs_and_is_slow():
    """4 m at 0.25 m/s (0.5 m/s on a slope of 30 degrees), walked to and from, standing on it."""
    speed = trapezoid_speed(T, 25.0, 4.0, 0.25, 1.0)
    sway = gait(T, 8.0, 25.5) + gait(T, 41.5, 60.0)
    over = [e for e in detect(recording(T, speed, sway=sway), use_pressure=True) if e.is_over]
    assert [e.behaviour for e in over] == [Behaviour.ESCALATOR]
    assert over[0].rise == pytest.approx(4.0, abs=0.4)


@settings(max_examples=15)
@given(
    seed=st.integers(0, 1000),
    jump=st.floats(-3.0, 3.0),
    drift=st.floats(-0.1, 0.1),
    swing=st.floats(0.0, 0.5),
    rate=st.sampled_from([1.0, 5.0, 25.0]),
    walks=st.booleans(),
)
def test_air_alone_makes_no_movement(seed, jump, drift, swing, rate, walks):
    """Doors (jumps), weather (m/min), swings of 1 m within 10 s, 0.04 m of noise; standing and walking."""
    air = jump * (T > 33.3) + drift / 60.0 * T + swing * np.sin(2 * np.pi * T / 20.0)
    r = recording(
        T,
        np.zeros_like(T),
        seed=seed,
        sway=gait(T, 5.0, 70.0) if walks else 0.0,
        pressure_noise=0.04 * PA_PER_METRE,
        pressure_rate=rate,
        extra_altitude=air,
    )
    assert detect(r, use_pressure=True) == []


@settings(max_examples=15)
@given(seed=st.integers(0, 1000), has_pressure=st.booleans(), has_gyro=st.booleans())
def test_gestures_and_shaking_make_no_movement(seed, has_pressure, has_gyro):
    """The hand goes up 0.3 m and down again in a second; the phone is shaken for ten seconds.

    With a barometer while walking as well; without one a gesture while walking may pass for a tread.
    """
    hand = sum(trapezoid_speed(T, s, h, 0.5, 0.25) for s, h in ((20.0, 0.3), (26.0, -0.3), (40.0, 0.25)))
    shaking = np.where((T > 50) & (T < 60), np.sin(2 * np.pi * 3 * T), 0.0)
    sway = 8.0 * shaking + (gait(T, 5.0, 75.0) if has_pressure else 0.0)
    r = recording(T, np.asarray(hand), seed=seed, sway=sway)
    shaken = Recording(
        "shaken",
        acceleration=r.acceleration,
        rotation_rate=Series(r.rotation_rate.t, r.rotation_rate.values + 6.0 * shaking[:, None])
        if has_gyro
        else Series.empty(3),
        pressure=r.pressure if has_pressure else Series.empty(1),
    )
    assert detect(shaken, use_pressure=True) == []


def test_without_a_gyroscope_a_lift_is_found_and_walking_is_not_judged():
    r = recording(T, trapezoid_speed(T, 30.0, 6.0, 0.8, 1.5), sway=gait(T, 5.0, 18.0))
    without = Recording("no gyro", acceleration=r.acceleration)
    over = [e for e in detect(without, use_pressure=True) if e.is_over]
    assert [(e.behaviour, e.has_pressure) for e in over] == [(Behaviour.LIFT, False)]
    assert abs(over[0].rise - 6.0) < 2.0 * over[0].sigma


def test_a_barometer_that_falls_silent_hands_over():
    r = recording(T, trapezoid_speed(T, 45.0, -6.0, 0.8, 1.5), sway=gait(T, 5.0, 18.0))
    cut = Recording(
        "cut",
        acceleration=r.acceleration,
        rotation_rate=r.rotation_rate,
        pressure=r.pressure.between(-np.inf, 30.0),
    )
    over = [e for e in detect(cut, use_pressure=True) if e.is_over]
    assert [(e.behaviour, e.has_pressure) for e in over] == [(Behaviour.LIFT, False)]


@settings(max_examples=50)
@given(seed=st.integers(0, 10_000), mode=st.integers(0, 4))
def test_a_branch_is_a_kalman_filter(seed, mode):
    """One update of a branch against the textbook in matrices."""
    rng = np.random.default_rng(seed)
    p = VerticalConfig().parameters()
    root = rng.standard_normal((3, 3)) * 0.1
    cov, x = root @ root.T + 1e-4 * np.eye(3), rng.standard_normal(3) * 0.1 + (0, 0, (-1) ** (mode + 1) * 0.6)
    b = np.zeros(at.B_SIZE)
    if mode == 0:
        x[2], cov[2], cov[:, 2] = 0.0, 0.0, 0.0
    b[at.B_MODE], b[at.B_O], b[at.B_B], b[at.B_S] = mode, *x
    b[[at.B_OO, at.B_OB, at.B_BB, at.B_OS, at.B_BS, at.B_SS]] = cov[[0, 0, 1, 0, 1, 2], [0, 1, 1, 2, 2, 2]]
    now, y, noise, dt = 5.0, x[0] + x[2] + 0.05, 0.03, 0.6
    kernels.update_branch(b, p, y, noise, now, mode in (1, 2))
    f = np.array([[1, dt, 0], [0, 1, 0], [0, 0, 1]])
    h = np.array([1.0, 0.0, float(mode > 0)])
    q = np.diag([noise**2 * dt, p[at.P_BIAS] ** 2 * dt, p[at.P_WANDER] ** 2 * dt if mode > 2 else 0.0])
    x, cov = f @ x, f @ cov @ f.T + q
    s, e = h @ cov @ h + p[at.P_READING] ** 2, y - h @ x
    scaled = max(e * e / s / p[at.P_OUTLIER], 1.0)
    gain = cov @ h / (s * scaled)
    weight = -0.5 * (min(e * e / s, p[at.P_OUTLIER]) + np.log(s * scaled))
    x, cov = x + gain * e, cov - np.outer(gain, h @ cov)
    assert np.allclose(b[[at.B_O, at.B_B, at.B_S]], x)
    assert np.allclose(b[[at.B_OO, at.B_OB, at.B_BB]], cov[[0, 0, 1], [0, 1, 1]])
    assert np.allclose(b[[at.B_OS, at.B_BS, at.B_SS]], cov[[0, 1, 2], [2, 2, 2]])
    backwards = mode > 0 and x[2] * (-1) ** (mode + 1) < 0.1
    assert b[at.B_WEIGHT] == pytest.approx(weight - (3.0 * dt if backwards else 0.0))


def test_the_weights_of_the_branches_are_probabilities_and_alike_ones_are_joined():
    rng = np.random.default_rng(1)
    v = at.initial_memory()
    branches = np.zeros((kernels.N_SCRATCH, at.B_SIZE))
    branches[:, at.B_O] = np.repeat(np.arange(36) * 0.1, 2)[: kernels.N_SCRATCH]
    branches[:, at.B_WEIGHT] = -rng.exponential(2.0, kernels.N_SCRATCH)
    kernels.keep_best(v, branches, kernels.N_SCRATCH)
    n = int(v[at.V_N_BRANCH])
    kept = v[at.V_BRANCHES :].reshape(at.N_BRANCH, at.B_SIZE)[:n]
    assert n == at.N_BRANCH
    assert np.exp(kept[:, at.B_WEIGHT]).sum() == pytest.approx(1.0)
    assert len(np.unique(kept[:, at.B_O])) == n
    best = branches[branches[:, at.B_WEIGHT].argmax(), at.B_O]
    pairs = branches[branches[:, at.B_O] == best, at.B_WEIGHT]
    joined = kept[kept[:, at.B_O] == best, at.B_WEIGHT][0] - kept[:, at.B_WEIGHT].max()
    sums = np.array(
        [np.logaddexp.reduce(branches[branches[:, at.B_O] == o, at.B_WEIGHT]) for o in kept[:, at.B_O]]
    )
    assert joined == pytest.approx(np.logaddexp.reduce(pairs) - sums.max())


def test_the_noise_grows_with_the_vigour():
    vigour = np.linspace(0.0, 6.0, 50)
    noise = speed_noise(vigour)
    assert np.all(np.diff(noise) >= 0.0)
    assert noise[0] == 0.005
    assert 0.05 < noise[-1] < 0.06
