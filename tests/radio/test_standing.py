"""Scans of a standing phone, averaged: against the sums written out, access point by access point."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from wayfuse.radio.scans import ScanBuffer
from wayfuse.radio.standing import Standing
from wayfuse.radio.survey import Fingerprint
from wayfuse.sensors.records import WifiScan


def heard(levels: dict[int, float]) -> Fingerprint:
    ids = sorted(levels)
    return Fingerprint(
        np.array(ids, np.uint64),
        np.array([levels[i] for i in ids], np.float32),
        np.array([2400 + i for i in ids], np.int32),
    )


def after(scans: list[Fingerprint], memory: float) -> Fingerprint:
    standing = Standing.of(scans[0])
    for scan in scans[1:]:
        standing = standing.add(scan, memory)
    return standing.fingerprint


levels = st.dictionaries(st.integers(1, 9), st.floats(-95.0, -30.0, width=32), min_size=1)


@given(scans=st.lists(levels, min_size=1, max_size=12), memory=st.floats(2.0, 9.0))
def test_the_mean_is_that_of_the_sums(scans: list[dict[int, float]], memory: float) -> None:
    fade = 1.0 - 1.0 / memory
    share = [fade ** (len(scans) - 1 - k) for k in range(len(scans))]
    weight = {a: sum(w for w, s in zip(share, scans, strict=True) if a in s) for a in range(1, 10)}
    often = [a for a, w in weight.items() if w >= 0.25 * sum(share)]
    assume(all(abs(w / sum(share) - 0.25) > 1e-4 for w in weight.values()))  # else a matter of rounding
    got = after([heard(s) for s in scans], memory)
    assert got.bssid.tolist() == often
    assert got.frequency.tolist() == [2400 + a for a in often]
    want = [sum(w * s[a] for w, s in zip(share, scans, strict=True) if a in s) / weight[a] for a in often]
    assert got.rssi.tolist() == pytest.approx(want, abs=1e-3)


def test_one_scan_is_itself() -> None:
    scan = heard({3: -50.0, 7: -71.0})
    for got, want in zip(Standing.of(scan).fingerprint, scan, strict=True):
        np.testing.assert_array_equal(got, want)


@given(ids=st.lists(st.integers(1, 2**48), min_size=1, max_size=20))
def test_what_the_buffer_gives_is_in_ascending_order(ids: list[int]) -> None:
    n = len(ids)
    scan = WifiScan(
        1.0, np.array(ids, np.uint64), np.full(n, -60.0), np.full(n, 2437, np.int32), np.full(n, 1.0)
    )
    _, fingerprint = ScanBuffer().step(ScanBuffer().init(), scan)
    assert fingerprint is not None
    assert fingerprint.bssid.tolist() == sorted(set(ids))
