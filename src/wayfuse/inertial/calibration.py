"""Step-length models calibrated from surveyed walks.

A surveyor's waypoints give the distance walked between them where the way was straight. A segment counts
when it is at least 3 m and three steps long and its steps point one way (mean resultant of their headings
above 0.9). A step that straddles a waypoint counts with the part of its duration that lies inside, which
removes most of the quantisation of seven-metre segments of ten steps.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from wayfuse.core.types import Array, IntArray
from wayfuse.inertial.front_end import InertialConfig, InertialFrontEnd, StepEvents
from wayfuse.inertial.step_length import StepLengthModel, coefficient_count, design, fit
from wayfuse.sensors.recording import Recording
from wayfuse.sensors.records import Waypoint

__all__ = ["Segments", "calibrate", "straight_segments"]

_DELAY = 0.1  # s between the end of a step and its declaration (0 to 0.2 s fit equally well)
_MIN_DISTANCE = 3.0  # m
_MIN_STEPS = 3.0
_MIN_RESULTANT = 0.9  # sd of the step headings below 26 degrees


class Segments(NamedTuple):
    """Straight ways between waypoints.

    summed : (m, k) sum of the columns of a step-length model. distance : (m,) m. steps : (m,) number of
    steps, fractional. duration : (m,) s. heading : (m,) mean heading of the steps (rad). direction : (m,) of
    the way (rad). walk : (m,) index of the recording.
    """

    summed: Array
    distance: Array
    steps: Array
    duration: Array
    heading: Array
    direction: Array
    walk: IntArray


def calibrate(
    recordings: Iterable[Recording], name: str = "regression", config: InertialConfig | None = None
) -> StepLengthModel:
    """Fit a step-length model to walks with waypoints in metres.

    Parameters
    ----------
    recordings : walks with waypoints.
    name : one of `MODELS`; a model of one coefficient suits few walks of one person.
    config : parameters of the front end the model will be used with.

    Raises
    ------
    UsageError : the walks hold fewer than five straight segments per coefficient.
    """
    segments = straight_segments(recordings, name, config)
    return fit(name, segments.summed, segments.distance)


def straight_segments(
    recordings: Iterable[Recording], name: str = "regression", config: InertialConfig | None = None
) -> Segments:
    """The straight ways between waypoints, with the columns of a step-length model summed over each."""
    front_end = InertialFrontEnd(config or InertialConfig())
    rows: list[tuple[float, ...]] = []
    for walk, recording in enumerate(recordings):
        _, events, features = front_end.run_with_features(front_end.init(), recording)
        if len(events.t) == 0:
            continue
        columns = design(name, features)
        for one, two in zip(recording.waypoints[:-1], recording.waypoints[1:], strict=True):
            row = _segment(events, columns, one, two)
            if row:
                rows.append((*row, float(walk)))
    k = coefficient_count(name)
    table = np.array(rows, dtype=np.float64).reshape(-1, k + 6)
    distance, steps, duration, heading, direction, walk_of = table[:, k:].T
    return Segments(table[:, :k], distance, steps, duration, heading, direction, walk_of.astype(np.int64))


def _segment(events: StepEvents, columns: Array, one: Waypoint, two: Waypoint) -> tuple[float, ...]:
    dx, dy = two.x - one.x, two.y - one.y
    distance = float(np.hypot(dx, dy))
    if not distance >= _MIN_DISTANCE:
        return ()
    end = events.t - _DELAY
    inside = np.minimum(end, two.t) - np.maximum(end - events.duration, one.t)
    part = np.clip(inside / events.duration, 0.0, 1.0)
    steps = float(part.sum())
    if steps < _MIN_STEPS:
        return ()
    mean = complex(np.sum(part * np.exp(1j * events.heading))) / steps
    if abs(mean) < _MIN_RESULTANT:
        return ()
    direction = float(np.arctan2(dy, dx))
    return (*(part @ columns), distance, steps, two.t - one.t, float(np.angle(mean)), direction)
