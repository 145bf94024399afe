"""Velocity by Eq. 13-17 of li2015: a made-up wave, simulated walks of known truth, recorded walks."""

from __future__ import annotations

from collections.abc import Iterator
from hashlib import sha256
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest

from wayfuse.core.errors import ConfigError, UsageError
from wayfuse.core.types import Array
from wayfuse.formats.reading import read
from wayfuse.inertial.velocity import (
    Strides,
    VelocityConfig,
    azimuths,
    building_heading,
    calibrate,
    find_strides,
    low_pass,
    velocities,
    vertical_acceleration,
)
from wayfuse.sensors.recording import Recording, Series

if TYPE_CHECKING:
    from tests.conftest import SmallWorld

G = 9.81


def strides_of(recording: Recording, config: VelocityConfig | None = None) -> Strides:
    raw = vertical_acceleration(recording.acceleration, recording.orientation)
    smooth = low_pass(recording.acceleration.t, raw, (config or VelocityConfig()).beta)
    return find_strides(recording.acceleration.t, smooth, config)


def between(strides: Strides, start: float, stop: float) -> Strides:
    inside = (strides.t > start) & (strides.t <= stop)
    return Strides(*(column[inside] for column in strides))


def facing(azimuth: float, t: Array) -> Series:
    """Azimuths (n, 1) of a phone that points one way."""
    return Series(t, np.full((len(t), 1), azimuth))


def test_the_low_pass_is_equation_13_at_100_hz_and_the_same_filter_at_other_rates() -> None:
    raw = np.random.default_rng(0).normal(size=50)
    t = np.arange(50) / 100.0
    expected = raw[0]
    for k, value in enumerate(raw):
        expected = 0.1 * value + 0.9 * expected if k else value
        assert low_pass(t[: k + 1], raw[: k + 1], 0.9)[-1] == pytest.approx(expected)
    step = np.ones(200)
    step[0] = 0.0
    for rate in (50.0, 200.0):
        after = low_pass(np.arange(200) / rate, step, 0.9)
        assert after[int(0.1 * rate)] == pytest.approx(1.0 - 0.9**10)  # 0.1 s
    assert len(low_pass(np.empty(0), np.empty(0), 0.9)) == 0


def test_a_wave_gives_its_steps_their_length_and_speed() -> None:
    t = np.arange(0.0, 10.0, 0.01)
    wave = G + 1.5 * np.sin(2.0 * np.pi * 2.0 * t) * (t < 6.0)  # 12 steps of 0.5 s, 3 m/s² from dip to peak
    strides = find_strides(t, wave)
    assert len(strides.t) == 12
    assert strides.swing == pytest.approx(np.full(12, 3.0), abs=0.05)
    assert strides.duration == pytest.approx(np.full(12, 0.5), abs=0.02)
    config = VelocityConfig(k=calibrate(strides, 12 * 0.7))
    out = velocities(np.array([0.2, 3.0, 9.0]), strides, facing(0.5 * np.pi, t), config=config)
    assert out.speed == pytest.approx([0.0, 1.4, 0.0], abs=0.05)  # before the second peak, walking, standing
    assert out.velocity[1] == pytest.approx([1.4, 0.0], abs=0.05)  # the phone points east


def test_the_direction_is_equation_16() -> None:
    north, east, west = 0.0, 0.5 * np.pi, -0.5 * np.pi
    assert building_heading([north, east, west], east=0.0) == pytest.approx([0.5 * np.pi, 0.0, np.pi])
    assert building_heading(east, east=0.3) == pytest.approx(0.3)  # east is 0.3 rad from +x
    assert azimuths(Series(np.zeros(1), np.array([[1.0, 0.0, 0.0, 0.0]]))) == pytest.approx([north])


def test_directions_are_averaged_on_the_circle_over_the_step() -> None:
    t = np.arange(0.0, 4.0, 0.01)
    strides = find_strides(t, G + 1.5 * np.sin(4.0 * np.pi * t))
    sway = np.pi + 0.4 * np.sin(4.0 * np.pi * t)  # about south, where angles jump
    out = velocities(t[150:], strides, Series(t, sway[:, None]))
    assert np.abs(np.abs(out.heading + 0.5 * np.pi)).max() < 0.05


def test_nothing_is_known_before_its_time() -> None:
    t = np.arange(0.0, 8.0, 0.01)
    raw = G + 1.5 * np.sin(4.0 * np.pi * t) * (t > 1.0) + np.random.default_rng(1).normal(0.0, 0.3, len(t))
    azimuth = facing(1.0, t)
    whole = velocities(t, find_strides(t, low_pass(t, raw, 0.9)), azimuth)
    for stop in (250, 431, 700):
        part = find_strides(t[:stop], low_pass(t[:stop], raw[:stop], 0.9))
        assert (velocities(t[:stop], part, azimuth).speed == whole.speed[:stop]).all()


def test_standing_still_is_no_walk() -> None:
    rng = np.random.default_rng(3)
    t = np.arange(0.0, 30.0, 0.01)
    raw = G + rng.normal(0.0, 0.3, len(t)) + 0.2 * np.sin(2.0 * np.pi * 0.3 * t)
    assert len(find_strides(t, low_pass(t, raw, 0.9)).t) == 0
    nothing = find_strides(np.empty(0), np.empty(0))
    out = velocities(np.array([1.0, 2.0]), nothing, Series.empty(1))
    assert not out.velocity.any()
    with pytest.raises(UsageError, match="no step"):
        calibrate(nothing, 5.0)
    with pytest.raises(UsageError, match="no orientation"):
        vertical_acceleration(Series(np.zeros(1), np.zeros((1, 3))), Series.empty(4))


@pytest.mark.parametrize("bad", [{"beta": 1.0}, {"k": 0.0}, {"shortest": 2.0}, {"swing": -1.0}])
def test_parameters_are_checked(bad: dict[str, float]) -> None:
    with pytest.raises(ConfigError):
        VelocityConfig(**bad)


def test_simulated_walks_are_reckoned_from_their_velocity(world: SmallWorld) -> None:
    for recording in world.walks:
        truth = world.truth[recording.name]
        strides = strides_of(recording)
        assert len(strides.t) == pytest.approx(len(truth.contacts), abs=0.08 * len(truth.contacts) + 2)
        config = VelocityConfig(k=calibrate(strides, float(truth.step_length.sum())))
        t = np.arange(truth.t[0], truth.t[-1], 0.1)
        azimuth = Series(recording.orientation.t, azimuths(recording.orientation)[:, None])
        found = velocities(t, strides, azimuth, config=config)
        xy = truth.at(t)
        true_speed = np.hypot(*np.gradient(xy, t, axis=0).T)
        smooth = np.convolve(true_speed, np.ones(10) / 10.0, mode="same")
        late = found.speed[3:]  # a step is known at its end
        assert np.abs(late - smooth[:-3])[5:-5].mean() < 0.25
        assert found.speed.mean() == pytest.approx(true_speed.mean(), rel=0.12)


def _development_walks(folder: Path) -> Iterator[Path]:
    for path in sorted(folder.glob("**/*.txt")):
        if int(sha256(path.stem.encode()).hexdigest(), 16) % 10 == 1:
            yield path


@pytest.mark.real_data
def test_recorded_walks_have_the_length_that_k_of_the_others_says(ms_indoor: Path) -> None:
    ways, swings = [], []
    for path in list(_development_walks(ms_indoor))[:12]:
        recording = read(path)
        points = np.array([w[:3] for w in recording.waypoints])
        strides = between(strides_of(recording), points[0, 0], points[-1, 0])
        ways.append(float(np.hypot(*np.diff(points[:, 1:], axis=0).T).sum()))
        swings.append(float((strides.swing**0.25).sum()))
        assert 1.2 < len(strides.t) / (points[-1, 0] - points[0, 0]) < 2.3  # steps per second
    assert len(ways) == 12
    errors = []
    for k in range(12):
        others = [i for i in range(12) if i != k]
        factor = sum(ways[i] for i in others) / sum(swings[i] for i in others)
        errors.append(abs(factor * swings[k] / ways[k] - 1.0))
    assert np.median(errors) < 0.08
