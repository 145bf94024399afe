"""The system of liu2017 in its own world: what its paper reports holds, in a reduced version."""

from __future__ import annotations

import pickle
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from wayfuse.evaluation.results_folds import in_turn
from wayfuse.papers.liu2017 import SEEDS, Runs, reproduce
from wayfuse.papers.reproduction import page
from wayfuse.presets.liu2017 import Config, Motion, Pose, dead_reckoning, fused, sequence_neighbours
from wayfuse.simulator.liu2017_world import World, office, survey, walk


def test_the_walk_is_that_of_the_paper() -> None:
    world = World()
    place = office(world, np.random.default_rng(0))
    walked = walk(world, place, np.random.default_rng(1))
    assert len(walked.t) in (415, 416)
    assert len(place.ap_xy) == 9
    assert survey(world, place, np.random.default_rng(2)).rssi.shape == (41, 9)
    length = np.linalg.norm(np.diff(walked.truth, axis=0), axis=1).sum()
    assert 0.95 * 648.2 < length <= 648.2  # chords cut the corners
    assert walked.step_count[-1] == pytest.approx(648.2 / 0.7, abs=3)


def test_a_world_repeats_bit_by_bit() -> None:
    first, second = (
        walk(World(), office(World(), np.random.default_rng(5)), np.random.default_rng(6)) for _ in range(2)
    )
    assert all(np.array_equal(a, b) for a, b in zip(first, second, strict=True))


def test_fair_sensors_are_followed_closely() -> None:
    world = World(distortion=0.0, compass_sigma=0.0)
    walked = walk(world, office(world, np.random.default_rng(0)), np.random.default_rng(1))
    start = Pose(*walked.truth[0], walked.heading[0])
    estimates = dead_reckoning(Motion(walked.step_count, walked.orientation), start, Config())
    # each corner costs up to one period of the old heading (Eq. 5 moves before Eq. 7 turns)
    assert np.linalg.norm(estimates - walked.truth, axis=1).mean() < 2.5


def test_without_noise_the_filter_is_dead_reckoning() -> None:
    world = World()
    place = office(world, np.random.default_rng(0))
    walked = walk(world, place, np.random.default_rng(1))
    motion, start = Motion(walked.step_count, walked.orientation), Pose(*walked.truth[0], walked.heading[0])
    still = Config(distance_sigma=0.0, turn_sigma=0.0, n_particles=3)
    scans = sequence_neighbours(place.ap_xy, (0.0, 0.0, 25.0, 14.0), walked.rssi, still)
    np.testing.assert_allclose(
        fused(motion, start, scans, 1, still), dead_reckoning(motion, start, still), atol=1e-6
    )
    moving = replace(still, distance_sigma=0.4, n_particles=50)
    assert np.array_equal(fused(motion, start, scans, 1, moving), fused(motion, start, scans, 1, moving))


def test_the_table_of_section_4() -> None:
    pickle.dumps(Runs())  # goes to other processes
    runs = [Runs(sweeps=False)(seed) for seed in range(3)]
    mean = {name: np.mean([run[name][0] for run in runs]) for name in runs[0]}
    assert mean["wifi"] == pytest.approx(5.22, rel=0.2)
    assert mean["imu"] == pytest.approx(27.5, rel=0.06)
    assert mean["fused"] == pytest.approx(2.67, rel=0.3)
    assert mean["fingerprints"] == pytest.approx(2.35, rel=0.2)
    assert mean["fused"] < 0.7 * mean["wifi"] < mean["imu"]
    assert mean["fingerprints printed"] < 0.7 * mean["fingerprints"]  # the misprint shows here
    assert not any(run[name][1] for run in runs for name in ("wifi", "fused", "fingerprints"))


@pytest.mark.slow
def test_the_whole_reproduction_in_small(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("WAYFUSE_DATA", str(tmp_path))
    result = reproduce((0, 1), in_turn)
    assert {bar.what for bar in result.bars if not bar.met} <= {"fingerprints - fused", "fused, mean error"}
    assert len(result.tables) == 9
    assert {line.split(":")[0] for line in result.lost} >= {"imu", "sigma_d 0.1"}


def test_the_page_says_what_it_has_to() -> None:
    assert SEEDS >= 20
    for word in ("Eq. 2", "Eq. 3", "Eq. 4", "Eq. 5", "Eq. 7", "ap_sequence", "test_ap_sequence", "misprint"):
        assert word in page("liu2017")
