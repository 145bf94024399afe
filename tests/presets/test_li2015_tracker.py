"""li2015 as a tracker: its parts, simulated walks with steps and without, the published walks of wifi-rtt."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from wayfuse.core.errors import ConfigError, UsageError
from wayfuse.core.philox import Noise
from wayfuse.core.types import Array
from wayfuse.filters.cloud import Cloud
from wayfuse.formats import wifi_rtt
from wayfuse.maps.build import build_floor
from wayfuse.maps.geometry import Polygon
from wayfuse.maps.site import Site
from wayfuse.models.motion.constant_velocity import ConstantVelocity, MovingCloud
from wayfuse.models.motion.course_and_speed import CourseAndSpeed, Held, StepsOrVelocity
from wayfuse.models.motion.pdr import StepInput
from wayfuse.models.observation.ranges import Exponents
from wayfuse.models.range_start import RangeStart, RestingStart
from wayfuse.papers.li2015_real import read_walks
from wayfuse.presets.li2015 import Config
from wayfuse.presets.li2015_tracker import build
from wayfuse.presets.methods import begun_at
from wayfuse.radio.ap_places import ApPlaces
from wayfuse.radio.range_correction import RangeLine, fit_range_line
from wayfuse.sensors.recording import Recording
from wayfuse.sensors.records import Range
from wayfuse.tracking.dead_reckoning import Start
from wayfuse.tracking.estimate import State

N = 4000
SPREAD = Config(n_particles=600)


def rectangle(x1: float, y1: float) -> Polygon:
    return Polygon(np.array([[0.0, 0.0], [x1, 0.0], [x1, y1], [0.0, y1]]))


def placed(anchors: Sequence[int], xy: Array, floor: int = 0) -> ApPlaces:
    n = len(xy)
    return ApPlaces(
        np.array(anchors, np.uint64), xy[:, 0], xy[:, 1], np.full(n, floor, np.int32), np.full(n, np.nan)
    )


def errors(tracker: Any, recording: Recording, truth: Any) -> Array:
    """Errors (k,) m of the estimates of a track, after 3 s; truth : places (k, 2) m of times (k,) s."""
    start = recording.ranges[0].t
    said = [
        e
        for e in tracker.run(recording, 0).estimates
        if e.state is not State.INITIALISING and e.t > start + 3.0
    ]
    assert said
    return np.hypot(*(np.array([(e.x, e.y) for e in said]) - truth(np.array([e.t for e in said]))).T)


# the parts


def test_course_and_speed_are_the_constant_velocity_of_the_paper() -> None:
    rng = np.random.default_rng(0)
    x, y, vx, vy = rng.normal(size=(4, N))
    cloud = Cloud.on_floors(
        x.astype(np.float32), y.astype(np.float32), np.arctan2(vy, vx).astype(np.float32),
        np.hypot(vx, vy).astype(np.float32), np.ones(N, np.int32),
    )  # fmt: skip
    for k, dt in enumerate((0.2, 1.0, 3.0)):
        after = CourseAndSpeed(acceleration_sigma=0.5).propagate(Noise.of(k, "a"), cloud, dt)
        expected = ConstantVelocity(0.5).propagate(Noise.of(k, "a"), MovingCloud(x, y, vx, vy), dt)
        assert after.x == pytest.approx(expected.x, abs=2e-5)
        assert after.y == pytest.approx(expected.y, abs=2e-5)
        assert after.step_scale * np.cos(after.heading_bias) == pytest.approx(expected.vx, abs=2e-5)
        assert after.step_scale * np.sin(after.heading_bias) == pytest.approx(expected.vy, abs=2e-5)
        assert (after.floor == 1).all()
    long = CourseAndSpeed(acceleration_sigma=0.0, longest=2.0).propagate(Noise.of(0, "a"), cloud, 1000.0)
    assert long.x == pytest.approx(x + 2.0 * vx, abs=2e-5)


def test_a_step_moves_and_leaves_no_other_velocity() -> None:
    still = np.zeros(N, np.float32)
    cloud = Cloud.on_floors(still, still, still + 1, still + 2, np.zeros(N, np.int32))
    after = StepsOrVelocity(0.3).propagate(Noise.of(0, "b"), cloud, StepInput(0.7, 0.5 * np.pi))
    assert after.x.mean() == pytest.approx(0.0, abs=0.02)
    assert after.y.mean() == pytest.approx(0.7, abs=0.02)
    assert after.x.std() == pytest.approx(0.3, rel=0.06)
    assert not after.step_scale.any()
    assert Held().propagate(Noise.of(0, "b"), cloud, 5.0) is cloud
    for bad in (lambda: CourseAndSpeed(acceleration_sigma=-1.0), lambda: StepsOrVelocity(-1.0)):
        with pytest.raises(ConfigError):
            bad()


def test_the_start_is_the_fix_of_the_anchors_of_one_floor() -> None:
    xy = np.array([[0.0, 0.0], [10.0, 0.0], [10.0, 10.0], [50.0, 50.0]])
    places = replace(placed((1, 2, 3, 4), xy), floor=np.array([1, 1, 1, 0], np.int32))
    start = RangeStart(places=places, line=RangeLine(-1.0, 1.0), sigma=2.0)
    true = np.hypot(*(xy[:3] - [6.0, 3.0]).T)
    seen = (
        *(Range(0.0, a, d + 1.0) for a, d in zip((1, 2, 3), true, strict=True)),
        Range(0.0, 4, 5.0),
        Range(0.0, 99, 5.0),
    )
    cloud = start.draw(Noise.of(0, "c"), seen, N, heading_known=True)
    assert cloud is not None
    assert (cloud.floor == 1).all()
    assert [cloud.x.mean(), cloud.y.mean()] == pytest.approx([6.0, 3.0], abs=0.15)
    assert cloud.x.std() == pytest.approx(2.0, rel=0.06)
    contradictory = [r._replace(distance=d) for r, d in zip(seen[:3], (1.5, 1.5, 15.0), strict=True)]
    wrong = start.draw(Noise.of(0, "c"), contradictory, N, heading_known=True)
    assert wrong is not None
    assert wrong.x.std() > 3.0  # the worse ranges agree, the less is known
    few = start.draw(Noise.of(0, "c"), [Range(0.0, 4, 21.0)], N, heading_known=True)
    assert few is not None
    assert few.x.std() == pytest.approx(20.0, rel=0.06)  # somewhere about the one anchor
    for nothing in (None, (), (Range(0.0, 99, 5.0),)):
        assert start.draw(Noise.of(0, "c"), nothing, N, heading_known=True) is None
    told = RestingStart(sigma=0.5).at(3.0, 4.0, 0).draw(Noise.of(0, "c"), None, N)
    assert [told.x.mean(), told.y.mean(), told.floor[0]] == pytest.approx([3.0, 4.0, 0.0], abs=0.05)


def test_without_places_it_says_what_it_needs(world: Any) -> None:
    with pytest.raises(UsageError, match="--access-points"):
        build(world.site, None)


# walks


@pytest.fixture(scope="module")
def ranged(world: Any) -> tuple[Recording, ApPlaces, Any]:
    """A simulated walk with ranges every second to eight anchors of its floor; farther ones are worse."""
    rng = np.random.default_rng(6)
    recording = world.walks[1]
    truth = world.truth[recording.name]
    k = world.site.floor_index(truth.floor_name)
    floor = world.site.floors[k]
    xy = rng.uniform((0.0, 0.0), (floor.width, floor.height), (8, 2))
    ranges = []
    for t in np.arange(truth.t[0], truth.t[-1], 1.0):
        true = np.hypot(*(xy - truth.at(np.array([t]))[0]).T)
        measured = true * (1.0 + 0.1 * rng.normal(size=8)) + 0.3 * rng.normal(size=8)
        ranges += [Range(float(t), a + 1, float(d)) for a, d in enumerate(measured)]
    return replace(recording, ranges=tuple(ranges), wifi=()), placed(range(1, 9), xy, k), truth


def test_steps_and_ranges_together_are_better_than_ranges(world: Any, ranged: Any) -> None:
    recording, places, truth = ranged
    tracker = build(world.site, None, places=places, config=SPREAD)
    both = errors(tracker, recording, truth.at)
    alone = errors(tracker, Recording(recording.name, ranges=recording.ranges), truth.at)
    assert both.mean() < alone.mean()
    assert alone.mean() < 2.5
    assert both.mean() < 1.5
    floors = {e.floor for e in tracker.run(recording, 0).estimates if e.state is not State.INITIALISING}
    assert {world.site.floors[f].name for f in floors} == {truth.floor_name}


def test_exponents_help_where_far_ranges_are_worse() -> None:
    site = Site("hall", (build_floor("0", 0, [rectangle(60.0, 20.0)]),))
    xy = np.array([[2.0, 2.0], [8.0, 3.0], [4.0, 9.0], [55.0, 4.0], [58.0, 16.0]])
    true = np.hypot(*(xy - [5.0, 5.0]).T)
    late = true + np.array([0.0, 0.0, 0.0, 8.0, 8.0])
    ranges = tuple(Range(0.5 * k, a + 1, float(d)) for k in range(60) for a, d in enumerate(late))
    means = [
        errors(
            build(site, None, places=placed(range(1, 6), xy), config=replace(SPREAD, exponents=e)),
            Recording("r", ranges=ranges),
            lambda t: np.broadcast_to([5.0, 5.0], (len(t), 2)),
        ).mean()
        for e in (Exponents.INVERSE_RANGE, Exponents.EQUAL, Exponents.ONE)
    ]
    assert means[0] < 0.6 * min(means[1:])


def test_replay_is_the_live_form_and_a_start_is_taken(world: Any, ranged: Any) -> None:
    recording, places, truth = ranged
    x, y = truth.at(truth.t[:1])[0]
    start = Start(float(x), float(y), world.site.floor_index(truth.floor_name))
    tracker = begun_at(build(world.site, None, places=places, config=SPREAD, lag=2.0), start)
    whole = tracker.run(recording, 3).estimates
    state, live = tracker.init(recording.name, 3), []
    for record in replace(recording, waypoints=()).records():
        state, out, _ = tracker.step(state, record)
        live += out
    live += tracker.flush(state, state.now)[1]
    assert live == whole
    assert np.hypot(whole[0].x - x, whole[0].y - y) < 1.0


@pytest.mark.real_data
@pytest.mark.parametrize("room", ["Laboratory", "Conference Room"])
def test_published_walks_are_followed(room: str, data_root: Path) -> None:
    walks = [w for w in read_walks(data_root / "wifi-rtt") if w.room == room]
    if not walks:
        pytest.skip("REAL DATA ABSENT: no wifi-rtt; fetch with `wayfuse datasets fetch wifi-rtt`")
    development = [w for w in walks if w.is_development]
    line = fit_range_line(*(np.concatenate([getattr(w, name).ravel() for w in development])
                            for name in ("ranges", "distances")))  # fmt: skip
    (path,) = (data_root / "wifi-rtt").glob(f"*/raw_data/{room}/3/324.csv")
    recording = wifi_rtt.read(path)
    anchors = wifi_rtt.read_places(path.parent.parent)
    xy = np.array([a[1:] for a in anchors])
    site = Site(room, (build_floor("0", 0, [rectangle(*(xy.max(axis=0) + 3.0))]),))
    places = placed([a.anchor for a in anchors], xy)
    points = np.array([w[:3] for w in recording.waypoints])

    def truth(t: Array) -> Array:
        return np.column_stack([np.interp(t, points[:, 0], points[:, k]) for k in (1, 2)])

    corrected = Config(range_line=line, acceleration_sigma=0.1, n_particles=500)
    found = errors(build(site, None, places=places, config=corrected), recording, truth)
    raw = errors(
        build(site, None, places=places, config=replace(corrected, range_line=RangeLine())), recording, truth
    )
    assert found.mean() < 1.5
    assert found.mean() < 0.6 * raw.mean()
