"""The Gaussian-process field of he2014: against plain formulas, and on a field that is known."""

from __future__ import annotations

import numpy as np
import pytest

from wayfuse.core.errors import RadioMapError
from wayfuse.radio.gp_field import (
    SquaredExponential,
    fit_gp_field,
    fit_squared_exponential,
    log_evidence,
)

EXTENT = (0.0, 0.0, 12.0, 9.0)


def _made_up(noise: float, seed: int = 3) -> tuple[np.ndarray, np.ndarray]:
    """A survey of 12 x 9 m: one smooth field along x, one along y."""
    x, y = (v.ravel() for v in np.meshgrid(np.arange(0.5, 12.0), np.arange(0.5, 9.0)))
    rng = np.random.default_rng(seed)
    field = np.column_stack([-50.0 - 2.0 * x, -60.0 + 1.5 * y])
    return np.column_stack([x, y]), field + noise * rng.standard_normal(field.shape)


def test_the_evidence_is_that_of_the_normal_density_and_its_gradient_that_of_differences() -> None:
    rng = np.random.default_rng(1)
    xy, z, kernel = rng.uniform(0, 9, (14, 2)), rng.normal(0, 4, 14), SquaredExponential(4.0, 3.0, 1.5)
    squared = ((xy[:, None] - xy[None]) ** 2).sum(axis=-1)

    def plain(log_parameters: np.ndarray) -> float:
        s, length, noise = np.exp(log_parameters)
        covariance = s * s * np.exp(-squared / (2 * length**2)) + noise**2 * np.eye(14)
        return float(-0.5 * z @ np.linalg.solve(covariance, z) - 0.5 * np.linalg.slogdet(covariance)[1])

    at, h = np.log(np.array(kernel)), 1e-5
    value, gradient = log_evidence(squared, z, kernel)
    differences = [(plain(at + h * e) - plain(at - h * e)) / (2 * h) for e in np.eye(3)]
    assert value == pytest.approx(plain(at), rel=1e-9)
    assert gradient == pytest.approx(differences, rel=1e-5)


def test_prediction_is_that_of_the_joint_normal() -> None:
    xy, rssi = _made_up(1.5)
    field = fit_gp_field(xy, rssi, EXTENT, step=1.0)
    k = fit_squared_exponential(xy, rssi[:, 0] - rssi[:, 0].mean())
    node = np.array([[4.0, 6.0]])  # a node of the grid: no interpolation

    def covariance(a: np.ndarray, b: np.ndarray) -> np.ndarray:
        return k.signal**2 * np.exp(-((a[:, None] - b[None]) ** 2).sum(-1) / (2 * k.length**2))

    inverse = np.linalg.inv(covariance(xy, xy) + k.noise**2 * np.eye(len(xy)))
    cross = covariance(node, xy)
    mean, sigma = field.predict(node)
    level = rssi[:, 0].mean()
    assert mean[0, 0] == pytest.approx(level + (cross @ inverse @ (rssi[:, 0] - level)).item(), abs=1e-6)
    spread = k.signal**2 - (cross @ inverse @ cross.T).item() + k.noise**2
    assert sigma[0, 0] == pytest.approx(np.sqrt(spread), rel=1e-6)


def test_the_noise_of_a_survey_is_found_and_the_field_between_its_places() -> None:
    xy, rssi = _made_up(2.0)
    assert fit_squared_exponential(xy, rssi[:, 0] - rssi[:, 0].mean()).noise == pytest.approx(2.0, rel=0.15)
    mean, _ = fit_gp_field(xy, rssi, EXTENT).predict(np.array([[3.13, 4.77], [9.2, 2.2]]))
    truth = np.array([[-56.26, -52.845], [-68.4, -56.7]])
    assert np.abs(mean - truth).max() < 1.2


def test_the_likelihood_is_greatest_at_the_place_and_that_of_independent_access_points() -> None:
    xy, rssi = _made_up(1.0)
    field = fit_gp_field(xy, rssi, EXTENT)
    places, z = np.array([[2.0, 2.0], [7.0, 4.0], [11.0, 8.0]]), np.array([-64.0, -54.0])
    both = field.log_likelihood(z, places)
    assert both.argmax() == 1
    alone = [field.select([a]).log_likelihood(z[[a]], places) for a in range(2)]
    assert both == pytest.approx(alone[0] + alone[1])


def test_beyond_the_grid_the_edge_holds() -> None:
    xy, rssi = _made_up(1.0)
    field = fit_gp_field(xy, rssi, EXTENT)
    inside, beyond = np.array([[12.0, 5.0]]), np.array([[30.0, 5.0]])
    assert np.array_equal(field.predict(beyond)[0], field.predict(inside)[0])


def test_missing_readings_are_refused() -> None:
    xy, rssi = _made_up(1.0)
    rssi[3, 1] = np.nan
    with pytest.raises(RadioMapError, match="finite reading"):
        fit_gp_field(xy, rssi, EXTENT)
    with pytest.raises(RadioMapError, match="4 places"):
        fit_gp_field(xy[:3], rssi[:3], EXTENT)
