"""The engine of the published systems: scans and ranges weigh, steps move, nothing that says nothing does anything."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest

from wayfuse.core.errors import ConfigError, UsageError
from wayfuse.core.philox import Noise
from wayfuse.core.types import Array
from wayfuse.filters.cloud import Cloud
from wayfuse.filters.particle_filter import ParticleFilter
from wayfuse.filters.widening import WideningFilter, scaling
from wayfuse.inertial.front_end import StepEvent
from wayfuse.models.initial import KnownStart
from wayfuse.models.motion.pdr import PdrMotion
from wayfuse.models.motion.random_walk import RandomWalk
from wayfuse.models.placed_start import ToldStart
from wayfuse.presets.methods import begun_at
from wayfuse.radio.survey import Fingerprint
from wayfuse.sensors.quality import Verdict
from wayfuse.sensors.recording import Recording, Series
from wayfuse.sensors.records import Range
from wayfuse.tracking.dead_reckoning import Start
from wayfuse.tracking.engine import Known
from wayfuse.tracking.estimate import Estimate, State
from wayfuse.tracking.fix_engine import FixEngine
from wayfuse.tracking.plain_engine import PlainEngine, Seen
from wayfuse.tracking.tracker import Tracker

ANCHORS = {1: (0.0, 0.0), 2: (20.0, 0.0), 3: (0.0, 20.0), 4: (20.0, 20.0)}
STEP = StepEvent(0.5, 0.7, 0.0, 0.5, 2.0, -2.0, 1.0, 0.0, 1.0)
PRIOR = Estimate(0.0, 10.0, 10.0, 0, 30.0, 0.0, 30.0, 8.0, 14.0, State.INITIALISING)


@dataclass(frozen=True)
class ToAnchors:
    sigma: float = 1.0

    def log_likelihood(self, cloud: Cloud, ranges: Sequence[Range], out: Array) -> bool:
        known = [r for r in ranges if r.anchor in ANCHORS]
        for r in known:
            x, y = ANCHORS[r.anchor]
            out -= 0.5 * ((np.hypot(cloud.x - x, cloud.y - y) - r.distance) / self.sigma) ** 2
        return bool(known)


@dataclass(frozen=True)
class Louder:
    """The one access point is at (0, 0): -40 dBm there and 1 dB less per metre."""

    def log_likelihood(self, cloud: Cloud, fingerprint: Fingerprint, out: Array) -> bool:
        heard = fingerprint.bssid == 1
        if not np.any(heard):
            return False
        out -= 0.5 * ((fingerprint.rssi[heard][0] + 40.0 + np.hypot(cloud.x, cloud.y)) / 2.0) ** 2
        return True


@dataclass(frozen=True)
class Anywhere:
    wants_scan: bool = False

    def draw(self, noise: Noise, seen: Seen | None, n: int, *, heading_known: bool) -> Cloud | None:
        assert isinstance(heading_known, bool)
        if self.wants_scan and not isinstance(seen, Fingerprint):
            return None
        u = (20.0 * noise.uniforms(n)).astype(np.float32)
        zero = np.zeros(n, np.float32)
        return Cloud.on_floors(u[0], u[1], zero, zero + 1, np.zeros(n, np.int32))


def engine(**changes: Any) -> PlainEngine:
    parts: dict[str, Any] = {
        "n_floors": 1, "prior": PRIOR, "first": Anywhere(), "told": ToldStart(about=KnownStart(sigma=0.5)),
        "motion": PdrMotion(), "quiet": RandomWalk(0.5), "ranging": ToAnchors(), "n_particles": 2000,
    }  # fmt: skip
    return PlainEngine(**{**parts, **changes})


def ranges(t: float, x: float, y: float, *anchors: int) -> tuple[Range, ...]:
    return tuple(Range(t, k, float(np.hypot(x - ANCHORS[k][0], y - ANCHORS[k][1]))) for k in anchors)


def test_ranges_of_one_moment_find_the_place_together() -> None:
    tracker = Tracker(engine=engine())
    said = tracker.run(
        Recording("r", ranges=(*ranges(0.0, 5.0, 12.0, 1, 2, 3), *ranges(1.0, 5.0, 12.0, 2, 3, 4)))
    )
    last = said.estimates[-1]
    assert np.hypot(last.x - 5.0, last.y - 12.0) < 1.0
    assert last.n_aps == 3
    assert last.state is State.TRACKING
    assert last.r95 < 4.0


def test_a_moment_is_looked_at_when_it_is_over_and_not_before() -> None:
    tracker = Tracker(engine=engine())
    state = tracker.init("r")
    for record in ranges(0.0, 5.0, 5.0, 1, 2, 3):
        state, out, verdict = tracker.step(state, record)
        assert verdict is Verdict.USED
        assert not out
        assert state.engine.filter is None
    state, out, _ = tracker.step(state, ranges(0.5, 5.0, 5.0, 1)[0])
    assert [e.t for e in out] == [0.0]
    state, out = tracker.flush(state, 0.5)
    assert [e.t for e in out] == [0.5]


def test_bad_ranges_have_verdicts_and_change_nothing() -> None:
    tracker = Tracker(engine=engine())
    state = tracker.init("r")
    for record, expected in (
        (Range(0.0, 1, 5.0), Verdict.USED),
        (Range(0.0, 1, 6.0), Verdict.DUPLICATE),
        (Range(0.0, 2, float("nan")), Verdict.NOT_FINITE),
        (Range(0.0, 3, 5000.0), Verdict.OUT_OF_RANGE),
        (Range(-1.0, 4, 5.0), Verdict.LATE),
    ):
        state, _, verdict = tracker.step(state, record)
        assert verdict is expected
    assert state.ranges == (Range(0.0, 1, 5.0),)
    deaf = Tracker(engine=engine(ranging=None, observation=Louder()))
    assert deaf.step(deaf.init("r"), Range(0.0, 1, 5.0))[2] is Verdict.IGNORED


def test_unknown_anchors_change_nothing_not_even_the_random_numbers() -> None:
    e = engine()
    state = e.on_ranges(e.init("r", 0), 0.0, ranges(0.0, 5.0, 5.0, 1, 2), Known())
    assert e.on_ranges(state, 1.0, (Range(1.0, 99, 3.0),), Known()) is state


def test_a_start_that_waits_for_a_scan_is_not_made_by_ranges() -> None:
    e = engine(first=Anywhere(wants_scan=True), observation=Louder())
    state = e.init("r", 0)
    assert e.on_ranges(state, 0.0, ranges(0.0, 5.0, 5.0, 1, 2), Known()) is state
    assert e.estimate(state, 0.0)[1].state is State.INITIALISING
    scan = Fingerprint(np.array([1], np.uint64), np.array([-45.0], np.float32), np.array([2412], np.int32))
    state = e.on_fingerprint(state, 1.0, scan, Known())
    assert state.filter is not None
    cloud = state.filter.cloud
    assert abs(float(np.mean(np.hypot(cloud.x, cloud.y))) - 5.0) < 1.0


def test_steps_move_and_standing_disturbs_only_who_made_none() -> None:
    e = engine(standing=RandomWalk(1.0), always_resample=False, filter=ParticleFilter(ess_ratio=0.0))
    begun = e.on_ranges(e.init("r", 0), 0.0, ranges(0.0, 10.0, 10.0, 1, 2, 3, 4), Known())
    walked = e.on_step(begun, STEP)
    assert begun.filter is not None
    assert walked.filter is not None
    assert float(np.mean(walked.filter.cloud.x - begun.filter.cloud.x)) == pytest.approx(0.7, abs=0.02)
    same = ranges(1.0, 10.0, 10.0, 1)
    after_walk, after_rest = e.on_ranges(walked, 1.0, same, Known()), e.on_ranges(begun, 1.0, same, Known())
    assert after_walk.filter is not None
    assert after_rest.filter is not None
    np.testing.assert_array_equal(after_walk.filter.cloud.x, walked.filter.cloud.x)
    assert float(np.std(after_rest.filter.cloud.x - begun.filter.cloud.x)) == pytest.approx(1.0, abs=0.1)


def test_a_replay_equals_records_one_by_one_and_lag_looks_back() -> None:
    walk = [(0.5 * k, 4.0 + 0.3 * k, 9.0) for k in range(40)]
    t = np.arange(0.0, 20.0, 0.02)
    still = Series(t, np.tile([0.0, 0.0, 9.81], (len(t), 1)))
    recording = Recording(
        "r", acceleration=still, ranges=tuple(r for k, x, y in walk for r in ranges(k, x, y, 1, 2, 3, 4))
    )
    e = engine(standing=RandomWalk(1.0))
    tracker = Tracker(engine=e)
    state, out = tracker.init("r", 3), []
    for record in recording.records():
        state, said, _ = tracker.step(state, record)
        out += said
    out += tracker.flush(state, recording.span[1])[1]
    assert out == tracker.run(recording, 3).estimates
    late = Tracker(engine=e, lag=3.0).run(recording, 3).estimates
    assert [x.t for x in late] == [x.t for x in out]

    def error(estimates: list[Estimate]) -> float:
        seen = [x for x in estimates if 4.0 < x.t < 16.0]
        return float(np.mean([np.hypot(x.x - 4.0 - 0.6 * x.t, x.y - 9.0) for x in seen]))

    assert error(late) < error(out)


def test_a_widening_filter_may_predict_the_steps() -> None:
    e = engine(steps=WideningFilter(wider=scaling("length_sigma")))
    begun = e.on_ranges(e.init("r", 0), 0.0, ranges(0.0, 10.0, 10.0, 1, 2, 3, 4), Known())
    plain = replace(e, steps=None)
    event = STEP
    a, b = e.on_step(begun, event).filter, plain.on_step(begun, event).filter
    assert a is not None
    assert b is not None
    np.testing.assert_array_equal(a.cloud.x, b.cloud.x)  # nothing is blocked, nothing is widened


def test_bad_use_is_named() -> None:
    with pytest.raises(ConfigError, match="neither scans nor ranges"):
        engine(ranging=None)
    with pytest.raises(ConfigError, match="n_particles"):
        engine(n_particles=3)
    begun = engine(starts_unseen=True)
    assert begun.init("r", 0).filter is not None


def test_a_place_that_is_told_is_where_tracks_begin_with_all_else_as_it_was() -> None:
    made = engine()
    told = begun_at(Tracker(engine=made), Start(12.0, 3.0, 0)).engine
    first = told.estimate(told.init("r", 0), 0.0)[1]
    assert np.hypot(first.x - 12.0, first.y - 3.0) < 0.2
    assert told.ranging is made.ranging
    assert made.init("r", 0).filter is None
    scan_by_scan: Any = FixEngine(radio_map=None, prior=PRIOR)  # type: ignore[arg-type]
    with pytest.raises(UsageError, match="finds its start itself"):
        begun_at(Tracker(engine=scan_by_scan), Start(12.0, 3.0, 0))
