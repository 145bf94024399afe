"""The demo's files: the three-storey building, its survey and its walks to track over stairs and lift.

::

    FOLDER/plan.imdf.zip            the floor plans, an IMDF archive
    FOLDER/survey/<name>.txt        walks for the radio map, GetSensorData logs
    FOLDER/walks/<name>.txt         walks to track
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from wayfuse.sensors.recording import Recording
from wayfuse.simulator.getsensordata_log import write_log
from wayfuse.simulator.house_site import write_plan
from wayfuse.simulator.journeys import Trip
from wayfuse.simulator.scenario import Scenario
from wayfuse.simulator.simulate import SimulatedSite
from wayfuse.simulator.simulate_journey import (
    JourneyTruth,
    Phone,
    make_house,
    simulate_journey,
    simulate_stay,
)

__all__ = ["PLAN", "HouseDemo", "house_scenario", "write_house_demo"]

PLAN = "plan.imdf.zip"


@dataclass(slots=True)
class HouseDemo:
    """What was written, and the truth that was not: ``truth`` by recording name, of survey and test walks."""

    plan: Path
    site: SimulatedSite
    survey: list[Path] = field(default_factory=list)
    walks: list[Path] = field(default_factory=list)
    truth: dict[str, JourneyTruth] = field(default_factory=dict)


def house_scenario() -> Scenario:
    """What the demo simulates."""
    return Scenario(survey_walks=24, test_walks=6, visit_m=(12.0, 24.0), tracked_offset_db=(-4.0, -2.0))


def write_house_demo(folder: Path, seed: int, scenario: Scenario | None = None) -> HouseDemo:
    """Write the demo's files into a folder (made where absent); the same seed writes the same bytes.

    The survey walks each floor in turn and then every stairway and lift once, up or down. Each walk draws from its own
    generator: more walks leave the others as they are.
    """
    scenario = house_scenario() if scenario is None else scenario
    site_seed, survey_seed, ways_seed, test_seed, phone_seed = np.random.SeedSequence(seed).spawn(5)
    site = make_house(scenario, np.random.default_rng(site_seed))
    offsets = np.random.default_rng(phone_seed).normal(0.0, scenario.barometer.phone_hpa, 2).tolist()
    survey_phone, phone = Phone("survey phone", offsets[0]), Phone("visitor's phone", offsets[1])
    for part in ("survey", "walks"):
        (folder / part).mkdir(parents=True, exist_ok=True)
    demo = HouseDemo(folder / PLAN, site)
    write_plan(demo.plan, site.building)

    storeys = site.building.storeys
    visits = [np.zeros(len(storey.edges), dtype=np.int64) for storey in storeys]
    for i, child in enumerate(survey_seed.spawn(scenario.survey_walks)):
        rng, k, name = (
            np.random.default_rng(child),
            i % len(storeys),
            f"survey-floor-{i % len(storeys)}-{i:02d}",
        )
        made = simulate_stay(site, scenario, rng, name, floor=k, visits=visits[k], phone=survey_phone)
        demo.survey.append(_write(folder / "survey", demo, made))
    for i, child in enumerate(ways_seed.spawn(len(site.building.passages))):
        rng, name = (
            np.random.default_rng(child),
            f"survey-{site.building.passages[i].connector.id.replace(' ', '-')}",
        )
        made = simulate_journey(site, scenario, rng, name, trips=_through_all(site, i), phone=survey_phone)
        demo.survey.append(_write(folder / "survey", demo, made))
    for i, child in enumerate(test_seed.spawn(scenario.test_walks)):
        rng, name = np.random.default_rng(child), f"walk-{i:02d}"
        made = simulate_journey(site, scenario.tracked(), rng, name, lift_first=i % 2 == 1, phone=phone)
        demo.walks.append(_write(folder / "walks", demo, made))
    return demo


def _through_all(site: SimulatedSite, passage: int) -> tuple[int, list[Trip]]:
    """From the lowest floor of a passage to its highest, every floor on the way."""
    floors = site.building.passages[passage].connector.floors
    return floors[0], [Trip(passage, floor) for floor in floors[1:]]


def _write(folder: Path, demo: HouseDemo, made: tuple[Recording, JourneyTruth]) -> Path:
    recording, truth = made
    radios = demo.site.radios
    ssid = dict(zip(radios.bssid.tolist(), radios.ssid, strict=True))
    path = folder / f"{recording.name}.txt"
    write_log(path, recording, ssid)
    demo.truth[recording.name] = truth
    return path
