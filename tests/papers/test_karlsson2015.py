"""karlsson2015 with few seeds: its parts by hand, its order, its bars within wide bounds."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from wayfuse.core.errors import ConfigError
from wayfuse.core.philox import Noise
from wayfuse.evaluation.results_folds import in_turn
from wayfuse.filters.cloud import Cloud
from wayfuse.models.motion.step_count import CountedSteps, StepCountMotion
from wayfuse.papers import karlsson2015 as page
from wayfuse.papers.karlsson2015_real import band_errors, fix_errors
from wayfuse.papers.karlsson2015_runs import fitted_bands, long_walk, short_walk
from wayfuse.papers.sodindoorloc_buildings import read_buildings
from wayfuse.presets import karlsson2015 as preset
from wayfuse.radio.band_correlation import correlate
from wayfuse.simulator import karlsson2015_world as world

QUIET = replace(
    world.RadioWorld(),
    bands=tuple(replace(band, sigma=1e-3, cut_off=-200.0) for band in world.RadioWorld().bands),
)


def cloud(n: int, heading: float = 0.0) -> Cloud:
    zero = np.zeros(n, np.float32)
    return Cloud.on_floors(zero, zero, zero + np.float32(heading), zero + 1.0, np.zeros(n, np.int32))


def test_steps_without_noise_are_equation_2() -> None:
    motion = StepCountMotion(step_length=0.8, length_sigma=0.0, heading_sigma=0.0)
    moved = motion.propagate(Noise.of(0, "steps"), cloud(3, math.pi / 6.0), CountedSteps(5, math.pi / 3.0))
    np.testing.assert_allclose(moved.x, 0.0, atol=1e-6)
    np.testing.assert_allclose(moved.y, 4.0, rtol=1e-6)


def test_one_draw_serves_all_steps_and_the_turn_comes_after_the_move() -> None:
    motion = StepCountMotion(step_length=0.8, length_sigma=0.1, heading_sigma=0.2)
    moved = motion.propagate(Noise.of(0, "noise"), cloud(20_000), CountedSteps(5, 0.0))
    assert float(moved.x.std()) == pytest.approx(0.5, rel=0.03)  # N sigma_r, not sqrt(N) sigma_r
    np.testing.assert_allclose(moved.y, 0.0, atol=1e-6)
    assert float(moved.heading_bias.std()) == pytest.approx(0.2, rel=0.03)


@pytest.mark.parametrize("wrong", [{"step_length": 0.0}, {"length_sigma": -1.0}, {"heading_sigma": -1.0}])
def test_impossible_steps_are_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(ConfigError):
        StepCountMotion(**({"step_length": 0.8, "length_sigma": 0.1, "heading_sigma": 0.1} | wrong))


def test_the_walks_are_as_long_as_printed_and_dead_reckoning_of_a_perfect_phone_is_the_walk() -> None:
    assert world.SHORT_WALK.length == pytest.approx(100.0, rel=0.05)
    for place in (world.LONG_WALK, *world.OTHER_BUILDINGS.values()):
        assert place.length == pytest.approx(273.0)
        assert len(place.ap_xy) == 20
        assert place.corners[0] == place.corners[-1] == (109.0, 10.0)
        assert place.corners[1][0] < 109.0
        assert place.corners[1][1] == 10.0
    perfect = world.StepWorld(length_sigma=0.0, heading_drift=0.0, heading_noise=0.0, start_noise=0.0)
    walk = world.draw_steps(np.random.default_rng(0), perfect, world.LONG_WALK)
    found = preset.dead_reckoning(preset.Config(), walk.xy[0], walk.told_heading, walk.turn)
    # legs that cut a corner are shorter than a step
    assert np.hypot(*(found - walk.xy).T).max() < 2.5


def test_without_noise_least_squares_is_as_exact_as_the_rounding_to_1_db() -> None:
    errors = long_walk(0, QUIET, preset.Config())
    assert errors["LS, Gauss-Newton (ours)"].mean() < 0.5
    assert errors["LS, Wi-Fi only"].mean() < 1.5
    assert short_walk(0, QUIET, preset.Config(walk_sigma=2.0)).mean() < 0.7


def test_errors_of_the_simulator_have_the_chosen_moments() -> None:
    radio = replace(QUIET, bands=world.RadioWorld().bands, correlation=0.6)
    radio = replace(radio, bands=tuple(replace(band, cut_off=-300.0) for band in radio.bands))
    walked = np.arange(4000.0)
    still = replace(world.SHORT_WALK, corners=((4.0, 5.0), (4.0, 5.0)))
    scans = world.draw_readings(np.random.default_rng(1), radio, still, walked)
    error = scans - scans.mean(axis=0)
    # sigma and the rounding to 1 dB
    for b, band in enumerate(radio.bands):
        assert error[:, b].std() == pytest.approx(math.hypot(band.sigma, 12**-0.5), rel=0.05)
    between = [np.corrcoef(error[:, 0, a], error[:, 1, a])[0, 1] for a in range(7)]
    assert np.mean(between) == pytest.approx(0.6, abs=0.03)
    along = [np.corrcoef(error[:-1, 0, a], error[1:, 0, a])[0, 1] for a in range(7)]
    assert np.mean(along) == pytest.approx(0.5 * math.exp(-1.0 / 3.0), abs=0.03)


def test_a_survey_gives_back_the_bands_where_nothing_is_cut_off() -> None:
    found = fitted_bands(0, world.RadioWorld(), preset.Config(), world.SHORT_WALK)
    for band, of in zip(found, preset.Config().bands, strict=True):
        assert band.attenuation == pytest.approx(of.attenuation, abs=0.05)
        assert band.sigma == pytest.approx(of.sigma, rel=0.1)


def test_the_same_seed_gives_the_same_bits_and_another_seed_others() -> None:
    config = preset.Config(n_particles=300)
    first, again, other = (long_walk(seed, world.RadioWorld(), config) for seed in (3, 3, 4))
    for row, errors in first.items():
        np.testing.assert_array_equal(errors, again[row])
        assert not np.array_equal(errors[:5], other[row][:5]) or row == "PDR only"


def test_a_scan_that_hears_nothing_is_survived() -> None:
    config, plan = preset.Config(n_particles=200), preset.RadioPlan(
        np.array(world.SHORT_WALK.ap_xy), world.SHORT_WALK.low, world.SHORT_WALK.high
    )  # fmt: skip
    silent = np.full((4, 2, 7), np.nan)
    assert np.all(np.isfinite(preset.wifi_only(config, plan, silent, 1.0, 0)))
    np.testing.assert_allclose(preset.least_squares(config, plan, silent), np.tile([20.0, 12.5], (4, 1)))


def test_two_seeds_come_near_the_paper(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("WAYFUSE_DATA", str(tmp_path))  # the walks of real data take minutes
    result = page.reproduce(range(2), in_turn)
    values = {bar.what: bar.value for bar in result.bars}
    assert values["Table I: printed against Fisher interval ends, largest difference"] <= 0.01
    assert 1.3 < values["Table II, both bands"] < 2.3
    assert values["Table II, both over the better single band"] < 0.9
    assert 1.0 < values["Table III, PF, Wi-Fi + PDR"] < 1.9
    assert values["Table III, fused over PF Wi-Fi only"] < 0.6
    assert not result.lost
    widths = [(len(table.columns), {len(row) for row in table.rows}) for table in result.tables]
    assert all({n} == found for n, found in widths)


@pytest.mark.real_data
def test_real_bands_share_their_walls_but_not_their_fading(data_root: Path) -> None:
    buildings = {b.name: b for b in read_buildings(data_root / "sodindoorloc", both_bands=True)}
    if not buildings:
        pytest.skip("REAL DATA ABSENT: no sodindoorloc; fetch with `wayfuse datasets fetch sodindoorloc`")
    errors = band_errors(buildings["SYL"])
    assert len(errors) > 15
    assert np.mean([correlate(*e.across).r for e in errors]) > 0.45
    assert abs(np.mean([correlate(*e.within).r for e in errors])) < 0.2
    found = fix_errors(buildings["SYL"], (0, 1))
    assert len(found) > 90
    assert (
        4.0 < found.mean() < 9.0
    )  # of a building of about 60 m: a wrong column or frame gives 20 m and more
