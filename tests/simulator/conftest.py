"""One simulated site and a few walks on it, made once."""

from __future__ import annotations

import numpy as np
import pytest

from wayfuse.sensors.recording import Recording
from wayfuse.simulator.scenario import Scenario
from wayfuse.simulator.simulate import SimulatedSite, Truth, make_site, simulate_walk
from wayfuse.simulator.simulate_journey import JourneyTruth, make_house, simulate_journey


@pytest.fixture(scope="session")
def sim_scenario() -> Scenario:
    return Scenario()


@pytest.fixture(scope="session")
def sim_site(sim_scenario: Scenario) -> SimulatedSite:
    return make_site(sim_scenario, np.random.default_rng(20))


@pytest.fixture(scope="session")
def sim_walks(sim_scenario: Scenario, sim_site: SimulatedSite) -> list[tuple[Recording, Truth]]:
    """Eight walks, four per floor."""
    return [
        simulate_walk(sim_site, sim_scenario, np.random.default_rng(100 + k), f"walk-{k}", floor=k % 2)
        for k in range(8)
    ]


@pytest.fixture(scope="session")
def sim_house(sim_scenario: Scenario) -> SimulatedSite:
    """The three-storey building."""
    return make_house(sim_scenario, np.random.default_rng(0))


@pytest.fixture(scope="session")
def journeys(sim_scenario: Scenario, sim_house: SimulatedSite) -> list[tuple[Recording, JourneyTruth]]:
    """Four journeys over floors, lift or stairs first in turn."""
    return [
        simulate_journey(
            sim_house, sim_scenario, np.random.default_rng(200 + k), f"journey-{k}", lift_first=k % 2 == 1
        )
        for k in range(4)
    ]
