"""Scenarios from TOML: values change, mistakes are named."""

from __future__ import annotations

import pytest

from wayfuse.core.errors import ConfigError
from wayfuse.simulator.scenario import Scenario, load_scenario


def load(tmp_path, text):
    path = tmp_path / "scenario.toml"
    path.write_text(text, encoding="utf-8")
    return load_scenario(path)


def test_an_empty_file_is_the_default(tmp_path):
    assert load(tmp_path, "") == Scenario()


def test_values_change_and_keep_their_kind(tmp_path):
    text = "test_walks = 4\nduration_s = [20, 30]\n[radio]\nshadow_sigma = 6\n[scanner]\nperiod_s = 30.0\n"
    scenario = load(tmp_path, text)
    assert scenario.test_walks == 4
    assert scenario.duration_s == (20.0, 30.0)
    assert scenario.radio.shadow_sigma == 6.0
    assert isinstance(scenario.radio.shadow_sigma, float)
    assert scenario.scanner.period_s == 30.0
    assert scenario.imu == Scenario().imu


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("tset_walks = 4", "unknown key 'tset_walks'"),
        ("[radio]\nshadow = 6", "radio: unknown key 'shadow'"),
        ("test_walks = 'many'", "test_walks: 'many'"),
        ("test_walks = 1.5", "test_walks: 1.5"),
        ("test_walks = true", "test_walks: True"),
        ("duration_s = [20]", "a list of 2 numbers"),
        ("[test_walks]\na = 1", "a table where a number belongs"),
        ("radio = 3", "radio: 3"),
        ("duration_s = [30, 20]", "duration_s"),
        ("survey_walks = -1", "must not be negative"),
        ("[scanner]\nperiod_s = 0.0", "must be positive"),
        ("= nonsense", "not TOML"),
    ],
)
def test_mistakes_are_named(tmp_path, text, said):
    with pytest.raises(ConfigError, match=said):
        load(tmp_path, text)
