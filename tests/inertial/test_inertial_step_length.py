"""Step-length models, their kernel, and calibration from waypoints."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from made_up_gait import walk

from wayfuse.core.errors import ConfigError, UsageError
from wayfuse.formats import ms_indoor as ms_indoor_format
from wayfuse.inertial.calibration import calibrate, straight_segments
from wayfuse.inertial.front_end import InertialFrontEnd
from wayfuse.inertial.step_length import DEFAULTS, MODELS, StepLengthModel, design, fit
from wayfuse.sensors.recording import Recording
from wayfuse.sensors.records import Waypoint


def gaits(n: int, **options: float) -> list[Recording]:
    rng = np.random.default_rng(1)
    return [
        walk(i, steps=40, cadence=rng.uniform(1.5, 2.2), noise=rng.uniform(0.02, 0.4), **options)
        for i in range(n)
    ]


@pytest.mark.parametrize("name", MODELS)
def test_kernel_gives_the_length_of_the_formula(name):
    front_end = InertialFrontEnd(step_length=DEFAULTS[name])
    _, events, features = front_end.run_with_features(front_end.init(), walk(1, steps=30))
    np.testing.assert_allclose(events.length, DEFAULTS[name].length(features), rtol=1e-12)
    assert np.all((events.length >= 0.25) & (events.length <= 1.3))


def test_formulas_by_hand():
    front_end = InertialFrontEnd()
    _, events, f = front_end.run_with_features(front_end.init(), walk(1, steps=10))
    np.testing.assert_array_equal(f.duration, events.duration)
    for name, by_hand in (
        ("constant", np.full(len(events.t), 0.7)),
        ("weinberg", 0.7 * (events.peak - events.valley) ** 0.25),
        ("kim", 0.7 * events.mean_abs ** (1 / 3)),
        ("kakiuchi", 0.7 * f.vertical**0.25),
    ):
        np.testing.assert_allclose(StepLengthModel(name, (0.7,), (0.01, 9.0)).length(f), by_hand)


@pytest.mark.parametrize("name", MODELS)
def test_fit_recovers_known_coefficients(name):
    rng = np.random.default_rng(2)
    front_end = InertialFrontEnd()
    summed = []
    for recording in gaits(12):
        *_, features = front_end.run_with_features(front_end.init(), recording)
        columns = design(name, features)
        summed += [columns[i : i + 8].sum(axis=0) for i in range(1, len(columns) - 8, 8)]
    known = np.asarray(DEFAULTS[name].coefficients)
    distance = np.array(summed) @ known
    distance[::9] *= rng.uniform(1.3, 1.6, len(distance[::9]))  # detours that the fit must shrug off
    model = fit(name, np.array(summed), distance)
    predicted = np.array(summed) @ np.asarray(model.coefficients)
    assert np.median(np.abs(predicted / (np.array(summed) @ known) - 1)) < 0.05
    clean = fit(name, np.array(summed), np.array(summed) @ known)
    np.testing.assert_allclose(clean.coefficients, known, rtol=1e-6)


def test_calibrate_recovers_the_step_of_a_walker():
    walks = []
    for i, recording in enumerate(gaits(6, heading=0.3)):
        _, events = InertialFrontEnd().run(InertialFrontEnd().init(), recording)
        ends = events.t[4::10] - 0.1
        along = 0.8 * 10 * np.arange(len(ends))
        points = tuple(
            Waypoint(t, d * np.cos(0.3), d * np.sin(0.3), "") for t, d in zip(ends, along, strict=True)
        )
        walks.append(replace(recording, name=str(i), waypoints=points))
    assert calibrate(walks, "constant").coefficients[0] == pytest.approx(0.8, rel=1e-3)
    segments = straight_segments(walks)
    np.testing.assert_allclose(segments.steps, 10.0, atol=1e-6)
    np.testing.assert_allclose(segments.heading, segments.direction, atol=0.05)


def test_calibration_needs_segments():
    with pytest.raises(UsageError, match="0 segments"):
        calibrate([walk(1)], "regression")
    with pytest.raises(UsageError, match="too few"):
        calibrate([Recording("empty")], "constant")


@pytest.mark.parametrize(
    ("wrong", "match"),
    [
        (("stride", (1.0,)), "stride"),
        (("kim", (1.0, 2.0)), "1 finite"),
        (("regression", (1.0,)), "5 finite"),
        (("constant", (float("nan"),)), "finite"),
        (("constant", (0.7,), (1.0, 0.5)), "bounds"),
    ],
)
def test_wrong_models_are_refused(wrong, match):
    with pytest.raises(ConfigError, match=match):
        StepLengthModel(*wrong)


@pytest.mark.real_data
@pytest.mark.slow
def test_step_lengths_of_real_walks(ms_indoor: Path):
    """On F1, B1 fits, F1 is predicted: median error of straight segments below 10 %."""
    floors = [
        [ms_indoor_format.read(p) for p in sorted((ms_indoor / floor).glob("path_data_files/*.txt"))[:60]]
        for floor in ("B1", "F1")
    ]
    model = calibrate(floors[0])
    other = straight_segments(floors[1])
    error = np.abs(other.summed @ np.asarray(model.coefficients) / other.distance - 1)
    assert len(error) > 100
    assert np.median(error) < 0.105
    assert np.percentile(error, 90) < 0.30
