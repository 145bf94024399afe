"""k nearest neighbours in signal space, against the formula written out."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from wayfuse.core.errors import ConfigError, RadioMapError
from wayfuse.radio._kernels import nearest_by_overlap
from wayfuse.radio.sparse_knn import SparseKnn
from wayfuse.radio.survey import Fingerprint, Survey


def made_up(n: int = 60, m: int = 30) -> Survey:
    rng = np.random.default_rng(6)
    rssi = np.where(rng.random((n, m)) < 0.4, rng.uniform(-105.0, -30.0, (n, m)), np.nan)
    rssi[:, 3] = -50.0  # heard everywhere: no information
    frequency = np.where(np.arange(m) % 2, 5180, 2437)
    return Survey.from_dense(
        rssi, rng.uniform(0, 50, (n, 2)), rng.integers(0, 3, n), ("A", "B", "C"), frequency=frequency
    )


def query(seed: int = 0, m: int = 30) -> Fingerprint:
    rng = np.random.default_rng(seed)
    ids = rng.permutation(np.arange(1, m + 9, dtype=np.uint64))[:20]  # some unknown
    return Fingerprint(ids, rng.uniform(-104, -30, 20).astype(np.float32), np.zeros(20, np.int32))


def twin(survey: Survey, q: Fingerprint, *, idf: bool, bands: tuple[tuple[int, int], ...] = ()) -> np.ndarray:
    def represent(rssi: np.ndarray) -> np.ndarray:
        return np.nan_to_num(np.clip((rssi + 100.0) / 70.0, 0.0, None)) ** 2.2

    dense = survey.dense().astype(np.float64)
    heard = np.isfinite(dense).sum(axis=0)
    weight = 2.0 + np.log(len(survey) / np.maximum(heard, 1)) if idf else np.ones(len(heard))
    if bands:
        weight = weight * np.any([(survey.frequency >= a) & (survey.frequency < b) for a, b in bands], axis=0)
    v, u = represent(dense), represent(survey.vector(q).astype(np.float64))
    return 1.0 - 2.0 * (np.minimum(u, v) @ weight) / (v @ weight + u @ weight + 1e-6)


@pytest.mark.parametrize("idf", [True, False])
@pytest.mark.parametrize("bands", [(), ((2400, 2500),), ((4900, 5925),), ((2400, 2500), (4900, 5925))])
def test_distances_are_those_of_the_formula(idf: bool, bands: tuple[tuple[int, int], ...]) -> None:
    survey = made_up()
    got, n_aps = SparseKnn(survey, idf=idf, bands=bands).distances(query())
    np.testing.assert_allclose(got, twin(survey, query(), idf=idf, bands=bands), atol=2e-6)
    assert 0 < n_aps <= 20
    assert np.all((got >= -1e-5) & (got <= 1.0))


def test_neighbours_are_the_nearest_with_their_weights() -> None:
    survey = made_up()
    near = SparseKnn(survey, k=7, temperature=0.05).neighbours(query())
    assert near is not None
    d = twin(survey, query(), idf=True)
    order = np.argsort(d, kind="stable")[:7]
    np.testing.assert_allclose(near.x, survey.xy[order, 0], rtol=1e-6)
    np.testing.assert_array_equal(near.floor, survey.floor[order])
    weight = np.exp(-(d[order] - d[order[0]]) / 0.05)
    np.testing.assert_allclose(near.weight, weight / weight.sum(), rtol=1e-3)
    assert near.distance == pytest.approx(d.min(), abs=2e-6)


def test_a_fingerprint_of_the_survey_finds_itself() -> None:
    survey = made_up()
    for i in range(0, 60, 7):
        row = slice(survey.indptr[i], survey.indptr[i + 1])
        q = Fingerprint(
            survey.bssid[survey.indices[row]], survey.rssi[row], np.zeros(row.stop - row.start, np.int32)
        )
        near = SparseKnn(survey, k=1).neighbours(q)
        assert near is not None
        assert near.distance == pytest.approx(0.0, abs=1e-5)
        np.testing.assert_allclose([near.x[0], near.y[0]], survey.xy[i], rtol=1e-6)


def test_a_query_of_unknown_access_points_has_no_neighbours() -> None:
    radio_map = SparseKnn(made_up())
    for ids, rssi in (([900, 901], [-40.0, -50.0]), ([], []), ([1, 2], [-100.0, -120.0])):
        q = Fingerprint(np.array(ids, np.uint64), np.array(rssi, np.float32), np.zeros(len(ids), np.int32))
        assert radio_map.neighbours(q) is None
        assert radio_map.locate(q) is None


def test_more_neighbours_than_fingerprints() -> None:
    survey = made_up(5)
    near = SparseKnn(survey, k=40).neighbours(query())
    assert near is not None
    assert len(near.x) == 5
    assert near.weight.sum() == pytest.approx(1.0)


def test_a_fix_is_the_mean_on_the_heaviest_floor() -> None:
    survey = made_up()
    radio_map = SparseKnn(survey, k=9, temperature=0.1)
    near, fix = radio_map.neighbours(query(3)), radio_map.locate(query(3))
    assert near is not None
    assert fix is not None
    mass = [near.weight[near.floor == f].sum() for f in range(3)]
    on = near.floor == int(np.argmax(mass))
    assert fix.floor == int(np.argmax(mass))
    assert fix.x == pytest.approx(np.average(near.x[on], weights=near.weight[on]), rel=1e-5)
    assert fix.y == pytest.approx(np.average(near.y[on], weights=near.weight[on]), rel=1e-5)


@given(
    hnp.arrays(np.float32, st.integers(0, 40), elements=st.sampled_from([0.0, 0.25, 0.5, 0.5, 1.0])),
    st.integers(1, 12),
)
def test_the_kernel_picks_as_a_stable_sort_does(overlap: np.ndarray, k: int) -> None:
    index, best = np.empty(k, np.int32), np.empty(k, np.float32)
    row_sum, query_sum = np.full(len(overlap), 1.5, np.float32), np.float32(0.7)
    n = nearest_by_overlap(overlap, row_sum, query_sum, k, index, best)
    distance = np.float32(1.0) - np.float32(2.0) * overlap / (row_sum + query_sum + np.float32(1e-6))
    want = np.argsort(distance, kind="stable")[:k]
    assert n == len(want)
    np.testing.assert_array_equal(index[:n], want)
    np.testing.assert_array_equal(best[:n], distance[want])


def test_wrong_use_is_refused() -> None:
    survey = made_up()
    with pytest.raises(ConfigError, match="k >= 1"):
        SparseKnn(survey, k=0)
    with pytest.raises(ConfigError, match="temperature > 0"):
        SparseKnn(survey, temperature=0.0)
    with pytest.raises(RadioMapError, match="has no fingerprint"):
        SparseKnn(survey.select(np.zeros(60, bool)))


@pytest.mark.parametrize("n", [1, 39, 512, 513, 2000])
def test_neighbours_are_the_nearest_of_all_distances_to_the_last_bit(n: int) -> None:
    radio_map = SparseKnn(made_up(n))
    for seed in range(5):
        near = radio_map.neighbours(query(seed))
        distance, _ = radio_map.distances(query(seed))
        order = np.argsort(distance, kind="stable")[:40]
        assert near is not None
        assert near.distance == distance[order[0]]
        np.testing.assert_array_equal(near.x, radio_map.survey.xy[order, 0].astype(np.float32))
        weight = np.exp(-(distance[order] - distance[order[0]]) / np.float32(0.02))
        np.testing.assert_array_equal(near.weight, (weight / weight.sum()).astype(np.float32))
