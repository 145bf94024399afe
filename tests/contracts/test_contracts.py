"""One contract for everything that fits a seam: shapes, types, inputs unchanged, same seed same bits.

A new algorithm adds a row to a table below.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import FrozenInstanceError, fields, is_dataclass, replace
from typing import Any

import numpy as np
import pytest

from wayfuse.core.philox import Noise
from wayfuse.filters.cloud import Cloud
from wayfuse.filters.resampling import RESAMPLERS
from wayfuse.inertial.front_end import StepEvent
from wayfuse.models.constraint.barriers import Barriers
from wayfuse.models.constraint.speed_filter import SpeedDisc
from wayfuse.models.constraint.walkable_mask import WalkableMask
from wayfuse.models.motion.pdr import PdrMotion, StepInput
from wayfuse.models.motion.random_walk import RandomWalk
from wayfuse.models.observation.coverage import SurveyDistance
from wayfuse.models.observation.fingerprint import FingerprintLikelihood
from wayfuse.presets import baselines, catalogue, fused
from wayfuse.presets.catalogue import PAPERS
from wayfuse.presets.methods import build_method
from wayfuse.radio.sparse_knn import SparseKnn
from wayfuse.radio.survey import Fingerprint
from wayfuse.tracking.dead_reckoning import Start
from wayfuse.tracking.engine import Known
from wayfuse.tracking.estimate import Estimate, State

N = 64
FEW = fused.Config(n_particles=N)

MOTIONS: dict[str, tuple[Any, Any]] = {
    "pdr": (PdrMotion(), StepInput(0.7, 1.0)),
    "random walk": (RandomWalk(1.5), 0.5),
}
CONSTRAINTS: dict[str, Callable[[Any], Any]] = {
    "none to speak of": lambda site: Barriers(tuple(f.barrier_index for f in site.floors), 0.0),
    "barriers": lambda site: Barriers(tuple(f.barrier_index for f in site.floors)),
    "walkable": lambda site: WalkableMask(tuple(f.walkable for f in site.floors)),
    "speed": lambda site: SpeedDisc(0.5 * site.floors[1].width, 0.5 * site.floors[1].height, 1, 8.0),
}
OBSERVATIONS: dict[str, Callable[[Any], Any]] = {
    "mixture": lambda _: FingerprintLikelihood(),
    "with coverage": lambda world: FingerprintLikelihood(coverage=SurveyDistance.build(world.survey)),
}
WITHOUT_RANGES = tuple(name for name in PAPERS if "ranges" not in catalogue.METHODS[name].hears)
METHODS: dict[str, Callable[[Any], Any]] = {
    "fused": lambda w: fused.build(w.site, w.survey, FEW),
    "fused, lag": lambda w: fused.build(w.site, w.survey, FEW, lag=3.0),
    "barriers": lambda w: fused.build(w.site, w.survey, replace(FEW, map_constraint="barriers")),
    **{
        name: (lambda w, n=name: build_method(n, w.site, w.survey, n_particles=N))
        for name in ("fused-no-map", "fused-no-steps", "fused-2.4ghz", "fused-5ghz", *WITHOUT_RANGES)
    },
    **{
        scheme: (lambda w, s=scheme: fused.build(w.site, w.survey, replace(FEW, resampling=s)))
        for scheme in RESAMPLERS
    },
    "no injection": lambda w: fused.build(w.site, w.survey, replace(FEW, injection=0.0, injection_least=0.0)),
    "random walk": lambda w: fused.build(w.site, w.survey, replace(baselines.RANDOM_WALK, n_particles=N)),
    "wknn": lambda w: baselines.wknn(w.site, w.survey),
    "nnss": lambda w: baselines.nnss(w.site, w.survey),
    "pdr": lambda w: baselines.dead_reckoning(w.site, Start(20.0, 11.0, 0)),
}


def cloud(world: Any, n: int = N) -> Cloud:
    """Particles around the fingerprints of the survey, on all floors."""
    rng = np.random.default_rng(5)
    rows = rng.integers(0, len(world.survey), n)
    xy = world.survey.xy[rows] + rng.normal(0.0, 1.5, (n, 2))
    bias, scale = rng.normal(0.0, 0.2, n), rng.normal(1.0, 0.1, n)
    columns = (a.astype(np.float32) for a in (xy[:, 0], xy[:, 1], bias, scale))
    return Cloud.on_floors(*columns, world.survey.floor[rows].astype(np.int32))


def fingerprint(world: Any) -> Fingerprint:
    survey = world.survey
    row = slice(survey.indptr[7], survey.indptr[8])
    ids, rssi = survey.bssid[survey.indices[row]], survey.rssi[row]
    return Fingerprint(ids, rssi, np.zeros(len(ids), np.int32))


def copies(*arrays: np.ndarray) -> list[np.ndarray]:
    return [a.copy() for a in arrays]


def same(found: Any, kept: list[np.ndarray]) -> None:
    for now, then in zip(found, kept, strict=True):
        np.testing.assert_array_equal(now, then)


def is_cloud(c: Cloud, n: int = N) -> None:
    for name, column in c._asdict().items():
        assert column.shape == (n,)
        assert column.dtype == (np.int32 if name in ("floor", "connector") else np.float32)
        assert np.all(np.isfinite(column))


@pytest.mark.parametrize("scheme", RESAMPLERS)
def test_resampler(scheme: str) -> None:
    weights = np.random.default_rng(0).dirichlet(np.ones(N))
    kept = weights.copy()
    noise = Noise.of(1, "x")
    first = RESAMPLERS[scheme](noise, weights, 40)
    assert first.shape == (40,)
    assert first.dtype == np.int64
    assert np.all((first >= 0) & (first < N))
    assert noise.draw == 1  # one draw, whatever the weights: a replay counts on it
    np.testing.assert_array_equal(weights, kept)
    np.testing.assert_array_equal(RESAMPLERS[scheme](Noise.of(1, "x"), weights, 40), first)
    assert np.any(RESAMPLERS[scheme](Noise.of(2, "x"), weights, 40) != first)


@pytest.mark.parametrize("name", MOTIONS)
def test_motion_model(world: Any, name: str) -> None:
    model, event = MOTIONS[name]
    before = cloud(world)
    kept = copies(*before)
    after = model.propagate(Noise.of(1, "x"), before, event)
    is_cloud(after)
    same(before, kept)
    np.testing.assert_array_equal(after.floor, before.floor)
    same(model.propagate(Noise.of(1, "x"), before, event), list(after))
    assert np.any(model.propagate(Noise.of(2, "x"), before, event).x != after.x)
    few = model.propagate(Noise.of(1, "x"), before.take(np.arange(5)), event)
    same(few, [column[:5] for column in after])  # a particle's noise does not depend on the others


@pytest.mark.parametrize("name", CONSTRAINTS)
def test_constraint(world: Any, name: str) -> None:
    constraint = CONSTRAINTS[name](world.site)
    before = cloud(world, 400)
    after = RandomWalk(2.0).propagate(Noise.of(1, "x"), before, 1.0)
    kept = copies(*before, *after)
    log_weights = np.linspace(-1.0, 0.0, 400)
    found, n = constraint.restrict(before, after, log_weights)
    is_cloud(found, 400)
    same((*before, *after), kept)
    lost = np.linspace(-1.0, 0.0, 400) - log_weights
    assert np.all(lost >= 0.0)
    assert np.count_nonzero(lost > 0.0) == (n if constraint.penalty else 0)
    assert 0 < n < 400
    order = np.random.default_rng(2).permutation(400)
    shuffled = np.linspace(-1.0, 0.0, 400)[order]
    again, m = constraint.restrict(before.take(order), after.take(order), shuffled)
    assert m == n
    same(again, [column[order] for column in found])
    np.testing.assert_array_equal(shuffled, log_weights[order])


@pytest.mark.parametrize("name", OBSERVATIONS)
def test_observation_model(world: Any, name: str) -> None:
    model = OBSERVATIONS[name](world)
    near = SparseKnn(world.survey).neighbours(fingerprint(world))
    assert near is not None
    near = near._replace(distance=0.4)  # beyond which the coverage term counts
    c = cloud(world)
    kept = copies(*c, *near[:4])
    out = np.zeros(N)
    model.log_likelihood(c, near, out)
    assert np.all(np.isfinite(out))
    assert np.ptp(out) > 0.1
    same((*c, *near[:4]), kept)
    order = np.random.default_rng(3).permutation(N)
    shuffled = np.zeros(N)
    model.log_likelihood(c.take(order), near, shuffled)
    np.testing.assert_array_equal(shuffled, out[order])
    added = np.full(N, 3.0)
    model.log_likelihood(c, near, added)
    np.testing.assert_allclose(added, out + 3.0, rtol=1e-12)


@pytest.fixture(params=METHODS)
def method(request: pytest.FixtureRequest, world: Any) -> Any:
    return METHODS[request.param](world)


def test_method_on_a_recording(world: Any, method: Any) -> None:
    recording = world.walks[0]
    kept = copies(
        *(s.values for s in (recording.acceleration, recording.orientation)),
        *(s.rssi for s in recording.wifi),
    )
    done = method.run(recording, 3)
    same(
        (recording.acceleration.values, recording.orientation.values, *(s.rssi for s in recording.wifi)), kept
    )
    assert done.name == recording.name
    assert sum(done.verdicts.values()) == len(recording.wifi)
    assert len(done.estimates) >= len(recording.wifi)
    for e in done.estimates:
        assert isinstance(e, Estimate)
        numbers = [v for v in e if isinstance(v, float)]
        assert np.all(np.isfinite(numbers))
        assert isinstance(e.state, State)
        assert 0 <= e.floor < len(world.site.floors)
        assert type(e.floor) is int
        assert 0.0 <= e.r68 <= e.r95
        assert 0.0 < e.ess <= 1.0 + 1e-9
        assert 0.0 <= e.share_blocked <= 1.0
    assert done.estimates == method.run(recording, 3).estimates


def test_engine_keeps_its_states(world: Any, method: Any) -> None:
    """States are values: going on from one twice gives the same, and leaves it as it was."""
    engine = method.engine
    state = engine.init("x", 1)
    step = StepEvent(0.0, 0.7, 0.3, 0.5, 2.0, -2.0, 1.0, 0.0, 1.0)
    for k in range(3):
        state = engine.on_fingerprint(state, 2.0 * k, fingerprint(world), Known())
        state = engine.on_step(state, step)

    def onward() -> list[Estimate]:
        after, out = state, []
        for k in range(4):
            after = engine.on_step(after, step)
            after = engine.on_quiet(after, 0.5)
            after = engine.on_fingerprint(after, 7.0 + k, fingerprint(world), Known(heading=False))
            after, e = engine.estimate(after, 7.0 + k)
            out.append(e)
        return out

    assert onward() == onward()
    assert isinstance(engine.uses_steps, bool)
    assert isinstance(engine.uses_scans, bool)
    assert isinstance(engine.supports_lag, bool)


def test_configuration_is_frozen(method: Any) -> None:
    for thing in (method, method.engine):
        assert is_dataclass(thing)
        with pytest.raises((FrozenInstanceError, AttributeError)):
            setattr(thing, fields(thing)[0].name, None)
