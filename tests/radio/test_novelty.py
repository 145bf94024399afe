"""Scans made where nobody surveyed: told apart, counted less, and never believed without evidence."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wayfuse.core.errors import ConfigError, RadioMapError
from wayfuse.radio.archive import read_archive, write_archive
from wayfuse.radio.novelty import Novelty, usual_distances
from wayfuse.radio.sparse_knn import Neighbours, SparseKnn
from wayfuse.radio.survey import Fingerprint, Survey
from wayfuse.radio.survey_file import load_survey, save_survey

STATIONS = np.random.default_rng(4).uniform((0.0, -15.0), (60.0, 30.0), (25, 2))


def _levels(xy: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    away = np.linalg.norm(xy[:, None] - STATIONS[None], axis=2)
    return -35.0 - 25.0 * np.log10(1.0 + away) + rng.normal(0.0, 1.5, away.shape)


def _corridor(n_walks: int = 3, n: int = 60) -> Survey:
    """The same corridor along y = 0, walked several times."""
    rng = np.random.default_rng(5)
    xy = np.tile(np.column_stack([np.linspace(0.0, 60.0, n), np.zeros(n)]), (n_walks, 1))
    survey = Survey.from_dense(
        _levels(xy, rng),
        xy,
        np.zeros(n * n_walks, int),
        ("F1",),
        walk=np.repeat(np.arange(n_walks), n),
        walks=tuple(f"w{w}" for w in range(n_walks)),
    )
    return replace(survey, usual=usual_distances(survey))


def _query(xy: tuple[float, float], rng: np.random.Generator) -> Fingerprint:
    levels = _levels(np.array([xy]), rng)[0].astype(np.float32)
    return Fingerprint(np.arange(1, 26, dtype=np.uint64), levels, np.zeros(25, np.int32))


def _near(distance: float, usual: float) -> Neighbours:
    one = np.ones(1, np.float32)
    return Neighbours(one, one, np.zeros(1, np.int32), one, distance, 5, usual)


def test_usual_distances_are_those_to_the_nearest_of_other_walks() -> None:
    survey = _corridor()
    radio_map = SparseKnn(survey)
    for row in (0, 17, 100, 179):
        part = slice(survey.indptr[row], survey.indptr[row + 1])
        columns = survey.indices[part]
        query = Fingerprint(survey.bssid[columns], survey.rssi[part], survey.frequency[columns])
        distance, _ = radio_map.distances(query)
        assert survey.usual[row] == pytest.approx(distance[survey.walk != survey.walk[row]].min(), abs=1e-6)


def test_nothing_is_usual_with_one_walk_and_some_are_looked_at_in_a_large_survey() -> None:
    assert len(usual_distances(_corridor(1))) == 0
    some = usual_distances(_corridor(3), most=30)
    assert np.isfinite(some).sum() == 30


def test_neighbours_say_the_weighted_mean_of_what_is_known() -> None:
    survey, query = _corridor(), _query((30.0, 0.0), np.random.default_rng(1))
    known = np.arange(len(survey)) % 2 == 0
    marked = np.where(known, survey.xy[:, 0] / 100.0, np.nan).astype(np.float32)
    near = SparseKnn(replace(survey, usual=marked)).neighbours(query)
    nearest = SparseKnn(replace(survey, usual=np.zeros(len(survey), np.float32)))
    distance, _ = nearest.distances(query)
    index = np.argsort(distance, kind="stable")[: nearest.k]
    weight = np.exp(-(distance[index] - distance[index[0]]) / nearest.temperature)
    weight *= known[index]
    assert near is not None
    assert near.usual == pytest.approx(weight @ survey.xy[index, 0] / 100.0 / weight.sum(), rel=1e-4)
    nothing = SparseKnn(replace(survey, usual=np.full(len(survey), np.nan, np.float32))).neighbours(query)
    assert nothing is not None
    assert math.isnan(nothing.usual)


@pytest.mark.parametrize("other", [{"bands": ((0, 9000),)}, {"idf": False}, {"exponent": 2.0}])
def test_distances_of_another_kind_are_not_compared(other: dict[str, object]) -> None:
    near = SparseKnn(_corridor(), **other).neighbours(_query((30.0, 0.0), np.random.default_rng(1)))  # type: ignore[arg-type]
    assert near is not None
    assert math.isnan(near.usual)


def test_away_from_the_survey_scans_are_novel_and_on_it_they_are_not() -> None:
    radio_map, novelty, rng = SparseKnn(_corridor()), Novelty(), np.random.default_rng(2)
    said = {}
    for y in (0.0, 20.0):
        state = math.nan
        for x in np.linspace(5.0, 55.0, 25):
            near = radio_map.neighbours(_query((float(x), y), rng))
            assert near is not None
            state = novelty.step(state, near)
        said[y] = novelty.trust(state)
    assert said[0.0] == 1.0
    assert said[20.0] < 0.7


@given(st.lists(st.tuples(st.floats(0.0, 1.0), st.floats(0.0, 1.0)), max_size=20))
def test_trust_is_a_share_and_less_novelty_is_never_trusted_less(scans: list[tuple[float, float]]) -> None:
    novelty, low, high = Novelty(), math.nan, math.nan
    for distance, usual in scans:
        low = novelty.step(low, _near(distance, usual))
        high = novelty.step(high, _near(min(distance + 0.1, 1.1), usual))
    assert novelty.least <= novelty.trust(high) <= novelty.trust(low) <= 1.0


def test_without_usual_distances_all_scans_count() -> None:
    novelty = Novelty()
    state = novelty.step(math.nan, _near(0.9, math.nan))
    assert math.isnan(state)
    assert novelty.trust(state) == 1.0
    assert novelty.step(0.2, _near(0.9, math.nan)) == 0.2


@pytest.mark.parametrize("wrong", [{"memory": 0.5}, {"width": 0.0}, {"least": 1.5}, {"first": -0.1}])
def test_parameters_that_cannot_be_are_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(ConfigError):
        Novelty(**wrong)


def test_files_keep_usual_distances_and_those_of_before_have_none(tmp_path: Path) -> None:
    survey = _corridor()
    save_survey(survey, tmp_path / "new.npz")
    assert load_survey(tmp_path / "new.npz").usual.tobytes() == survey.usual.tobytes()
    save_survey(replace(survey, usual=np.empty(0, np.float32)), tmp_path / "old.npz")
    assert "usual" not in read_archive(tmp_path / "old.npz")[2]
    assert len(load_survey(tmp_path / "old.npz").usual) == 0
    assert len(survey.select(np.arange(7)).usual) == 7


@pytest.mark.parametrize("usual", [np.zeros(3, np.float32), np.zeros(180, np.float64)])
def test_usual_distances_that_do_not_fit_are_refused(tmp_path: Path, usual: np.ndarray) -> None:
    save_survey(_corridor(), tmp_path / "survey.npz")
    kind, header, arrays = read_archive(tmp_path / "survey.npz")
    version = header.pop("version")
    write_archive(tmp_path / "survey.npz", kind, version, header, arrays | {"usual": usual})
    with pytest.raises(RadioMapError, match="fit together"):
        load_survey(tmp_path / "survey.npz")
    if len(usual) == 3:
        with pytest.raises(RadioMapError):
            replace(_corridor(), usual=usual)
