"""Tracks that only ranges speak of: found again on another floor and elsewhere, left alone where they are right."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from wayfuse.core.errors import ConfigError
from wayfuse.filters.cloud import NO_CONNECTOR, Cloud
from wayfuse.filters.particle_filter import FilterState
from wayfuse.maps.build import build_floor
from wayfuse.maps.site import Polygon, Site
from wayfuse.maps.walkable import Walkable
from wayfuse.models.initial import Anywhere
from wayfuse.models.observation.anchored_ranges import AnchoredRanges
from wayfuse.presets.fused import Config, build_from_ranges
from wayfuse.radio.ap_places import ApPlaces
from wayfuse.radio.range_line import LineGrid, Spread
from wayfuse.sensors.recording import Recording
from wayfuse.sensors.records import Range
from wayfuse.tracking.elsewhere import Elsewhere
from wayfuse.tracking.engine import Known
from wayfuse.tracking.range_parts import Ranging

WIDTH, HEIGHT, STOREY = 40.0, 24.0, 4.0
XY = np.array([(6.0, 4.0), (34.0, 4.0), (20.0, 12.0), (6.0, 20.0), (34.0, 20.0)])
LINE = LineGrid(offset=Spread(0.0, 1.0, n=1), slope=Spread(1.0, 1.0, n=1))
N = 400
KEY = (7, 9)
SHIFT = np.array([[0.0, 0.0], [100.0, -50.0]])  # of the frames in the parts


def _site(n_floors: int) -> Site:
    ring = np.array([[0.0, 0.0], [WIDTH, 0.0], [WIDTH, HEIGHT], [0.0, HEIGHT], [0.0, 0.0]])
    floors = [build_floor(str(k), k, [Polygon(ring)], elevation=k * STOREY) for k in range(n_floors)]
    return Site("tower", tuple(floors))


def _places(n_floors: int, offsets: Any = None) -> ApPlaces:
    n = len(XY)
    floor = np.repeat(np.arange(n_floors, dtype=np.int32), n)
    xy = np.tile(XY, (n_floors, 1)) - (0.0 if offsets is None else offsets[floor])
    ids = np.arange(1, n_floors * n + 1).astype(np.uint64)
    return ApPlaces(ids, xy[:, 0], xy[:, 1], floor, np.full(n_floors * n, 2.5))


def _ranges(way: list[tuple[float, float, float, int]], rng: np.random.Generator) -> tuple[Range, ...]:
    """Of anchors within 25 m, each slab between them keeping most of the answers away; a third come late."""
    places, out = _places(3), []
    for t, x, y, k in way:
        for row in range(len(places)):
            slabs = abs(int(places.floor[row]) - k)
            rise = places.floor[row] * STOREY + 2.5 - k * STOREY - 1.2
            distance = math.hypot(places.x[row] - x, places.y[row] - y, rise)
            if distance > 25.0 or rng.random() > 0.8 * 0.3**slabs:
                continue
            late = rng.exponential(3.0) if rng.random() < 0.3 else 0.0
            out.append(Range(t, int(places.bssid[row]), distance + late + rng.normal(0.0, 0.6)))
    return tuple(out)


def _to_and_fro(t0: float, seconds: float, middle: tuple[float, float], floor: int) -> list[Any]:
    return [
        (t0 + t, middle[0] + 4.0 * math.sin(t / 6.0), middle[1], floor) for t in np.arange(0.0, seconds, 0.5)
    ]


@pytest.mark.parametrize("seed", [1, 2, 3])
@pytest.mark.parametrize(("place", "floor"), [((10.0, 12.0), 1), ((32.0, 6.0), 0), ((32.0, 18.0), 2)])
def test_who_is_elsewhere_unnoticed_is_found_again(place: Any, floor: int, seed: int) -> None:
    """By a lift that nothing felt, carried across the floor, and both; while no range came."""
    way = [*_to_and_fro(0.0, 40.0, (10.0, 12.0), 0), *_to_and_fro(60.0, 40.0, place, floor)]
    recording = Recording("tag", ranges=_ranges(way, np.random.default_rng(seed)))
    estimates = build_from_ranges(_site(3), _places(3)).run(recording, seed).estimates
    true = np.array([w[:3] for w in way])

    def off(e: Any) -> float:
        at = true[np.argmin(np.abs(true[:, 0] - e.t)), 1:]
        return float(np.hypot(e.x - at[0], e.y - at[1]))

    before = [e for e in estimates if 10.0 < e.t < 40.0]
    after = [e for e in estimates if 65.0 < e.t < 100.0]
    assert {e.floor for e in before} == {0}
    assert {e.floor for e in after} == {floor}
    assert np.mean([off(e) for e in before]) < 3.0
    assert np.mean([off(e) for e in after]) < 3.0


def test_without_the_rates_nobody_changes_floors() -> None:
    way = [*_to_and_fro(0.0, 20.0, (10.0, 12.0), 0), *_to_and_fro(30.0, 40.0, (10.0, 12.0), 1)]
    recording = Recording("tag", ranges=_ranges(way, np.random.default_rng(1)))
    deaf = Config(range_floor_rate=0.0, range_jump_rate=0.0)
    estimates = build_from_ranges(_site(3), _places(3), deaf).run(recording, 1).estimates
    assert {e.floor for e in estimates if e.t > 10.0} == {0}


# --- the parts, on two floors whose frames differ ---------------------------------------------------------------------
def _parts(n_floors: int = 2, **more: Any) -> tuple[Ranging, Elsewhere]:
    offsets = SHIFT[:n_floors]
    places = _places(n_floors, offsets)
    elevations = STOREY * np.arange(n_floors)
    ranges = AnchoredRanges(
        places=places, offsets=offsets, elevations=elevations, late=0.3, gain=0.3, slab=0.3
    )
    mask = np.ones((48, 80), np.uint8)
    walkable = tuple(Walkable(tuple((-shift).tolist()), 0.5, mask) for shift in offsets)
    return Ranging(ranges=ranges, lines=LINE), Elsewhere(anywhere=Anywhere(walkable=walkable), **more)


def _at(x: float, y: float, floor: int) -> FilterState:
    spread = np.random.default_rng(0).normal(0.0, 1.0, (2, N))
    x, y = (np.array([x, y]) - SHIFT[floor]).tolist()
    one = np.ones(N, np.float32)
    cloud = Cloud.on_floors(
        (x + spread[0]).astype(np.float32),
        (y + spread[1]).astype(np.float32),
        0.0 * one,
        one,
        np.full(N, floor, np.int32),
    )
    return FilterState(cloud, np.zeros(N), 5)


def _heard(x: float, y: float, floor: int, n: int = 5, t: float = 1.0) -> list[Range]:
    rise = 2.5 - 1.2
    return [Range(t, floor * len(XY) + i + 1, math.hypot(*(XY[i] - (x, y)), rise), 0.3) for i in range(n)]


def _look(
    parts: Any, now: FilterState, heard: list[Range], *, is_watched: bool = False, looked: float = 0.0
) -> Any:
    ranging, elsewhere = parts
    state = ranging.init()._replace(looked=looked)
    moment = ranging.moment(state, heard, heard[0].t)
    return elsewhere.look(ranging, KEY, state, now, moment, Known(), is_watched=is_watched)


def test_particles_that_are_right_are_left_alone() -> None:
    parts = _parts()
    now = _at(10.0, 12.0, 1)
    after, log_likelihood, fresh = _look(parts, now, _heard(10.0, 12.0, 1))
    assert fresh is None
    ranging = parts[0]
    moment = ranging.moment(ranging.init(), _heard(10.0, 12.0, 1), 1.0)
    plain, expected = ranging.look(ranging.init(), now.cloud, now.weights, moment)
    np.testing.assert_array_equal(log_likelihood, expected)
    np.testing.assert_array_equal(after.lines, plain.lines)
    assert after.looks > 0
    assert after.looked == 1.0


def test_the_same_place_on_the_other_floor_is_tried_in_its_own_frame() -> None:
    now = _at(10.0, 12.0, 0)
    _, _, fresh = _look(_parts(jump_rate=0.0, floor_rate=0.1), now, _heard(10.0, 12.0, 1))
    assert set(fresh.cloud.floor.tolist()) == {1}
    x, y = fresh.cloud.x + SHIFT[1, 0], fresh.cloud.y + SHIFT[1, 1]
    assert np.hypot(x - 10.0, y - 12.0).max() < 5.0
    assert set(fresh.cloud.connector.tolist()) == {NO_CONNECTOR}
    assert len(np.unique(fresh.slots)) == fresh.cloud.n
    assert 0 <= fresh.slots.min() <= fresh.slots.max() < N


def test_a_change_of_floors_that_would_be_noticed_is_not_made_up() -> None:
    parts = _parts(jump_rate=0.0, floor_rate=0.1)
    assert _look(parts, _at(10.0, 12.0, 0), _heard(10.0, 12.0, 1), is_watched=True)[2] is None
    nobody_there = _parts(1, jump_rate=0.0, floor_rate=0.1)
    assert _look(nobody_there, _at(10.0, 12.0, 0), _heard(30.0, 6.0, 0))[2] is None
    on_stairs = _at(10.0, 12.0, 0)
    connector = np.zeros(N, np.int32)
    on_stairs = on_stairs._replace(cloud=on_stairs.cloud._replace(connector=connector))
    assert _look(parts, on_stairs, _heard(10.0, 12.0, 1))[2] is None


def test_who_is_far_off_is_drawn_where_the_ranges_say_and_no_more_than_so_many_at_once() -> None:
    for most in (0.25, 1.0):
        _, _, fresh = _look(_parts(most=most), _at(5.0, 5.0, 0), _heard(33.0, 18.0, 1))
        assert fresh.cloud.n == pytest.approx(most * N, abs=1.0)
        x, y = (column + SHIFT[fresh.cloud.floor, k] for k, column in enumerate(fresh.cloud[:2]))
        assert np.median(np.hypot(x - 33.0, y - 18.0)) < 4.0
        assert np.mean(fresh.cloud.floor == 1) > 0.9


def test_the_share_is_that_of_the_formula() -> None:
    parts = _parts(floor_rate=0.0, jump_rate=1e-3, most=1.0)
    ranging, elsewhere = parts
    now, heard = _at(16.0, 12.0, 0), _heard(10.0, 12.0, 0)
    shares = []
    for looked in (0.0, -9.0):
        _, _, fresh = _look(parts, now, heard, looked=looked)
        shares.append(fresh.cloud.n / N)
    state = ranging.init()
    moment = ranging.moment(state, heard, 1.0)
    here = float(np.exp(ranging.at_best_line(state, now.cloud, moment)).mean())
    there = []
    for floor, walkable in enumerate(elsewhere.anywhere.walkable):
        x, y = walkable.centres().T.astype(np.float32)
        cloud = Cloud.on_floors(x, y, 0.0 * x, 0.0 * x, np.full(len(x), floor, np.int32))
        there.append(np.exp(ranging.at_best_line(state, cloud, moment)).mean())
    for share, seconds in zip(shares, (1.0, 10.0), strict=True):
        mass = 1e-3 * seconds * float(np.mean(there))
        assert share == pytest.approx(mass / (here + mass), rel=0.25, abs=1.0 / N)


def test_it_looks_now_and_then() -> None:
    parts = _parts()
    state, _, fresh = _look(parts, _at(5.0, 5.0, 0), _heard(33.0, 18.0, 1), looked=0.5)
    assert fresh is None
    assert state.looked == 0.5
    assert state.looks == 0


@pytest.mark.parametrize(
    "wrong", [{"floor_rate": -1.0}, {"jump_rate": -1.0}, {"every": 0.0}, {"most": 0.0}, {"most": 1.1}]
)
def test_what_cannot_be_is_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(ConfigError, match="rates must not be negative"):
        replace(_parts()[1], **wrong)
