"""Levels on a grid of training places: bilinear between them, nearest in signal space, Gaussian kernel."""

from __future__ import annotations

import numpy as np

from wayfuse.radio.level_grid import LevelGrid


def grid() -> LevelGrid:
    return LevelGrid(np.random.default_rng(4).normal(-60.0, 5.0, (5, 5, 3)), 2.0)


def test_the_map_is_bilinear_between_its_places_and_finds_them() -> None:
    g = grid()
    np.testing.assert_allclose(g.at(np.array([4.0]), np.array([6.0]))[0], g.levels[3, 2])
    middle = g.levels[1:3, 2:4].mean(axis=(0, 1))
    np.testing.assert_allclose(g.at(np.array([5.0]), np.array([3.0]))[0], middle)
    np.testing.assert_array_equal(g.nearest(g.levels[4, 1]), [2.0, 8.0])


def test_outside_the_edge_holds() -> None:
    g = grid()
    np.testing.assert_allclose(g.at(np.array([-3.0, 99.0]), np.array([0.0, 99.0])), g.levels[[0, 4], [0, 4]])


def test_the_kernel_is_a_product_over_access_points() -> None:
    g = grid()
    x, y = np.array([4.0, 1.3]), np.array([6.0, 7.7])
    z = np.array([-55.0, -61.0, -70.0])
    by_hand = [sum(-((a - b) ** 2) / (2 * 2.5**2) for a, b in zip(row, z, strict=True)) for row in g.at(x, y)]
    np.testing.assert_allclose(g.log_likelihood(z, x, y, 2.5), by_hand)
