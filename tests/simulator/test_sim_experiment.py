"""Scenarios in memory: bits repeat, every part of a scenario has its effect, any site can be walked in."""

from __future__ import annotations

import csv
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from wayfuse.core.errors import ConfigError
from wayfuse.core.types import Array
from wayfuse.evaluation.estimates_file import read_estimates
from wayfuse.maps.site import Site
from wayfuse.sensors.recording import Recording
from wayfuse.simulator.channel_state import ChannelModel
from wayfuse.simulator.errands import errands
from wayfuse.simulator.experiment import Plan, World, make_world, plan_walks, simulate_plan
from wayfuse.simulator.experiment_files import check_formats, write_access_points, write_tables, write_walk
from wayfuse.simulator.hall import hall
from wayfuse.simulator.house_site import site_of
from wayfuse.simulator.imu import ImuModel
from wayfuse.simulator.passages import Activity
from wayfuse.simulator.radio_field import RadioModel
from wayfuse.simulator.round_trip import RangesModel
from wayfuse.simulator.routes import Manner
from wayfuse.simulator.scanner import ScannerModel
from wayfuse.simulator.scenario_file import (
    ChangesPart,
    OutputPart,
    PhoneModel,
    PhonePart,
    Place,
    ScenarioFile,
    SitePart,
    SurveyPart,
    WalkersPart,
)
from wayfuse.simulator.site_building import building_of
from wayfuse.simulator.storeys import three_storeys

HALL = SitePart(building="hall", size=(30.0, 20.0), racks=1)
FEW = SurveyPart(walks=2, duration_s=(15.0, 20.0))
SMALL = ScenarioFile(
    site=HALL,
    walkers=WalkersPart(number=2, duration_s=(15.0, 20.0)),
    radio=RadioModel(aps_per_floor=5),
    ranges=RangesModel(period_s=1.0),
    csi=ChannelModel(period_s=1.0),
    survey=FEW,
)
NOWHERE = Path()


def world_of(scenario: ScenarioFile, seed: int = 1) -> tuple[World, tuple[Plan, ...]]:
    world = make_world(scenario, seed, NOWHERE)[1]
    return world, plan_walks(world)


def bits(recording: Recording) -> list[bytes]:
    columns = [recording.acceleration, recording.rotation_rate, recording.magnetic_field, recording.pressure]
    out = [np.column_stack([c.t, c.values]).tobytes() for c in (*columns, recording.orientation)]
    out += [
        np.column_stack([s.bssid, s.rssi, s.last_seen]).tobytes() + str(s.t).encode() for s in recording.wifi
    ]
    out += [repr(r).encode() for r in (*recording.ranges, *recording.waypoints)]
    return out + [f.csi.tobytes() + repr((f.t, f.anchor, f.rss, f.agc)).encode() for f in recording.csi]


def test_the_same_seed_gives_the_same_bits_in_any_order_and_another_seed_others():
    world, plans = world_of(SMALL)
    first = {p.name: bits(simulate_plan(world, p).recording) for p in plans}
    again, more = world_of(replace(SMALL, walkers=replace(SMALL.walkers, number=3)))
    second = {p.name: bits(simulate_plan(again, p).recording) for p in reversed(more)}
    assert {name: second[name] for name in first} == first
    assert len(second) == len(first) + 1
    other, third = world_of(SMALL, 2)
    assert bits(simulate_plan(other, third[0]).recording) != first[third[0].name]


def test_survey_walks_hold_waypoints_and_walks_to_track_hold_none():
    world, plans = world_of(SMALL)
    for plan in plans:
        made = simulate_plan(world, plan)
        assert bool(made.recording.waypoints) == (plan.role == "survey")
        assert made.recording.wifi
        assert made.recording.ranges
        assert made.recording.csi
        at = np.array([(p.t, p.x, p.y) for p in made.places])
        np.testing.assert_allclose(made.truth.at(at[:, 0])[:, :2], at[:, 1:], atol=0.02)
        if plan.role == "survey":
            stated = np.array([(p.x, p.y) for p in made.recording.waypoints])
            assert 0.0 < np.abs(stated - at[:, 1:]).max() < 0.6


def test_phones_differ_by_what_the_scenario_says_and_are_carried_in_turn():
    models = (PhoneModel(name="a"), PhoneModel(name="b", rss_offset_db=(-9.0, -9.0), pressure_hpa=7.0))
    plain = ScenarioFile(
        site=HALL,
        walkers=WalkersPart(number=4, duration_s=(20.0, 20.0)),
        radio=RadioModel(aps_per_floor=5),
        phone=PhonePart(models=models),
        survey=replace(FEW, phone="b"),
    )
    world, plans = world_of(plain)
    assert [p.phone for p in plans if p.role == "survey"] == [1, 1]
    walks = [p for p in plans if p.role == "walk"]
    assert [p.phone for p in walks] == [0, 1, 0, 1]
    heard = [simulate_plan(world, replace(walks[0], phone=k)).recording for k in (0, 1)]
    assert [r.device.model for r in heard] == ["a", "b"]
    strongest = [np.median([s.rssi.max() for s in r.wifi]) for r in heard]  # weak ones are not heard by both
    assert strongest[0] - strongest[1] == pytest.approx(9.0, abs=1.0)
    pressure = [r.pressure.values.mean() for r in heard]
    assert pressure[1] - pressure[0] == pytest.approx(7.0, abs=0.01)
    only = replace(plain, walkers=replace(plain.walkers, phones=("b",)))
    assert {p.phone for p in world_of(only)[1]} == {1}


def test_a_phone_can_be_held_across_the_walk():
    turned = replace(SMALL, phone=PhonePart(imu=ImuModel(hold=0.5 * np.pi)))
    headings = []
    for scenario in (SMALL, turned):
        world, plans = world_of(scenario)
        q = simulate_plan(world, plans[-1]).recording.orientation.values
        headings.append(
            np.arctan2(1 - 2 * (q[:, 1] ** 2 + q[:, 3] ** 2), 2 * (q[:, 1] * q[:, 2] - q[:, 3] * q[:, 0]))
        )
    turn = np.angle(np.exp(1j * (headings[1] - headings[0])))
    assert np.median(turn) == pytest.approx(0.5 * np.pi, abs=0.25)


def test_walks_meet_the_changed_access_points_and_the_survey_the_old_ones(tmp_path):
    world, _ = world_of(replace(SMALL, changes=ChangesPart(moved=2, removed=1)))
    for site, name in ((world.before, "before"), (world.later, "later")):
        write_access_points(tmp_path / name, world, site)
    before, later = ((tmp_path / n).read_text().splitlines() for n in ("before", "later"))
    assert before[0] == later[0] == "bssid,x,y,floor,height"
    assert len(later) < len(before)
    assert len(set(later) - set(before)) > 0
    everywhere = [r for plan in world_of(SMALL)[1] for r in [simulate_plan(world, plan).recording]]
    known = {row.split(",")[0] for row in later[1:]}
    from wayfuse.sensors.records import bssid_text

    for recording, plan in zip(everywhere, world_of(SMALL)[1], strict=True):
        heard = {bssid_text(b) for s in recording.wifi for b in s.bssid.tolist()}
        assert heard <= known or plan.role == "survey"
    with pytest.raises(ConfigError, match=r"at most the 5"):
        world_of(replace(SMALL, changes=ChangesPart(moved=4, removed=2)))


def house(**walkers: object) -> ScenarioFile:
    part = WalkersPart(**{"number": 3, "visit_m": (3.0, 10.0), **walkers})  # type: ignore[arg-type]
    return ScenarioFile(walkers=part, survey=SurveyPart(walks=0), radio=RadioModel(aps_per_floor=4))


@pytest.mark.parametrize(
    ("connectors", "used"), [("stairs", {False}), ("lift", {True}), ("both", {False, True})]
)
def test_walkers_take_the_connectors_they_are_told_to(connectors, used):
    world, plans = world_of(house(connectors=connectors, changes=3))
    passages = world.building.passages
    taken = {
        passages[leg.passage].is_lift
        for p in plans
        if p.role == "walk"
        for leg in p.journey.legs
        if leg.passage >= 0
    }
    assert taken == used
    assert sum(p.role == "survey" for p in plans) == len(passages)  # one through each


def test_given_places_are_passed_in_their_order_over_floors():
    given = (Place(30.0, 9.75, "0"), Place(30.0, 26.25, "0"), Place(50.25, 18.0, "2"))
    world, plans = world_of(house(waypoints=given, connectors="lift", pause_share=0.0))
    walk = simulate_plan(world, next(p for p in plans if p.role == "walk"))
    truth, since = walk.truth, 0
    for place in given:
        gap = np.hypot(truth.xy[since:, 0] - place.x, truth.xy[since:, 1] - place.y)
        on = truth.floor[since:] == int(place.floor)
        near = np.flatnonzero((gap < 0.5) & on)
        assert len(near), place
        since += int(near[0])
    assert Activity.LIFT in truth.activity
    assert Activity.STAIRS not in truth.activity
    storeys = world.building.storeys
    for k in range(3):
        level = (truth.floor == k) & (truth.passage < 0)
        assert storeys[k].is_walkable(truth.xy[level]).all()


@pytest.mark.parametrize(
    ("places", "said"),
    [
        ((Place(30.0, 9.75, "0"), Place(90.0, 9.0, "0")), r"\(90, 9\) on floor 0 is nowhere"),
        ((Place(30.0, 9.75, "0"), Place(3.0, 3.0, "0")), "nowhere to walk"),
        ((Place(30.0, 9.75, "0"), Place(30.0, 9.75, "7")), "no floor '7'"),
    ],
)
def test_places_that_cannot_be_walked_to_are_refused(places, said):
    with pytest.raises(ConfigError, match=said):
        world_of(house(waypoints=places))


def test_access_points_outside_are_refused():
    from wayfuse.simulator.radio_field import AccessPoint

    lost = replace(SMALL, radio=RadioModel(access_points=(AccessPoint(99.0, 3.0, "0"),)))
    with pytest.raises(ConfigError, match=r"\(99, 3\) is outside"):
        world_of(lost)


def test_formats_that_cannot_say_it_are_refused():
    world, plans = world_of(house(changes=2))
    for kind, said in (("ms-indoor", "one floor per recording"), ("getsensordata", "")):
        asked = replace(world, scenario=replace(world.scenario, output=OutputPart(formats=(kind,))))
        if said:
            with pytest.raises(ConfigError, match=said):
                check_formats(asked, plans)
        else:
            check_formats(asked, plans)
            with pytest.raises(ConfigError, match="no anchor"):
                check_formats(replace(asked, georeferenced=False), plans)
    mall = ScenarioFile(
        site=SitePart(building="mall"), survey=FEW, output=OutputPart(formats=("getsensordata",))
    )
    with pytest.raises(ConfigError, match="whole numbers as floors, not F1, F2"):
        check_formats(*world_of(mall))


@pytest.fixture(scope="module")
def house_site() -> Site:
    return site_of(three_storeys(np.random.default_rng(0), with_escalator=True))


def test_a_site_becomes_a_building_with_all_its_connectors_on_one_net_per_floor(house_site):
    building, shift = building_of(house_site)
    np.testing.assert_allclose(shift, 0.0, atol=1e-6)
    assert [p.connector.kind for p in building.passages] == [c.kind for c in house_site.connectors]
    assert [s.elevation for s in building.storeys] == [f.elevation for f in house_site.floors]
    for storey, floor in zip(building.storeys, house_site.floors, strict=True):
        assert floor.walkable.contains(*storey.nodes.T).mean() > 0.95
        reached = {0}
        while more := {int(n) for e in storey.edges for n in e if reached & set(e.tolist())} - reached:
            reached |= more
        assert len(reached) == len(storey.nodes)
        closed = [room.polygon for room in storey.rooms]
        assert len(closed) > 10
        assert not floor.walkable.contains(*np.array([p.mean(axis=0) for p in closed]).T).any()


def test_floors_with_their_own_frames_are_walked_in_one(tmp_path, house_site):
    def displaced(floor, by: Array):
        anchor = floor.anchor
        lon, lat = anchor.to_lonlat(-by)
        return replace(floor, anchor=replace(anchor, origin=(float(lon), float(lat)))), by

    by = np.array([3.0, -2.0])
    moved, _ = displaced(house_site.floors[1], by)
    site = replace(house_site, floors=(house_site.floors[0], moved, house_site.floors[2]))
    _, shift = building_of(site)
    np.testing.assert_allclose(shift, [(0.0, 0.0), by, (0.0, 0.0)], atol=1e-3)
    building, shift = building_of(replace(site, connectors=()))
    inside = building.storeys[1].nodes + shift[1]
    assert house_site.floors[1].walkable.contains(*inside.T).mean() > 0.95


def test_walks_over_a_saved_site_stay_on_its_walkable_space(tmp_path, house_site):
    house_site.save(tmp_path / "SITE")
    scenario = replace(house(changes=2), site=SitePart(folder="SITE"), survey=SurveyPart(walks=3))
    site, world = make_world(scenario, 3, tmp_path)
    for plan in plan_walks(world):
        truth = simulate_plan(world, plan).truth
        outside = 0
        for k, floor in enumerate(site.floors):
            level = (truth.floor == k) & (truth.passage < 0)
            outside += int(np.sum(~floor.walkable.contains(*truth.xy[level].T)))
        assert outside < 0.03 * len(truth.t), plan.name
    floors = {
        int(f) for p in plan_walks(world) if p.role == "walk" for f in simulate_plan(world, p).truth.floor
    }
    assert len(floors) > 1


def test_a_hall_needs_room_for_its_racks():
    with pytest.raises(ConfigError, match="racks"):
        hall(30.0, 20.0, 4)
    with pytest.raises(ConfigError, match="size"):
        hall(30.0, 5.0, 0)
    building = hall(30.0, 26.0, 2)
    storey = building.storeys[0]
    assert len(storey.rooms) == 2
    assert storey.is_walkable(storey.nodes).all()
    assert all(storey.is_clear(*storey.nodes[e], 0.9) for e in storey.edges)


def test_a_survey_of_an_open_hall_spreads_over_it():
    open_hall = replace(SMALL, site=replace(HALL, racks=0, size=(40.0, 30.0)), survey=replace(FEW, walks=10))
    world, plans = world_of(open_hall)
    places = np.concatenate(
        [[leg.stretch[:2] for leg in p.journey.legs] for p in plans if p.role == "survey"]
    )
    nodes = world.building.storeys[0].nodes
    gap = np.hypot(*(nodes[:, None] - places[None]).transpose(2, 0, 1)).min(axis=1)
    assert np.mean(gap < 5.0) > 0.8


def test_a_survey_is_throttled_only_where_it_is_said():
    scan = ScannerModel(period_s=1.0, throttle_scans=2, before_s=0.0, stale_repeats=True, memory_s=60.0)
    for throttled in (False, True):
        scenario = replace(SMALL, scan=scan, survey=replace(FEW, throttled=throttled))
        world, plans = world_of(scenario)
        for plan in plans:
            wifi = simulate_plan(world, plan).recording.wifi
            fresh = {float(s.last_seen.max()) for s in wifi}
            assert (len(fresh) <= 2) == (throttled or plan.role == "walk")


def test_floors_and_phones_of_any_name_give_files_and_tables_that_read_back(tmp_path):
    name = 'ground, "left"/hall'
    building = hall(30.0, 20.0, 1)
    odd = replace(building, storeys=(replace(building.storeys[0], name=name),))
    site_of(odd).save(tmp_path / "SITE")
    scenario = replace(
        SMALL,
        site=SitePart(folder="SITE"),
        phone=PhonePart(models=(PhoneModel(name="a, b"),)),
        csi=ChannelModel(),
    )
    _, world = make_world(scenario, 1, tmp_path)
    for part in ("survey", "walks", "truth"):
        (tmp_path / part).mkdir()
    done = [write_walk(world, plan, tmp_path) for plan in plan_walks(world)]
    write_tables(tmp_path, done)
    write_access_points(tmp_path / "aps.csv", world, world.before)
    for file, column, value in (
        ("truth.csv", "floor", name),
        ("walks.csv", "phone", "a, b"),
        ("aps.csv", "floor", name),
    ):
        rows = list(csv.DictReader((tmp_path / file).read_text(encoding="utf-8").splitlines()))
        assert {row[column] for row in rows} == {value}
    assert {t.walk for t in read_estimates(tmp_path / "truth.csv").tracks} == {one.name for one in done}


@pytest.mark.real_data
@pytest.mark.slow
def test_a_real_site_can_be_walked_in(ms_indoor):
    from wayfuse.maps.importers.ms_indoor import import_site

    site, _ = import_site(ms_indoor)
    building, shift = building_of(site)
    assert [s.name for s in building.storeys] == list(site.floor_names)
    rng = np.random.default_rng(0)
    for k, (storey, floor) in enumerate(zip(building.storeys, site.floors, strict=True)):
        assert len(storey.nodes) > 50
        assert len(storey.rooms) > 20
        way = errands(building, k, 80.0, rng, manner=Manner(0.0, 0.0))
        xy = np.array([way.start[:2], *[leg.stretch[:2] for leg in way.legs]]) + shift[k]
        assert floor.walkable.contains(*xy.T).all()
