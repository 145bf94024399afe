"""The integrated vertical acceleration against plain NumPy, and its noise on level walks against the stated law."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from made_up_vertical import gait, recording, trapezoid_speed

from wayfuse.inertial import _vertical_layout as at
from wayfuse.inertial.front_end import InertialFrontEnd
from wayfuse.inertial.vertical_front_end import VerticalConfig, VerticalFrontEnd
from wayfuse.inertial.vertical_speed import speed_noise
from wayfuse.sensors.recording import Recording

TICK = at.TICK


def vertical_force(r: Recording, tau: float) -> np.ndarray:
    """Vertical specific force at each acceleration: tilt by the gyro, drawn to the force within tau."""
    up, out, last = None, np.empty(len(r.acceleration)), -np.inf
    merged = sorted(
        [(t, 0, i) for i, t in enumerate(r.acceleration.t)]
        + [(t, 1, i) for i, t in enumerate(r.rotation_rate.t)]
    )
    times = [-np.inf, -np.inf]
    for t, kind, i in merged:
        dt = min(t - times[kind], 0.1)
        times[kind] = t
        if kind == 1:
            if up is not None:
                up = up - dt * np.cross(r.rotation_rate.values[i], up)
                up = up / np.linalg.norm(up)
            last = t
        else:
            force = r.acceleration.values[i]
            way = force / np.linalg.norm(force)
            gain = dt / (tau if t - last <= 0.5 else 0.5 * tau)
            up = way if up is None else up + gain * (way - up)
            up = up / np.linalg.norm(up)
            out[i] = up @ force
    return out


def by_ticks(r: Recording, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Numbers of the bins and means over each; a bin without a sample repeats the one before."""
    number = np.floor(r.acceleration.t / TICK).astype(np.int64)
    first = number[0]
    n = np.bincount(number - first)
    mean = np.bincount(number - first, values) / np.maximum(n, 1)
    filled = mean[np.maximum.accumulate(np.where(n > 0, np.arange(len(n)), 0))]
    return first + np.arange(len(n)), filled


def test_the_integral_is_that_of_plain_numpy():
    t = np.round(np.arange(0.0, 30.0, 0.02), 3)
    r = recording(t, trapezoid_speed(t, 18.0, 3.0, 0.5, 1.0), sway=gait(t, 5.0, 15.0))
    front_end = VerticalFrontEnd(VerticalConfig(use_pressure=False))
    inertial = InertialFrontEnd()
    steps = inertial.run(inertial.init(), r)[1]
    state, _ = front_end.run(front_end.init(), r, steps)
    _, mean = by_ticks(r, vertical_force(r, 1.0))
    integral = np.cumsum(TICK * (mean - 9.8))
    n = int(state.memory[at.V_TICKS])
    ring = state.memory[at.V_RING_SUM : at.V_RING_SUM + at.N_RING]
    back = np.arange(100)
    assert np.allclose(ring[(n - 1 - back) % at.N_RING], integral[n - 1 - back], atol=1e-9)


def second_differences(r: Recording, lag: float) -> tuple[np.ndarray, np.ndarray]:
    """Ratio of the second differences over a lag to those the law foretells, while walking; its vigour."""
    inertial = InertialFrontEnd()
    steps = inertial.run(inertial.init(), r)[1].t
    number, mean = by_ticks(r, vertical_force(r, 1.0))
    _, power = by_ticks(r, (np.linalg.norm(r.acceleration.values, axis=1) - 9.81) ** 2)
    kernel = np.convolve(np.ones(6) / 6, np.ones(3) / 3)
    y = np.convolve(TICK * np.cumsum(mean - 9.8), kernel, "valid")
    t = (number[len(kernel) - 1 :] + 1) * TICK
    k = round(lag / TICK)
    d = y[2 * k :] - 2 * y[k:-k] + y[: -2 * k]
    end = t[2 * k :]
    first = r.waypoints[0].t + 3.0
    counts = np.searchsorted(steps, end) - np.searchsorted(steps, end - 2 * lag - 1.2)
    use = (counts >= 1.2 * (2 * lag)) & (end - 2 * lag - 2.0 > max(first, steps[0]))
    total = np.concatenate([[0.0], np.cumsum(power)])
    j = np.flatnonzero(use) + 2 * k + len(kernel)
    vigour = np.sqrt((total[j] - total[j - 2 * k]) / (2 * k))
    return d[use] / (np.sqrt(2 * lag) * speed_noise(vigour)), vigour


@pytest.mark.slow
@pytest.mark.real_data
@pytest.mark.parametrize("lag", [2.4, 4.8])
def test_the_law_of_the_noise_holds_on_level_walks_of_two_sets(data_root: Path, read_log, lag):
    """It was measured on all of them, here on a part; it includes reading noise and drift, hence the factor 0.93."""
    logs = data_root / "ipin2023-track3" / "logs"
    walks = data_root / "ms-indoor" / "site1"
    if not (logs.is_dir() and walks.is_dir()):
        pytest.skip(
            "REAL DATA ABSENT: needs ipin2023-track3 and ms-indoor; fetch with `wayfuse datasets fetch`"
        )
    museum = [logs / f"IPIN2023_T3_TrainingTrial{n}_repetition01.txt" for n in ("02", "05", "24")]
    mall = sorted(walks.glob("F1/path_data_files/*.txt"))[:40:2]
    for paths, low, high in ((museum, 0.6, 2.5), (mall, 1.2, 6.0)):
        parts = [second_differences(r, lag) for r in map(read_log, paths) if len(r.rotation_rate)]
        ratio, vigour = (np.concatenate(column) for column in zip(*parts, strict=True))
        assert len(ratio) > 300
        assert low < np.median(vigour) < high
        assert 0.7 < np.sqrt(np.mean(ratio**2)) < 1.3
