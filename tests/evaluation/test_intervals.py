from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from made_up_walks import noisy_scores, recording, track

from wayfuse.core.errors import ConfigError
from wayfuse.evaluation.errors import score
from wayfuse.evaluation.intervals import Bootstrap, compare, error_intervals, replicated_percentiles

PERCENTS = (0, 10, 50, 75, 95, 100)


@settings(max_examples=60)
@given(st.integers(0, 2**32 - 1))
def test_replicated_percentiles_equal_numpy_on_repeated_values(seed: int) -> None:
    rng = np.random.default_rng(seed)
    n_walks, n = int(rng.integers(1, 6)), int(rng.integers(1, 25))
    values, walk = np.round(rng.exponential(size=n), 1), rng.integers(0, n_walks, n)
    counts = rng.integers(0, 3, (8, n_walks))
    found = replicated_percentiles(values, walk, counts, PERCENTS)
    for row, expected_counts in zip(found, counts, strict=True):
        repeated = np.repeat(values, expected_counts[walk])
        if len(repeated):
            np.testing.assert_allclose(row, np.percentile(repeated, PERCENTS), atol=1e-12)
        else:
            assert np.all(np.isnan(row))


def test_every_replicate_draws_as_many_walks_as_there_are() -> None:
    counts = Bootstrap(n=500).counts(7)
    assert counts.shape == (500, 7)
    assert np.all(counts.sum(axis=1) == 7)
    # Each walk is drawn once on average: the mean of 500 x 7 draws with variance 6/7 per walk and replicate.
    z = (counts.mean(axis=0) - 1.0) / np.sqrt(6 / 7 / 500)
    assert np.all(np.abs(z) < 5)
    np.testing.assert_array_equal(counts, Bootstrap(n=500).counts(7))
    assert np.any(counts != Bootstrap(n=500, seed=1).counts(7))


def test_interval_of_the_mean_is_that_of_resampled_walks() -> None:
    points = noisy_scores(8).methods[0].points["1hz"].used()
    draw = Bootstrap(n=300)
    walks = np.unique(points.walk)
    means = []
    for counts in draw.counts(len(walks)):
        parts = [points.error[points.walk == w] for w, c in zip(walks, counts, strict=True) for _ in range(c)]
        means.append(np.concatenate(parts).mean())
    found = error_intervals(points, draw)["mean"]
    np.testing.assert_allclose((found.low, found.high), np.percentile(means, (5, 95)))
    assert found.low < found.value < found.high


@pytest.mark.parametrize("figure", ["mean", "p50", "p75", "p90", "p95", "combined_mean", "ipin"])
def test_intervals_hold_their_value(figure: str) -> None:
    found = error_intervals(noisy_scores(15).methods[0].points["1hz"].used())[figure]
    assert found.low <= found.value <= found.high


def test_intervals_hold_the_expectation_as_often_as_they_say() -> None:
    # Walks differ in their own mean, so its points are dependent: drawing points would be too narrow.
    rng = np.random.default_rng(5)
    n_trials, n_walks, inside = 120, 30, 0
    for _ in range(n_trials):
        level = rng.gamma(4.0, 1.0, n_walks)  # expectation 4
        values = np.abs(np.repeat(level, 20) + 0.1 * rng.normal(size=20 * n_walks))
        draw = Bootstrap(n=400, seed=int(rng.integers(1 << 30)))
        walk = np.repeat(np.arange(n_walks), 20)
        sums = np.bincount(walk, weights=values)
        interval = draw.interval(values.mean(), draw.counts(n_walks) @ sums / (20.0 * n_walks))
        inside += interval.low <= 4.0 <= interval.high
    share = inside / n_trials
    sigma = np.sqrt(0.9 * 0.1 / n_trials)
    assert (
        abs(share - 0.88) < 4 * sigma
    )  # the percentile bootstrap of 30 skewed walks falls a little short of 0.90


def test_the_paired_difference_takes_the_walks_out() -> None:
    # Both methods suffer from the same hard walks; b is always 10 % worse.
    walks, tracks = [], []
    rng = np.random.default_rng(2)
    for i in range(20):
        walks.append(recording(f"w{i}", scans=(100.0,)))
        t = np.arange(100.0, 111.0)
        truth = np.stack([t - 100.0, np.zeros_like(t)], axis=1)
        offset = rng.gamma(2.0, 2.0) * np.array([0.6, 0.8])
        tracks.append(track(t, truth + offset, walk=f"w{i}", method="a"))
        tracks.append(track(t, truth + 1.1 * offset, walk=f"w{i}", method="b"))
    found = score(tracks, walks)
    a, b = (found.method(name).points["1hz"].used() for name in "ab")
    both = compare("a", a, "b", b)
    assert (both.n, both.n_walks) == (220, 20)
    for figure in ("mean", "p50", "p90"):
        assert both.reduction[figure].value == pytest.approx(1 - 1 / 1.1)
        assert both.reduction[figure].low == pytest.approx(1 - 1 / 1.1)
    own = error_intervals(a)["mean"]
    paired = both.difference["mean"]
    assert paired.high - paired.low < 0.2 * (own.high - own.low)
    assert paired.high < 0.0


def test_only_common_points_are_compared() -> None:
    estimates = [track([101.5], [(0, 0)], method="early"), track([106.0], [(0, 0)], method="late")]
    found = score(estimates, [recording()])
    early, late = (found.method(n).points["1hz"].used() for n in ("early", "late"))
    both = compare("early", early, "late", late)
    assert both.n == len(late) == 5
    assert both.difference["mean"].value == 0.0
    assert np.isnan(both.difference["mean"].low)  # one walk: no interval


def test_one_walk_gives_values_without_ends() -> None:
    points = noisy_scores(1).methods[0].points["1hz"].used()
    found = error_intervals(points)
    assert found["mean"].value == pytest.approx(points.error.mean())
    assert all(np.isnan(i.low) and np.isnan(i.high) for i in found.values())


def test_no_points_give_nothing() -> None:
    points = noisy_scores(2).methods[0].points["1hz"]
    found = error_intervals(points.select(np.zeros(len(points), np.bool_)))
    assert all(np.isnan(i.value) for i in found.values())


def test_share_of_points() -> None:
    good, walk = np.array([True, True, False, True]), np.array([0, 0, 1, 1])
    found = Bootstrap().share(good, walk)
    assert (found.value, found.low, found.high) == (0.75, 0.5, 1.0)


@pytest.mark.parametrize(("n", "level"), [(0, 0.9), (10, 0.0), (10, 1.0)])
def test_parameters_out_of_range_are_refused(n: int, level: float) -> None:
    with pytest.raises(ConfigError, match="bootstrap"):
        Bootstrap(n, level)
