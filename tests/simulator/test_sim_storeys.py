"""The three-storey building, the passages between its floors, and walks over them."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from wayfuse.inertial.vertical import Behaviour
from wayfuse.maps.connectors import ConnectorKind
from wayfuse.simulator.geometry import crossings, inside
from wayfuse.simulator.house_site import site_of
from wayfuse.simulator.journeys import Trip, draw_trips, plan_journey
from wayfuse.simulator.passages import RISER, Activity
from wayfuse.simulator.rides import LiftModel, ride
from wayfuse.simulator.simulate_journey import make_house, simulate_journey
from wayfuse.simulator.storeys import three_storeys

HEIGHT = 4.42  # m


@pytest.fixture(scope="module")
def house():
    return three_storeys(np.random.default_rng(0))


@pytest.mark.parametrize("seed", range(4))
def test_corridors_keep_off_the_walls_and_reach_every_landing(seed):
    building = three_storeys(np.random.default_rng(seed), with_escalator=seed == 3)
    for number, storey in enumerate(building.storeys):
        assert storey.is_walkable(storey.nodes).all()
        for a, b in storey.edges:
            assert storey.is_clear(storey.nodes[a], storey.nodes[b], 0.7), (storey.name, storey.nodes[[a, b]])
        reached = {0}
        for _ in storey.nodes:
            reached |= {int(b) for e in storey.edges for a, b in (e, e[::-1]) if int(a) in reached}
        assert len(reached) == len(storey.nodes)
        for passage in building.passages:
            landing = passage.connector.landing(number)
            if landing is not None:
                assert np.hypot(*(storey.nodes - (landing.x, landing.y)).T).min() < 1e-9


def test_stairs_join_every_pair_of_floors_and_the_lift_serves_all(house):
    pairs, lifts = set(), []
    for passage in house.passages:
        connector = passage.connector
        if connector.kind is ConnectorKind.STAIRS:
            pairs |= set(pairwise(connector.floors))
            assert connector.n_steps == (26,) * (len(connector.floors) - 1)
        else:
            lifts.append(connector.floors)
    assert pairs == {(0, 1), (1, 2)}
    assert lifts == [(0, 1, 2)]


def test_a_way_climbs_its_storeys_by_stairs_of_one_height_and_comes_back_the_same_way(house):
    for passage in house.passages:
        for a, b in pairwise(passage.connector.floors):
            up, down = passage.way(a, b), passage.way(b, a)
            assert sum(piece.rise for piece in up) == pytest.approx(HEIGHT)
            assert sum(piece.rise for piece in down) == pytest.approx(-HEIGHT)
            first, last = passage.connector.landing(a), passage.connector.landing(b)
            assert (up[-1].x, up[-1].y) == last[1:]
            assert (down[-1].x, down[-1].y) == first[1:]
            flights = [piece for piece in up if piece.activity is Activity.STAIRS]
            assert len(flights) == (0 if passage.is_lift else 2)
            assert all(piece.rise / piece.n_steps == pytest.approx(RISER) for piece in flights)


def test_ways_cross_no_wall_of_either_floor(house):
    for passage in house.passages:
        for a, b in pairwise(passage.connector.floors):
            start = passage.connector.landing(a)
            places = np.array([start[1:], *[(p.x, p.y) for p in passage.way(a, b)]])
            middle = len(places) // 2
            for floor, way in ((a, places[: middle + 1]), (b, places[middle:])):
                moved = np.hypot(*np.diff(way, axis=0).T) > 0.0
                hit = crossings(way[:-1][moved], way[1:][moved], passage.walls(floor))
                assert not hit.any(), (passage.connector.id, floor)


def test_activities_are_those_the_detectors_report():
    assert {a.name: a.value for a in Activity} == {b.name: b.value for b in Behaviour}


@pytest.mark.parametrize("rise", [4.42, -4.42, 8.84, 0.5, -30.0])
@pytest.mark.parametrize("acceleration", [0.5, 0.9])
def test_a_ride_keeps_its_limits_and_stops_where_it_should(rise, acceleration):
    model = LiftModel()
    z = ride(rise, acceleration, model, 0.01)
    speed = np.diff(z) / 0.01
    push = np.diff(speed) / 0.01
    jerk = np.diff(push) / 0.01
    assert z[0] == 0.0
    assert z[-1] == pytest.approx(rise)
    assert np.abs(speed).max() <= 1.02 * model.speed
    assert np.abs(push).max() <= 1.02 * acceleration
    assert np.percentile(np.abs(jerk), 95) <= 1.1 * model.jerk
    assert abs(speed[0]) < 1e-3
    assert abs(speed[-1]) < 2e-2
    assert (np.sign(rise) * speed > -1e-6).all()


def test_trips_take_lift_and_stairs_in_turn(house):
    for seed in range(20):
        floor, trips = draw_trips(house, 4, np.random.default_rng(seed), lift_first=seed % 2 == 0)
        assert [house.passages[t.passage].is_lift for t in trips] == [seed % 2 == k % 2 for k in range(4)]
        for trip in trips:
            passage = house.passages[trip.passage]
            assert {floor, trip.floor} <= set(passage.connector.floors)
            assert trip.floor != floor
            assert passage.is_lift or abs(trip.floor - floor) == 1
            floor = trip.floor


def test_a_journey_without_trips_stays_on_its_floor(house):
    journey = plan_journey(house, 1, [], np.random.default_rng(0), lifts=LiftModel())
    assert journey.start[2] == 1
    assert {leg.stretch.activity for leg in journey.legs} == {Activity.WALKING}
    assert sum(abs(leg.stretch.rise) for leg in journey.legs) == 0.0


def test_floors_change_only_inside_connectors(house, journeys):
    changes = 0
    for _, truth in journeys:
        at = np.flatnonzero(np.diff(truth.floor)) + 1
        changes += len(at)
        assert (truth.passage[at] >= 0).all()
        for i in at:
            passage = house.passages[truth.passage[i]]
            margin = 1.0  # m: the footprint and the step before its door
            ring = passage.footprint
            low, high = ring.min(axis=0) - margin, ring.max(axis=0) + margin
            assert np.all((truth.xy[i] >= low) & (truth.xy[i] <= high))
            assert {truth.floor[i - 1], truth.floor[i]} <= set(passage.connector.floors)
        outside = truth.passage < 0
        level = np.array([s.elevation for s in house.storeys])[truth.floor]
        np.testing.assert_allclose(
            truth.z[outside], level[outside], atol=0.1
        )  # the height is rounded by 0.3 s
    assert changes >= 8


def test_heights_are_continuous_and_end_where_the_trips_lead(house, journeys):
    for _, truth in journeys:
        assert np.abs(np.diff(truth.z)).max() <= 0.0125  # m per 0.01 s: the lift's speed, with some room
        assert truth.z[-1] == pytest.approx(house.storeys[truth.floor[-1]].elevation, abs=1e-6)


def test_every_stair_is_one_step(house, journeys):
    for _, truth in journeys:
        stairs = truth.activity == Activity.STAIRS
        flights = np.flatnonzero(np.diff(stairs.astype(int)) > 0) + 1
        for start in flights:
            stop = start + int(np.argmin(stairs[start:]))
            t0, t1 = truth.t[start] + 1e-3, truth.t[stop] + 1e-3
            assert np.count_nonzero((truth.contacts > t0) & (truth.contacts <= t1)) == 13
            assert abs(
                truth.at(np.array([t1 + 0.5]))[0, 2] - truth.at(np.array([t0 - 0.5]))[0, 2]
            ) == pytest.approx(13 * RISER, abs=0.02)


def test_nobody_steps_while_the_lift_moves(journeys):
    rides = 0
    for _, truth in journeys:
        riding = truth.activity == Activity.LIFT
        rides += np.count_nonzero(np.diff(riding.astype(int)) > 0)
        row = np.clip(np.searchsorted(truth.t, truth.contacts), 0, len(truth.t) - 1)
        away = np.interp(truth.contacts, truth.t, riding.astype(float))
        assert not np.any((away == 1.0) & riding[row])
    assert rides >= 4


def test_walkers_stay_off_rooms_and_voids(house, journeys):
    for _, truth in journeys:
        for number, storey in enumerate(house.storeys):
            here = (truth.floor == number) & (truth.passage < 0)
            assert storey.is_walkable(truth.xy[here]).all()
            for void in storey.voids:
                assert not inside(void.polygon, truth.xy[here]).any()


def test_a_trip_that_skips_a_landing_of_stairs_is_refused(house):
    with pytest.raises(ValueError, match="not next to each other"):
        plan_journey(house, 0, [Trip(0, 2)], np.random.default_rng(0), lifts=LiftModel())


def test_an_escalator_carries_a_standing_rider_up_and_only_up(sim_scenario):
    site = make_house(sim_scenario, np.random.default_rng(0), with_escalator=True)
    (index,) = [
        k for k, p in enumerate(site.building.passages) if p.connector.kind is ConnectorKind.ESCALATOR
    ]
    recording, truth = simulate_journey(
        site, sim_scenario, np.random.default_rng(1), "up", trips=(0, [Trip(index, 1)])
    )
    riding = truth.t[truth.activity == Activity.ESCALATOR]
    duration = np.hypot(8.4, HEIGHT) / sim_scenario.lift.escalator_speed
    assert riding[-1] - riding[0] == pytest.approx(duration, abs=0.05)
    assert not np.any((truth.contacts > riding[0] + 0.02) & (truth.contacts < riding[-1]))
    z = truth.at(riding[[0, -1]] + (-0.5, 0.5))[:, 2]
    assert z[1] - z[0] == pytest.approx(HEIGHT, abs=0.01)
    assert {w.floor for w in recording.waypoints} == {"0", "1"}
    with pytest.raises(ValueError, match="does not go"):
        plan_journey(site.building, 1, [Trip(index, 0)], np.random.default_rng(0), lifts=LiftModel())
    for seed in range(30):
        floor, trips = draw_trips(site.building, 3, np.random.default_rng(seed))
        for trip in trips:
            assert (trip.passage, floor) != (index, 1)
            floor = trip.floor
    connector = next(c for c in site_of(site.building).connectors if c.id == "escalator")
    assert (connector.direction, connector.floors) == (1, (0, 1))
