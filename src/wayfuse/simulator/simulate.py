"""From a scenario to walks in memory: the site once, then any number of walks, each from its own generator.

The recording holds what a phone would write, no more precisely than the file format does, so that a walk in
memory and the same walk read back from its file are equal; `Truth` holds what no phone knows.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from wayfuse.core.angles import wrap
from wayfuse.core.types import Array, IntArray
from wayfuse.sensors.recording import Device, Recording
from wayfuse.sensors.records import Waypoint, WifiScan
from wayfuse.simulator.building import Building, shopping_centre
from wayfuse.simulator.imu import MagneticField, magnetic_field, measure
from wayfuse.simulator.phone_columns import sensed
from wayfuse.simulator.radio_field import RadioField, radio_field
from wayfuse.simulator.routes import plan_route
from wayfuse.simulator.scanner import Sweep, scan
from wayfuse.simulator.scenario import Scenario
from wayfuse.simulator.walker import Walk, draw_person, walk

__all__ = ["SimulatedSite", "Truth", "make_site", "simulate_walk", "site_in"]

EPOCH_MS = 1_577_872_800_000  # 1 January 2020, 10:00 UTC: the first walk's start unless told otherwise
DECIMALS = {
    "acceleration": 5,
    "rotation_rate": 6,
    "magnetic_field": 4,
    "orientation": 7,
}  # of the written files
_DEVICE = Device("wayfuse", "simulated", "Android 10")


@dataclass(frozen=True, slots=True, eq=False)
class SimulatedSite:
    """A building, its access points and its magnetic field."""

    building: Building
    radios: RadioField
    magnetic: MagneticField


@dataclass(frozen=True, slots=True, eq=False)
class Truth:
    """What happened on a walk, on the recording's clock (s).

    t (n,), xy (n, 2) m, heading (n,) rad in (-pi, pi]: the body's, at 100 Hz. ``floor`` is the storey's
    ordinal. contacts (k,) s and step_length (k,) m of every step; walking (n,) 0 standing to 1 walking.
    """

    name: str
    floor: int
    floor_name: str
    t: Array
    xy: Array
    heading: Array
    walking: Array
    contacts: Array
    step_length: Array

    def at(self, t: Array) -> Array:
        """Place (m, 2) m at times (m,) s, held at both ends."""
        return np.column_stack([np.interp(t, self.t, self.xy[:, k]) for k in (0, 1)])


def make_site(scenario: Scenario, rng: np.random.Generator) -> SimulatedSite:
    """Draw a shopping centre."""
    return site_in(shopping_centre(rng), scenario, rng)


def site_in(building: Building, scenario: Scenario, rng: np.random.Generator) -> SimulatedSite:
    """Draw the access points and the magnetic field of a building."""
    return SimulatedSite(
        building=building,
        radios=radio_field(building, scenario.radio, rng),
        magnetic=magnetic_field(len(building.storeys), scenario.imu, rng),
    )


def simulate_walk(
    site: SimulatedSite,
    scenario: Scenario,
    rng: np.random.Generator,
    name: str,
    *,
    floor: int | None = None,
    visits: IntArray | None = None,
    start_ms: int = EPOCH_MS,
) -> tuple[Recording, Truth]:
    """Simulate one walk.

    Parameters
    ----------
    floor : ordinal of the storey; drawn where not given.
    visits : (e,) how often each corridor was surveyed, updated; with it the walk seeks the least walked.
    start_ms : Unix time in ms of the walk's start.

    Returns
    -------
    the recording of the phone, equal to its file read back, and the truth.
    """
    if floor is None:
        floor = int(rng.integers(len(site.building.storeys)))
    storey = site.building.storeys[floor]
    person = draw_person(scenario.walker, rng)
    route = plan_route(
        storey,
        scenario.way_length(person, rng),
        rng,
        manner=scenario.manner,
        visits=visits,
    )
    truth_walk = walk(route, person, scenario.walker, rng)
    imu = measure(truth_walk, floor, person, site.magnetic, scenario.imu, scenario.walker, rng)
    sweeps = scan(truth_walk, floor, site.radios, scenario.scanner, rng)
    stated = truth_walk.stated + np.array([0.0, 1.0, 1.0]) * rng.normal(
        0.0, scenario.stated_sigma, truth_walk.stated.shape
    )
    base = sensed(name, imu, (start_ms + np.round(1000 * imu.t)) / 1000, DECIMALS)
    recording = replace(
        base,
        wifi=tuple(_wifi(sweep, site.radios, start_ms) for sweep in sweeps),
        waypoints=tuple(_stated(row, storey.name, start_ms) for row in stated),
        site=site.building.name,
        floor=storey.name,
        clock="Unix time",
        device=_DEVICE,
    )
    return recording, _truth(name, floor, storey.name, truth_walk, start_ms)


def _truth(name: str, floor: int, floor_name: str, w: Walk, start_ms: int) -> Truth:
    start = start_ms / 1000
    return Truth(
        name, floor, floor_name, start + w.t, w.xy, wrap(w.heading), w.gait, start + w.contact, w.step_length
    )


def _clock(t: float, start_ms: int) -> float:
    """A time of the walk (s) as a phone stamps it: whole milliseconds."""
    return (start_ms + round(1000 * t)) / 1000


def _wifi(sweep: Sweep, radios: RadioField, start_ms: int) -> WifiScan:
    return WifiScan(
        t=_clock(sweep.t, start_ms),
        bssid=radios.bssid[sweep.network],
        rssi=sweep.rssi.astype(np.float32),
        frequency=radios.frequency[radios.radio[sweep.network]],
        last_seen=(start_ms + np.round(1000 * sweep.last_seen)) / 1000,
    )


def _stated(row: Array, floor: str, start_ms: int) -> Waypoint:
    return Waypoint(_clock(float(row[0]), start_ms), round(float(row[1]), 4), round(float(row[2]), 4), floor)
