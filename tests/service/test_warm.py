"""What is loaded before the first phone comes: with it, the first walk needs no kernel more."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from wayfuse.presets.methods import CONFIGS, build_method
from wayfuse.service.warm import warm
from wayfuse.tracking.tracker import Tracker


def test_warming_walks_steps_and_scans_and_changes_nothing(
    world: Any, tracker: Tracker, monkeypatch: pytest.MonkeyPatch
) -> None:
    walk = replace(world.walks[0], name="walk")
    before = tracker.run(walk).estimates
    batches = []
    extend = type(tracker).extend
    monkeypatch.setattr(type(tracker), "extend", lambda *a: batches.append(extend(*a)) or batches[-1])
    warm(tracker, world.survey)
    assert sum(e.n_steps for e in batches[0].estimates) >= 5
    assert max(e.n_aps for e in batches[0].estimates) > 0
    assert tracker.run(walk).estimates == before


@pytest.mark.parametrize("method", CONFIGS)
def test_every_method_can_be_warmed(world: Any, method: str) -> None:
    warm(build_method(method, world.site, world.survey, n_particles=50), world.survey)
