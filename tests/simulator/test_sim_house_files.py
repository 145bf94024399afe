"""What the demo writes of the three-storey building reads back as what was simulated."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from wayfuse.formats.getsensordata import read
from wayfuse.formats.reading import sniff
from wayfuse.maps.importers.imdf import import_site
from wayfuse.simulator import faults
from wayfuse.simulator.getsensordata_log import log_text, write_log
from wayfuse.simulator.house_demo import house_scenario, write_house_demo
from wayfuse.simulator.house_site import site_of, write_plan
from wayfuse.simulator.scenario import Scenario
from wayfuse.simulator.simulate_journey import make_house, simulate_journey

SERIES = ("acceleration", "rotation_rate", "magnetic_field", "orientation", "pressure")
NUMBER = r"-?\d+\.\d+"
CLOCKS = rf"{NUMBER};{NUMBER}"
SYNTAX = {
    "ACCE": rf"{CLOCKS};{NUMBER};{NUMBER};{NUMBER};[0-3]",
    "GYRO": rf"{CLOCKS};{NUMBER};{NUMBER};{NUMBER};[0-3]",
    "MAGN": rf"{CLOCKS};{NUMBER};{NUMBER};{NUMBER};[0-3]",
    "PRES": rf"{CLOCKS};{NUMBER};[0-3]",
    "AHRS": rf"{CLOCKS};{NUMBER};{NUMBER};{NUMBER};{NUMBER};{NUMBER};{NUMBER};[0-3]",
    "WIFI": rf"{CLOCKS};[^;]*;([0-9a-fA-F]{{2}}:){{5}}[0-9a-fA-F]{{2}};\d{{4}};-\d+",
    "POSI": rf"{NUMBER};\d+;{NUMBER};{NUMBER};-?\d+;\d+",
}


@pytest.fixture(scope="module")
def recording(journeys):
    return journeys[0][0]


@pytest.fixture(scope="module")
def text(recording):
    return log_text(recording)


def test_lines_have_the_syntax_of_the_public_files(text):
    records = [line for line in text.splitlines() if not line.startswith("%")]
    patterns = {kind: re.compile(f"{kind};{body}") for kind, body in SYNTAX.items()}
    for line in records:
        assert patterns[line[:4]].fullmatch(line), line
    assert {line[:4] for line in records} == set(SYNTAX)
    times = [float(line.split(";")[1]) for line in records]
    assert times == sorted(times)


@pytest.mark.real_data
def test_public_lines_have_the_same_syntax(data_root):
    """The patterns above are not of our own making."""
    logs = data_root / "ipin2023-track3" / "logs"
    if not logs.is_dir():
        pytest.skip(
            f"REAL DATA ABSENT: no folder {logs}; fetch with `wayfuse datasets fetch ipin2023-track3`"
        )
    path = logs / "IPIN2023_T3_TrainingTrial52_repetition01.txt"
    met = set()
    for line in path.read_text(encoding="utf-8", errors="replace").splitlines():
        kind = line[:4]
        if kind in SYNTAX and line[4:5] == ";":
            assert re.fullmatch(f"{kind};{SYNTAX[kind]}", line), line
            met.add(kind)
    assert met == set(SYNTAX)


def test_a_log_reads_back_as_the_recording(tmp_path, journeys):
    for recording, _ in journeys[:2]:
        path = tmp_path / f"{recording.name}.txt"
        write_log(path, recording)
        assert sniff(path) == "getsensordata"
        back = read(path)
        assert back.report.issues == {}
        for name in SERIES:
            ours, theirs = getattr(recording, name), getattr(back, name)
            assert len(ours) > 0
            np.testing.assert_array_equal(ours.t, theirs.t)
            np.testing.assert_allclose(ours.values, theirs.values, rtol=0, atol=1e-9)
        assert [(w.t, w.floor, w.lat, w.lon) for w in back.waypoints] == [
            (w.t, w.floor, w.lat, w.lon) for w in recording.waypoints
        ]
        assert np.isnan([(w.x, w.y) for w in (*back.waypoints, *recording.waypoints)]).all()
        assert (back.name, back.clock, back.device) == (recording.name, recording.clock, recording.device)
        assert len(back.wifi) == len(recording.wifi) > 10
        for a, b in zip(recording.wifi, back.wifi, strict=True):
            assert a.t == b.t
            for field in ("bssid", "rssi", "frequency"):
                np.testing.assert_array_equal(getattr(a, field), getattr(b, field))
            np.testing.assert_allclose(a.last_seen, b.last_seen, rtol=0, atol=1e-6)


def test_angles_of_the_log_are_those_of_its_quaternion(text):
    """A phone tilted up by p has PitchX = p; a phone whose top points west has YawZ = 90 degrees."""
    rows = [line.split(";") for line in text.splitlines() if line.startswith("AHRS")]
    angle = np.deg2rad([[float(v) for v in row[3:6]] for row in rows])
    x, y, z = np.array([[float(v) for v in row[6:9]] for row in rows]).T
    w = np.sqrt(1 - x * x - y * y - z * z)
    np.testing.assert_allclose(np.sin(angle[:, 0]), 2 * (y * z + w * x), atol=1e-6)
    top = np.column_stack([2 * (x * y - w * z), 1 - 2 * (x * x + z * z)])  # of the phone: east, north
    west = np.arctan2(-top[:, 0], top[:, 1])
    np.testing.assert_allclose(np.angle(np.exp(1j * (angle[:, 2] - west))), 0.0, atol=1e-6)


def test_stated_places_lie_on_the_truth(sim_house, journeys):
    for recording, truth in journeys:
        lonlat = np.array([(w.lon, w.lat) for w in recording.waypoints])
        t = np.array([w.t for w in recording.waypoints])
        away = np.hypot(*(sim_house.building.anchor.to_xy(lonlat) - truth.at(t)[:, :2]).T)
        assert away.max() < 0.5
        assert np.median(away) < 0.2
        assert {w.floor for w in recording.waypoints} == {str(k) for k in np.unique(truth.floor)}


def test_the_plan_imports_to_the_simulated_building(tmp_path, sim_house):
    building = sim_house.building
    write_plan(tmp_path / "plan.zip", building)
    site, report = import_site(tmp_path / "plan.zip")
    assert report.warnings == ()
    assert site.floor_names == ("0", "1", "2")
    assert [f.elevation for f in site.floors] == pytest.approx([s.elevation for s in building.storeys])
    ours = {p.connector.id: p.connector for p in building.passages}
    assert {c.id for c in site.connectors} == set(ours)
    for connector in site.connectors:
        same = ours[connector.id]
        assert (connector.kind, connector.n_steps, connector.floors) == (same.kind, same.n_steps, same.floors)
        np.testing.assert_allclose(connector.landings, same.landings, atol=1e-3)
    for floor, storey in zip(site.floors, building.storeys, strict=True):
        inside = floor.walkable.contains(storey.nodes[:, 0], storey.nodes[:, 1])
        assert inside.all()
        assert (floor.width, floor.height) == pytest.approx((building.width, building.height), abs=1e-3)


def test_a_way_into_stairs_and_lift_is_walkable_on_the_imported_plan(tmp_path, sim_house):
    site = site_of(sim_house.building)
    for passage in sim_house.building.passages:
        for number in passage.connector.floors:
            floor, landing = site.floors[number], passage.connector.landing(number)
            x, y = passage.opening(number).reshape(2, 2).mean(axis=0)
            crossed = floor.wall_index.crosses(landing.x, landing.y, np.array([x]), np.array([y]))
            assert not crossed.any()
            assert floor.walkable.contains([landing.x], [landing.y])[0]


@pytest.fixture(scope="module")
def small() -> Scenario:
    return replace(
        house_scenario(), survey_walks=1, test_walks=1, duration_s=(8.0, 10.0), changes=1, visit_m=(3.0, 12.0)
    )


def contents(folder):
    return {p.relative_to(folder).as_posix(): p.read_bytes() for p in folder.rglob("*") if p.is_file()}


@pytest.fixture(scope="module")
def written(tmp_path_factory, small):
    folder = tmp_path_factory.mktemp("house")
    return folder, write_house_demo(folder, 5, small)


def test_the_same_seed_writes_the_same_bytes(tmp_path, small, written):
    folder, _ = written
    write_house_demo(tmp_path / "again", 5, small)
    assert contents(tmp_path / "again") == contents(folder)
    write_house_demo(tmp_path / "other", 6, small)
    assert contents(tmp_path / "other")["walks/walk-00.txt"] != contents(folder)["walks/walk-00.txt"]


def test_more_walks_leave_the_others_as_they_are(tmp_path, small, written):
    folder, few = written
    more = write_house_demo(tmp_path, 5, replace(small, test_walks=2))
    assert more.walks[0].read_bytes() == few.walks[0].read_bytes()
    assert [p.read_bytes() for p in more.survey] == [p.read_bytes() for p in few.survey]
    assert folder != tmp_path


def test_the_survey_sees_every_floor_and_every_connector(written):
    _, demo = written
    assert len(demo.survey) == 1 + 3
    floors = set()
    ways = set()
    for path in demo.survey:
        truth = demo.truth[path.stem]
        floors |= set(truth.floor.tolist())
        ways |= set(truth.passage.tolist())
        assert read(path).span[1] <= truth.t[-1] + 1e-3
    assert floors == {0, 1, 2}
    assert ways == {-1, 0, 1, 2}


def test_a_journey_is_the_same_bits_for_the_same_generator(sim_house, sim_scenario):
    a, b, c = (simulate_journey(sim_house, sim_scenario, np.random.default_rng(k), "w") for k in (9, 9, 10))
    assert log_text(a[0]) == log_text(b[0]) != log_text(c[0])
    np.testing.assert_array_equal(a[1].z, b[1].z)
    np.testing.assert_array_equal(
        make_house(sim_scenario, np.random.default_rng(1)).radios.bssid,
        make_house(sim_scenario, np.random.default_rng(1)).radios.bssid,
    )


def read_text(tmp_path, text):
    path = tmp_path / "walk.txt"
    path.write_text(text, encoding="utf-8")
    return read(path)


def test_a_log_garbled_cut_or_joined_still_reads(tmp_path, recording, text):
    report = read_text(tmp_path, faults.garbled_text(text, np.random.default_rng(0), 0.02)).report
    assert report.n_bad == pytest.approx(0.02 * report.n_lines, rel=0.5)
    back = read_text(tmp_path, faults.truncated_text(text, 0.5))
    assert 0.3 < len(back.pressure) / len(recording.pressure) < 0.7
    joined = faults.joined_lines(text, 50)
    assert joined.replace("\n", "") == text.replace("\n", "")
    assert len(read_text(tmp_path, joined).acceleration) == len(recording.acceleration)


def test_a_log_whose_clock_is_set_back_goes_on(tmp_path, recording, text):
    jumped = faults.text_clock_jump(text, 0.5, -60_000)
    before, after = (
        [float(s.split(";")[1]) for s in each.splitlines() if s[0] != "%"] for each in (text, jumped)
    )
    moved = np.subtract(after, before)
    np.testing.assert_allclose(np.unique(moved.round(3)), (-60.0, 0.0))
    back = read_text(tmp_path, jumped)
    assert back.report.n_bad > 0
    assert (np.diff(back.acceleration.t) >= 0.0).all()
    assert len(back.acceleration) > 0.9 * len(recording.acceleration)


def test_barometers_may_be_absent_or_step(recording):
    assert len(faults.without_pressure(recording).pressure) == 0
    assert faults.without_pressure(recording).wifi is recording.wifi
    middle = 0.5 * recording.span[1]
    stepped = faults.pressure_step(recording, middle, 2.0).pressure
    change = stepped.values[:, 0] - recording.pressure.values[:, 0]
    np.testing.assert_allclose(change, np.where(stepped.t >= middle, -0.24, 0.0), atol=1e-9)
