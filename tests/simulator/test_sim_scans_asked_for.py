"""Android refuses scans, some fail, and apps are given the old list again."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from wayfuse.simulator.hall import hall
from wayfuse.simulator.radio_field import RadioModel, radio_field
from wayfuse.simulator.scanner import ScannerModel, Sweep, scan
from wayfuse.simulator.walker import Walk

HALL = hall(30.0, 20.0, 0)
RADIOS = radio_field(HALL, RadioModel(aps_per_floor=6), np.random.default_rng(0))


def standing(seconds: float) -> Walk:
    t = np.arange(0.0, seconds, 0.1)
    place = np.tile([15.0, 10.0], (len(t), 1))
    zero, none = np.zeros(len(t)), np.empty(0)
    return Walk(t, place, zero, zero, none, none, t[:2], zero[:2], np.empty((0, 3)))


def lists(seconds: float, seed: int = 0, **changes: object) -> tuple[Sweep, ...]:
    model = ScannerModel(**{"hit_rate": 1.0, **changes})  # type: ignore[arg-type]
    return scan(standing(seconds), 0, RADIOS, model, np.random.default_rng(seed))


@settings(max_examples=25)
@given(st.integers(0, 10_000), st.floats(0.5, 40.0), st.integers(1, 6), st.booleans())
def test_never_more_scans_than_granted_in_any_two_minutes(seed, period, most, repeats):
    made = lists(
        600.0,
        seed,
        period_s=period,
        throttle_scans=most,
        missed_share=0.1,
        stale_repeats=repeats,
        memory_s=700.0,
    )
    fresh = sorted({float(one.last_seen.max()) for one in made})
    # a sweep is known by its last reading, of a moment up to sweep_s before the end of the sweep
    for k in range(len(fresh)):
        assert np.sum((np.array(fresh) >= fresh[k]) & (np.array(fresh) < fresh[k] + 120.0 - 1.5)) <= most


def test_four_scans_in_two_minutes_come_at_once_and_then_none():
    made = lists(480.0, period_s=2.0, period_jitter_s=0.0, throttle_scans=4)
    gaps = np.diff([one.t for one in made])
    assert len(made) == pytest.approx(16, abs=4)
    assert np.sum(gaps > 100.0) >= 3
    assert np.median(gaps) == pytest.approx(2.0)
    assert all(b.t - a.t >= 120.0 for a, b in zip(made, made[4:], strict=False))


def test_a_refused_scan_can_repeat_the_last_list():
    made = lists(200.0, period_s=4.0, throttle_scans=4, stale_repeats=True, memory_s=300.0)
    assert len(made) == pytest.approx(50, abs=3)
    repeats = [
        np.array_equal(a.last_seen, b.last_seen) and np.array_equal(a.network, b.network)
        for a, b in pairwise(made)
    ]
    assert np.mean(repeats) > 0.8
    fresh = {float(one.last_seen.max()) for one in made}
    assert len(fresh) <= 9


def test_a_share_of_scans_is_missed():
    whole, missing = (len(lists(3000.0, 1, period_s=2.0, missed_share=share)) for share in (0.0, 0.3))
    assert missing / whole == pytest.approx(0.7, abs=0.05)


def test_one_storey_is_no_special_case_for_heights():
    from dataclasses import replace

    from wayfuse.simulator.walker import Climb

    w = standing(30.0)
    n = len(w.t)
    flat = Climb(
        np.zeros(n), np.zeros(n, np.int64), np.zeros(n, np.int64), np.full(n, -1), np.empty(0, np.int64)
    )
    rngs = [np.random.default_rng(3) for _ in range(2)]
    a, b = (
        scan(one, 0, RADIOS, ScannerModel(), rng)
        for one, rng in zip((w, replace(w, climb=flat)), rngs, strict=True)
    )
    assert [x.rssi.tolist() for x in a] == [x.rssi.tolist() for x in b]
