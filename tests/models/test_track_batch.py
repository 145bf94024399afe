"""A batch of tracks against the particle filter that takes them one at a time, and its passes against NumPy."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from wayfuse.core.errors import ConfigError, UsageError
from wayfuse.core.philox import Noise, track_key
from wayfuse.filters._batch_kernels import resample_block, weigh_block
from wayfuse.filters.cloud import Cloud
from wayfuse.filters.particle_filter import FilterState, ParticleFilter
from wayfuse.filters.resampling import systematic
from wayfuse.maps.walls import WallIndex
from wayfuse.models._kernels import add_levels, add_places, add_ranges
from wayfuse.models.constraint.barriers import Barriers
from wayfuse.models.motion.pdr import PdrMotion, StepInput
from wayfuse.models.track_batch import BatchModel, Seen, TrackBatch
from wayfuse.radio.level_table import LANES, LevelTable

N = 300
ANCHORS = np.array([[0.0, 0.0], [30.0, 0.0], [30.0, 20.0], [0.0, 20.0], [15.0, 10.0]])
WALLS = WallIndex.build(np.array([[10.0, 0.0, 10.0, 8.0], [10.0, 9.5, 10.0, 20.0], [10.0, 8.0, 20.0, 8.0]]))


def cloud(seed: int, n: int = N) -> Cloud:
    rng = np.random.default_rng(seed)
    x, y = rng.normal((9.0, 8.0), 2.0, (n, 2)).astype(np.float32).T.copy()
    bias, scale = rng.normal(0.0, 0.2, n).astype(np.float32), rng.normal(1.0, 0.05, n).astype(np.float32)
    return Cloud.on_floors(x, y, bias, scale, np.zeros(n, np.int32))


def made_batch(tracks: int) -> TrackBatch:
    return TrackBatch.of([cloud(u) for u in range(tracks)], [track_key(5, str(u)) for u in range(tracks)])


def model(**parameters: object) -> BatchModel:
    return replace(BatchModel(walls=WALLS, anchors=ANCHORS, range_sigma=2.0), **parameters)


def ranges_of(tracks: int, seed: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    d = np.hypot(*(ANCHORS - [9.0, 8.0]).T) + rng.normal(0.0, 1.0, (tracks, len(ANCHORS)))
    d[rng.random(d.shape) < 0.2] = np.nan
    return d


def one_by_one(key: tuple[int, int], state: FilterState, step: np.ndarray, ranges: np.ndarray) -> FilterState:
    """A tick of one track by the parts of the particle filter and NumPy."""
    filter_ = ParticleFilter()
    if step[0] > 0.0:
        barriers = Barriers((WALLS,), penalty=1.2)
        state, _ = filter_.predict(key, state, PdrMotion(), StepInput(*step.tolist()), barriers)
    total = np.zeros(state.cloud.n)
    for (ax, ay), d in zip(ANCHORS, ranges, strict=True):
        if np.isfinite(d):
            total -= (d - np.hypot(state.cloud.x - ax, state.cloud.y - ay)) ** 2 / (2.0 * 2.0**2)
    return filter_.update(key, state, total)[0]


def test_a_tick_is_that_of_the_particle_filter() -> None:
    tracks = 6
    batch, rng = made_batch(tracks), np.random.default_rng(1)
    states = [FilterState(cloud(u), np.zeros(N), 0) for u in range(tracks)]
    resampled = 0
    for tick in range(5):
        steps = np.column_stack([rng.choice([0.0, 0.6, 0.7], tracks), rng.uniform(-3.0, 3.0, tracks)])
        ranges = ranges_of(tracks, tick)
        out = model().tick(batch, np.arange(tracks), steps, Seen(ranges=ranges))
        for u in range(tracks):
            states[u] = one_by_one(track_key(5, str(u)), states[u], steps[u], ranges[u])
            assert batch.counters[u, 2] == states[u].draw
            resampled += int(out[u, 7])
            ours = batch.cloud(u, 0)
            # float32 weights: a position that falls on the end of a particle's share may take its neighbour
            apart = np.abs(ours.x - states[u].cloud.x) + np.abs(ours.y - states[u].cloud.y) > 1e-3
            assert np.mean(apart) <= 0.01
            np.testing.assert_allclose(batch.log_weights[u], states[u].log_weights, atol=2e-3)
            states[u] = FilterState(ours, batch.log_weights[u].astype(np.float64), states[u].draw)
    assert 0 < resampled < 5 * tracks


def test_a_track_does_not_depend_on_the_others() -> None:
    together, alone = made_batch(4), made_batch(4)
    steps, ranges = np.tile([0.7, 0.4], (4, 1)), ranges_of(4, 0)
    out = model().tick(together, [0, 1, 2, 3], steps, Seen(ranges=ranges))
    for u in (2, 0, 3, 1):
        part = model().tick(alone, [u], steps[[u]], Seen(ranges=ranges[[u]]))
        np.testing.assert_array_equal(part[0], out[u])
    for a, b in zip(
        (together.particles, together.log_weights, together.counters),
        (alone.particles, alone.log_weights, alone.counters),
        strict=True,
    ):
        np.testing.assert_array_equal(a, b)


def test_a_checkpoint_goes_on_with_the_same_bits_and_others_stay() -> None:
    batch = made_batch(3)
    kept, first = batch.copy(), batch.particles[1].copy()
    steps, seen = np.tile([0.7, 0.4], (2, 1)), Seen(ranges=ranges_of(2, 4))
    want = model().tick(batch, [0, 2], steps, seen)
    np.testing.assert_array_equal(batch.particles[1], first)
    np.testing.assert_array_equal(model().tick(kept, [0, 2], steps, seen), want)
    np.testing.assert_array_equal(kept.particles, batch.particles)


def test_the_summary_is_that_of_numpy() -> None:
    batch = made_batch(1)
    before, ranges = cloud(0), ranges_of(1, 2)
    out = model(ess_ratio=0.0).tick(batch, [0], [[0.0, 0.0]], Seen(ranges=ranges))[0]
    off = ranges[0] - np.hypot(before.x[:, None] - ANCHORS[:, 0], before.y[:, None] - ANCHORS[:, 1])
    logs = -np.nansum(off**2, axis=1) / 8.0
    w = np.exp(logs - logs.max())
    p = np.column_stack([before.x, before.y]).astype(np.float64)
    mean = w @ p / w.sum()
    spread = (w[:, None] * (p - mean)).T @ (p - mean) / w.sum()
    np.testing.assert_allclose(out[:2], mean, atol=1e-4)
    np.testing.assert_allclose(out[[2, 3, 4]], spread[[0, 0, 1], [0, 1, 1]], rtol=1e-3, atol=1e-4)
    assert out[5] == pytest.approx(w.sum() ** 2 / (w**2).sum(), rel=1e-4)
    assert out[6] == pytest.approx(logs.max() + np.log(w.mean()), abs=1e-4)
    assert out[7] == 0.0


@pytest.mark.parametrize("n", [1, 2, 3, 7, 1000, 1025, 5000])
def test_weights_of_any_number_of_particles(n: int) -> None:
    rng = np.random.default_rng(n)
    x, y, logs = rng.normal(0.0, 3.0, (3, n)).astype(np.float32)
    given, weights, out = logs.copy(), np.empty(n, np.float32), np.empty(8)
    weigh_block(x, y, logs, weights, out)
    np.testing.assert_allclose(weights, np.exp(given - given.max()), rtol=2e-6, atol=1e-12)
    np.testing.assert_array_equal(logs, given - given.max())
    assert out[5] == pytest.approx(
        weights.sum(dtype=float) ** 2 / (weights.astype(float) ** 2).sum(), rel=1e-5
    )


@pytest.mark.parametrize(
    "n", [1, 2, 7, 8, 9, 17, 128, 129, 137, 500]
)  # as many as are folded not at all .. twice
def test_the_greatest_weight_is_found_wherever_it_is(n: int) -> None:
    x, weights, out = np.zeros(n, np.float32), np.empty(n, np.float32), np.empty(8)
    for at in range(n):
        logs = np.linspace(-9.0, -5.0, n, dtype=np.float32)
        logs[at] = -3.0
        weigh_block(x, x, logs, weights, out)
        assert logs[at] == 0.0


@pytest.mark.parametrize("seed", range(8))
def test_ancestors_are_those_of_systematic_resampling(seed: int) -> None:
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 400))
    weights = (rng.exponential(1.0, n) ** rng.integers(0, 6)).astype(np.float32)
    u = Noise.of(seed, "u").uniforms(1)[0, 0]
    block, out = np.arange(n, dtype=np.float32)[None], np.empty((1, n), np.float32)
    logs = np.ones(n, np.float32)
    resample_block(weights, u, block, np.empty(n + 1, np.int32), out, logs)
    want = systematic(Noise.of(seed, "u"), weights.astype(np.float64), n)
    np.testing.assert_array_equal(out[0], want)
    assert not logs.any()


def test_one_particle_of_weight_has_all_the_offspring() -> None:
    weights = np.zeros(50, np.float32)
    weights[17] = 1.0
    out = np.empty((1, 50), np.float32)
    for u in (1e-12, 0.5, 1.0 - 1e-12):
        resample_block(
            weights,
            u,
            np.arange(50, dtype=np.float32)[None],
            np.empty(51, np.int32),
            out,
            np.zeros(50, np.float32),
        )
        assert np.all(out == 17)


def test_ranges_are_those_of_numpy() -> None:
    c, ranges, out = cloud(3), ranges_of(1, 7)[0], np.ones(N, np.float32)
    add_ranges(c.x, c.y, ANCHORS.astype(np.float32), ranges.astype(np.float32), 0.3, out)
    off = ranges - np.hypot(c.x[:, None] - ANCHORS[:, 0], c.y[:, None] - ANCHORS[:, 1])
    np.testing.assert_allclose(out, 1.0 - 0.3 * np.nansum(off**2, axis=1), rtol=1e-4, atol=1e-4)


def level_table(n_aps: int) -> tuple[LevelTable, np.ndarray, np.ndarray]:
    rng = np.random.default_rng(n_aps)
    mean, sigma = rng.uniform(-90, -40, (5, 7, n_aps)), rng.uniform(2.0, 8.0, (5, 7, n_aps))
    return LevelTable.of((4.0, 2.0), 3.0, mean, sigma), mean, sigma


@pytest.mark.parametrize("n_aps", [1, 15, 16, 17, 40])
def test_levels_are_those_of_numpy(n_aps: int) -> None:
    from scipy.interpolate import RegularGridInterpolator

    table, mean, sigma = level_table(n_aps)
    assert table.levels.shape[::3] == (-(-n_aps // LANES), LANES)
    rng = np.random.default_rng(0)
    x, y = rng.uniform((4.0, 2.0), (21.9, 13.9), (N, 2)).astype(np.float32).T.copy()
    rssi = np.where(rng.random(n_aps) < 0.3, np.nan, rng.uniform(-90, -40, n_aps))
    out = np.zeros(N, np.float32)
    add_levels(x, y, table.levels, table.frame, table.scans(rssi[None])[0], out)
    axes = (2.0 + 3.0 * np.arange(5), 4.0 + 3.0 * np.arange(7))
    m, s, g = (
        RegularGridInterpolator(axes, field)(np.column_stack([y, x]))
        for field in (mean, 1 / sigma, -np.log(sigma))
    )
    want = np.where(np.isnan(rssi), 0.0, g - 0.5 * ((np.nan_to_num(rssi) - m) * s) ** 2).sum(axis=1)
    np.testing.assert_allclose(out, want, rtol=2e-3, atol=2e-2)


def test_places_off_the_grid_read_its_edge() -> None:
    table, _, _ = level_table(4)
    scan = table.scans(np.full((1, 4), -60.0))[0]
    inside, outside = np.zeros(2, np.float32), np.zeros(2, np.float32)
    x, y = np.array([4.0, 22.0], np.float32), np.array([2.0, 14.0], np.float32)
    add_levels(x, y, table.levels, table.frame, scan, inside)
    far = np.array([-500.0, 500.0], np.float32)
    add_levels(x + far, y + far, table.levels, table.frame, scan, outside)
    np.testing.assert_array_equal(inside, outside)


def test_places_are_those_of_numpy_and_finite_far_away() -> None:
    rng = np.random.default_rng(2)
    places = np.column_stack([rng.normal(9.0, 3.0, (4, 2)), rng.normal(0.0, 1.0, 4), np.full(4, 50.0)])
    places[3, 2] = -1e9  # there is none
    c, out = cloud(1), np.zeros(N, np.float32)
    c.x[0] += 400.0  # a kernel of 0.1 m: exp(-8e6) is no number
    add_places(c.x, c.y, places.astype(np.float32), out)
    terms = places[:3, 2] - 50.0 * ((c.x[:, None] - places[:3, 0]) ** 2 + (c.y[:, None] - places[:3, 1]) ** 2)
    top = terms.max(axis=1)
    np.testing.assert_allclose(
        out, top + np.log(np.exp(terms - top[:, None]).sum(axis=1)), rtol=1e-4, atol=1e-3
    )


def test_all_observations_add_up() -> None:
    table, _, _ = level_table(5)
    rng = np.random.default_rng(3)
    scans, places = rng.uniform(-80, -50, (2, 5)), rng.normal(9.0, 1.0, (2, 3, 4))
    places[..., 3] = 0.2
    whole = model(levels=table, ess_ratio=0.0)
    parts = []
    still = np.zeros((2, 2))
    for seen in (Seen(ranges=ranges_of(2, 1)), Seen(scans=scans), Seen(places=places)):
        batch = made_batch(2)
        out = whole.tick(batch, [0, 1], still, seen)
        parts.append(batch.log_weights + out[:, 6:7] - 0.0)
        assert np.all(out[:, 5] < N)
    batch = made_batch(2)
    whole.tick(batch, [0, 1], still, Seen(ranges_of(2, 1), scans, places))
    total = sum(parts)
    np.testing.assert_allclose(
        batch.log_weights - batch.log_weights.mean(axis=1, keepdims=True),
        total - total.mean(axis=1, keepdims=True),
        atol=1e-2,
    )


def test_twenty_bytes_a_particle() -> None:
    batch = made_batch(2)
    assert batch.particles.nbytes + batch.log_weights.nbytes == 2 * N * 20


@pytest.mark.parametrize(
    ("tracks", "steps", "seen"),
    [
        ([0, 0], np.zeros((2, 2)), Seen()),
        ([3], np.zeros((1, 2)), Seen()),
        ([-1], np.zeros((1, 2)), Seen()),
        ([0], np.zeros((2, 2)), Seen()),
        ([0], [[np.nan, 0.0]], Seen()),
        ([0], np.zeros((1, 2)), Seen(ranges=np.zeros((1, 4)))),
        ([0], np.zeros((1, 2)), Seen(scans=np.zeros((1, 1)))),
        ([0], np.zeros((1, 2)), Seen(scans=np.zeros((2, 5)))),
        ([0], np.zeros((1, 2)), Seen(places=np.zeros((1, 2, 3)))),
        ([0], np.zeros((1, 2)), Seen(places=np.full((1, 2, 4), -np.inf))),
    ],
)
def test_what_does_not_fit_is_refused(tracks: list[int], steps: np.ndarray, seen: Seen) -> None:
    batch = made_batch(3)
    with pytest.raises(UsageError):
        model(levels=level_table(5)[0]).tick(batch, tracks, steps, seen)


def test_parameters_out_of_range_are_refused() -> None:
    for wrong in ({"penalty": -1.0}, {"range_sigma": 0.0}, {"ess_ratio": 2.0}, {"anchors": np.zeros(3)}):
        with pytest.raises(ConfigError):
            model(**wrong)
    with pytest.raises(ConfigError):
        LevelTable.of((0.0, 0.0), 1.0, np.zeros((1, 5, 2)), np.ones((1, 5, 2)))
    with pytest.raises(ConfigError):
        LevelTable.of((0.0, 0.0), 1.0, np.zeros((2, 5, 2)), np.zeros((2, 5, 2)))
    with pytest.raises(UsageError):
        TrackBatch.of([cloud(0), cloud(1, 7)], [(1, 2), (3, 4)])
