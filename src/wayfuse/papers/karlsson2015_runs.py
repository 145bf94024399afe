"""The experiments of karlsson2015, one seed at a time: its walks and series, and what we vary besides."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from wayfuse.core.types import Array
from wayfuse.presets import karlsson2015 as preset
from wayfuse.radio.band_correlation import correlate, effective_pairs, model_errors
from wayfuse.radio.path_loss import PathLoss, distances, fit_path_loss
from wayfuse.simulator import karlsson2015_world as world

__all__ = ["BANDS", "CORRELATIONS", "GAUSS_NEWTON", "MEMORIES", "SURVEY", "TABLE_1", "WALKS", "Run", "fitted_bands",
           "long_walk", "one_seed", "series", "short_walk"]  # fmt: skip

TABLE_1 = ((-0.10, -0.29, 0.09), (0.26, 0.05, 0.44), (0.26, -0.09, 0.55), (0.24, 0.04, 0.42),
            (-0.06, -0.13, 0.01), (-0.12, -0.18, -0.06))  # fmt: skip
_INTERVAL = 4.0  # s between scans of the long walk; section IV
_SPACING = 0.5  # m between scans of the short walk; section III
BANDS = {"2.4 and 5 GHz": (0, 1), "2.4 GHz": (0,), "5 GHz": (1,)}
GAUSS_NEWTON = "LS, Gauss-Newton (ours)"
CORRELATIONS = (
    0.0,
    0.25,
    0.5,
    0.75,
    0.999999,
)  # of the errors of the bands; at 1 there is no Cholesky factor
WALKS = (0.8, 0.84, 0.95, 1.1)  # m per root second
SURVEY = 100  # places
MEMORIES = (0.0, 0.5, 0.9)


class Run(NamedTuple):
    """Errors of one seed: (n,) m by row of a table; coefficients and whether their interval holds the truth."""

    short: dict[str, Array]
    long: dict[str, Array]
    by_correlation: Array
    by_walk: Array
    by_building: Array
    fitted: tuple[PathLoss, ...]
    with_fitted: Array
    r: Array
    covered: Array
    covered_memory: Array


def short_walk(
    seed: int, radio: world.RadioWorld, config: preset.Config, keep: tuple[int, ...] = (0, 1)
) -> Array:
    """Errors (n,) m of section III after each scan, with the bands of indices ``keep``."""
    place = world.SHORT_WALK
    walked = world.scan_distances(place, _SPACING)
    scans = world.draw_readings(np.random.default_rng((seed, 2)), radio, place, walked)[:, list(keep)]
    config = replace(config, bands=tuple(config.bands[b] for b in keep))
    found = preset.wifi_only(config, _plan(place), scans, _SPACING / world.StepWorld().speed, seed)
    return _distance(found, place.at(walked))


def long_walk(
    seed: int, radio: world.RadioWorld, config: preset.Config, place: world.PlaceWorld = world.LONG_WALK
) -> dict[str, Array]:
    """Errors (n,) m of section IV by row: after each scan, with steps after each step."""
    rng, walker = np.random.default_rng((seed, 3)), world.StepWorld()
    walk = world.draw_steps(rng, walker, place)
    at = world.scan_distances(place, walker.speed * _INTERVAL)
    # a scan waits for the end of the step it falls into
    due = np.minimum(np.round(at / walk.walked[1]).astype(np.int64), len(walk.turn))
    scans, truth, plan = world.draw_readings(rng, radio, place, walk.walked[due]), walk.xy[due], _plan(place)
    newton = preset.least_squares(config, plan, scans, gauss_newton=True)
    reckoned = preset.dead_reckoning(config, walk.xy[0], walk.told_heading, walk.turn)
    return {
        "LS, Wi-Fi only": _distance(preset.least_squares(config, plan, scans), truth),
        "PF, Wi-Fi only": _distance(preset.wifi_only(config, plan, scans, _INTERVAL, seed), truth),
        "PDR only": _distance(reckoned, walk.xy),
        "PF, Wi-Fi + PDR": _distance(preset.fused(config, plan, scans, due, walk.turn, seed), walk.xy),
        GAUSS_NEWTON: _distance(newton, truth),
    }


def fitted_bands(
    seed: int, radio: world.RadioWorld, config: preset.Config, place: world.PlaceWorld
) -> tuple[PathLoss, ...]:
    """Attenuation and sigma of each band from a survey of a place, the powers known as the paper demands."""
    xy, readings = world.draw_survey(np.random.default_rng((seed, 4)), radio, place, SURVEY)
    away = distances(xy, np.array(place.ap_xy))
    return tuple(
        fit_path_loss(away.ravel(), readings[:, b].ravel(), power=band.power)
        for b, band in enumerate(config.bands)
    )


def series(seed: int, which: int, correlation: float, memory: float = 0.0) -> tuple[float, bool, bool]:
    """Coefficient of one series; does its interval hold the truth, counted by pairs, and by effective pairs?"""
    rng = np.random.default_rng((seed, 1, which, round(100 * memory)))
    distance, rssi = world.draw_series(rng, world.RadioWorld(), world.SERIES[which], correlation, memory)
    a, b = (model_errors(distance, band) for band in rssi)
    plain, honest = correlate(a, b), correlate(a, b, n_effective=effective_pairs(a, b))
    return plain.r, plain.low <= correlation <= plain.high, honest.low <= correlation <= honest.high


def one_seed(seed: int) -> Run:
    """Everything measured with one seed."""
    radio, config = world.RadioWorld(), preset.Config()
    found = [series(seed, k, row[0]) for k, row in enumerate(TABLE_1)]
    memory = [series(seed, len(TABLE_1) - 1, 0.0, m)[1:] for m in MEMORIES]
    correlated = [short_walk(seed, replace(radio, correlation=c), config).mean() for c in CORRELATIONS]
    by_walk = [_walks(seed, radio, replace(config, walk_sigma=s)) for s in WALKS]
    others = [long_walk(seed, radio, config, place) for place in world.OTHER_BUILDINGS.values()]
    bands = fitted_bands(seed, radio, config, world.LONG_WALK)
    fitted = replace(config, bands=bands)
    with_fitted = (short_walk(seed, radio, fitted), long_walk(seed, radio, fitted)["PF, Wi-Fi + PDR"])
    return Run(
        {row: short_walk(seed, radio, config, keep) for row, keep in BANDS.items()},
        long_walk(seed, radio, config),
        np.array(correlated),
        np.array(by_walk),
        np.array([[e.mean() for e in other.values()] for other in others]),
        bands,
        np.array([e.mean() for e in with_fitted]),
        np.array([f[0] for f in found]),
        np.array([f[1] for f in found]),
        np.array(memory),
    )


def _walks(seed: int, radio: world.RadioWorld, config: preset.Config) -> tuple[float, float]:
    short = short_walk(seed, radio, config).mean()
    return float(short), float(long_walk(seed, radio, config)["PF, Wi-Fi only"].mean())


def _plan(place: world.PlaceWorld) -> preset.RadioPlan:
    return preset.RadioPlan(np.array(place.ap_xy), place.low, place.high)


def _distance(found: Array, truth: Array) -> Array:
    return np.hypot(found[:, 0] - truth[:, 0], found[:, 1] - truth[:, 1])
