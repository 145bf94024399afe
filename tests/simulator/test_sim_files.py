"""What is written is what the public files look like, and reads back as what was simulated."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from hashlib import sha256

import numpy as np
import pytest

from wayfuse.formats.ms_indoor import read
from wayfuse.maps.importers.ms_indoor import import_site
from wayfuse.simulator.demo import demo_name, write_demo
from wayfuse.simulator.recordings import recording_text, write_recording, write_site
from wayfuse.simulator.scenario import Scenario
from wayfuse.simulator.simulate import make_site, simulate_walk

SERIES = ("acceleration", "rotation_rate", "magnetic_field", "orientation")
NUMBER = r"-?\d+\.\d+"
SYNTAX = {
    "TYPE_WAYPOINT": rf"{NUMBER}\t{NUMBER}",
    "TYPE_ACCELEROMETER": rf"{NUMBER}\t{NUMBER}\t{NUMBER}\t[0-3]",
    "TYPE_GYROSCOPE": rf"{NUMBER}\t{NUMBER}\t{NUMBER}\t[0-3]",
    "TYPE_MAGNETIC_FIELD": rf"{NUMBER}\t{NUMBER}\t{NUMBER}\t[0-3]",
    "TYPE_ROTATION_VECTOR": rf"{NUMBER}\t{NUMBER}\t{NUMBER}\t[0-3]",
    "TYPE_WIFI": r"[^\t]*\t([0-9a-f]{2}:){5}[0-9a-f]{2}\t-\d+\t\d{4}\t\d{13}",
}


@pytest.fixture(scope="module")
def text(sim_walks):
    return recording_text(sim_walks[0][0])


def test_lines_have_the_syntax_of_the_public_files(text):
    lines = text.splitlines()
    assert lines[0].startswith("#\tstartTime:15")
    assert lines[-1].startswith("#\tendTime:15")
    records = [line for line in lines if not line.startswith("#")]
    patterns = {kind: re.compile(rf"\d{{13}}\t{kind}\t{body}") for kind, body in SYNTAX.items()}
    for line in records:
        assert patterns[line.split("\t")[1]].fullmatch(line), line
    times = [int(line[:13]) for line in records]
    assert times == sorted(times)
    assert {line.split("\t")[1] for line in records} == set(SYNTAX)


@pytest.mark.real_data
def test_public_lines_have_the_same_syntax(ms_indoor):
    """The patterns above are not of our own making."""
    path = min((ms_indoor / "F1" / "path_data_files").glob("*.txt"))
    met = set()
    for line in path.read_text(encoding="utf-8").splitlines():
        kind = line.split("\t")[1]
        if kind in SYNTAX:
            number = SYNTAX[kind].replace(NUMBER, r"-?\d+\.\d+(?:E-?\d+)?")
            assert re.fullmatch(rf"\d{{13}}\t{kind}\t{number}", line), line
            met.add(kind)
    assert met == set(SYNTAX)


@pytest.mark.real_data
def test_header_fields_are_those_of_the_public_files(ms_indoor, text):
    def names(lines):
        return [re.findall(r"\t(\w+):", line) for line in lines if line.startswith("#")]

    path = min((ms_indoor / "F1" / "path_data_files").glob("*.txt"))
    public, ours = names(path.read_text(encoding="utf-8").splitlines()), names(text.splitlines())
    assert [row for row in ours if "type" not in row] == [row for row in public if "type" not in row]


def test_a_file_reads_back_as_the_recording(tmp_path, sim_walks):
    for recording, _ in sim_walks[:3]:
        path = tmp_path / f"{recording.name}.txt"
        write_recording(path, recording)
        back = read(path)
        assert back.report.issues == {}
        for name in SERIES:
            ours, theirs = getattr(recording, name), getattr(back, name)
            np.testing.assert_array_equal(ours.t, theirs.t)
            np.testing.assert_allclose(ours.values, theirs.values, rtol=0, atol=1e-12)
        assert [w[:4] for w in back.waypoints] == [w[:4] for w in recording.waypoints]
        assert (back.name, back.site, back.floor, back.clock) == (
            recording.name, recording.site, recording.floor, recording.clock,
        )  # fmt: skip
        assert back.device == recording.device
        assert len(back.wifi) == len(recording.wifi)
        for a, b in zip(recording.wifi, back.wifi, strict=True):
            assert a.t == b.t
            for field in ("bssid", "rssi", "frequency", "last_seen"):
                np.testing.assert_array_equal(getattr(a, field), getattr(b, field))


def test_names_of_networks_are_written(sim_site, sim_walks):
    ssid = dict(zip(sim_site.radios.bssid.tolist(), sim_site.radios.ssid, strict=True))
    named = recording_text(sim_walks[0][0], ssid)
    assert "\tTYPE_WIFI\tcentre_free\t02:5a:3c:" in named


def test_the_written_site_imports_to_the_simulated_one(tmp_path, sim_site):
    write_site(tmp_path, sim_site.building)
    site, report = import_site(tmp_path)
    assert report.warnings == ()
    for storey, floor, notes in zip(sim_site.building.storeys, site.floors, report.floors, strict=True):
        assert notes.warnings == ()
        assert notes.residual < 1e-3
        assert floor.name == storey.name
        assert (floor.width, floor.height) == (70.0, 45.0)
        assert len(floor.units) == len(storey.rooms) + len(storey.voids)
        ours = {tuple(sorted([(x0, y0), (x1, y1)])) for x0, y0, x1, y1 in storey.walls.round(2).tolist()}
        theirs = {tuple(sorted([(x0, y0), (x1, y1)])) for x0, y0, x1, y1 in floor.walls.round(2).tolist()}
        free = 1.0 - sum(room_area(r.polygon) for r in (*storey.rooms, *storey.voids)) / room_area(
            storey.outline
        )
        assert floor.walkable_share == pytest.approx(free, abs=0.08)  # importers widen free space a little
        corners = {p for wall in theirs for p in wall}
        assert corners <= {p for wall in ours for p in wall}


def room_area(polygon):
    x, y = polygon.T
    return 0.5 * abs(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y))


@pytest.mark.real_data
def test_plan_features_have_the_properties_of_the_public_ones(tmp_path, ms_indoor, sim_site):
    write_site(tmp_path, sim_site.building)
    ours, public = (
        json.loads((root / "F1" / "geojson_map.json").read_text(encoding="utf-8"))["features"]
        for root in (tmp_path, ms_indoor)
    )
    for a, b in zip(ours[:2], public[:2], strict=True):
        assert a["geometry"]["type"] == b["geometry"]["type"]
        assert set(a["properties"]) <= set(b["properties"])
    info = [json.loads((root / "F1" / "floor_info.json").read_text()) for root in (tmp_path, ms_indoor)]
    assert info[0].keys() == info[1].keys()
    assert info[0]["map_info"].keys() == info[1]["map_info"].keys()


@pytest.fixture(scope="module")
def small() -> Scenario:
    return replace(Scenario(), survey_walks=3, test_walks=2, duration_s=(8.0, 10.0))


def contents(folder):
    return {p.relative_to(folder).as_posix(): p.read_bytes() for p in folder.rglob("*") if p.is_file()}


def test_the_same_seed_writes_the_same_bytes(tmp_path, small):
    for name in ("a", "b"):
        write_demo(tmp_path / name, 5, small)
    a, b = contents(tmp_path / "a"), contents(tmp_path / "b")
    assert a == b
    assert len(a) == 4 + 3 + 2
    write_demo(tmp_path / "c", 6, small)
    assert all(
        contents(tmp_path / "c").get(name) != data for name, data in a.items() if name.startswith("walks")
    )


def test_more_test_walks_leave_the_others_as_they_are(tmp_path, small):
    few = write_demo(tmp_path / "few", 5, small)
    more = write_demo(tmp_path / "more", 5, replace(small, test_walks=4))
    assert [p.read_bytes() for p in few.walks] == [p.read_bytes() for p in more.walks[:2]]
    assert [p.read_bytes() for p in few.survey] == [p.read_bytes() for p in more.survey]


def test_the_demo_says_what_it_wrote(tmp_path, small):
    files = write_demo(tmp_path, 1, small)
    assert sorted(p.name for p in files.site.iterdir()) == ["F1", "F2"]
    assert (len(files.survey), len(files.walks)) == (3, 2)
    for path in (*files.survey, *files.walks):
        truth = files.truth[path.stem]
        recording = read(path)
        assert recording.floor == truth.floor_name == path.parent.name
        assert truth.t[0] <= recording.span[0]
        assert recording.span[1] <= truth.t[-1] + 1e-3


def test_names_fall_on_their_side_of_the_split():
    for number in range(30):
        assert int(sha256(demo_name("survey", "F1", number).encode()).hexdigest(), 16) % 10 >= 2
        assert int(sha256(demo_name("walk", "F2", number).encode()).hexdigest(), 16) % 10 == 1


def test_a_walk_is_the_same_bits_for_the_same_generator(sim_site, sim_scenario):
    a, b, c = (simulate_walk(sim_site, sim_scenario, np.random.default_rng(seed), "w") for seed in (9, 9, 10))
    assert recording_text(a[0]) == recording_text(b[0]) != recording_text(c[0])
    np.testing.assert_array_equal(a[1].xy, b[1].xy)


def test_a_site_is_the_same_bits_for_the_same_generator(sim_scenario):
    a, b = (make_site(sim_scenario, np.random.default_rng(3)) for _ in range(2))
    np.testing.assert_array_equal(a.radios.ap_xy, b.radios.ap_xy)
    np.testing.assert_array_equal(a.radios.bssid, b.radios.bssid)
    np.testing.assert_array_equal(a.building.storeys[0].walls, b.building.storeys[0].walls)
