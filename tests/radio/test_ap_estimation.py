"""Estimated places of access points: simulated truth, outliers, floors, and what is too little to go by."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from wayfuse.core.errors import ConfigError, RadioMapError
from wayfuse.core.types import Array
from wayfuse.formats.sodindoorloc import read
from wayfuse.formats.sodindoorloc_places import WORKBOOK, read_places
from wayfuse.radio.ap_estimation import EstimationParameters, estimate_places
from wayfuse.radio.survey import Survey

TRUE = np.random.default_rng(5).uniform((3.0, 3.0), (37.0, 22.0), (20, 2))


def lattice(step: float = 2.0) -> Array:
    gx, gy = np.meshgrid(np.arange(1.0, 40.0, step), np.arange(1.0, 25.0, step))
    return np.column_stack([gx.ravel(), gy.ravel()])


def readings(xy: Array, noise: float, seed: int = 0, level: float = -38.0) -> Array:
    squared = ((xy[:, None] - TRUE) ** 2).sum(axis=2) + 4.0
    rssi = level - 13.0 * np.log10(squared)
    rssi += np.random.default_rng(seed).normal(0.0, noise, rssi.shape)
    return np.where(rssi > -88.0, rssi, np.nan)


def survey(xy: Array, rssi: Array, floor: int = 0) -> Survey:
    return Survey.from_dense(rssi, xy, np.full(len(xy), floor), ("0", "1"))


def off(one: Survey, parameters: EstimationParameters | None = None) -> Array:
    found = estimate_places(one, parameters)
    return np.asarray(np.hypot(*(found.xy - TRUE[one.columns(found.bssid)]).T))


def test_places_of_a_clean_survey_are_found() -> None:
    assert off(survey(lattice(), readings(lattice(), 0.1))).max() < 1.2


def test_places_are_found_through_shadowing_and_the_deviation_says_how_well() -> None:
    errors, sigmas = [], []
    for seed in range(2):
        one = survey(lattice(), readings(lattice(), 5.0, seed))
        errors.append(off(one))
        found = estimate_places(one)
        assert found.is_estimated
        assert found.sigma is not None
        sigmas.append(found.sigma)
    error, sigma = np.concatenate(errors), np.concatenate(sigmas)
    assert np.median(error) < 2.0
    assert (
        0.2 < np.sqrt(np.mean((error / sigma) ** 2) / 2.0) < 1.0
    )  # made for errors that go together: careful here
    poor = estimate_places(survey(lattice(6.0), readings(lattice(6.0), 5.0)))
    assert poor.sigma is not None
    assert np.median(poor.sigma) > 1.3 * np.median(sigma)


def test_a_few_false_readings_hardly_matter() -> None:
    rssi = readings(lattice(), 2.0)
    drawn = np.random.default_rng(1)
    spoilt = np.where(drawn.uniform(size=rssi.shape) < 0.03, drawn.uniform(-85.0, -60.0, rssi.shape), rssi)
    assert np.median(off(survey(lattice(), spoilt))) < np.median(off(survey(lattice(), rssi))) + 0.7


def test_it_stands_where_it_is_loudest_and_the_other_floor_has_no_say() -> None:
    both = np.concatenate([lattice(), lattice()])
    loud = readings(lattice(), 1.0)
    rssi = np.concatenate([loud[::-1] - 20.0, loud])  # the faint copy is mirrored
    floor = np.repeat([0, 1], len(lattice()))
    found = estimate_places(Survey.from_dense(rssi, both, floor, ("0", "1")))
    assert set(found.floor.tolist()) == {1}
    alone = estimate_places(survey(lattice(), loud, 1))
    np.testing.assert_array_equal(found.xy, alone.xy)


def test_standing_long_in_one_spot_counts_once() -> None:
    xy, rssi = lattice(), readings(lattice(), 3.0)
    spot = np.repeat(np.arange(5), 60)
    longer = survey(np.concatenate([xy, xy[spot]]), np.concatenate([rssi, rssi[spot]]))
    np.testing.assert_allclose(estimate_places(longer).xy, estimate_places(survey(xy, rssi)).xy, atol=1e-6)


def test_too_few_places_give_none() -> None:
    xy, rssi = lattice(), readings(lattice(), 1.0)
    rssi[:, 0] = np.nan
    rssi[:7, 0] = -50.0
    one = survey(xy, rssi)
    assert one.bssid[0] not in estimate_places(one).bssid
    assert one.bssid[0] in estimate_places(one, EstimationParameters(min_places=4)).bssid
    with pytest.raises(RadioMapError, match="larger survey"):
        estimate_places(survey(xy[:5], rssi[:5]))
    with pytest.raises(ConfigError, match="min_places"):
        EstimationParameters(min_places=3)
    with pytest.raises(ConfigError, match="positive"):
        EstimationParameters(cell=0.0)


def test_the_order_of_the_fingerprints_does_not_matter() -> None:
    xy, rssi = lattice(), readings(lattice(), 3.0)
    shuffled = np.random.default_rng(2).permutation(len(xy))
    np.testing.assert_allclose(
        estimate_places(survey(xy[shuffled], rssi[shuffled])).xy,
        estimate_places(survey(xy, rssi)).xy,
        atol=1e-6,
    )


@pytest.mark.real_data
def test_access_points_of_a_real_building(data_root: Path) -> None:
    root = data_root / "sodindoorloc"
    if not (root / WORKBOOK).is_file():
        pytest.skip("REAL DATA ABSENT: no sodindoorloc; fetch with `wayfuse datasets fetch sodindoorloc`")
    table = read(root / "CETC331" / "Training_CETC331.csv")
    levels, floor = np.unique(table.floor, return_inverse=True)
    names = tuple(map(str, levels))
    found = estimate_places(Survey.from_dense(table.rssi, table.xy, floor, names, bssid=table.bssid))
    placed = {ap.column_24: ap for ap in read_places(root / WORKBOOK, "CETC331")}
    mine = [k for k, number in enumerate(found.bssid.tolist()) if number in placed]
    true = [placed[int(found.bssid[k])] for k in mine]
    assert len(mine) > 20
    assert [names[int(found.floor[k])] for k in mine] == [str(ap.floor) for ap in true]
    error = np.hypot(found.x[mine] - [ap.x for ap in true], found.y[mine] - [ap.y for ap in true])
    assert np.median(error) < 4.0  # of storeys of tens of metres
