"""How accurate a survey makes a fix, by the survey itself; and that files keep it."""

from __future__ import annotations

import json
import math
import zipfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from wayfuse.core.errors import RadioMapError
from wayfuse.radio.survey import Survey
from wayfuse.radio.survey_accuracy import held_out_errors, survey_accuracy
from wayfuse.radio.survey_file import load_survey, save_survey


def walks(
    n_walks: int, n: int = 60, noise: float = 1.0, apart: float = 0.0, disjoint: bool = False
) -> Survey:
    """The same corridor walked several times; ``apart`` : m between the walks. disjoint : networks of their own."""
    rng = np.random.default_rng(4)
    stations = rng.uniform((0.0, -15.0), (60.0, 15.0), (25, 2))
    rssi, xy = [], []
    for w in range(n_walks):
        at = np.stack([np.linspace(0.0, 60.0, n), np.full(n, apart * w)], axis=1)
        heard = -35.0 - 25.0 * np.log10(1.0 + np.linalg.norm(at[:, None] - stations[None], axis=2))
        heard += rng.normal(0.0, noise, heard.shape)
        own = np.full((n, n_walks if disjoint else 1, 25), np.nan)
        own[:, w if disjoint else 0] = heard
        rssi.append(own.reshape(n, -1))
        xy.append(at)
    return Survey.from_dense(
        np.concatenate(rssi),
        np.concatenate(xy),
        np.zeros(n * n_walks, int),
        ("F1", "F2"),
        walk=np.repeat(np.arange(n_walks), n),
        walks=tuple(f"w{w}" for w in range(n_walks)),
    )


def test_repeated_walks_find_each_other_and_noise_makes_it_worse() -> None:
    exact, fair, poor = (survey_accuracy(walks(3, noise=s)) for s in (0.2, 3.0, 12.0))
    assert 0.0 <= exact < 1.0
    assert exact < fair < poor


def test_walks_farther_apart_are_found_less_well() -> None:
    near, far = (survey_accuracy(walks(2, apart=d)) for d in (0.5, 8.0))
    assert near < 2.0
    assert far >= 8.0 - 1e-6  # nobody is found nearer than the other walk is


def test_nothing_is_said_of_one_walk_or_of_few_fingerprints() -> None:
    assert math.isnan(survey_accuracy(walks(1)))
    assert len(held_out_errors(walks(1))) == 0
    assert math.isnan(survey_accuracy(walks(2, n=9)))
    assert math.isfinite(survey_accuracy(walks(2, n=11)))


def test_nothing_is_said_of_walks_that_have_nothing_in_common() -> None:
    assert len(held_out_errors(walks(2, disjoint=True))) == 0
    assert math.isnan(survey_accuracy(walks(2, disjoint=True)))


def test_a_fingerprint_on_a_wrong_floor_counts_as_infinitely_far() -> None:
    survey = walks(2)
    split = replace(survey, floor=survey.walk.astype(np.int32))
    errors = held_out_errors(split)
    assert len(errors) > 100
    assert np.all(np.isinf(errors))
    assert math.isnan(survey_accuracy(split))
    third = replace(walks(3), floor=(walks(3).walk == 2).astype(np.int32))
    assert 0.0 < survey_accuracy(third) < 3.0  # a third is infinite, the lower quartile is not


def test_about_n_fingerprints_are_held_out_and_the_survey_is_left_alone() -> None:
    survey = walks(3)
    kept = survey.rssi.copy()
    assert len(held_out_errors(survey, 50)) == 50
    assert len(held_out_errors(survey, 1000)) == len(survey)
    np.testing.assert_array_equal(survey.rssi, kept)


def test_the_accuracy_of_the_simulated_world_is_plausible(world: Any) -> None:
    assert 0.3 < world.survey.accuracy < 6.0
    assert world.survey.accuracy == survey_accuracy(world.survey)


def test_files_keep_the_accuracy(tmp_path: Path) -> None:
    for accuracy in (1.25, math.nan):
        save_survey(replace(walks(2), accuracy=accuracy), tmp_path / "s.npz")
        back = load_survey(tmp_path / "s.npz").accuracy
        assert back == accuracy or (math.isnan(back) and math.isnan(accuracy))
    assert math.isnan(walks(2).accuracy)


def rewritten(path: Path, value: object) -> Path:
    """The file with another accuracy in its header, None = without one, as older files are."""
    with zipfile.ZipFile(path) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    top = json.loads(members["header.json"])
    del top["header"]["accuracy"]
    if value is not None:
        top["header"]["accuracy"] = value
    members["header.json"] = json.dumps(top).encode()
    with zipfile.ZipFile(path, "w") as archive:
        for name, data in members.items():
            archive.writestr(name, data)
    return path


def test_older_files_have_none_and_nonsense_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "s.npz"
    survey = replace(walks(2), accuracy=1.25)
    save_survey(survey, path)
    old = load_survey(rewritten(path, None))
    assert math.isnan(old.accuracy)
    np.testing.assert_array_equal(old.rssi, survey.rssi)
    save_survey(survey, path)
    with pytest.raises(RadioMapError, match="accuracy 'good' is no number"):
        load_survey(rewritten(path, "good"))
