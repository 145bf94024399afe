from __future__ import annotations

import numpy as np

from wayfuse.radio.sparse_knn import SparseKnn
from wayfuse.radio.survey import Fingerprint, Survey
from wayfuse.radio.twins import twin_groups, twin_shares

# one radio with three networks (first octet), one with two (last octet), a stranger on the first one's channel
BSSID = np.array(
    [0x0A749C2EAFF7, 0x0E749C2EAFF7, 0x12749C2EAFF7, 0x00112233445A, 0x00112233445B, 0x0A749C2EA0F7],
    np.uint64,
)
CHANNEL = np.array([5765, 5765, 5765, 2412, 2412, 5765], np.int32)


def survey(noise: float = 0.5, stranger_alike: bool = False) -> Survey:
    rng = np.random.default_rng(0)
    order = np.argsort(BSSID)
    base = rng.uniform(-80, -50, (40, 3))
    source = np.array([0, 0, 0, 1, 1, 0 if stranger_alike else 2])
    rssi = base[:, source] + rng.normal(0, noise, (40, 6))
    return Survey.from_dense(
        rssi[:, order].astype(np.float32),
        rng.uniform(0, 30, (40, 2)),
        np.zeros(40, np.int32),
        ("F1",),
        bssid=BSSID[order],
        frequency=CHANNEL[order],
    )


def shares_by_address(s: Survey) -> dict[int, float]:
    return {int(b): round(float(w), 3) for b, w in zip(s.bssid, twin_shares(s), strict=True)}


def test_the_networks_of_one_radio_are_twins_and_strangers_are_not() -> None:
    shares = shares_by_address(survey())
    assert [shares[int(b)] for b in BSSID] == [0.333, 0.333, 0.333, 0.5, 0.5, 1.0]


def test_alike_addresses_that_are_heard_differently_are_not_twins() -> None:
    assert set(shares_by_address(survey(noise=8.0)).values()) == {1.0}


def test_twins_are_heard_together_often_enough() -> None:
    assert np.array_equal(twin_groups(survey(), min_common=41), np.arange(6))


def test_another_channel_is_another_radio() -> None:
    s = survey()
    moved = Survey.from_dense(
        s.dense(), s.xy, s.floor, s.floors, bssid=s.bssid, frequency=np.arange(6, dtype=np.int32) + 2412
    )
    assert set(shares_by_address(moved).values()) == {1.0}


def test_shared_weights_make_a_radio_count_once() -> None:
    s = survey()
    query = Fingerprint(s.bssid, s.dense()[3], s.frequency)
    plain, shared = SparseKnn(s, k=5, idf=False), SparseKnn(s, k=5, idf=False, share_twins=True)
    near = shared.neighbours(query)
    assert near is not None
    assert near.distance < 1e-5
    # by hand: one value per radio, the mean over its networks of min and of sums
    value = (np.clip((s.dense() + 100.0) / 70.0, 0, None) ** 2.2) * twin_shares(s)
    expected = 1.0 - 2.0 * np.minimum(value, value[3]).sum(1) / (value.sum(1) + value[3].sum())
    np.testing.assert_allclose(shared.distances(query)[0], expected, atol=2e-6)
    assert not np.allclose(plain.distances(query)[0], expected, atol=1e-3)
