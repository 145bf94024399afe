"""Wrong beginnings and kidnapped phones: a track finds back, and says meanwhile that it is lost."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from wayfuse.core.errors import ConfigError
from wayfuse.presets import fused
from wayfuse.sensors.recording import Recording, Series
from wayfuse.sensors.records import WifiScan
from wayfuse.tracking.estimate import Estimate, State
from wayfuse.tracking.particle_engine import Recovery

LOST_AT = 17.0  # m
SERIES = ("acceleration", "rotation_rate", "magnetic_field", "orientation")


def part(recording: Recording, start: float, stop: float, shift: float) -> Recording:
    """Records between two times since the first one, moved by ``shift`` s."""
    low, high = recording.span[0] + start, recording.span[0] + stop

    def cut(series: Series) -> Series:
        keep = (series.t >= low) & (series.t < high)
        return Series(series.t[keep] + shift, series.values[keep])

    def moved(scan: WifiScan) -> WifiScan:
        return replace(scan, t=scan.t + shift, last_seen=scan.last_seen + shift)

    columns = {name: cut(getattr(recording, name)) for name in SERIES}
    wifi = tuple(moved(s) for s in recording.wifi if low <= s.t < high)
    return replace(recording, **columns, wifi=wifi, waypoints=())


def spliced(first: Recording, then: Recording, at: float) -> tuple[Recording, float]:
    """``first`` for ``at`` seconds, then ``then`` from its beginning; and what was added to its times."""
    shift = first.span[0] + at - then.span[0]
    a, b = part(first, 0.0, at, 0.0), part(then, 0.0, 1e3, shift)
    columns = {
        name: Series(
            np.concatenate([getattr(a, name).t, getattr(b, name).t]),
            np.concatenate([getattr(a, name).values, getattr(b, name).values]),
        )
        for name in SERIES
    }
    # a phone carried through nowhere still lists what it heard before: cut that, to have a clean jump
    fresh = tuple(
        replace(s, last_seen=np.where(s.last_seen < first.span[0] + at, s.t - 100.0, s.last_seen))
        for s in b.wifi
    )
    return replace(a, **columns, wifi=a.wifi + fresh), shift


def errors(world: Any, estimates: list[Estimate], of: Recording, shift: float) -> np.ndarray:
    """Distance (m) from the truth of a walk, infinite on a wrong floor."""
    truth = world.truth[of.name]
    at = truth.at(np.array([e.t - shift for e in estimates]))
    off = np.hypot(*(np.array([(e.x, e.y) for e in estimates]) - at).T)
    return np.where(np.array([e.floor for e in estimates]) == truth.floor, off, np.inf)


Jump = tuple[Recording, Recording, Recording, float]


@pytest.fixture(scope="module")
def jump(world: Any) -> Jump:
    """A walk on one floor that goes on as a walk on the other after 15 s."""
    first, then = world.walks[0], world.walks[1]
    assert world.truth[first.name].floor != world.truth[then.name].floor
    recording, shift = spliced(first, then, 15.0)
    return recording, first, then, shift


def test_a_kidnapped_phone_is_found_on_the_other_floor(world: Any, jump: Jump) -> None:
    recording, first, then, shift = jump
    for seed in range(3):
        estimates = fused.build(world.site, world.survey).run(recording, seed).estimates
        moment = then.span[0] + shift
        before = [e for e in estimates if moment - 5.0 < e.t < moment]
        after = [e for e in estimates if e.t > moment + 12.0]
        assert len(before) > 5
        assert len(after) > 10
        assert np.median(errors(world, before, first, 0.0)) < 8.0
        assert np.median(errors(world, after, then, shift)) < 8.0
        assert np.mean(np.isinf(errors(world, after, then, shift))) < 0.05


def test_without_fresh_particles_it_would_not_be_found(world: Any, jump: Jump) -> None:
    recording, _, then, shift = jump
    tracker = fused.build(world.site, world.survey)
    engine = replace(tracker.engine, recovery=Recovery(injection=0.0, injection_least=0.0, reset_share=0.0))
    estimates = replace(tracker, engine=engine).run(recording).estimates
    assert np.all(np.isinf(errors(world, estimates[-10:], then, shift)))


def test_while_lost_it_says_so(world: Any, jump: Jump) -> None:
    recording, _, then, shift = jump
    tracker = fused.build(world.site, world.survey)
    # no fresh particles at each scan: only the contradiction itself can help
    engine = replace(
        tracker.engine, recovery=Recovery(injection=0.0, injection_least=0.0, patience=3, reset_share=0.5)
    )
    estimates = replace(tracker, engine=engine).run(recording).estimates
    moment = then.span[0] + shift
    lost = [e.t for e in estimates if e.state is State.LOST]
    assert lost
    assert moment < lost[0] < moment + 12.0
    assert estimates[-1].state is State.TRACKING
    assert lost[-1] < estimates[-1].t
    scans = [s.t for s in recording.wifi if moment <= s.t <= lost[0]]
    assert len(scans) >= 3  # patience


def test_a_start_on_the_wrong_floor_is_mended(world: Any) -> None:
    right, wrong = world.walks[0], world.walks[1]
    scans = tuple(
        replace(bad, t=good.t, last_seen=bad.last_seen + good.t - bad.t)
        for good, bad in zip(right.wifi[:2], wrong.wifi[:2], strict=True)
    )
    recording = replace(right, wifi=scans + right.wifi[2:])
    estimates = fused.build(world.site, world.survey).run(recording).estimates
    off = errors(world, estimates, right, 0.0)
    start = next(i for i, e in enumerate(estimates) if e.t >= scans[0].t)
    assert np.isinf(off[start])
    late = np.array([e.t > scans[1].t + 20.0 for e in estimates])
    assert late.sum() > 10
    assert np.median(off[late]) < 8.0
    assert np.mean(np.isinf(off[late])) < 0.05


def test_a_cloud_that_spreads_is_lost_once_it_was_settled(world: Any) -> None:
    recording = world.walks[0]
    far = replace(
        recording.wifi[6], t=recording.wifi[5].t + 250.0, bssid=np.uint64([1]), rssi=np.float32([-50])
    )
    far = replace(far, frequency=np.int32([0]), last_seen=np.array([far.t]))
    # six scans, no motion sensors, then nothing for minutes: the cloud diffuses over the house
    deaf = Recording(recording.name, wifi=(*recording.wifi[:6], far))
    tracker = fused.build(world.site, world.survey)
    engine = replace(tracker.engine, recovery=Recovery(lost=LOST_AT))
    estimates = replace(tracker, engine=engine).run(deaf).estimates
    settled = next(i for i, e in enumerate(estimates) if e.state is State.TRACKING)
    for e in estimates[:settled]:
        assert e.state is State.INITIALISING
    for e in estimates[settled:]:
        assert e.state is (State.LOST if e.r95 > LOST_AT else State.TRACKING)
    assert estimates[-1].state is State.LOST


def test_parameters_out_of_range_are_refused() -> None:
    for bad in (
        {"injection": 1.0},
        {"injection": -0.1},
        {"injection_least": -0.1},
        {"hold": 1.5},
        {"reset_share": 1.5},
        {"patience": 0},
    ):
        with pytest.raises(ConfigError, match="shares, patience"):
            Recovery(**bad)


def test_in_silence_the_cloud_spreads_and_keeps_its_particles(world: Any) -> None:
    recording = world.walks[0]
    far = replace(
        recording.wifi[6], t=recording.wifi[5].t + 200.0, bssid=recording.wifi[6].bssid + np.uint64(1 << 47)
    )
    far = replace(far, last_seen=np.full(len(far.bssid), far.t))
    for method in ("walkable", "barriers"):
        tracker = fused.build(world.site, world.survey, fused.Config(map_constraint=method))  # type: ignore[arg-type]
        state, out = tracker.init("silence"), []
        for record in Recording("silence", wifi=(*recording.wifi[:6], far)).records():
            state, more, _ = tracker.step(state, record)
            out += more
        weights = state.engine.filter.weights
        assert 1.0 / np.sum(weights**2) > 0.3 * len(weights)
        spread = [e.r95 for e in out if e.t > recording.wifi[5].t + 2.0]
        assert spread[-1] > 1.5 * spread[0]
        assert np.all(np.diff(spread) > -0.25 * np.array(spread[:-1]))  # nothing heard makes nobody surer
