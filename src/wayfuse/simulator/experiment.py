"""From a scenario file to walks in memory: the world is drawn and every walk planned first, then each walk by itself.

Every random number of a walk comes from (seed, role, number of the walk, part): more walks, another order or more
processes change no walk. Survey walks are planned one after the other, for each seeks the corridors least walked so
far.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from wayfuse.core.errors import ConfigError
from wayfuse.core.types import Array
from wayfuse.maps.site import Site
from wayfuse.maps.store import file_stems
from wayfuse.sensors.recording import Recording
from wayfuse.sensors.records import Waypoint
from wayfuse.simulator.building import Building, shopping_centre
from wayfuse.simulator.channel_state import measure_channels
from wayfuse.simulator.errands import errands
from wayfuse.simulator.given_way import given_journey
from wayfuse.simulator.hall import hall
from wayfuse.simulator.house_site import site_of
from wayfuse.simulator.journeys import Journey, Trip, draw_trips, plan_journey, stay
from wayfuse.simulator.radio_field import changed
from wayfuse.simulator.ray_tracer import Work
from wayfuse.simulator.round_trip import measure_ranges
from wayfuse.simulator.routes import Manner
from wayfuse.simulator.scenario import Scenario
from wayfuse.simulator.scenario_file import ScenarioFile
from wayfuse.simulator.simulate import SimulatedSite, site_in
from wayfuse.simulator.simulate_journey import JourneyTruth, Phone, go, record
from wayfuse.simulator.site_building import building_of
from wayfuse.simulator.storeys import three_storeys
from wayfuse.simulator.traced_site import traced
from wayfuse.simulator.walker import Person, Walk, draw_person

__all__ = ["Plan", "SimulatedWalk", "World", "make_world", "plan_walks", "simulate_plan"]

_CLOCK = "seconds since the start"
_WORLD, _CHANGES, _SURVEY, _WAYS, _WALKS = range(5)  # what random numbers are for
_PLAN, _BODY, _RANGES, _CSI = range(4)  # of a walk


@dataclass(frozen=True, slots=True, eq=False)
class World:
    """What all walks share. before, later : with the access points of the survey and of the walks to track.

    shift : (f, 2) m, takes a place of the building into each floor's own frame. georeferenced : the anchor is the
    site's.
    """

    scenario: ScenarioFile
    seed: int
    before: SimulatedSite
    later: SimulatedSite
    shift: Array
    georeferenced: bool

    @property
    def building(self) -> Building:
        """The building walked in."""
        return self.before.building


@dataclass(frozen=True, slots=True, eq=False)
class Plan:
    """A walk to come. role : ``survey`` or ``walk``. key : of its random numbers. phone : index into the models."""

    name: str
    role: str
    key: tuple[int, ...]
    phone: int
    person: Person
    journey: Journey


@dataclass(frozen=True, slots=True, eq=False)
class SimulatedWalk:
    """What the phone recorded, and what it does not know: ``truth``, and the exact ``places`` stated or passed."""

    plan: Plan
    recording: Recording
    truth: JourneyTruth
    places: tuple[Waypoint, ...]


def make_world(
    scenario: ScenarioFile,
    seed: int,
    folder: Path,
    work: Work = Work(),
) -> tuple[Site, World]:
    """Draw the world.

    Parameters
    ----------
    folder : that of the scenario's file, from which a site folder counts.
    work : processes and progress where rays are traced; without influence.

    Raises
    ------
    MapError, ConfigError : the site cannot be read or walked in; more access points change than there are.
    """
    rng = np.random.default_rng((seed, _WORLD))
    if scenario.site.folder:
        site = Site.load(folder / scenario.site.folder)
        building, shift = building_of(site)
        georeferenced = site.anchor is not None
    else:
        building = _built_in(scenario, rng)
        site, shift, georeferenced = site_of(building), np.zeros((len(building.storeys), 2)), True
    _check_places(scenario, building)
    before = site_in(building, _numbers(scenario, "survey", 0), rng)
    change, n_aps = scenario.changes, len(before.radios.ap_xy)
    if change.moved + change.removed > n_aps:
        raise ConfigError(
            f"changes.moved + changes.removed = {change.moved + change.removed}",
            remedy=f"at most the {n_aps} access points there are",
        )
    after_rng = np.random.default_rng((seed, _CHANGES))
    later = replace(before, radios=changed(before.radios, building, change.moved, change.removed, after_rng))
    if scenario.radio.model == "rays":
        before, later = traced(before, later, scenario.csi, seed, work)
    return site, World(scenario, seed, before, later, shift, georeferenced)


def plan_walks(world: World) -> tuple[Plan, ...]:
    """All walks of a world: the survey's, then those to track."""
    return (*_survey_plans(world), *_walk_plans(world))


def simulate_plan(world: World, plan: Plan) -> SimulatedWalk:
    """One walk; the same plan gives the same bits."""
    is_survey = plan.role == "survey"
    site = world.before if is_survey else world.later
    numbers = _numbers(world.scenario, plan.role, plan.phone)
    model = world.scenario.phone.models[plan.phone]
    body, ranging, packets = (np.random.default_rng((*plan.key, k)) for k in (_BODY, _RANGES, _CSI))
    w = go(site, numbers, body, plan.journey, plan.person)
    phone = Phone(model.name, model.pressure_hpa)
    recording, truth = record(site, numbers, body, plan.name, w, plan.person, phone)
    stated = [(p.t, *_site_place(world, p.lon, p.lat), p.floor) for p in recording.waypoints]
    recording = replace(
        recording,
        ranges=measure_ranges(w, site.radios, world.scenario.ranges, ranging),
        csi=measure_channels(w, site.radios, world.scenario.csi, packets),
        waypoints=_waypoints(world, stated) if is_survey else (),
        site=world.building.name,
        clock=_CLOCK,
    )
    return SimulatedWalk(plan, recording, truth, _waypoints(world, _exact(world, w)))


def _built_in(scenario: ScenarioFile, rng: np.random.Generator) -> Building:
    part = scenario.site
    if part.building == "house":
        return three_storeys(rng, with_escalator=part.escalator)
    return shopping_centre(rng) if part.building == "mall" else hall(*part.size, part.racks)


def _check_places(scenario: ScenarioFile, building: Building) -> None:
    for ap in scenario.radio.access_points:
        if not (0.0 <= ap.x <= building.width and 0.0 <= ap.y <= building.height):
            raise ConfigError(
                f"({ap.x:g}, {ap.y:g}) is outside the site",
                where="radio.access_points",
                remedy=f"0 to {building.width:g} and 0 to {building.height:g} m",
            )
        building.floor_index(ap.floor)


def _numbers(scenario: ScenarioFile, role: str, phone: int) -> Scenario:
    """The models' numbers of a walk, with its phone's own."""
    walkers, survey = scenario.walkers, scenario.survey
    scanner = scenario.scan
    if role == "survey" and not survey.throttled:
        scanner = replace(scanner, throttle_scans=0, stale_repeats=False)
    low, high = np.add(scanner.device_offset_db, scenario.phone.models[phone].rss_offset_db).tolist()
    return Scenario(
        duration_s=survey.duration_s if role == "survey" else walkers.duration_s,
        manner=Manner(walkers.wander_m, walkers.pause_share, walkers.pause_s),
        stated_sigma=survey.stated_sigma,
        changes=walkers.changes,
        visit_m=walkers.visit_m,
        walker=walkers.gait,
        imu=scenario.phone.imu,
        radio=scenario.radio,
        scanner=replace(scanner, device_offset_db=(low, high)),
        barometer=scenario.phone.barometer,
        lift=walkers.lift,
    )


def _survey_plans(world: World) -> list[Plan]:
    """Walks on the floors in turn, then one through every passage."""
    scenario, storeys = world.scenario, world.building.storeys
    names = [model.name for model in scenario.phone.models]
    phone = names.index(scenario.survey.phone) if scenario.survey.phone else 0
    numbers = _numbers(scenario, "survey", phone)
    visits = [np.zeros(len(storey.edges), dtype=np.int64) for storey in storeys]
    stems = file_stems(tuple(storey.name for storey in storeys))
    plans = []
    for i in range(scenario.survey.walks):
        key, k = (world.seed, _SURVEY, i), i % len(storeys)
        rng = np.random.default_rng((*key, _PLAN))
        person = draw_person(numbers.walker, rng)
        journey = _stay(world, numbers, k, person, rng, visits[k])
        plans.append(Plan(f"survey-{stems[k]}-{i:03d}", "survey", key, phone, person, journey))
    for i in range(len(world.building.passages) if scenario.survey.connectors else 0):
        key = (world.seed, _WAYS, i)
        rng = np.random.default_rng((*key, _PLAN))
        floors = world.building.passages[i].connector.floors
        person = draw_person(numbers.walker, rng)
        journey = _journey(world, numbers, (floors[0], [Trip(i, floor) for floor in floors[1:]]), rng)
        plans.append(Plan(f"survey-connector-{i:03d}", "survey", key, phone, person, journey))
    return plans


def _walk_plans(world: World) -> list[Plan]:
    """Walks to track: through given places, over floors, or on one."""
    part, building = world.scenario.walkers, world.building
    names = [model.name for model in world.scenario.phone.models]
    carried = [names.index(name) for name in part.phones] or list(range(len(names)))
    plans = []
    for i in range(part.number):
        key, phone = (world.seed, _WALKS, i), carried[i % len(carried)]
        rng = np.random.default_rng((*key, _PLAN))
        numbers = _numbers(world.scenario, "walk", phone)
        person = draw_person(numbers.walker, rng)
        changes = part.changes if building.passages else 0
        start, trips = draw_trips(building, changes, rng, lift_first=i % 2 == 1, connectors=part.connectors)
        if part.waypoints:
            journey = given_journey(
                building, part.waypoints, rng, lifts=part.lift, connectors=part.connectors
            )
        elif trips:
            journey = _journey(world, numbers, (start, trips), rng)
        else:
            journey = _stay(world, numbers, start, person, rng, None)
        plans.append(Plan(f"walk-{i:03d}", "walk", key, phone, person, journey))
    return plans


def _stay(
    world: World,
    numbers: Scenario,
    floor: int,
    person: Person,
    rng: np.random.Generator,
    visits: np.ndarray | None,
) -> Journey:
    is_net = bool(world.scenario.site.folder) or not world.building.storeys[floor].rooms
    return (errands if is_net else stay)(
        world.building,
        floor,
        numbers.way_length(person, rng),
        rng,
        manner=numbers.manner,
        visits=visits,
    )


def _journey(
    world: World, numbers: Scenario, trips: tuple[int, list[Trip]], rng: np.random.Generator
) -> Journey:
    return plan_journey(
        world.building,
        *trips,
        rng,
        lifts=numbers.lift,
        visit=numbers.visit_m,
        manner=numbers.manner,
    )


def _site_place(world: World, lon: float, lat: float) -> tuple[float, float]:
    x, y = world.building.anchor.to_xy((lon, lat)).tolist()
    return x, y


def _exact(world: World, w: Walk) -> list[tuple[float, float, float, str]]:
    """Time, place and floor of what a surveyor would state, without his errors."""
    floors = np.zeros(len(w.stated), dtype=np.int64) if w.climb is None else w.climb.stated_floor
    names = [storey.name for storey in world.building.storeys]
    return [(t, x, y, names[f]) for (t, x, y), f in zip(w.stated.tolist(), floors.tolist(), strict=True)]


def _waypoints(world: World, rows: list[tuple[float, float, float, str]]) -> tuple[Waypoint, ...]:
    """Way points in the frames of their floors, and in degrees where the site is georeferenced."""
    out = []
    for t, x, y, floor in rows:
        lon, lat = world.building.anchor.to_lonlat((x, y)).tolist() if world.georeferenced else (np.nan,) * 2
        dx, dy = world.shift[world.building.floor_index(floor)].tolist()
        out.append(
            Waypoint(round(t, 4), round(x + dx, 4), round(y + dy, 4), floor, round(lat, 12), round(lon, 12))
        )
    return tuple(out)
