"""li2015 reduced: fewer seeds and particles, bounds that a broken filter does not meet."""

from __future__ import annotations

import numpy as np
import pytest

from wayfuse.core.philox import Noise
from wayfuse.papers.li2015 import Experiment
from wayfuse.presets.li2015 import R_PF, Config, dead_reckon, track
from wayfuse.simulator.li2015_world import LOS_NLOS, PATHS, simulate_run, walls_between


def test_the_order_of_table_1_and_of_the_exponents() -> None:
    seeds = [Experiment(n_particles=300)(seed) for seed in (0, 1)]

    def mean(name: str, s: int, method: str) -> float:
        return float(np.mean([seed[name, s, method][0] for seed in seeds]))

    for s in (0, 1):
        assert 1.3 < mean("LOS/NLOS", s, "R-PF") < 2.3
        assert mean("LOS/NLOS", s, "FW-PF") < 0.9 * mean("LOS/NLOS", s, "R-PF")
        assert mean("LOS/NLOS", s, "FW-PF") < mean("LOS/NLOS", s, "FW-PF 1/N")
        assert mean("equal", s, "FW-PF") > mean("equal", s, "FW-PF 1/N")


def test_a_seed_gives_the_same_figures_again() -> None:
    scenario = LOS_NLOS[0]
    for config in (Config(n_particles=100), R_PF):
        first, second = (
            track(scenario.anchors, run.ranges, run.velocity, (1.5, 8.0), run.dt, Noise.of(7, "a"), config)
            for run in (simulate_run(scenario, 0, np.random.default_rng(5)) for _ in range(2))
        )
        assert (first == second).all()


def test_exact_inputs_give_the_path_back() -> None:
    run = simulate_run(LOS_NLOS[1], 2, np.random.default_rng(2))
    true = np.hypot(*(run.xy[:, None] - LOS_NLOS[1].anchors[None]).transpose(2, 0, 1))
    velocity = np.diff(run.xy, axis=0, prepend=run.xy[:1]) / run.dt
    start = (28.5, 8.0)
    assert dead_reckon(velocity, start, run.dt) == pytest.approx(run.xy)
    config = Config(range_sigma=0.5, velocity_sigma=0.3)
    places = track(LOS_NLOS[1].anchors, true, velocity, start, run.dt, Noise.of(0, "b"), config)
    assert np.hypot(*(places - run.xy).T).mean() < 0.35


def test_walls_block_rays_that_cross_them() -> None:
    wall = np.array([[0.0, 5.0, 10.0, 5.0]])
    places = np.array([[5.0, 1.0], [20.0, 1.0]])
    anchors = np.array([[5.0, 9.0], [5.0, 4.0]])
    assert walls_between(places, anchors, wall).tolist() == [[True, False], [False, False]]


def test_errors_of_the_world_are_those_it_says() -> None:
    scenario = LOS_NLOS[1]
    biased: list[float] = []
    clear: list[float] = []
    for seed in range(12):
        for path in range(len(PATHS)):
            run = simulate_run(scenario, path, np.random.default_rng([seed, path]))
            true = np.hypot(*(run.xy[:, None] - scenario.anchors[None]).transpose(2, 0, 1))
            blocked = walls_between(run.xy, scenario.anchors)
            far = true > 8.0  # a range is never below zero
            biased += (run.ranges - true)[blocked & far].tolist()
            clear += (run.ranges - true)[~blocked & far].tolist()
    for errors, mean, sigma in (
        (biased, scenario.nlos_bias, scenario.nlos_sigma),
        (clear, 0.0, scenario.los_sigma),
    ):
        assert np.mean(errors) == pytest.approx(mean, abs=5.0 * sigma / np.sqrt(len(errors)))
        assert np.std(errors) == pytest.approx(sigma, rel=5.0 / np.sqrt(2 * len(errors)))
