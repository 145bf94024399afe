"""The methods behind the tracker: fixes, dead reckoning, and how a cloud is summed up."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from wayfuse.core.errors import ConfigError, UsageError
from wayfuse.filters.particle_filter import Snapshot
from wayfuse.inertial.front_end import StepEvent
from wayfuse.presets import baselines, fused
from wayfuse.radio.sparse_knn import SparseKnn
from wayfuse.sensors.records import Acceleration, MagneticField
from wayfuse.tracking.dead_reckoning import DeadReckoning, Start
from wayfuse.tracking.engine import Known
from wayfuse.tracking.estimate import State
from wayfuse.tracking.summary import Summary, summarise

PLAIN = Summary(scale_68=1.0, offset_68=0.0, scale_95=1.0, offset_95=0.0, median_iterations=0)


def step(length: float, heading: float, t: float = 0.0) -> StepEvent:
    return StepEvent(t, length, heading, 0.5, 2.0, -2.0, 1.0, 0.0, 1.0)


def test_dead_reckoning_adds_up_steps() -> None:
    engine = DeadReckoning(start=Start(10.0, 5.0, 1), rotation=0.5)
    state = engine.init("x", 0)
    for heading in (0.5, 0.5 + np.pi / 2, 0.5 + np.pi):
        state = engine.on_step(state, step(0.8, heading))
    state, e = engine.estimate(state, 3.0)
    assert (e.x, e.y, e.floor, e.n_steps) == (pytest.approx(10.0), pytest.approx(5.8), 1, 3)
    assert e.state is State.TRACKING
    _, again = engine.estimate(state, 4.0)
    assert (again.n_steps, again.x) == (0, e.x)
    assert again.r95 > again.r68 > 1.0
    with pytest.raises(UsageError, match="no lag"):
        engine.mark(state, 0.0)
    with pytest.raises(UsageError, match="no lag"):
        engine.recall(state)


def test_nearest_neighbour_holds_each_fix(world: Any) -> None:
    recording = world.walks[0]
    tracker = baselines.nnss(world.site, world.survey)
    estimates = tracker.run(recording).estimates
    places = {tuple(p) for p in world.survey.xy.astype(np.float32).tolist()}
    informed = [e for e in estimates if e.state is State.TRACKING]
    assert len(informed) > 20
    assert {(e.x, e.y) for e in informed} <= places
    scans = [s.t for s in recording.wifi]
    for before, after in pairwise(informed):
        if after.t not in scans:
            assert (after.x, after.y, after.floor) == (before.x, before.y, before.floor)


def test_weighted_neighbours_are_those_of_the_radio_map(world: Any) -> None:
    recording = replace(world.walks[0], wifi=world.walks[0].wifi[:1])
    tracker = baselines.wknn(world.site, world.survey)
    tracker = replace(tracker, engine=replace(tracker.engine, device=None))
    last = tracker.run(recording).estimates[-1]
    _, fingerprint = tracker.scan_buffer.step(tracker.scan_buffer.init(), recording.wifi[0])
    assert fingerprint is not None
    fix = SparseKnn(world.survey).locate(fingerprint)
    assert fix is not None
    assert (last.x, last.y, last.floor) == (fix.x, fix.y, fix.floor)


@pytest.mark.parametrize("method", ["nnss", "fused"])
def test_before_the_first_scan_only_the_house_is_known(world: Any, method: str) -> None:
    recording = replace(world.walks[0], wifi=())
    tracker = (
        baselines.nnss(world.site, world.survey)
        if method == "nnss"
        else fused.build(world.site, world.survey)
    )
    prior = fused.prior_estimate(world.site)
    for e in tracker.run(recording).estimates:
        assert (e.x, e.y, e.floor, e.r95) == (prior.x, prior.y, prior.floor, prior.r95)
        assert e.state is State.INITIALISING


def test_the_first_scan_makes_the_cloud_where_the_scan_says(world: Any) -> None:
    recording = world.walks[0]
    tracker = fused.build(world.site, world.survey)
    first = recording.wifi[0].t
    said = next(e for e in tracker.run(recording).estimates if e.t >= first)
    truth = world.truth[recording.name]
    assert said.floor == truth.floor
    assert np.hypot(*(truth.at(np.array([first]))[0] - (said.x, said.y))) < 12.0


def test_sensors_gone_mad_leave_finite_estimates(world: Any) -> None:
    recording = world.walks[0]
    tracker = fused.build(world.site, world.survey, fused.Config(n_particles=50))
    state, out = tracker.init("mad"), []
    for i, record in enumerate(
        replace(recording, orientation=type(recording.orientation).empty(4)).records()
    ):
        if i % 700 == 650 and isinstance(record, Acceleration | MagneticField):
            record = type(record)(record.t, 1e200, -1e300, 1e250)  # noqa: PLW2901
        state, more, _ = tracker.step(state, record)
        out += more
    assert len(out) > 20
    assert np.all(np.isfinite([(e.x, e.y, e.r68, e.r95) for e in out]))


def snapshot(x: Any, y: Any, floor: Any) -> Snapshot:
    return Snapshot(0.0, np.float32(x), np.float32(y), np.int32(floor))


def test_a_summary_is_of_the_heaviest_floor() -> None:
    cloud = snapshot([0, 2, 50, 51], [0, 0, 7, 7], [0, 0, 1, 1])
    e = summarise(cloud, np.array([0.2, 0.2, 0.3, 0.3]), 2, 5.0, PLAIN)
    assert (e.t, e.x, e.y, e.floor) == (5.0, pytest.approx(50.5), pytest.approx(7.0), 1)
    assert (e.cov_xx, e.cov_xy, e.cov_yy) == pytest.approx((0.25, 0.0, 0.0))
    assert e.r68 > 40.0  # the others count in the radii


def test_radii_of_a_round_cloud_are_those_of_rayleigh() -> None:
    rng = np.random.default_rng(0)
    n = 40_000
    cloud = snapshot(rng.normal(3.0, 2.0, n), rng.normal(4.0, 2.0, n), np.zeros(n))
    e = summarise(cloud, np.full(n, 1.0 / n), 1, 0.0, PLAIN)
    assert e.r68 == pytest.approx(2.0 * np.sqrt(-2.0 * np.log(0.32)), rel=0.02)
    assert e.r95 == pytest.approx(2.0 * np.sqrt(-2.0 * np.log(0.05)), rel=0.02)
    scaled = summarise(cloud, np.full(n, 1.0 / n), 1, 0.0, replace(PLAIN, scale_68=2.0, offset_95=3.0))
    assert scaled.r68 == pytest.approx(2.0 * e.r68)
    assert scaled.r95 == pytest.approx(max(3.0 + e.r95, 2.0 * e.r68))


def test_the_median_lies_in_the_larger_lump() -> None:
    cloud = snapshot([0.0] * 6 + [40.0] * 4, [0.0] * 10, [0] * 10)
    weights = np.full(10, 0.1)
    mean = summarise(cloud, weights, 1, 0.0, PLAIN)
    median = summarise(cloud, weights, 1, 0.0, replace(PLAIN, median_iterations=30))
    assert mean.x == pytest.approx(16.0)
    assert median.x < 3.0


def test_wrong_parameters_are_refused(world: Any) -> None:
    with pytest.raises(ConfigError, match="scales positive"):
        Summary(scale_68=0.0)
    with pytest.raises(ConfigError, match="n_particles must be at least 10"):
        fused.build(world.site, world.survey, fused.Config(n_particles=3))


def test_without_motion_sensors_fused_moves_like_the_random_walk(world: Any) -> None:
    engine = fused.build(world.site, world.survey).engine
    sharp = fused.build(world.site, world.survey, fused.Config(quiet_exponent=9.0)).engine
    scan = world.walks[0].wifi[0]
    tracker = fused.build(world.site, world.survey)
    _, fingerprint = tracker.scan_buffer.step(tracker.scan_buffer.init(), scan)
    assert fingerprint is not None

    def after(engine: Any, *, quiet: bool) -> Any:
        state = engine.on_fingerprint(engine.init("x", 0), scan.t, fingerprint, Known())
        if quiet:
            state = engine.on_quiet(state, 1.0)
            assert state.is_quiet
        else:
            state = engine.on_step(state, step(0.7, 0.3))
            assert not state.is_quiet
        return engine.on_fingerprint(state, scan.t + 1.0, fingerprint, Known())

    assert after(sharp, quiet=True).ess < after(engine, quiet=True).ess < 1.0
    assert after(sharp, quiet=False).ess == after(engine, quiet=False).ess
    state = engine.on_step(after(engine, quiet=True), step(0.7, 0.3))
    assert not state.is_quiet  # the first step ends it
