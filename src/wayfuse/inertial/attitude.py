r"""Attitude of the phone: from its rotation vector, or from the own filter of six or nine axes.

The phone's rotation vector is used where it is recorded. Where it is not, a quaternion filter of the
complementary kind (as Mahony's [1]_, in discrete form) runs in the front end: each rotation rate turns the
attitude,

.. math:: q \leftarrow q \otimes \exp(\omega \Delta t / 2),

each acceleration turns it by the part :math:`1 - e^{-\Delta t / \tau}` of the angle between the measured
specific force and the vertical, and each magnetic field turns it *about the vertical only* by such a part of
the angle to magnetic north, so that a disturbed field cannot tilt it. A field whose strength differs from
its running mean by d is trusted 1 / (1 + (d / tolerance)²). Every record acts when it comes: the sensors
need not be synchronous. Without a gyro the time constants shrink and the filter is a tilt-compensated
compass.

North is magnetic north; the phone's rotation vector has none of the declination either.

>>> turn = quaternion_from_rotation_vector(np.array([[0.0, 0.0, np.sin(np.pi / 4)]]))
>>> turn.round(4)
array([[0.7071, 0.    , 0.    , 0.7071]])
>>> rotate(turn, np.array([[1.0, 0.0, 0.0]])).round(4)
array([[0., 1., 0.]])

References
----------
.. [1] R. Mahony, T. Hamel and J.-M. Pflimlin, Nonlinear complementary filters on the special orthogonal
   group, IEEE Transactions on Automatic Control 53 (2008), doi 10.1109/TAC.2008.923738.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from wayfuse.core.types import Array
from wayfuse.inertial import _kernels
from wayfuse.inertial import _layout as at
from wayfuse.inertial.config import InertialConfig
from wayfuse.inertial.front_end import contiguous
from wayfuse.inertial.step_length import DEFAULT
from wayfuse.sensors.recording import Recording, Series

__all__ = ["estimate_attitude", "quaternion_from_rotation_vector", "rotate"]


def quaternion_from_rotation_vector(vector: ArrayLike) -> Array:
    """Unit quaternions (w, x, y, z), (n, 4), of Android rotation vectors axis * sin(angle / 2), (n, 3)."""
    v = np.asarray(vector, dtype=np.float64)
    w = np.sqrt(np.maximum(0.0, 1.0 - np.sum(v * v, axis=-1, keepdims=True)))
    q = np.concatenate([w, v], axis=-1)
    return np.asarray(q / np.linalg.norm(q, axis=-1, keepdims=True))


def rotate(quaternion: ArrayLike, vector: ArrayLike) -> Array:
    """Device vectors (n, 3) in the world, by unit quaternions (w, x, y, z) (n, 4)."""
    q, v = np.asarray(quaternion, dtype=np.float64), np.asarray(vector, dtype=np.float64)
    u = q[..., 1:]
    twice = 2.0 * np.cross(u, v)
    return np.asarray(v + q[..., :1] * twice + np.cross(u, twice))


def estimate_attitude(recording: Recording, config: InertialConfig | None = None) -> Series:
    """Attitude by the own filter at each acceleration, whether or not the recording has a rotation vector.

    Parameters
    ----------
    recording : accelerations; rotation rates and magnetic fields as far as there are any. Its
        ``orientation`` is left out.
    config : time constants; the defaults where not given.

    Returns
    -------
    times of the accelerations and unit quaternions (w, x, y, z), device to east-north-up. Without a magnetic
    field the heading is relative: the device's y axis starts as north.
    """
    columns = (*contiguous(recording)[:6], np.empty(0), np.empty((0, 4)))
    trace = np.empty((len(columns[0]), 5))
    events = np.empty((len(columns[0]) + 1, at.N_EVENT))
    parameters = (config or InertialConfig()).parameters(DEFAULT)
    _kernels.consume_series(at.initial_state(), parameters, columns, events, trace)
    return Series(recording.acceleration.t, trace[:, :4])
