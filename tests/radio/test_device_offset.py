"""The offset of a phone: the compiled cost against plain NumPy, and offsets put on simulated scans."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from wayfuse.core.errors import ConfigError
from wayfuse.radio.device_offset import N_BANDS, DeviceOffset, OffsetState, band_of, shifted
from wayfuse.radio.scans import ScanBuffer
from wayfuse.radio.sparse_knn import SparseKnn
from wayfuse.radio.survey import Fingerprint, Survey


def made_up(n: int = 60, m: int = 30) -> Survey:
    rng = np.random.default_rng(6)
    rssi = np.where(rng.random((n, m)) < 0.4, rng.uniform(-105.0, -30.0, (n, m)), np.nan)
    frequency = np.where(np.arange(m) % 2, 5180, 2437)
    return Survey.from_dense(
        rssi, rng.uniform(0, 50, (n, 2)), rng.integers(0, 3, n), ("A", "B", "C"), frequency=frequency
    )


@settings(max_examples=40)
@given(
    seed=st.integers(0, 1000), k=st.integers(1, 70), versions=st.integers(1, 15), unknown=st.integers(0, 8)
)
def test_mean_distances_are_those_of_each_version_alone(
    seed: int, k: int, versions: int, unknown: int
) -> None:
    survey = made_up()
    radio_map = SparseKnn(survey)
    rng = np.random.default_rng(seed)
    ids = np.concatenate([rng.permutation(survey.bssid)[:12], np.arange(900, 900 + unknown)]).astype(
        np.uint64
    )
    rssi = rng.uniform(-104, -30, (len(ids), versions)).astype(np.float32)
    column = survey.columns(ids)
    known = column >= 0
    got = radio_map.mean_distances(column[known], rssi[known], k)
    assert got.shape == (versions,)
    for s in range(versions):
        alone, _ = radio_map.distances(Fingerprint(ids, rssi[:, s], np.zeros(len(ids), np.int32)))
        padded = np.concatenate([np.minimum(alone, 1.0), np.ones(max(0, k - len(survey)))])
        assert got[s] == pytest.approx(np.sort(padded)[:k].mean(), abs=3e-6)


def test_mean_distances_of_nothing_are_one() -> None:
    none = np.empty((0, 3), np.float32)
    got = SparseKnn(made_up()).mean_distances(np.empty(0, np.int64), none, 5)
    np.testing.assert_array_equal(got, np.ones(3, np.float32))


def test_bands_and_shifts() -> None:
    frequency = np.array([0, 2412, 2484, 5180, 5955], np.int32)
    np.testing.assert_array_equal(band_of(frequency), [0, 0, 0, 1, 1])
    scan = Fingerprint(np.arange(5, dtype=np.uint64), np.full(5, -60.0, np.float32), frequency)
    moved = shifted(scan, np.array([3.0, -2.0]))
    np.testing.assert_array_equal(moved.rssi, [-57.0, -57.0, -57.0, -62.0, -62.0])
    assert moved.rssi.dtype == np.float32
    np.testing.assert_array_equal(scan.rssi, -60.0)


def scans_of(world: Any) -> list[Fingerprint]:
    buffer, out = ScanBuffer(), []
    for recording in world.walks:
        state = buffer.init()
        for scan in recording.wifi:
            state, fingerprint = buffer.step(state, scan)
            if fingerprint is not None:
                out.append(fingerprint)
    return out


def heard_by(scans: list[Fingerprint], low: float, high: float) -> list[Fingerprint]:
    """The scans as a phone reads them whose levels are so many dB above the survey's."""
    return [shifted(scan, np.array([low, high])) for scan in scans]


def learnt(device: DeviceOffset, world: Any, scans: list[Fingerprint]) -> OffsetState:
    radio_map, state = SparseKnn(world.survey), device.init()
    for scan in scans:
        state = device.step(state, radio_map, scan)
    return state


@pytest.fixture(scope="module")
def scans(world: Any) -> list[Fingerprint]:
    return scans_of(world)


def test_without_an_offset_none_is_found(world: Any, scans: list[Fingerprint]) -> None:
    device = DeviceOffset()
    assert len(scans) > 20
    np.testing.assert_allclose(device.shift(learnt(device, world, scans)), 0.0, atol=1.0)


@pytest.mark.parametrize(("low", "high"), [(-10.0, -6.0), (-8.0, -3.0), (-5.0, -5.0), (0.0, -4.0)])
def test_an_offset_is_found_per_band(world: Any, scans: list[Fingerprint], low: float, high: float) -> None:
    device = DeviceOffset()
    found = device.shift(learnt(device, world, heard_by(scans, low, high)))
    np.testing.assert_allclose(found, [-low, -high], atol=1.5)


def test_a_phone_that_reads_more_than_the_survey_is_brought_nearer(
    world: Any, scans: list[Fingerprint]
) -> None:
    """Less surely: survey fingerprints pool several scans, so that louder levels look a little likelier."""
    device = DeviceOffset()
    found = device.shift(learnt(device, world, heard_by(scans, 6.0, 6.0)))
    assert np.all((found < -2.0) & (found > -7.5))


def test_an_offset_that_changes_is_followed(world: Any, scans: list[Fingerprint]) -> None:
    """A hand comes over the antenna; what was learnt before fades."""
    device = DeviceOffset(memory=8.0)
    before, after = heard_by(scans, 0.0, 0.0), heard_by(scans, -6.0, -6.0)
    state = learnt(device, world, before)
    radio_map = SparseKnn(world.survey)
    for scan in 3 * after:
        state = device.step(state, radio_map, scan)
    np.testing.assert_allclose(device.shift(state), 6.0, atol=2.0)


def test_before_the_first_scan_the_prior_holds() -> None:
    device = DeviceOffset()
    state = device.init()
    assert state.cost.shape == (N_BANDS, len(device.grid))
    assert 0.0 in device.grid
    np.testing.assert_allclose(device.shift(state), 0.0, atol=1e-12)
    some = device.grid != 0.0
    for cost, sigma in zip(state.cost, device.prior, strict=True):
        np.testing.assert_allclose(cost[some], 0.5 * (device.grid[some] / sigma) ** 2)
        assert np.all(cost[~some] <= 0.0)


def test_unknown_access_points_change_nothing(world: Any, scans: list[Fingerprint]) -> None:
    device = DeviceOffset()
    state = learnt(device, world, scans[:5])
    strange = scans[5]._replace(bssid=scans[5].bssid ^ np.uint64(0xF0_00_00_00_00_00))
    after = device.step(state, SparseKnn(world.survey), strange)
    np.testing.assert_array_equal(after.cost, state.cost)
    some = scans[5]
    n = len(some.bssid)
    mixed = Fingerprint(
        np.concatenate([some.bssid, strange.bssid]),
        np.concatenate([some.rssi, strange.rssi]),
        np.concatenate([some.frequency, strange.frequency]),
    )
    assert len(mixed.bssid) == 2 * n
    alone = device.step(state, SparseKnn(world.survey), some)
    both = device.step(state, SparseKnn(world.survey), mixed)
    np.testing.assert_allclose(both.cost, alone.cost, atol=1e-4)


def test_a_scan_of_one_band_says_nothing_of_the_other(world: Any, scans: list[Fingerprint]) -> None:
    device = DeviceOffset()
    state = device.init()
    scan = scans[0]
    on = band_of(scan.frequency) == 0
    assert 0 < on.sum() < len(on)
    low = Fingerprint(scan.bssid[on], scan.rssi[on], scan.frequency[on])
    after = device.step(state, SparseKnn(world.survey), low)
    np.testing.assert_array_equal(after.cost[1], state.cost[1])
    assert np.ptp(after.cost[0] - state.cost[0]) > 0.1


def test_states_are_values_and_scans_are_judged_now_and_then(world: Any, scans: list[Fingerprint]) -> None:
    device = DeviceOffset(burn_in=3, every=4)
    radio_map, state = SparseKnn(world.survey), device.init()
    judged = []
    for scan in scans[:12]:
        kept = state.cost.copy()
        after = device.step(state, radio_map, scan)
        np.testing.assert_array_equal(state.cost, kept)
        again = device.step(state, radio_map, scan)
        np.testing.assert_array_equal(again.cost, after.cost)
        judged.append(int(np.any(after.cost != state.cost)))
        state = after
    assert judged == [1, 1, 1, 1, 0, 0, 0, 1, 0, 0, 0, 1]
    assert state.n_seen == 12


@settings(max_examples=30)
@given(cost=st.lists(st.floats(0.0, 1e6), min_size=30, max_size=30))
def test_the_mean_shift_lies_on_the_grid_whatever_the_cost(cost: list[float]) -> None:
    device = DeviceOffset()
    n = len(device.grid)
    shift = device.shift(OffsetState(np.array(cost[: 2 * n]).reshape(2, -1)[:, :n]))
    assert np.all(np.isfinite(shift))
    assert np.all(np.abs(shift) <= device.reach + 1e-9)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("reach", 1.0), ("spacing", 0.0), ("prior", (0.0, 3.0)), ("temperature", 0.0), ("k", 0), ("every", 0),
        ("memory", 0.0), ("memory", np.nan),
    ],
)  # fmt: skip
def test_parameters_out_of_range_are_refused(name: str, value: Any) -> None:
    with pytest.raises(ConfigError):
        DeviceOffset(**{name: value})
