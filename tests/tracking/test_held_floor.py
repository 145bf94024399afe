"""The floor said before is kept while enough of the weight is on it: nobody flickers between floors."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wayfuse.filters.particle_filter import Snapshot
from wayfuse.tracking.summary import Held, Summary, summarise

HOW = Summary()


def said(shares: list[float], held: Held | None) -> int:
    """The floor of a cloud with so much weight on each floor, all at places of their own."""
    floor = np.arange(len(shares), dtype=np.int32)
    x = 10.0 * floor.astype(np.float32)
    weights = np.array(shares) / np.sum(shares)
    e = summarise(Snapshot(0.0, x, x, floor), weights, len(shares), 0.0, HOW, held)
    assert (e.x, e.y) == (pytest.approx(10.0 * e.floor), pytest.approx(10.0 * e.floor))
    return e.floor


def test_a_floor_is_held_until_its_share_is_lost() -> None:
    assert said([0.3, 0.7], Held(0, 0.25)) == 0
    assert said([0.2, 0.8], Held(0, 0.25)) == 1
    assert said([0.3, 0.7], Held(1, 0.25)) == 1
    assert said([0.3, 0.7], None) == 1
    assert said([0.0, 1.0], Held(0, 0.25)) == 1


def test_a_share_that_swings_about_a_half_changes_floor_once() -> None:
    swings = [0.9, 0.6, 0.45, 0.55, 0.4, 0.6, 0.45, 0.1, 0.45, 0.55, 0.4, 0.6]
    floors, free = [0], [0]
    for p in swings:
        floors.append(said([p, 1.0 - p], Held(floors[-1], 0.15)))
        free.append(said([p, 1.0 - p], None))
    assert np.count_nonzero(np.diff(floors)) == 1
    assert np.count_nonzero(np.diff(free)) > 4


@given(
    shares=st.lists(st.floats(0.01, 1.0), min_size=2, max_size=5),
    index=st.integers(0, 4),
    share=st.floats(0.0, 1.0),
)
def test_it_is_either_the_heaviest_or_the_one_held(shares: list[float], index: int, share: float) -> None:
    held = Held(index % len(shares), share)
    floor = said(shares, held)
    mass = np.array(shares) / np.sum(shares)
    assert mass[floor] == mass.max() or (floor == held.floor and mass[floor] >= share - 1e-12)
    if mass[held.floor] > share + 1e-12:
        assert floor == held.floor
    assert said(shares, Held(held.floor, 1.1)) == int(np.argmax(mass))  # nobody holds that hard
