"""Ranges as observations: the table of lines and particles, tempering, and a phone that measures long."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from wayfuse.core.errors import ConfigError
from wayfuse.filters.cloud import Cloud
from wayfuse.models.observation.anchored_ranges import AnchoredRanges
from wayfuse.radio.ap_places import ApPlaces
from wayfuse.radio.range_line import LineGrid, Spread
from wayfuse.sensors.records import Range
from wayfuse.tracking.range_parts import Ranging, RangingState

XY = np.array([[0.0, 0.0], [12.0, 0.0], [12.0, 8.0], [0.0, 8.0]])
PLACES = ApPlaces(
    np.arange(1, 5).astype(np.uint64), XY[:, 0], XY[:, 1], np.zeros(4, np.int32), np.full(4, np.nan)
)
SITE = {"offsets": np.zeros((1, 2)), "elevations": np.zeros(1)}
LINE = LineGrid(offset=Spread(0.0, 1.0, n=1), slope=Spread(1.0, 1.0, n=1))
N = 500
EVEN = np.full(N, 1.0 / N)


def ranging(lines: LineGrid | None = None, near: float = 1e9) -> Ranging:
    ranges = AnchoredRanges(places=PLACES, **SITE, sigma=1.0, near=near)
    return Ranging(ranges=ranges, lines=lines or LineGrid())


def cloud(spread: float = 2.0) -> Cloud:
    x, y = (np.random.default_rng(0).normal(m, spread, N).astype(np.float32) for m in (7.0, 3.0))
    zero = np.zeros(N, np.float32)
    return Cloud.on_floors(x, y, zero, zero + 1, np.zeros(N, np.int32))


def moment(t: float, offset: float = 0.0, slope: float = 1.0) -> list[Range]:
    true = np.hypot(*(XY - [7.0, 3.0]).T)
    return [Range(t, k + 1, offset + slope * float(d), 0.1) for k, d in enumerate(true)]


def look(
    parts: Ranging, state: RangingState, where: Cloud, seen: list[Range], t: float
) -> tuple[RangingState, Any]:
    heard = parts.moment(state, seen, t)
    assert heard is not None
    return parts.look(state, where, EVEN, heard)


def test_on_the_line_of_no_error_it_is_the_gaussian() -> None:
    parts, where, seen = ranging(LINE), cloud(), moment(0.0)
    _, found = look(parts, parts.init(), where, seen, 0.0)
    expected = np.zeros(N)
    parts.ranges.log_likelihood(where, [r._replace(sigma=float("nan")) for r in seen], expected)
    np.testing.assert_allclose(found, expected, rtol=1e-6)


def test_ranges_close_in_time_and_far_anchors_say_less() -> None:
    parts, where = ranging(LINE), cloud()
    state, first = look(parts, parts.init(), where, moment(0.0), 0.0)
    _, soon = look(parts, state, where, moment(0.1), 0.1)
    _, later = look(parts, state, where, moment(5.0), 5.0)
    assert first is not None
    np.testing.assert_allclose(soon, 0.2 * first)
    np.testing.assert_allclose(later, first)
    one = [moment(0.0)[0]]
    near, far = (look(ranging(LINE, near=d), parts.init(), where, one, 0.0)[1] for d in (100.0, 2.0))
    np.testing.assert_allclose(far, near * 2.0 / one[0].distance)


def test_the_line_of_a_phone_is_found_between_anchors() -> None:
    means = []
    for offset, slope in ((0.2, 1.02), (1.8, 1.12)):
        parts = ranging()
        state, where = parts.init(), cloud(1.0)
        for k in range(40):
            state, _ = look(parts, state, where, moment(float(k), offset, slope), float(k))
        long = parts.lines.offsets + 7.0 * parts.lines.slopes  # of a range of 7 m, where both count
        means.append(float(np.exp(state.lines) @ long))
        assert means[-1] == pytest.approx(offset + 7.0 * slope, abs=0.4)
    assert means[1] > means[0] + 1.0


def test_unknown_anchors_teach_nothing() -> None:
    parts = ranging()
    state = parts.init()
    assert parts.moment(state, [Range(1.0, 99, 5.0)], 1.0) is None
    both = [*moment(1.0)[:1], Range(1.0, 99, 5.0)]
    some = look(parts, state, cloud(), both, 1.0)[1]
    np.testing.assert_array_equal(some, look(parts, state, cloud(), both[:1], 1.0)[1])


def test_what_is_heard_through_a_slab_is_rarer() -> None:
    two = {"offsets": np.zeros((2, 2)), "elevations": np.array([0.0, 4.0])}
    where, seen = cloud(), moment(0.0)
    below, above = where, where._replace(floor=np.ones(N, np.int32))
    found = []
    for slab in (1.0, 0.3):
        parts = Ranging(
            ranges=AnchoredRanges(places=PLACES, **two, sigma=1.0, gain=0.5, slab=slab), lines=LINE
        )
        found.append([look(parts, parts.init(), w, seen, 0.0)[1] for w in (below, above)])
    np.testing.assert_array_equal(found[0][0], found[1][0])
    np.testing.assert_allclose(found[1][1] - found[0][1], 0.5 * len(seen) * np.log(0.3))
    with pytest.raises(ConfigError, match="slab"):
        AnchoredRanges(places=PLACES, **two, slab=0.0)


def test_what_cannot_be_is_refused() -> None:
    with pytest.raises(ConfigError):
        Ranging(ranges=ranging().ranges, usual_spacing=0.0)
    with pytest.raises(ConfigError):
        ranging(near=0.0)
