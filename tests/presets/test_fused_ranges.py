"""fused by ranges: found from nothing, better with a radio map than without ranges, deaf to estimated places."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from wayfuse.core.errors import UsageError
from wayfuse.presets.methods import build_method
from wayfuse.radio.ap_places import ApPlaces
from wayfuse.sensors.records import Range
from wayfuse.tracking.estimate import State

N_ANCHORS = 8


@pytest.fixture(scope="module")
def ranged(world: Any) -> tuple[Any, ApPlaces, Any]:
    """A simulated walk on the ground floor with ranges every second to anchors of that floor, 1 m of noise."""
    rng = np.random.default_rng(5)
    recording = world.walks[0]
    truth = world.truth[recording.name]
    k = world.site.floor_index(truth.floor_name)
    floor = world.site.floors[k]
    xy = rng.uniform((0.0, 0.0), (floor.width, floor.height), (N_ANCHORS, 2))
    nowhere = np.full(N_ANCHORS, np.nan)
    places = ApPlaces(
        np.arange(1, N_ANCHORS + 1).astype(np.uint64),
        xy[:, 0],
        xy[:, 1],
        np.full(N_ANCHORS, k, np.int32),
        nowhere,
    )
    ranges = []
    for t in np.arange(truth.t[0], truth.t[-1], 1.0):
        here = truth.at(np.array([t]))[0]
        for i in range(N_ANCHORS):
            d = float(np.hypot(*(xy[i] - here)) + rng.normal(0.0, 1.0))
            ranges.append(Range(float(t), i + 1, d))
    return replace(recording, ranges=tuple(ranges)), places, truth


def errors(estimates: Any, truth: Any) -> Any:
    said = [e for e in estimates if e.state is not State.INITIALISING and truth.t[0] <= e.t <= truth.t[-1]]
    offset = np.array([(e.x, e.y) for e in said]) - truth.at(np.array([e.t for e in said]))
    return np.hypot(*offset.T)


def test_ranges_alone_find_and_follow(world: Any, ranged: Any) -> None:
    recording, places, truth = ranged
    done = build_method("fused-ranges", world.site, None, places=places).run(replace(recording, wifi=()), 0)
    found = errors(done.estimates, truth)
    assert len(found) > 20
    assert float(np.mean(found)) < 1.5
    assert {world.site.floors[e.floor].name for e in done.estimates[5:]} == {truth.floor_name}


def test_ranges_help_a_radio_map(world: Any, ranged: Any) -> None:
    recording, places, truth = ranged
    both = build_method("fused", world.site, world.survey, places=places).run(recording, 0).estimates
    scans = build_method("fused", world.site, world.survey).run(recording, 0).estimates
    assert float(np.mean(errors(both, truth))) < 0.8 * float(np.mean(errors(scans, truth)))


def test_estimated_places_are_no_anchors(world: Any, ranged: Any) -> None:
    recording, places, _ = ranged
    guessed = replace(places, is_estimated=True)
    with pytest.raises(UsageError, match="measured places"):
        build_method("fused-ranges", world.site, None, places=guessed)
    with_guess = build_method("fused", world.site, world.survey, places=guessed).run(recording, 0).estimates
    without = build_method("fused", world.site, world.survey).run(replace(recording, ranges=()), 0).estimates
    assert with_guess[-1].x == without[-1].x


def test_what_is_missing_is_named(world: Any) -> None:
    with pytest.raises(UsageError, match="fused-ranges lacks"):
        build_method("fused-ranges", world.site, None)
    with pytest.raises(UsageError, match="wknn lacks"):
        build_method("wknn", world.site, None)
