"""Every radio map keeps one contract."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from radio_map_contract import FITS, field, fingerprint, made_up_survey, queries

from wayfuse.core.errors import RadioMapError
from wayfuse.radio.archive import read_archive, write_archive
from wayfuse.radio.map_file import load, save
from wayfuse.radio.radio_map import RadioMap
from wayfuse.radio.survey import Fingerprint, Survey


@pytest.fixture(scope="module", params=FITS)
def fitted(request: pytest.FixtureRequest) -> tuple[RadioMap, Survey]:
    survey = made_up_survey()
    return FITS[request.param](survey), survey


def _particles(n: int = 60) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(9)
    return rng.uniform((-3, -3), (23, 15), (n, 2)), rng.integers(0, 2, n)


def test_it_locates_within_the_spacing_of_the_survey(fitted: tuple[RadioMap, Survey]) -> None:
    radio_map, _ = fitted
    xy, floor, rssi = queries(120)
    found, level = radio_map.locate_all(rssi)
    assert found.shape == (120, 2)
    assert level.shape == (120,)
    assert np.mean(level == floor) > 0.97
    assert np.mean(np.hypot(*(found - xy).T)) < 2.5


def test_locate_is_a_row_of_locate_all(fitted: tuple[RadioMap, Survey]) -> None:
    radio_map, survey = fitted
    _, _, rssi = queries(5)
    rssi = rssi.astype(np.float32)
    found, level = radio_map.locate_all(rssi)
    for row, xy, floor in zip(rssi, found, level, strict=True):
        fix = radio_map.locate(fingerprint(survey.bssid, row))
        np.testing.assert_allclose((fix.x, fix.y), xy, atol=1e-9)
        assert (fix.floor, fix.n_aps) == (floor, np.isfinite(row).sum())


def test_likelihood_is_finite_and_higher_at_the_truth(fitted: tuple[RadioMap, Survey]) -> None:
    radio_map, survey = fitted
    xy, floor, rssi = queries(40)
    far = xy + np.column_stack([np.where(xy[:, 0] > 10, -9.0, 9.0), np.zeros(40)])
    better, right_floor = 0, 0
    for i in range(40):
        places = np.stack([xy[i], far[i], xy[i], (1e4, -1e4)])
        levels = np.array([floor[i], floor[i], 1 - floor[i], floor[i]])
        log_p = radio_map.log_likelihood(fingerprint(survey.bssid, rssi[i]), places, levels)
        assert np.all(np.isfinite(log_p))
        better += log_p[0] > log_p[1]
        right_floor += log_p[0] > log_p[2]
    assert better >= 38
    assert right_floor >= 38


def test_likelihood_commutes_with_permuting_particles(fitted: tuple[RadioMap, Survey]) -> None:
    radio_map, survey = fitted
    xy, floor = _particles()
    query = fingerprint(survey.bssid, queries(1)[2][0])
    order = np.random.default_rng(2).permutation(len(xy))
    log_p = radio_map.log_likelihood(query, xy, floor)
    assert log_p.shape == (60,)
    assert log_p.dtype == np.float64
    np.testing.assert_allclose(radio_map.log_likelihood(query, xy[order], floor[order]), log_p[order])
    split = [radio_map.log_likelihood(query, xy[i : i + 1], floor[i : i + 1])[0] for i in range(8)]
    np.testing.assert_allclose(split, log_p[:8])


def test_float32_particles_and_no_particles(fitted: tuple[RadioMap, Survey]) -> None:
    radio_map, survey = fitted
    xy, floor = _particles()
    query = fingerprint(survey.bssid, queries(1)[2][0])
    want = radio_map.log_likelihood(query, xy, floor)
    got = radio_map.log_likelihood(query, xy.astype(np.float32), floor.astype(np.int32))
    np.testing.assert_allclose(got, want, rtol=1e-3, atol=1e-3)
    assert radio_map.log_likelihood(query, xy[:0], floor[:0]).shape == (0,)


def test_inputs_stay_as_they_are(fitted: tuple[RadioMap, Survey]) -> None:
    radio_map, survey = fitted
    xy, floor = _particles()
    _, _, rssi = queries(3)
    query = fingerprint(survey.bssid, rssi[0])
    before = [a.copy() for a in (xy, floor, rssi, query.rssi, survey.rssi, survey.xy)]
    radio_map.log_likelihood(query, xy, floor)
    radio_map.locate_all(rssi)
    for now, then in zip((xy, floor, rssi, query.rssi, survey.rssi, survey.xy), before, strict=True):
        np.testing.assert_array_equal(now, then)


def test_unknown_access_points_change_nothing(fitted: tuple[RadioMap, Survey]) -> None:
    radio_map, survey = fitted
    xy, floor = _particles()
    known = fingerprint(survey.bssid, queries(1)[2][0])
    unknown = np.array([7, 2**63], np.uint64)
    more = Fingerprint(
        np.concatenate([unknown, known.bssid]),
        np.concatenate([np.float32([-30, -40]), known.rssi]),
        np.zeros(len(known.bssid) + 2, np.int32),
    )
    assert radio_map.locate(more) == radio_map.locate(known)
    got, want = (radio_map.log_likelihood(f, xy, floor) for f in (more, known))
    np.testing.assert_array_equal(got, want)


def test_nothing_known_is_flat_and_cannot_be_located(fitted: tuple[RadioMap, Survey]) -> None:
    radio_map, _ = fitted
    xy, floor = _particles()
    for bssid, rssi in (([], []), ([7], [-50.0]), ([100], [np.nan])):
        query = Fingerprint(
            np.array(bssid, np.uint64), np.array(rssi, np.float32), np.zeros(len(bssid), np.int32)
        )
        np.testing.assert_array_equal(radio_map.log_likelihood(query, xy, floor), 0.0)
        with pytest.raises(RadioMapError, match="no access point of this radio map"):
            radio_map.locate(query)


def test_queries_of_another_width_are_refused(fitted: tuple[RadioMap, Survey]) -> None:
    with pytest.raises(RadioMapError, match="do not fit 8 access points"):
        fitted[0].locate_all(np.zeros((2, 9)))


def test_it_comes_back_from_a_file(fitted: tuple[RadioMap, Survey], tmp_path: Path) -> None:
    radio_map, survey = fitted
    save(radio_map, tmp_path / "map.npz")
    back = load(tmp_path / "map.npz")
    assert type(back) is type(radio_map)
    assert back.floors == ("EG", "OG")
    _, _, rssi = queries(20)
    xy, floor = _particles()
    for got, want in zip(back.locate_all(rssi), radio_map.locate_all(rssi), strict=True):
        np.testing.assert_array_equal(got, want)
    query = fingerprint(survey.bssid, rssi[0])
    got = back.log_likelihood(query, xy, floor)
    np.testing.assert_array_equal(got, radio_map.log_likelihood(query, xy, floor))


def test_a_file_without_a_part_or_of_another_kind_is_refused(
    fitted: tuple[RadioMap, Survey], tmp_path: Path
) -> None:
    save(fitted[0], tmp_path / "map.npz")
    kind, header, arrays = read_archive(tmp_path / "map.npz")
    for name in arrays:
        rest = {n: a for n, a in arrays.items() if n != name}
        write_archive(tmp_path / "less.npz", kind, 1, header, rest)
        with pytest.raises(RadioMapError, match=r"less\.npz"):
            load(tmp_path / "less.npz")
        shorter = {**arrays, name: arrays[name][:-1]}
        write_archive(tmp_path / "short.npz", kind, 1, header, shorter)
        with pytest.raises(RadioMapError, match=r"short\.npz"):
            load(tmp_path / "short.npz")
    write_archive(tmp_path / "other.npz", "poem", 1, header, arrays)
    with pytest.raises(RadioMapError, match="holds 'poem', not a radio map"):
        load(tmp_path / "other.npz")
    write_archive(tmp_path / "newer.npz", kind, 2, header, arrays)
    with pytest.raises(RadioMapError, match="newer"):
        load(tmp_path / "newer.npz")


@pytest.mark.parametrize("name", FITS)
def test_an_empty_survey_is_refused(name: str) -> None:
    deaf = Survey.from_dense(np.full((3, 2), np.nan), np.zeros((3, 2)), np.zeros(3, np.int32), ("EG",))
    with pytest.raises(RadioMapError, match="no readings"):
        FITS[name](deaf)


@pytest.mark.parametrize("name", FITS)
def test_a_floor_without_a_survey_is_less_likely(name: str) -> None:
    whole = made_up_survey()
    survey = Survey.from_dense(
        whole.dense(), whole.xy, whole.floor * 2, ("A", "unsurveyed", "C"), bssid=whole.bssid
    )
    radio_map = FITS[name](survey)
    xy = np.array([[8.0, 6.0], [8.0, 6.0], [8.0, 6.0]])
    rssi = field(xy[:1], np.array([0]))[0]
    log_p = radio_map.log_likelihood(fingerprint(survey.bssid, rssi), xy, np.array([0, 1, 2]))
    assert np.all(np.isfinite(log_p))
    assert np.argmax(log_p) == 0
