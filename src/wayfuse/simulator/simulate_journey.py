"""From a scenario to journeys over floors in memory, as a phone with the GetSensorData app records them.

As in `wayfuse.simulator.simulate` the recording holds no more than its file, and `JourneyTruth` what no phone
knows. The app's clock starts with the recording; places are stated in degrees and whole floor numbers.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from wayfuse.core.angles import wrap
from wayfuse.core.frames import GeoAnchor
from wayfuse.core.types import Array, IntArray
from wayfuse.sensors.recording import Device, Recording
from wayfuse.sensors.records import Waypoint, WifiScan
from wayfuse.simulator.barometer import measure_pressure
from wayfuse.simulator.imu import measure
from wayfuse.simulator.journeys import Journey, Trip, draw_trips, plan_journey, stay
from wayfuse.simulator.passages import Activity
from wayfuse.simulator.phone_columns import sensed
from wayfuse.simulator.radio_field import RadioField
from wayfuse.simulator.scanner import Sweep, scan
from wayfuse.simulator.scenario import Scenario
from wayfuse.simulator.simulate import SimulatedSite, site_in
from wayfuse.simulator.storeys import three_storeys
from wayfuse.simulator.travel import travel
from wayfuse.simulator.walker import Person, Walk, draw_person

__all__ = [
    "DECIMALS",
    "JourneyTruth",
    "Phone",
    "go",
    "make_house",
    "record",
    "simulate_journey",
    "simulate_stay",
]

DECIMALS = {
    "acceleration": 5,
    "rotation_rate": 5,
    "magnetic_field": 5,
    "orientation": 8,
    "pressure": 4,
    "time": 4,
    "degrees": 12,
}  # of the written files, as of the public ones


@dataclass(frozen=True, slots=True)
class Phone:
    """A phone: its model's name and its barometer's own offset (hPa)."""

    model: str = "simulated"
    pressure_hpa: float = 0.0


@dataclass(frozen=True, slots=True, eq=False)
class JourneyTruth:
    """What happened on a journey, on the recording's clock (s).

    t (n,), xy (n, 2) m, z (n,) m above the lowest floor (of the feet), heading (n,) rad in (-pi, pi], at 100 Hz.
    floor (n,) ordinal of the storey nearest in height; activity (n,) `Activity`; passage (n,) index into the
    building's passages, -1 outside. walking (n,) 0 standing to 1 walking. contacts (k,) s and step_length (k,)
    m (level) of every step.
    """

    name: str
    t: Array
    xy: Array
    z: Array
    floor: IntArray
    heading: Array
    walking: Array
    activity: IntArray
    passage: IntArray
    contacts: Array
    step_length: Array

    def at(self, t: Array) -> Array:
        """Place and height (m, 3) m at times (m,) s, held at both ends."""
        columns = (self.xy[:, 0], self.xy[:, 1], self.z)
        return np.column_stack([np.interp(t, self.t, column) for column in columns])


def make_house(
    scenario: Scenario, rng: np.random.Generator, *, with_escalator: bool = False
) -> SimulatedSite:
    """Draw the three-storey building of the demo, with an escalator where asked for."""
    return site_in(three_storeys(rng, with_escalator=with_escalator), scenario, rng)


def simulate_journey(
    site: SimulatedSite,
    scenario: Scenario,
    rng: np.random.Generator,
    name: str,
    *,
    trips: tuple[int, list[Trip]] | None = None,
    lift_first: bool = False,
    phone: Phone | None = None,
) -> tuple[Recording, JourneyTruth]:
    """Simulate one journey over floors.

    Parameters
    ----------
    trips : start floor and changes of floors; ``scenario.changes`` are drawn where not given, by lift and stairs
        in turn. lift_first : which of the two comes first.

    Returns
    -------
    the recording of the phone, equal to its file read back, and the truth.
    """
    start, changes = (
        draw_trips(site.building, scenario.changes, rng, lift_first=lift_first) if trips is None else trips
    )
    journey = plan_journey(
        site.building,
        start,
        changes,
        rng,
        lifts=scenario.lift,
        visit=scenario.visit_m,
        manner=scenario.manner,
    )
    person = draw_person(scenario.walker, rng)
    w = go(site, scenario, rng, journey, person)
    return record(site, scenario, rng, name, w, person, phone or Phone())


def simulate_stay(
    site: SimulatedSite,
    scenario: Scenario,
    rng: np.random.Generator,
    name: str,
    *,
    floor: int,
    visits: IntArray | None = None,
    phone: Phone | None = None,
) -> tuple[Recording, JourneyTruth]:
    """Simulate one walk on a floor: a surveyor's, with ``visits`` (e,) how often each corridor was walked, updated."""
    person = draw_person(scenario.walker, rng)
    journey = stay(
        site.building,
        floor,
        scenario.way_length(person, rng),
        rng,
        manner=scenario.manner,
        visits=visits,
    )
    w = go(site, scenario, rng, journey, person)
    return record(site, scenario, rng, name, w, person, phone or Phone())


def go(
    site: SimulatedSite, scenario: Scenario, rng: np.random.Generator, journey: Journey, person: Person
) -> Walk:
    """A person on a journey: what happens, before any sensor."""
    elevations = np.array([storey.elevation for storey in site.building.storeys])
    return travel(journey.start, journey.legs, elevations, person, scenario.walker, scenario.lift, rng)


def record(
    site: SimulatedSite,
    scenario: Scenario,
    rng: np.random.Generator,
    name: str,
    w: Walk,
    person: Person,
    phone: Phone,
) -> tuple[Recording, JourneyTruth]:
    """What a phone records of a walk that `go` made, and the truth."""
    if w.climb is None:
        raise AssertionError("a journey has heights")
    imu = measure(w, 0, person, site.magnetic, scenario.imu, scenario.walker, rng)
    air = measure_pressure(w, scenario.barometer, phone.pressure_hpa, rng)
    sweeps = scan(w, 0, site.radios, scenario.scanner, rng, _cabin_loss(site, w, scenario))
    base = sensed(name, imu, np.round(imu.t, DECIMALS["time"]), DECIMALS, air)
    stated = w.stated + np.array([0.0, 1.0, 1.0]) * rng.normal(0.0, scenario.stated_sigma, w.stated.shape)
    recording = replace(
        base,
        wifi=_scans(sweeps, site.radios),
        waypoints=_stated(stated, w.climb.stated_floor, site),
        clock="AppTimestamp",
        device=Device("wayfuse", phone.model, "Android 10"),
    )
    return recording, _truth(name, w)


def _truth(name: str, w: Walk) -> JourneyTruth:
    climb = w.climb
    if climb is None:
        raise AssertionError("a journey has heights")
    return JourneyTruth(
        name=name,
        t=w.t,
        xy=w.xy,
        z=climb.z,
        floor=climb.floor,
        heading=wrap(w.heading),
        walking=w.gait,
        activity=climb.activity,
        passage=climb.passage,
        contacts=w.contact,
        step_length=w.step_length,
    )


def _cabin_loss(site: SimulatedSite, w: Walk, scenario: Scenario) -> Array:
    """Loss (n, 2) dB of the lift's cabin: from standing in it to walking out."""
    climb = w.climb
    if climb is None:
        raise AssertionError("a journey has heights")
    lifts = [k for k, passage in enumerate(site.building.passages) if passage.is_lift]
    inside = np.isin(climb.passage, lifts) & (climb.activity != Activity.WALKING)
    return np.asarray(inside[:, None] * np.array(scenario.lift.loss_db))


def _scans(sweeps: tuple[Sweep, ...], radios: RadioField) -> tuple[WifiScan, ...]:
    """Scans with the times last heard as a reader can know them.

    The file has them on the radio's own clock; a reader takes the freshest reading of the promptest scan for as old
    as the scan.
    """
    times = [round(sweep.t, DECIMALS["time"]) for sweep in sweeps]
    seen = [np.round(sweep.last_seen, DECIMALS["time"]) for sweep in sweeps]
    prompt = min((t - float(s.max()) for t, s in zip(times, seen, strict=True)), default=0.0)
    return tuple(
        WifiScan(
            t=t,
            bssid=radios.bssid[sweep.network],
            rssi=sweep.rssi.astype(np.float32),
            frequency=radios.frequency[radios.radio[sweep.network]],
            last_seen=np.minimum(s + prompt, t),
        )
        for t, s, sweep in zip(times, seen, sweeps, strict=True)
    )


def _stated(rows: Array, floors: IntArray, site: SimulatedSite) -> tuple[Waypoint, ...]:
    anchor: GeoAnchor = site.building.anchor
    names = [storey.name for storey in site.building.storeys]
    degrees = np.round(anchor.to_lonlat(rows[:, 1:]), DECIMALS["degrees"]).tolist()
    times = np.round(rows[:, 0], DECIMALS["time"]).tolist()
    nan = float("nan")
    return tuple(
        Waypoint(t, nan, nan, names[floor], lat, lon)
        for t, floor, (lon, lat) in zip(times, floors.tolist(), degrees, strict=True)
    )
