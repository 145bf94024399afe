"""fused by ranges: found from nothing, better with a radio map than without ranges, deaf to estimated places."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from wayfuse.core.errors import DataMissingError, UsageError
from wayfuse.papers.wifi_rtt_groups import DEVELOPMENT, TrackedWalks, walk_groups
from wayfuse.presets.fused import Config, build_from_ranges
from wayfuse.presets.methods import build_method
from wayfuse.radio.ap_places import ApPlaces
from wayfuse.radio.range_line import LineGrid, Spread
from wayfuse.sensors.recording import Recording, Series
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


def long(recording: Any, offset: float, slope: float) -> Any:
    return replace(
        recording,
        wifi=(),
        ranges=tuple(r._replace(distance=offset + slope * r.distance, sigma=0.1) for r in recording.ranges),
    )


def test_a_phone_that_measures_long_is_no_worse(world: Any, ranged: Any) -> None:
    recording, places, truth = ranged
    tracker = build_method("fused-ranges", world.site, None, places=places)
    late = long(recording, 1.5, 1.12)
    assert float(np.mean(errors(tracker.run(late, 0).estimates, truth))) < 1.5
    deaf = LineGrid(offset=Spread(0.0, 1.0, n=1), slope=Spread(1.0, 1.0, n=1))
    told_nothing = build_from_ranges(world.site, places, Config(range_lines=deaf)).run(late, 0).estimates
    assert float(np.mean(errors(told_nothing, truth))) > 1.3 * float(
        np.mean(errors(tracker.run(late, 0).estimates, truth))
    )


def test_who_makes_no_steps_can_still_be_followed(ranged: Any, world: Any) -> None:
    """Motion sensors that speak and show no step: somebody who creeps."""
    _, places, truth = ranged
    xy = np.array([truth.at(truth.t[:1])[0] + [0.03 * k, 0.0] for k in range(120)])
    anchors = np.column_stack([places.x, places.y])
    ranges = tuple(
        Range(float(k), i + 1, float(np.hypot(*(a - xy[k]))))
        for k in range(120)
        for i, a in enumerate(anchors)
    )
    t = np.arange(0.0, 120.0, 0.2)
    still = Series(t, np.tile([0.0, 0.0, 9.81], (len(t), 1)))
    creeping = Recording("creep", acceleration=still, ranges=ranges)
    said = build_method("fused-ranges", world.site, None, places=places).run(creeping, 0).estimates
    last = [np.hypot(e.x - xy[int(e.t), 0], e.y - xy[int(e.t), 1]) for e in said if 60.0 < e.t < 119.0]
    assert float(np.mean(last)) < 1.5


@pytest.mark.real_data
def test_published_walks_are_followed_without_a_line(data_root: Path) -> None:
    try:
        groups = walk_groups(data_root / "wifi-rtt", DEVELOPMENT)
    except DataMissingError:
        pytest.skip("REAL DATA ABSENT: no wifi-rtt; fetch with `wayfuse datasets fetch wifi-rtt`")
    walks = TrackedWalks("fused-ranges", groups)
    assert len(walks.items) == 4
    assert max(walks(item) for item in walks.items) < 1.6


def test_what_is_missing_is_named(world: Any) -> None:
    with pytest.raises(UsageError, match="fused-ranges lacks"):
        build_method("fused-ranges", world.site, None)
    with pytest.raises(UsageError, match="wknn lacks"):
        build_method("wknn", world.site, None)
