"""One simulated site and a few walks on it, made once."""

from __future__ import annotations

import numpy as np
import pytest

from wayfuse.sensors.recording import Recording
from wayfuse.simulator.scenario import Scenario
from wayfuse.simulator.simulate import SimulatedSite, Truth, make_site, simulate_walk


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
