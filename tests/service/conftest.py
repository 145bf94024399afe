"""A site, a tracker and walks, as the server has them."""

from __future__ import annotations

from typing import Any

import pytest

from wayfuse.presets.methods import build_method
from wayfuse.tracking.tracker import Tracker


@pytest.fixture(scope="session")
def tracker(world: Any) -> Tracker:
    """The tracker of the small world, with few particles: bits do not depend on how many."""
    return build_method("fused", world.site, world.survey, n_particles=200)
