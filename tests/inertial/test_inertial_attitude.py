"""The own attitude filter against the truth of made-up walks, ahrs and the phone's rotation vector."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from made_up_gait import walk
from scipy.spatial.transform import Rotation, Slerp

from wayfuse.core.angles import wrap
from wayfuse.formats import ms_indoor as ms_indoor_format
from wayfuse.inertial import _kernels
from wayfuse.inertial.attitude import estimate_attitude, quaternion_from_rotation_vector, rotate
from wayfuse.inertial.heading import device_heading
from wayfuse.sensors.recording import Recording, Series


def rotations(q: np.ndarray) -> Rotation:
    return Rotation.from_quat(q, scalar_first=True)


def reference(recording: Recording, attitude: Series) -> Rotation:
    """The recording's orientation at the times of an attitude series."""
    o = recording.orientation
    return Slerp(o.t, rotations(o.values))(np.clip(attitude.t, o.t[0], o.t[-1]))


def tilt_between(one: Rotation, two: Rotation) -> np.ndarray:
    up = np.array([0.0, 0.0, 1.0])
    return np.arccos(np.clip(np.sum(one.inv().apply(up) * two.inv().apply(up), axis=1), -1, 1))


@settings(deadline=None)  # the first call compiles
@given(
    st.lists(st.floats(-0.57, 0.57), min_size=3, max_size=3),
    st.lists(st.floats(-9, 9), min_size=3, max_size=3),
)
def test_rotation_vector_and_rotate_agree_with_scipy(vector, v):
    q = quaternion_from_rotation_vector([vector])
    np.testing.assert_allclose(np.linalg.norm(q), 1.0)
    np.testing.assert_allclose(rotate(q, [v]), rotations(q).apply([v]), atol=1e-9)


@settings(deadline=None)  # the first call compiles
@given(st.lists(st.floats(-1, 1), min_size=4, max_size=4).filter(lambda q: np.linalg.norm(q) > 0.1))
def test_heading_kernel_equals_its_array_twin(q):
    q = np.asarray(q) / np.linalg.norm(q)
    assert abs(wrap(_kernels.heading_of(*q) - device_heading(q))) < 1e-9


@pytest.mark.parametrize("pitch", [-1.0, -0.3, 0.0, 0.5, 1.0, 1.1, 1.3, 1.5, 1.57])
@pytest.mark.parametrize("heading", [-2.5, 0.0, 1.0])
def test_heading_does_not_depend_on_pitch(pitch, heading):
    q = Rotation.from_euler("ZX", [heading - np.pi / 2, pitch]).as_quat(scalar_first=True)
    assert abs(wrap(device_heading(q) - heading)) < 1e-9


@pytest.mark.parametrize("pitch", [0.0, 0.6, -2.4])
def test_nine_axes_find_the_attitude_of_a_made_up_walk(pitch):
    recording = walk(1, steps=60, heading=2.0, turn_rate=0.1, pitch=pitch)
    attitude = estimate_attitude(recording)
    late = attitude.t > 5.0
    error = (rotations(attitude.values) * reference(recording, attitude).inv()).magnitude()[late]
    assert np.degrees(np.sqrt(np.mean(error**2))) < 1.5


def test_a_disturbed_field_cannot_tilt():
    recording = walk(2, steps=60)
    m = recording.magnetic_field
    shifted = m.values + np.array([25.0, 10.0, 30.0]) * ((m.t > 15) & (m.t < 20))[:, None]
    attitude = estimate_attitude(replace(recording, magnetic_field=Series(m.t, shifted)))
    clean = estimate_attitude(recording)
    assert np.degrees(tilt_between(rotations(attitude.values), rotations(clean.values)).max()) < 0.1


def ahrs_tilt(recording: Recording, name: str) -> Rotation:
    """Attitude by a filter of ahrs on the same samples, at the accelerations."""
    import ahrs

    a, g = recording.acceleration, recording.rotation_rate
    rate = (len(a.t) - 1) / (a.t[-1] - a.t[0])
    gyro = np.column_stack([np.interp(a.t, g.t, g.values[:, i]) for i in range(3)])
    options = {"Mahony": {"k_P": 0.33, "k_I": 1e-9}, "Madgwick": {"gain": 0.02}}[name]
    filtered = getattr(ahrs.filters, name)(gyr=gyro, acc=a.values, frequency=rate, **options)
    return rotations(filtered.Q)


@pytest.mark.parametrize("name", ["Mahony", "Madgwick"])
def test_six_axes_agree_with_ahrs_on_a_made_up_walk(name):
    recording = walk(3, steps=60, turn_rate=0.1)
    recording = replace(recording, magnetic_field=Series.empty(3))
    attitude = estimate_attitude(recording)
    late = attitude.t > 10.0
    apart = tilt_between(rotations(attitude.values), ahrs_tilt(recording, name))[late]
    assert np.degrees(np.sqrt(np.mean(apart**2))) < 1.0


@pytest.mark.real_data
@pytest.mark.parametrize("name", ["Mahony", "Madgwick"])
def test_six_axes_agree_with_ahrs_and_with_the_phone_on_real_walks(ms_indoor: Path, name):
    ours, theirs, between = [], [], []
    for path in sorted(ms_indoor.glob("*/path_data_files/*.txt"))[:40:10]:
        recording = ms_indoor_format.read(path)
        attitude = estimate_attitude(recording)
        other, phone = ahrs_tilt(recording, name), reference(recording, attitude)
        late = attitude.t > attitude.t[0] + 15.0
        own = rotations(attitude.values)
        for sink, pair in ((ours, (own, phone)), (theirs, (other, phone)), (between, (own, other))):
            sink.append(tilt_between(*pair)[late])
    r = [np.degrees(np.sqrt(np.mean(np.concatenate(v) ** 2))) for v in (ours, theirs, between)]
    # the own filter trusts the gyro for 3 s only (config: biased gyros), the filters of ahrs for longer
    assert r[0] < 3.0
    assert r[1] < 3.0
    assert r[2] < 3.0


@pytest.mark.real_data
def test_nine_axes_agree_with_the_rotation_vector_of_real_walks(ms_indoor: Path):
    errors = []
    for path in sorted(ms_indoor.glob("*/path_data_files/*.txt"))[:60:6]:
        recording = ms_indoor_format.read(path)
        attitude = estimate_attitude(recording)
        phone = reference(recording, attitude).as_quat(scalar_first=True)
        errors.append(
            wrap(device_heading(attitude.values) - device_heading(phone))[attitude.t > attitude.t[0] + 5]
        )
    assert np.degrees(np.median(np.abs(np.concatenate(errors)))) < 8.0
