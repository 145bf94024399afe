"""From channel state to a range, and from ranges to a place."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from wayfuse.core.errors import ConfigError, RadioMapError
from wayfuse.core.types import Array
from wayfuse.formats import intel5300
from wayfuse.radio.csi import INTEL5300_20MHZ, direct_path_power, impulse_response
from wayfuse.radio.multilateration import (
    constrained_least_squares,
    weighted_centroid,
    weighted_least_squares,
)
from wayfuse.radio.ranging import RangeRegression, fit_antennas, fit_range, mean_range
from wayfuse.sensors.records import CsiFrame

SPACING = 312.5e3  # Hz between subcarriers
ANCHORS = np.array([[0.0, 0.0], [20.0, 0.0], [18.0, 12.0], [-1.0, 11.0]])


def channel(*paths: tuple[float, complex]) -> Array:
    """Channel state of paths of (delay s, amplitude)."""
    return np.asarray(
        sum(a * np.exp(-2j * np.pi * INTEL5300_20MHZ * SPACING * delay) for delay, a in paths),
    )


def frame(csi: Array, rss: float = -50.0) -> CsiFrame:
    return CsiFrame(0.0, 0, csi.astype(np.complex64), rss, 40.0, float("nan"))


@pytest.mark.parametrize("tap", [0, 5, 250])
def test_one_path_is_one_tap_at_its_delay(tap: int) -> None:
    h = np.abs(impulse_response(channel((tap * 12.5e-9, 3.0 + 4.0j))))
    assert int(h.argmax()) == tap
    assert h.max() == pytest.approx(5.0, rel=1e-6)


def test_power_of_the_direct_path_sheds_a_far_echo() -> None:
    direct = channel((50e-9, 10.0))
    both = channel((50e-9, 10.0), (450e-9, 4.0))
    assert direct_path_power(frame(direct[None, None]))[0] == pytest.approx(-50.0, abs=1e-4)
    total = 10.0 * np.log10(1.0 + 0.16)
    assert direct_path_power(frame(both[None, None]))[0] == pytest.approx(-50.0 - total, abs=0.5)


def test_power_is_shared_out_over_antennas_and_free_of_the_gain() -> None:
    csi = np.stack([channel((0.0, 1.0)), channel((0.0, 2.0)), np.zeros(30)])[:, None]
    power = direct_path_power(frame(csi))
    assert power[1] - power[0] == pytest.approx(10.0 * np.log10(4.0), abs=1e-4)
    assert 10.0 * np.log10((10.0 ** (power[:2] / 10.0)).sum()) == pytest.approx(-50.0, abs=1e-4)
    assert np.isnan(power[2])
    assert direct_path_power(frame(7.0 * csi))[:2] == pytest.approx(power[:2], abs=1e-4)
    assert np.isnan(direct_path_power(frame(csi, float("nan")))).all()


def test_other_subcarriers_are_refused() -> None:
    with pytest.raises(ConfigError, match="28 subcarriers, 30"):
        impulse_response(np.ones(28, dtype=np.complex64))


def test_regression_finds_its_own_parameters() -> None:
    true = RangeRegression(-2.5, -0.07)
    power = np.linspace(-70.0, -40.0, 12)
    found = fit_range(np.append(power, np.nan), np.append(true.distance(power), 3.0))
    assert found == pytest.approx(true, rel=1e-6)
    assert found.path_loss_exponent == pytest.approx(np.log(10.0) / 0.7)


def test_regression_is_least_squares_of_distances_not_of_their_logs() -> None:
    rng = np.random.default_rng(4)
    power = rng.uniform(-70.0, -40.0, 60)
    distance = np.exp(-2.5 - 0.07 * power) + rng.uniform(-0.5, 0.5, 60)
    distance = np.maximum(distance, 0.2)

    def cost(model: RangeRegression) -> float:
        return float(((model.distance(power) - distance) ** 2).sum())

    found = fit_range(power, distance)
    line = np.polyfit(power, np.log(distance), 1)
    assert cost(found) < cost(RangeRegression(line[1], line[0]))
    for ds, dr in ((1e-3, 0.0), (-1e-3, 0.0), (0.0, 1e-5), (0.0, -1e-5)):
        assert cost(found) <= cost(RangeRegression(found.log_scale + ds, found.rate + dr))


def test_regression_needs_two_powers_and_positive_distances() -> None:
    with pytest.raises(RadioMapError, match="two different powers"):
        fit_range([-50.0, -50.0], [1.0, 2.0])
    with pytest.raises(RadioMapError, match="positive"):
        fit_range([-50.0, -60.0], [0.0, 2.0])


def test_range_of_an_anchor_is_the_mean_over_its_heard_antennas() -> None:
    models = (RangeRegression(0.0, -0.05), RangeRegression(0.5, -0.05))
    power = np.array([[-40.0, -42.0], [-40.0, np.nan], [np.nan, np.nan]])
    found = mean_range(models, power)
    each = [float(models[0].distance(-40.0)), float(models[1].distance(-42.0))]
    assert found[:2] == pytest.approx([np.mean(each), each[0]])
    assert np.isnan(found[2])


def test_exact_ranges_give_the_place_back() -> None:
    places = np.array([[5.0, 5.0], [15.0, 2.0], [9.0, 11.0]])
    ranges = np.hypot(*(places[:, None] - ANCHORS).transpose(2, 0, 1))
    assert weighted_least_squares(ANCHORS, ranges) == pytest.approx(places, abs=1e-6)
    assert constrained_least_squares(ANCHORS, ranges) == pytest.approx(places, abs=1e-6)
    ranges[:, 3] = np.nan
    assert constrained_least_squares(ANCHORS, ranges) == pytest.approx(places, abs=1e-6)


def test_the_constraint_helps_and_least_squares_beat_the_centroid() -> None:
    rng = np.random.default_rng(8)
    places = rng.uniform((2.0, 2.0), (16.0, 10.0), (400, 2))
    true = np.hypot(*(places[:, None] - ANCHORS).transpose(2, 0, 1))
    ranges = np.maximum(true * (1.0 + 0.1 * rng.standard_normal(true.shape)), 0.0)

    def error(found: Array) -> float:
        return float(np.hypot(*(found - places).T).mean())

    free, kept = weighted_least_squares(ANCHORS, ranges), constrained_least_squares(ANCHORS, ranges)
    assert error(kept) < error(free) < error(weighted_centroid(ANCHORS, ranges))


def test_too_few_anchors_give_no_place() -> None:
    ranges = np.array([[3.0, 4.0, np.nan, np.nan], [np.nan] * 4])
    assert np.isnan(constrained_least_squares(ANCHORS, ranges)).all()
    assert np.isnan(weighted_least_squares(ANCHORS, ranges)).all()
    centroid = weighted_centroid(ANCHORS, ranges)
    assert centroid[0] == pytest.approx([20.0 * 3.0 / 7.0, 0.0])
    assert np.isnan(centroid[1]).all()
    in_a_row = np.array([[0.0, 0.0], [1.0, 0.0], [2.0, 0.0]])
    assert np.isnan(weighted_least_squares(in_a_row, np.ones((1, 3)))).all()
    with pytest.raises(ConfigError, match="do not go together"):
        weighted_centroid(ANCHORS, np.ones((2, 3)))


@pytest.mark.real_data
def test_captures_at_known_distances_leave_one_out(data_root: Path) -> None:
    folder = data_root / "csi" / "intel5300-distance"
    if not folder.is_dir():
        pytest.skip(f"REAL DATA ABSENT: no folder {folder}; fetch with `wayfuse datasets fetch csi`")
    paths = sorted(folder.glob("*.dat"))
    distance = np.array([float(path.name.split("-")[0]) for path in paths])
    power = np.array(
        [np.nanmedian([direct_path_power(f) for f in intel5300.read(p).csi], axis=0) for p in paths]
    )
    others = ~np.eye(len(paths), dtype=bool)
    errors = [
        float(abs(mean_range(fit_antennas(power[k], distance[k]), power[i]) - distance[i]))
        for i, k in enumerate(others)
    ]
    assert len(errors) == 21
    assert np.mean(errors) <= 0.30
