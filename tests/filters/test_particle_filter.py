"""The filter against two exact answers: Kalman's on a line, and brute force over the cells of a corridor."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

from wayfuse.core.errors import ConfigError
from wayfuse.core.philox import Noise
from wayfuse.core.types import Array
from wayfuse.filters.cloud import Cloud
from wayfuse.filters.particle_filter import FilterState, ParticleFilter, Snapshot, replace_particles
from wayfuse.filters.resampling import RESAMPLERS

KEY = (11, 12)


@dataclass(frozen=True)
class Drift:
    """x + u + N(0, q), on a line."""

    sigma: float

    def propagate(self, noise: Noise, cloud: Cloud, event: float, /) -> Cloud:
        z = noise.normals(cloud.n)[0]
        return cloud._replace(x=cloud.x + np.float32(event) + np.float32(self.sigma) * z)


@dataclass(frozen=True)
class Hop:
    """One cell to the right with probability 0.6, to the left with 0.2; walls at both ends."""

    n_cells: int

    def propagate(self, noise: Noise, cloud: Cloud, event: None, /) -> Cloud:  # noqa: ARG002
        u = noise.uniforms(cloud.n)[0]
        move = np.where(u < 0.6, 1.0, np.where(u < 0.8, -1.0, 0.0))
        return cloud._replace(x=np.clip(cloud.x + move, 0.0, self.n_cells - 1.0).astype(np.float32))


@dataclass(frozen=True)
class OneWay:
    """Nobody gets beyond ``end``: such moves are undone and cost ``penalty``."""

    end: float
    penalty: float

    def restrict(self, before: Cloud, after: Cloud, log_weights: Array, /) -> tuple[Cloud, int]:
        bad = after.x > self.end
        log_weights[bad] -= self.penalty
        return after._replace(x=np.where(bad, before.x, after.x)), int(bad.sum())


def start(x: Array) -> FilterState:
    n = len(x)
    column = x.astype(np.float32)
    zero = np.zeros(n, np.float32)
    return FilterState(Cloud.on_floors(column, zero, zero, zero + 1, np.zeros(n, np.int32)), np.zeros(n), 0)


@pytest.mark.parametrize("scheme", RESAMPLERS)
def test_it_tends_to_the_kalman_filter(scheme: str) -> None:
    n, q, r, prior = 40_000, 0.5, 1.2, 2.0
    rng = np.random.default_rng(0)
    filtered = ParticleFilter(RESAMPLERS[scheme], ess_ratio=0.5)
    state = start(prior * Noise((1, 2)).normals(n)[0].astype(np.float64))
    mean, variance, truth, evidence, exact = 0.0, prior**2, 0.3, 0.0, 0.0
    for _ in range(12):
        truth += 0.8 + q * rng.normal()
        z = truth + r * rng.normal()
        state, _ = filtered.predict(KEY, state, Drift(q), 0.8, None)
        state, info = filtered.update(KEY, state, -0.5 * ((z - state.cloud.x) / r) ** 2, always_resample=True)
        evidence += info.log_evidence
        mean, variance = mean + 0.8, variance + q**2
        exact += -0.5 * (z - mean) ** 2 / (variance + r**2) + 0.5 * np.log(r**2 / (variance + r**2))
        gain = variance / (variance + r**2)
        mean, variance = mean + gain * (z - mean), (1.0 - gain) * variance
        w = state.weights
        got = w @ state.cloud.x
        # variance of the estimate: at most a few times that of n independent draws from the posterior
        z_score = (got - mean) / np.sqrt(4.0 * variance / n)
        assert abs(z_score) < 5.0
        assert w @ (state.cloud.x - got) ** 2 == pytest.approx(variance, rel=0.06)
    assert evidence == pytest.approx(exact, abs=0.1)


@pytest.mark.parametrize("ess_ratio", [0.3, 0.5, 1.0])
def test_it_tends_to_brute_force_over_a_corridor(ess_ratio: float) -> None:
    cells, n = 20, 60_000
    rng = np.random.default_rng(4)
    signal = rng.normal(0.0, 3.0, cells)  # what is measured in each cell
    step = np.zeros((cells, cells))
    for i in range(cells):
        for p, to in ((0.6, min(i + 1, cells - 1)), (0.2, max(i - 1, 0)), (0.2, i)):
            step[i, to] += p
    belief = np.full(cells, 1.0 / cells)
    filtered = ParticleFilter(ess_ratio=ess_ratio)
    state = start(np.arange(n) % cells)
    place = 2
    for _ in range(15):
        place = int(rng.choice(cells, p=step[place]))
        z = signal[place] + rng.normal()
        likelihood = np.exp(-0.5 * (z - signal) ** 2 / 4.0)
        belief = belief @ step * likelihood
        belief /= belief.sum()
        state, _ = filtered.predict(KEY, state, Hop(cells), None, None)
        at = state.cloud.x.astype(int)
        state, _ = filtered.update(KEY, state, np.log(likelihood[at]))
        got = np.bincount(state.cloud.x.astype(int), state.weights, minlength=cells)
        assert 0.5 * np.abs(got - belief).sum() < 0.03  # total variation
    assert np.argmax(belief) == np.argmax(got)


def test_it_resamples_when_few_particles_count() -> None:
    state = start(np.arange(100.0))
    even, lone = np.zeros(100), np.where(np.arange(100) == 5, 0.0, -50.0)
    filtered = ParticleFilter(ess_ratio=0.5)
    after, info = filtered.update(KEY, state, even)
    assert (info.resampled, info.ess) == (False, pytest.approx(100.0))
    assert after.draw == 0
    after, info = filtered.update(KEY, state, lone)
    assert info.resampled
    assert info.ess == pytest.approx(1.0)
    np.testing.assert_array_equal(after.cloud.x, 5.0)
    np.testing.assert_array_equal(after.log_weights, 0.0)
    assert after.draw == 1
    assert ParticleFilter(ess_ratio=0.0).update(KEY, state, lone)[1].resampled is False


def test_moves_that_are_forbidden_are_undone_and_cost() -> None:
    state = start(np.array([0.0, 5.0, 9.5]))
    after, n = ParticleFilter().predict(KEY, state, Drift(0.0), 1.0, OneWay(10.0, 2.0))
    assert n == 1
    np.testing.assert_array_equal(after.cloud.x, [1.0, 6.0, 9.5])
    np.testing.assert_array_equal(after.log_weights, [0.0, 0.0, -2.0])
    np.testing.assert_array_equal(state.log_weights, 0.0)


def test_the_past_follows_the_ancestors() -> None:
    state = start(np.arange(4.0))
    past = Snapshot(0.0, state.cloud.x + 10, state.cloud.y, state.cloud.floor)
    state = state._replace(history=(past,))
    lone = np.array([-99.0, -99.0, 0.0, -99.0])
    after, _ = ParticleFilter().update(KEY, state, lone)
    np.testing.assert_array_equal(after.history[0].x, 12.0)
    fresh = Cloud.on_floors(*(np.float32([70.0]) for _ in range(4)), np.int32([1]))
    replaced = replace_particles(after, np.array([1]), fresh)
    np.testing.assert_array_equal(replaced.cloud.x, [2, 70, 2, 2])
    np.testing.assert_array_equal(replaced.history[0].x, [12, 70, 12, 12])
    np.testing.assert_array_equal(replaced.history[0].floor, [0, 1, 0, 0])
    np.testing.assert_array_equal(after.cloud.x, 2.0)


def test_nothing_is_changed_in_place() -> None:
    state = start(np.linspace(0, 9, 50))
    before = [column.copy() for column in (*state.cloud, state.log_weights)]
    filtered = ParticleFilter(ess_ratio=1.0)
    moved, _ = filtered.predict(KEY, state, Drift(1.0), 1.0, OneWay(5.0, 1.0))
    filtered.update(KEY, moved, -moved.cloud.x.astype(float))
    for now, then in zip((*state.cloud, state.log_weights), before, strict=True):
        np.testing.assert_array_equal(now, then)


def test_a_share_outside_its_range_is_refused() -> None:
    for share in (-0.1, 1.1, np.nan):
        with pytest.raises(ConfigError, match="ess_ratio must lie in"):
            ParticleFilter(ess_ratio=share)
