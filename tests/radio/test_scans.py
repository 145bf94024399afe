"""From delivered sweeps to fingerprints: ages, repeats, what is no reading."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from wayfuse.radio.scans import ScanBuffer, readings
from wayfuse.sensors.records import WifiScan

NAN = float("nan")


def scan(t: float, *rows: tuple[int, float, float]) -> WifiScan:
    """Rows of bssid, dBm, last seen."""
    b, r, s = (np.array(c) for c in zip(*rows, strict=True)) if rows else ([], [], [])
    n = len(rows)
    return WifiScan(
        t,
        np.array(b, np.uint64),
        np.array(r, np.float32),
        np.arange(n, dtype=np.int32),
        np.array(s, np.float64),
    )


def feed(*scans: WifiScan, max_age: float = 4.0) -> list[dict[int, float] | None]:
    buffer = ScanBuffer(max_age)
    state, out = buffer.init(), []
    for one in scans:
        state, found = buffer.step(state, one)
        out.append(
            None if found is None else dict(zip(found.bssid.tolist(), found.rssi.tolist(), strict=True))
        )
    return out


def test_readings_count_from_when_they_were_heard() -> None:
    assert feed(scan(10.0, (1, -50, 9.5), (2, -60, 5.9), (3, -70, 6.0))) == [{1: -50.0, 3: -70.0}]
    assert feed(scan(10.0, (1, -50, NAN), (2, -60, 11.0))) == [
        {1: -50.0, 2: -60.0}
    ]  # no or a future time: now


def test_readings_stay_until_they_are_old() -> None:
    got = feed(
        scan(0.0, (1, -50, 0.0)), scan(2.0, (2, -60, 2.0)), scan(4.0, (3, -70, 4.0)), scan(5.0, (3, -71, 4.5))
    )
    assert got == [{1: -50.0}, {1: -50.0, 2: -60.0}, {1: -50.0, 2: -60.0, 3: -70.0}, {2: -60.0, 3: -71.0}]


def test_the_newest_reading_of_an_access_point_counts() -> None:
    got = feed(scan(0.0, (1, -50, 0.0)), scan(1.0, (1, -90, -1.0), (1, -60, 0.5)))
    assert got[1] == {1: -60.0}


def test_a_repeat_says_nothing_new() -> None:
    silent = scan(0.0, (1, -50, NAN))
    assert feed(silent, scan(2.0, (1, -50, NAN)), scan(3.0, (1, -51, NAN))) == [{1: -50.0}, None, {1: -51.0}]
    seen = scan(0.0, (1, -50, -1.0))
    assert feed(seen, seen, scan(2.0, (1, -50, 1.0))) == [{1: -50.0}, None, {1: -50.0}]


def test_what_is_no_reading_is_left_out() -> None:
    rows = [
        (1, NAN, 0.0),
        (2, np.inf, 0.0),
        (3, -np.inf, 0.0),
        (4, -127.0, 0.0),
        (5, 3.0, 0.0),
        (6, -40.0, 0.0),
    ]
    assert feed(scan(0.0, *rows)) == [{6: -40.0}]
    assert feed(scan(0.0, *rows[:5])) == [None]
    assert feed(scan(0.0)) == [None]
    kept = readings((scan(0.0, *rows),))
    assert kept.bssid.tolist() == [6]


READING = st.tuples(
    st.integers(0, 6), st.sampled_from([-30.0, -60.0, -126.5, -127.0, 0.0, 5.0, NAN]), st.floats(-10.0, 60.0)
)
SCANS = st.lists(st.tuples(st.floats(0.0, 3.0), st.lists(READING, max_size=6)), max_size=8)


@given(SCANS)
def test_a_fingerprint_has_each_access_point_once_and_nothing_old(rows: list) -> None:
    t, scans = 0.0, []
    for gap, readings_ in rows:
        t += gap
        scans.append(scan(t, *readings_))
    buffer = ScanBuffer(4.0)
    state = buffer.init()
    for one in scans:
        before = [c.copy() for c in state[:4]]
        after, found = buffer.step(state, one)
        for now, then in zip(state[:4], before, strict=True):
            np.testing.assert_array_equal(now, then)
        state = after
        if found is not None:
            assert len(np.unique(found.bssid)) == len(found.bssid) > 0
            assert np.all(np.isfinite(found.rssi))
            assert np.all(one.t - state.heard <= 4.0)
            assert len(found.bssid) == len(found.rssi) == len(found.frequency)


@given(SCANS)
def test_distinct_readings_are_ordered_and_distinct(rows: list) -> None:
    t, scans = 0.0, []
    for gap, readings_ in rows:
        t += gap
        scans.append(scan(t, *readings_))
    kept = readings(tuple(scans))
    assert np.all(np.diff(kept.t) >= 0.0)
    pairs = list(zip(kept.bssid.tolist(), kept.t.tolist(), strict=True))
    assert len(set(pairs)) == len(pairs)
    assert np.all(kept.t <= kept.delivered)
