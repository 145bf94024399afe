"""Scenarios from TOML: values change, mistakes are named with file, key and remedy."""

from __future__ import annotations

import tomllib
from pathlib import Path

import pytest

from wayfuse.core.errors import ConfigError, DataMissingError
from wayfuse.simulator.experiment_files import scenario_copy
from wayfuse.simulator.radio_field import AccessPoint
from wayfuse.simulator.scenario import Scenario
from wayfuse.simulator.scenario_file import (
    PhoneModel,
    Place,
    ScenarioFile,
    find_scenario,
    load_scenario_file,
    shipped_scenarios,
)


def load(tmp_path: Path, text: str) -> ScenarioFile:
    path = tmp_path / "scenario.toml"
    path.write_text(text, encoding="utf-8")
    return load_scenario_file(path)


def test_an_empty_file_is_the_default(tmp_path):
    assert load(tmp_path, "") == ScenarioFile()


def test_values_change_and_keep_their_kind(tmp_path):
    text = """
    seed = 5
    [walkers]
    number = 4
    duration_s = [20, 30]
    waypoints = [[1, 2.5, "0"], [3.0, 4.0, "1"]]
    phones = ["b"]
    [phone]
    models = [{ name = "a" }, { name = "b", rss_offset_db = [-3, 1] }]
    [phone.imu]
    hold = 0.5
    [radio]
    shadow_sigma = 6
    model = "rim"
    access_points = [[1, 2, "0"]]
    [radio.rim]
    max_walls = 2
    [scan]
    stale_repeats = true
    [output]
    formats = ["getsensordata", "wayfuse"]
    """
    s = load(tmp_path, text)
    assert (s.seed, s.walkers.number, s.walkers.duration_s) == (5, 4, (20.0, 30.0))
    assert s.walkers.waypoints == (Place(1.0, 2.5, "0"), Place(3.0, 4.0, "1"))
    assert s.phone.models == (PhoneModel(name="a"), PhoneModel(name="b", rss_offset_db=(-3.0, 1.0)))
    assert s.phone.imu.hold == 0.5
    assert (s.radio.shadow_sigma, s.radio.model, s.radio.rim.max_walls) == (6.0, "rim", 2)
    assert isinstance(s.radio.shadow_sigma, float)
    assert s.radio.access_points == (AccessPoint(1.0, 2.0, "0"),)
    assert s.scan.stale_repeats is True
    assert s.output.formats == ("getsensordata", "wayfuse")
    assert s.site == ScenarioFile().site


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("walker = 4", "unknown key 'walker' .*walkers"),
        ("[radio]\nshadow = 6", "radio: unknown key 'shadow'"),
        ("[radio.rim]\ndio = 1.0", "radio.rim: unknown key 'dio' .*doi"),
        ("[walkers]\nnumber = 'many'", "walkers.number: 'many' .*whole number"),
        ("[walkers]\nnumber = 1.5", "walkers.number: 1.5"),
        ("[walkers]\nnumber = true", "walkers.number: True"),
        ("[walkers]\nnumber = -1", "walkers: number = -1"),
        ("[walkers]\nduration_s = [20]", "walkers.duration_s: .*a list of 2 numbers"),
        ("[walkers]\nduration_s = [30, 20]", "walkers: duration_s = .*smaller number first"),
        ("[walkers]\nwaypoints = [[1, 2]]", r"walkers.waypoints\[0\].*\[x, y, floor\]"),
        ("[walkers]\nwaypoints = [[1, 2, 3]]", r"walkers.waypoints\[0\]"),
        ("[walkers]\nwaypoints = [[1, 2, '0']]", "waypoints = .*at least two"),
        ("[walkers]\nconnectors = 'ladder'", "walkers.connectors: 'ladder' .*both, stairs, lift"),
        ("[walkers]\nphones = ['x']", "walkers.phones"),
        ("[walkers]\nphones = [1]", r"walkers.phones\[0\]"),
        ("[walkers.lift]\nspeed = 0.0", "walkers.lift: speeds"),
        ("[walkers.gait]\nstep_rate = 0.0", "walkers.gait: step_rate = 0.0 .*from 1.6 to 2"),
        ("[walkers.gait]\nstep_length = 2.0", "walkers.gait: step_length = 2.0 .*from 0.5 to 0.84"),
        ("[walkers.gait]\nleg_length = 0.0", "walkers.gait: up_rate"),
        ("[phone]\nmodels = []", "models = .*at least one"),
        ("[phone]\nmodels = [1]", r"phone.models\[0\]: 1"),
        ("[phone]\nmodels = [{ nme = 'a' }]", r"phone.models\[0\]: unknown key"),
        ("[phone.imu]\nrate_hz = 0", "phone.imu: rate_hz"),
        ("[phone.imu]\naccel_noise = -1.0", "accel_noise = -1.0"),
        ("[phone.barometer]\nrate_hz = -1.0", "rate_hz = -1.0"),
        ("[radio]\nmodel = 'images'", "radio.model = 'images'.*hall"),
        ("[radio]\nshadow_m = 0.0", "shadow_m"),
        ("[radio]\naccess_points = 3", "radio.access_points: 3 .*a list in brackets"),
        ("[radio]\nmodel = 'images'\nceiling = 1.0", "ceiling"),
        ("[radio]\nmodel = 'rays'\nceiling = 2.9", "ceiling"),
        ("[radio.rays]\nwall_material = 'paper'", "brick"),
        ("[radio.rays]\nraster_m = 0.0", "raster_m"),
        ("[radio.rays]\ninteractions = 21", "interactions"),
        ("[radio.rays]\nsamples = 10", "samples"),
        ("radio = 3", "radio: 3 .*a table belongs here"),
        ("[seed]\na = 1", "a table where a value belongs"),
        ("seed = -1", "seed = -1"),
        ("[scan]\nperiod_s = 0.0", "period_s = 0.0 .*must be positive"),
        ("[scan]\nhit_rate = 2.0", "hit_rate"),
        ("[scan]\nstale_repeats = 1", "scan.stale_repeats: 1 .*true or false"),
        ("[scan]\nperiod_s = inf", "scan.period_s: inf"),
        ("[csi]\nn_antennas = 5", "n_antennas = 5"),
        ("[csi.multipath]\nray_ns = 0", "csi.multipath"),
        ("[changes]\nmoved = -1", "moved = -1"),
        ("[survey]\nphone = 'x'", "survey.phone"),
        ("[output]\nformats = ['csv']", "formats = .*wayfuse, getsensordata, ms-indoor"),
        ("[output]\nformats = []", "formats"),
        ("[output]\ntruth_hz = 0", "truth_hz"),
        ("title = 3", "title: 3 .*a text in quotes"),
        ("= nonsense", "not TOML"),
    ],
)
def test_mistakes_are_named(tmp_path, text, said):
    with pytest.raises(ConfigError, match=said) as caught:
        load(tmp_path, text)
    assert str(tmp_path / "scenario.toml") in str(caught.value)
    assert caught.value.remedy


def test_scenarios_that_come_with_the_package_are_found_by_name_and_read():
    names = shipped_scenarios()
    assert {
        "house-two-phones",
        "throttled-phone",
        "moved-access-points",
        "warehouse-rtt",
        "csi-room",
        "ray-traced-house",
    } <= set(names)
    for name in names:
        assert load_scenario_file(find_scenario(name)).title
    with pytest.raises(DataMissingError, match="house-two-phones"):
        find_scenario("no-such")


@pytest.mark.parametrize(
    "text",
    [
        "",
        'title = "a [b] c"\nseed = 3\n',
        'seed = 3\n[site]\nfolder = "../there"   # relative\n[walkers]\nwaypoints = [[1, 2, "0"],\n [2, 3, "0"]]\n',
        '[site]\nfolder = "x"\n',
    ],
)
def test_a_copy_says_the_seed_used_and_stays_the_same_scenario(text):
    copy = tomllib.loads(scenario_copy(text, 9, "1.2", has_folder="folder" in text))
    was = tomllib.loads(text)
    if "site" in was:
        was["site"]["folder"] = "SITE"
    assert copy == {**was, "seed": 9, "version": "1.2"}
    again = scenario_copy(scenario_copy(text, 9, "1.2", has_folder=False), 4, "1.3", has_folder=False)
    assert tomllib.loads(again)["seed"] == 4


@pytest.mark.parametrize(
    "changes", [{"duration_s": (30.0, 20.0)}, {"survey_walks": -1}, {"changes": -1}, {"visit_m": (9.0, 3.0)}]
)
def test_numbers_of_walks_that_cannot_be_are_refused(changes):
    with pytest.raises(ConfigError):
        Scenario(**changes)
