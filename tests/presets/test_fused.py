"""The fused system: its parts can be left out, its parameters are checked, its radii hold on simulated walks."""

from __future__ import annotations

from dataclasses import fields, replace
from typing import Any

import numpy as np
import pytest

from wayfuse.core.errors import ConfigError, RadioMapError
from wayfuse.models.constraint.barriers import Barriers
from wayfuse.models.constraint.walkable_mask import WalkableMask
from wayfuse.presets import baselines
from wayfuse.presets.catalogue import METHODS, PAPERS
from wayfuse.presets.fused import BAND_2_4, BAND_5, Config, build, prior_estimate
from wayfuse.presets.given import check_floors
from wayfuse.presets.methods import CONFIGS, FIXES, build_method
from wayfuse.radio.survey import Fingerprint
from wayfuse.tracking.estimate import Estimate, State


def score(world: Any, tracker: Any, seeds: tuple[int, ...] = (0, 1)) -> tuple[np.ndarray, list[Estimate]]:
    """Errors (m) and estimates of all walks, from the first scan on."""
    off, said = [], []
    for recording in world.walks:
        truth = world.truth[recording.name]
        for seed in seeds:
            rows = [e for e in tracker.run(recording, seed).estimates if e.t >= recording.wifi[0].t]
            at = truth.at(np.array([e.t for e in rows]))
            off += np.hypot(*(np.array([(e.x, e.y) for e in rows]) - at).T).tolist()
            said += rows
    return np.array(off), said


def test_it_beats_each_of_its_parts(world: Any) -> None:
    whole = score(world, build(world.site, world.survey))[0].mean()
    assert whole < 5.0
    for tracker in (
        baselines.nnss(world.site, world.survey),
        baselines.wknn(world.site, world.survey),
        baselines.random_walk(world.site, world.survey),
        build(world.site, world.survey, Config(use_steps=False)),
    ):
        assert whole < score(world, tracker)[0].mean()


def test_radii_hold_about_what_they_promise(world: Any) -> None:
    off, said = score(world, build(world.site, world.survey), seeds=(0, 1, 2))
    share68 = np.mean(off <= [e.r68 for e in said])
    share95 = np.mean(off <= [e.r95 for e in said])
    # four simulated walks, radii made for another house: a sane range, not a calibration
    assert 0.50 < share68 < 0.97
    assert 0.85 < share95 <= 1.0
    r68 = np.array([e.r68 for e in said])
    assert np.median(r68) < 10.0
    sure = r68 < np.median(r68)
    assert off[sure].mean() < off[~sure].mean()


def test_parts_can_be_left_out(world: Any) -> None:
    config = Config(n_particles=50)
    assert isinstance(build(world.site, world.survey, config).engine.constraint, WalkableMask)
    assert isinstance(
        build(world.site, world.survey, replace(config, map_constraint="barriers")).engine.constraint,
        Barriers,
    )
    bare = build_method("fused-no-map", world.site, world.survey, n_particles=50).engine
    assert bare.n_particles == 50
    assert bare.constraint is None
    assert bare.walkable == ()
    assert build_method("fused-no-steps", world.site, world.survey).engine.uses_steps is False
    assert CONFIGS["fused-2.4ghz"].bands == BAND_2_4
    assert CONFIGS["fused-5ghz"].bands == BAND_5
    assert all(CONFIGS[name] != CONFIGS["fused"] for name in CONFIGS if name != "fused")
    with pytest.raises(KeyError):
        build_method("fused-no-roof", world.site, world.survey)


def test_every_method_of_the_command_line_can_be_built() -> None:
    from_start = {name for name, method in METHODS.items() if "start" in method.needs}
    assert set(METHODS) - from_start - {"fused-ranges"} <= {*CONFIGS, *FIXES, *PAPERS}
    assert set(PAPERS) < set(METHODS)


def test_one_band_uses_that_band_alone(world: Any) -> None:
    scan = world.walks[0].wifi[3]
    for name, (low, high) in (("fused-2.4ghz", (2400, 2500)), ("fused-5ghz", (4900, 5925))):
        radio_map = build_method(name, world.site, world.survey, n_particles=50).engine.radio.radio_map
        on = (scan.frequency >= low) & (scan.frequency < high)
        assert 5 < on.sum() < len(on) - 5
        whole, alone = (
            radio_map.neighbours(Fingerprint(scan.bssid[rows], scan.rssi[rows], scan.frequency[rows]))
            for rows in (np.ones(len(on), bool), on)
        )
        assert whole.n_aps == alone.n_aps <= on.sum()
        assert whole.distance == pytest.approx(alone.distance, abs=1e-6)
        np.testing.assert_allclose(np.sort(whole.weight), np.sort(alone.weight), atol=1e-4)


def test_a_survey_of_other_floors_is_refused(world: Any) -> None:
    other = replace(world.survey, floors=("F1", "F7"))
    for make in (build, baselines.nnss, baselines.wknn, baselines.random_walk):
        with pytest.raises(RadioMapError, match="the radio map has floors F1, F7, site site has F1, F2"):
            make(world.site, other)
    check_floors(world.site, world.survey)


def test_the_prior_is_somewhere_on_the_largest_floor(world: Any) -> None:
    prior = prior_estimate(world.site)
    floor = world.site.floors[prior.floor]
    assert floor.walkable.area == max(f.walkable.area for f in world.site.floors)
    places = floor.walkable.centres()
    far = np.hypot(*(places - (prior.x, prior.y)).T)
    assert np.mean(far <= prior.r68) == pytest.approx(0.68, abs=0.01)
    assert np.mean(far <= prior.r95) == pytest.approx(0.95, abs=0.01)
    assert prior.state is State.INITIALISING


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("n_particles", 3), ("k", 0), ("temperature", 0.0), ("kernel_width", -1.0), ("background", 0.0),
        ("exponent", 0.0),
        ("length_sigma", -0.1), ("heading_sigma", -0.1), ("bias_sigma", np.nan), ("first_bias_sigma", -1.0),
        ("injection", 1.0), ("penalty", -1.0), ("diffusion", 0.0), ("resampling", "none"),
    ],
)  # fmt: skip
def test_parameters_out_of_range_are_refused(world: Any, name: str, value: Any) -> None:
    assert name in {f.name for f in fields(Config)}
    with pytest.raises(ConfigError):
        build(world.site, world.survey, Config(**{name: value}))
