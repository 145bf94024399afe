"""Weighted k nearest neighbours against a plain loop, and against a published figure."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from radio_map_contract import made_up_survey, queries

from wayfuse.core.errors import ConfigError
from wayfuse.radio import knn
from wayfuse.radio.representation import Representation
from wayfuse.radio.survey import Survey


def _plain_distance(a: np.ndarray, b: np.ndarray, metric: str) -> float:
    if metric == "euclidean":
        return float(np.sqrt(sum((x - y) ** 2 for x, y in zip(a, b, strict=True))))
    if metric == "sorensen":
        total = float(np.sum(a + b))
        return float(np.sum(np.abs(a - b))) / total if total > 0 else 1.0
    norm = float(np.sqrt(a @ a) * np.sqrt(b @ b))
    return 1.0 - float(a @ b) / norm if norm > 0 else 1.0


@pytest.mark.parametrize("metric", knn.METRICS)
def test_distances_equal_the_plain_loop(metric: knn.Metric) -> None:
    rng = np.random.default_rng(4)
    a, b = rng.random((6, 9)), rng.random((7, 9))
    a[0] = b[0] = 0.0
    want = [[_plain_distance(x, y, metric) for y in b] for x in a]
    np.testing.assert_allclose(knn.distances(a, b, metric), want, atol=1e-12)


@pytest.mark.parametrize("metric", knn.METRICS)
def test_neighbours_equal_the_plain_loop(metric: knn.Metric) -> None:
    survey = made_up_survey()
    shown = Representation("positive", -100.0)
    fitted = knn.fit(survey, k=4, metric=metric, representation=shown)
    _, _, rssi = queries(300)  # more than a chunk
    weight, rows = fitted.neighbours(rssi)
    references = shown(survey.dense())
    for q in (0, 17, 299):
        distance = np.array([_plain_distance(shown(rssi[q]), r, metric) for r in references])
        np.testing.assert_array_equal(rows[q], np.argsort(distance, kind="stable")[:4])
        inverse = 1.0 / (distance[rows[q]] + 1e-9)
        np.testing.assert_allclose(weight[q], inverse / inverse.sum(), rtol=1e-6)


def test_an_equal_fingerprint_is_found_exactly() -> None:
    survey = made_up_survey()
    xy, floor = knn.fit(survey).locate_all(survey.dense())
    np.testing.assert_allclose(xy, survey.xy, atol=1e-4)
    np.testing.assert_array_equal(floor, survey.floor)


def test_more_neighbours_than_rows() -> None:
    survey = made_up_survey().select(np.arange(3))
    xy, _ = knn.fit(survey, k=50).locate_all(survey.dense())
    assert xy.shape == (3, 2)


@pytest.mark.parametrize(
    "wrong",
    [{"k": 0}, {"metric": "taxi"}, {"bandwidth": 0.0}, {"representation": Representation("raw")}],
)
def test_parameters_out_of_range_are_refused(wrong: dict) -> None:  # type: ignore[type-arg]
    with pytest.raises(ConfigError):
        knn.fit(made_up_survey(), **wrong)


@pytest.mark.real_data
def test_the_published_figure_of_plain_weighted_knn(data_root: Path) -> None:
    """The benchmark of another library on these files: k = 5, weights 1/d, missing = -104: 2.817 m."""
    folder = data_root / "sodindoorloc" / "CETC331"
    if not folder.is_dir():
        pytest.skip(f"REAL DATA ABSENT: no folder {folder}")
    from wayfuse.formats.sodindoorloc import read

    training, test = (read(folder / f"{name}_CETC331.csv") for name in ("Training", "Testing"))
    survey = Survey.from_dense(training.rssi, training.xy, training.floor - 1, ("1", "2", "3"))
    raw = Representation("raw", -104.0)
    xy, floor = knn.fit(survey, k=5, metric="euclidean", representation=raw).locate_all(test.rssi)
    assert np.mean(np.hypot(*(xy - test.xy).T)) == pytest.approx(2.817, rel=0.005)
    assert np.all(floor == test.floor - 1)
