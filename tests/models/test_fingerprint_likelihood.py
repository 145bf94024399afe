"""The mixture of kernels: its formula, its floors, its tempering, its draws."""

from __future__ import annotations

import numpy as np
import pytest

from wayfuse.core.errors import ConfigError
from wayfuse.core.philox import Noise
from wayfuse.filters.cloud import Cloud
from wayfuse.models.observation.coverage import SurveyDistance
from wayfuse.models.observation.fingerprint import FingerprintLikelihood
from wayfuse.radio.sparse_knn import Neighbours
from wayfuse.radio.survey import Survey


def neighbours(distance: float = 0.15) -> Neighbours:
    x, y = np.float32([5, 6, 30, 5]), np.float32([5, 8, 5, 5])
    return Neighbours(x, y, np.int32([0, 0, 0, 1]), np.float32([0.5, 0.2, 0.1, 0.2]), distance, 12)


def cloud(n: int = 200) -> Cloud:
    rng = np.random.default_rng(2)
    x, y = rng.uniform(-10.0, 45.0, (2, n)).astype(np.float32)
    zero = np.zeros(n, np.float32)
    return Cloud.on_floors(x, y, zero, zero + 1, rng.integers(0, 2, n).astype(np.int32))


def twin(model: FingerprintLikelihood, c: Cloud, near: Neighbours) -> np.ndarray:
    width = model.kernel_width(near.distance)
    d2 = (c.x[:, None].astype(float) - near.x) ** 2 + (c.y[:, None].astype(float) - near.y) ** 2
    same = c.floor[:, None] == near.floor
    return model.exponent * np.log(
        (same * near.weight * np.exp(-0.5 * d2 / width**2)).sum(axis=1) + model.background
    )


@pytest.mark.parametrize("distance", [0.0, 0.15, 0.5, 1.0])
def test_it_is_its_twin(distance: float) -> None:
    model, c, near = FingerprintLikelihood(), cloud(), neighbours(distance)
    out = np.full(c.n, 2.0)
    model.log_likelihood(c, near, out)  # adds
    np.testing.assert_allclose(out - 2.0, twin(model, c, near), atol=1e-4)
    assert np.all(np.isfinite(out))


def test_far_away_the_background_is_left() -> None:
    c = cloud()._replace(x=np.full(200, 1e6, np.float32))
    out = np.zeros(200)
    FingerprintLikelihood(background=0.05, exponent=0.9).log_likelihood(c, neighbours(), out)
    np.testing.assert_allclose(out, 0.9 * np.log(0.05), rtol=1e-5)


def test_kernels_widen_with_the_signal_distance() -> None:
    model = FingerprintLikelihood(sigma=4.0, sigma_slope=15.0, sigma_most=10.0, near=0.2)
    widths = [model.kernel_width(d) for d in (0.0, 0.2, 0.4, 0.99)]
    assert widths == pytest.approx([4.0, 4.0, 7.0, 10.0])


def test_places_are_drawn_from_the_mixture() -> None:
    model, near, n = FingerprintLikelihood(sigma=2.0), neighbours(), 40_000
    x, y, floor = model.draw_places(Noise.of(0, "draw"), near, n)
    assert (x.dtype, y.dtype, floor.dtype) == (np.float32, np.float32, np.int32)
    assert np.mean(floor == 1) == pytest.approx(0.2, abs=5 * np.sqrt(0.16 / n))
    assert np.mean((floor == 0) & (x > 20)) == pytest.approx(0.1, abs=5 * np.sqrt(0.09 / n))
    lump = x[floor == 1]
    assert np.mean(lump) == pytest.approx(5.0, abs=5 * 2.0 / np.sqrt(len(lump)))
    assert np.std(lump) == pytest.approx(2.0, rel=0.05)
    again = model.draw_places(Noise.of(0, "draw"), near, n)
    for a, b in zip((x, y, floor), again, strict=True):
        np.testing.assert_array_equal(a, b)


def test_agreement_tells_a_cloud_at_the_scan_from_one_elsewhere() -> None:
    model, near = FingerprintLikelihood(sigma=4.0), neighbours()
    at = cloud()._replace(x=np.full(200, 5.4, np.float32), y=np.full(200, 5.9, np.float32))
    at = at._replace(floor=np.zeros(200, np.int32))
    weights = np.full(200, 1 / 200)
    said = []
    for c in (at, at._replace(x=at.x + 40), at._replace(floor=at.floor + 2)):
        out = np.zeros(200)
        model.log_likelihood(c, near, out)
        said.append(model.agreement(weights, out, near))
    assert 0.7 < said[0] < 1.5
    assert 0.0 <= said[1] < 1e-3
    assert 0.0 <= said[2] < 1e-3


def test_where_nobody_surveyed_an_unknown_scan_is_likelier() -> None:
    survey = Survey.from_dense(
        np.full((3, 1), -50.0), np.array([[0.0, 0.0], [1.0, 0.0], [2.0, 0.0]]), np.zeros(3, int), ("F1",)
    )
    coverage = SurveyDistance.build(survey)
    model = FingerprintLikelihood(coverage=coverage, coverage_gain=1.5)
    plain = FingerprintLikelihood()
    c = cloud()._replace(
        x=np.float32([1.0, 40.0] * 100), y=np.zeros(200, np.float32), floor=np.zeros(200, np.int32)
    )
    for distance, gain in ((0.2, 0.0), (0.375, 0.75), (0.9, 1.5)):
        got, want = np.zeros(200), np.zeros(200)
        model.log_likelihood(c, neighbours(distance), got)
        plain.log_likelihood(c, neighbours(distance), want)
        np.testing.assert_allclose(got - want, np.tile([0.0, gain], 100), atol=1e-9)


@pytest.mark.parametrize("name", ["sigma", "sigma_most", "background", "exponent", "coverage_width"])
def test_parameters_out_of_range_are_refused(name: str) -> None:
    for value in (0.0, -1.0, np.nan):
        with pytest.raises(ConfigError, match=f"{name} must be positive"):
            FingerprintLikelihood(**{name: value})
