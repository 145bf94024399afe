"""A survey of several phones: levels are brought to those of the phone with most fingerprints."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from wayfuse.core.errors import RadioMapError
from wayfuse.radio.device_offset import N_BANDS, band_of
from wayfuse.radio.device_survey import Levels, device_shifts, normalised
from wayfuse.radio.survey import Survey

TRUE = {"A": (0.0, 0.0), "B": (-7.0, -2.5), "C": (4.0, 5.0)}


def survey_by(devices: list[str], far: tuple[int, ...] = (), seed: int = 0, n: int = 40) -> Survey:
    """Walks along one corridor, one per device; ``far`` : walks in another part of the house."""
    rng = np.random.default_rng(seed)
    at = np.stack([np.linspace(0.0, 40.0, n), np.full(n, 2.0)], axis=1)
    stations = rng.uniform((0.0, -10.0), (40.0, 10.0), (20, 2))
    frequency = np.where(np.arange(20) % 2, 5180, 2437).astype(np.int32)
    rssi, xy, walk = [], [], []
    for w, device in enumerate(devices):
        moved = at + ((500.0, 0.0) if w in far else (0.0, 0.0)) + rng.normal(0.0, 0.3, at.shape)
        heard = -35.0 - 25.0 * np.log10(
            1.0 + np.linalg.norm((moved - (500.0 * (w in far), 0.0))[:, None] - stations[None], axis=2)
        )
        heard += (
            rng.normal(0.0, 2.0, heard.shape) + np.array(TRUE.get(device, (0.0, 0.0)))[band_of(frequency)]
        )
        # the first walk of the reference phone is longer, so that it is the reference
        keep = slice(None) if w == 0 else slice(0, n - 2)
        rssi.append(heard[keep])
        xy.append(moved[keep])
        walk.append(np.full(len(heard[keep]), w))
    names = tuple(f"walk {w}" for w in range(len(devices)))
    rows = np.concatenate(walk)
    return Survey.from_dense(
        np.concatenate(rssi),
        np.concatenate(xy),
        np.zeros(len(rows), int),
        ("F1",),
        frequency=frequency,
        walk=rows,
        walks=names,
    )


def test_shifts_are_found_within_a_decibel_and_make_levels_agree() -> None:
    devices = ["A", "B", "C"]
    survey = survey_by(devices)
    reference, shifts = device_shifts(survey, devices)
    assert reference == "A"
    np.testing.assert_array_equal(shifts["A"], 0.0)
    for device in ("B", "C"):
        np.testing.assert_allclose(shifts[device], [-v for v in TRUE[device]], atol=1.0)
    after = normalised(survey, devices, shifts)
    for device in range(3):
        for band in range(N_BANDS):
            rows = np.repeat(np.arange(len(survey)), np.diff(survey.indptr))
            on = band_of(survey.frequency)[survey.indices] == band
            level = [float(after.rssi[on & (survey.walk[rows] == w)].mean()) for w in (0, device)]
            assert level[1] == pytest.approx(level[0], abs=1.0)


def test_only_levels_change_and_the_given_survey_does_not() -> None:
    devices = ["A", "B"]
    survey = survey_by(devices)
    kept = survey.rssi.copy()
    after = normalised(survey, devices, device_shifts(survey, devices)[1])
    np.testing.assert_array_equal(survey.rssi, kept)
    assert after.rssi.dtype == np.float32
    for name in ("bssid", "frequency", "xy", "floor", "walk", "indptr", "indices"):
        np.testing.assert_array_equal(getattr(after, name), getattr(survey, name))
    mine = survey.walk[np.repeat(np.arange(len(survey)), np.diff(survey.indptr))] == 0
    np.testing.assert_array_equal(after.rssi[mine], kept[mine])
    assert np.all(after.rssi[~mine] != kept[~mine])


def test_walks_of_one_phone_are_pooled() -> None:
    devices = ["A", "B", "B", "A"]
    survey = survey_by(devices)
    reference, shifts = device_shifts(survey, devices)
    assert set(shifts) == {"A", "B"}
    np.testing.assert_allclose(shifts["B"], [7.0, 2.5], atol=1.0)
    # were the walks of B taken for phones of their own, each would get nearly the same
    _, apart = device_shifts(survey, ["A", "B1", "B2", "A"])
    np.testing.assert_allclose(apart["B1"], apart["B2"], atol=1.0)
    assert reference == "A"


def test_a_phone_that_shares_no_place_keeps_its_levels() -> None:
    devices = ["A", "B", "C"]
    survey = survey_by(devices, far=(2,))
    _, shifts = device_shifts(survey, devices)
    np.testing.assert_array_equal(shifts["C"], 0.0)
    np.testing.assert_allclose(shifts["B"], [7.0, 2.5], atol=1.0)
    other_floor = replace(survey_by(devices), floors=("F1", "F2"))
    floor = np.where(other_floor.walk == 1, 1, 0).astype(np.int32)
    _, shifts = device_shifts(replace(other_floor, floor=floor), devices)
    np.testing.assert_array_equal(shifts["B"], 0.0)  # the same place on another floor is another place


def test_too_few_readings_in_common_are_not_believed() -> None:
    devices = ["A", "B"]
    survey = survey_by(devices)
    for least, is_found in ((100, True), (100_000, False)):
        _, shifts = device_shifts(survey, devices, Levels(least=least))
        assert bool(np.any(shifts["B"])) is is_found


def test_walks_without_a_name_are_phones_of_their_own() -> None:
    survey = survey_by(["A", "B", "C"])
    devices = ["", "", "C"]
    reference, shifts = device_shifts(survey, devices)
    assert set(shifts) == {"? walk 0", "? walk 1", "C"}
    assert reference == "? walk 0"
    np.testing.assert_allclose(shifts["? walk 1"], [7.0, 2.5], atol=1.0)
    after = normalised(survey, devices, shifts)
    assert abs(np.median(after.rssi) - np.median(survey.rssi)) > 0.0


def test_one_device_per_walk_is_asked_for() -> None:
    with pytest.raises(RadioMapError, match="1 devices for 2 walks"):
        device_shifts(survey_by(["A", "B"]), ["A"])


@settings(max_examples=10)
@given(low=st.floats(-10.0, 10.0), high=st.floats(-10.0, 10.0))
def test_what_one_phone_adds_the_normalisation_takes_away(low: float, high: float) -> None:
    devices = ["A", "A2"]
    survey = survey_by(devices)
    rows = np.repeat(np.arange(len(survey)), np.diff(survey.indptr))
    added = np.array([low, high])[band_of(survey.frequency)[survey.indices]] * (survey.walk[rows] == 1)
    odd = replace(survey, rssi=(survey.rssi + added).astype(np.float32))
    base = device_shifts(survey, devices)[1]["A2"]
    np.testing.assert_allclose(device_shifts(odd, devices)[1]["A2"], base - (low, high), atol=1e-4)
