"""Walls and walkable space stop particles; both against plain twins."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from wayfuse.core.errors import ConfigError
from wayfuse.filters.cloud import Cloud
from wayfuse.maps.build import build_floor
from wayfuse.maps.site import Floor, Polygon, Unit
from wayfuse.maps.walkable import Walkable
from wayfuse.models.constraint.barriers import Barriers
from wayfuse.models.constraint.walkable_mask import WalkableMask


def box(x0: float, y0: float, x1: float, y1: float) -> Polygon:
    return Polygon(np.array([(x0, y0), (x1, y0), (x1, y1), (x0, y1), (x0, y0)]))


@pytest.fixture(scope="module")
def floors() -> tuple[Floor, ...]:
    """A hall with a block in its middle, and a plain hall above."""
    block = Unit("1", "block", "shop", box(8.0, 3.0, 12.0, 7.0))
    hall = box(0.0, 0.0, 20.0, 10.0)
    return build_floor("F1", 1, [hall], [block]), build_floor("F2", 2, [box(0.0, 0.0, 15.0, 12.0)])


def clouds(floor: np.ndarray, start: np.ndarray, stop: np.ndarray) -> tuple[Cloud, Cloud]:
    zero = np.zeros(len(floor), np.float32)
    before, after = (
        Cloud.on_floors(*p.astype(np.float32).T.copy(), zero, zero + 1, floor.astype(np.int32))
        for p in (start, stop)
    )
    return before, after


def random_moves(seed: int, n: int = 400, reach: float = 1.0) -> tuple[Cloud, Cloud]:
    rng = np.random.default_rng(seed)
    start = rng.uniform((-1.0, -1.0), (21.0, 13.0), (n, 2))
    return clouds(rng.integers(0, 2, n), start, start + rng.normal(0.0, reach, (n, 2)))


def mask_twin(masks: tuple[Walkable, ...], before: Cloud, after: Cloud) -> tuple[np.ndarray, np.ndarray]:
    """Which moves are stopped, and which of them are undone."""
    stopped, inside = np.zeros(before.n, bool), np.zeros(before.n, bool)
    for i, f in enumerate(before.floor):
        x, y = ((float(a[i]), float(b[i])) for a, b in ((before.x, after.x), (before.y, after.y)))
        ends = masks[f].contains(x[1], y[1]), masks[f].contains(0.5 * sum(x), 0.5 * sum(y))
        stopped[i] = not all(ends)
        inside[i] = masks[f].contains(x[0], y[0])
    return stopped, stopped & inside


@settings(max_examples=20)
@given(seed=st.integers(0, 1000))
def test_the_mask_is_its_twin(floors: tuple[Floor, ...], seed: int) -> None:
    masks = tuple(f.walkable for f in floors)
    before, after = random_moves(seed)
    copies = [c.copy() for c in (*before, *after)]
    log_weights = np.linspace(-1.0, 0.0, before.n)
    kept, n = WalkableMask(masks, 0.7).restrict(before, after, log_weights)
    stopped, undone = mask_twin(masks, before, after)
    assert n == stopped.sum()
    np.testing.assert_array_equal(kept.x, np.where(undone, before.x, after.x))
    np.testing.assert_array_equal(kept.y, np.where(undone, before.y, after.y))
    np.testing.assert_allclose(log_weights, np.linspace(-1.0, 0.0, before.n) - 0.7 * stopped)
    for now, then in zip((*before, *after), copies, strict=True):
        np.testing.assert_array_equal(now, then)


def crosses(walls: np.ndarray, p: np.ndarray, q: np.ndarray) -> bool:
    """Whether the segment meets a wall properly, by orientations."""

    def side(a: np.ndarray, b: np.ndarray, c: np.ndarray) -> np.ndarray:
        return (b[..., 0] - a[..., 0]) * (c[..., 1] - a[..., 1]) - (b[..., 1] - a[..., 1]) * (
            c[..., 0] - a[..., 0]
        )

    a, b = walls[:, :2], walls[:, 2:]
    one, two = side(a, b, p[None]), side(a, b, q[None])
    three, four = side(p[None], q[None], a), side(p[None], q[None], b)
    return bool(np.any((one * two < 0.0) & (three * four < 0.0)))


def test_barriers_are_their_twin(floors: tuple[Floor, ...]) -> None:
    before, after = random_moves(5)
    log_weights = np.zeros(before.n)
    kept, n = Barriers(tuple(f.barrier_index for f in floors), 1.1).restrict(before, after, log_weights)
    want = np.array(
        [
            crosses(floors[f].barriers, *(np.array([c.x[i], c.y[i]], np.float64) for c in (before, after)))
            for i, f in enumerate(before.floor)
        ]
    )
    assert 20 < n < 300
    assert n == want.sum()
    np.testing.assert_array_equal(kept.x, np.where(want, before.x, after.x))
    np.testing.assert_allclose(log_weights, -1.1 * want)


def test_one_floor_alone_and_no_blocked_move(floors: tuple[Floor, ...]) -> None:
    indices = tuple(f.barrier_index for f in floors)
    start = np.array([(2.0, 2.0), (3.0, 8.0)])
    before, after = clouds(np.array([1, 1]), start, start + 0.5)
    log_weights = np.zeros(2)
    kept, n = Barriers(indices).restrict(before, after, log_weights)
    assert n == 0
    assert kept is after
    np.testing.assert_array_equal(log_weights, 0.0)
    before, after = clouds(
        np.array([0, 0]), np.array([(10.0, 1.0)] * 2), np.array([(10.0, 9.0), (14.0, 1.0)])
    )
    kept, n = Barriers(indices).restrict(before, after, log_weights)
    assert n == 1
    np.testing.assert_array_equal(kept.y, [1.0, 1.0])


def test_a_particle_in_a_shop_can_leave_it(floors: tuple[Floor, ...]) -> None:
    before, after = clouds(
        np.array([0, 0]), np.array([(10.0, 5.0)] * 2), np.array([(11.0, 5.0), (10.0, 7.6)])
    )
    kept, n = WalkableMask(tuple(f.walkable for f in floors)).restrict(before, after, np.zeros(2))
    assert n == 2  # both pay: one stays inside, the other's middle does
    np.testing.assert_array_equal(kept.x, after.x)
    np.testing.assert_array_equal(kept.y, after.y)


def test_wrong_use_is_refused(floors: tuple[Floor, ...]) -> None:
    one = floors[0].walkable
    with pytest.raises(ConfigError, match="one cell size"):
        WalkableMask((one, Walkable((0.0, 0.0), 2.0 * one.cell, one.mask)))
    with pytest.raises(ConfigError, match="one cell size"):
        WalkableMask(())
    with pytest.raises(ConfigError, match="penalty"):
        WalkableMask((one,), -1.0)
    with pytest.raises(ConfigError, match="penalty"):
        Barriers((floors[0].barrier_index,), np.nan)
