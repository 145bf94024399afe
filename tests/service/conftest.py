"""A site, a tracker, and a server in this process."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest
from service_running import App, started

from wayfuse.presets.methods import build_method
from wayfuse.tracking.tracker import Tracker


@pytest.fixture(scope="session")
def tracker(world: Any) -> Tracker:
    """The tracker of the small world, with few particles: bits do not depend on how many."""
    return build_method("fused", world.site, world.survey, n_particles=200)


@pytest.fixture(scope="module")
def app(world: Any, tmp_path_factory: pytest.TempPathFactory) -> Iterator[App]:
    """One server for the tests of a file."""
    with started(world, tmp_path_factory.mktemp("server")) as app:
        yield app
