"""chu2009, chapter 5: the building as drawn, what its sensors tell, and a reduced run of the experiment."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from wayfuse.evaluation.results_folds import in_turn
from wayfuse.inertial.vertical import Behaviour
from wayfuse.maps.site import Site
from wayfuse.papers import chu2009
from wayfuse.papers.chu2009_building import PICTURE, Experiment, reproduce_building, seconds_of, survey_of
from wayfuse.papers.reproduction import Curve, Reproduction, page, write_pictures
from wayfuse.radio.interpolated_map import InterpolatedMap, fit
from wayfuse.simulator.chu2009_building import (
    FLOOR_HEIGHT,
    BuildingModel,
    Radio,
    Walk,
    draw_radio,
    engineering_building,
    walk,
)
from wayfuse.simulator.house_site import site_of
from wayfuse.simulator.passages import RISER


@pytest.fixture(scope="module")
def site() -> Site:
    return site_of(engineering_building())


@pytest.fixture(scope="module")
def radio() -> Radio:
    return draw_radio(engineering_building(), BuildingModel(n_samples=20), np.random.default_rng(1))


@pytest.fixture(scope="module")
def walks(radio: Radio) -> list[Walk]:
    return [walk(radio, np.random.default_rng(seed)) for seed in range(6)]


@pytest.fixture(scope="module")
def radio_map(radio: Radio) -> InterpolatedMap:
    return fit(survey_of(radio))


def test_the_building_is_that_of_chapter_5(site: Site, radio: Radio) -> None:
    assert site.floor_names == ("4", "5", "6")
    assert {(floor.width, floor.height) for floor in site.floors} == {(74.4, 37.2)}
    assert sorted(c.kind.value for c in site.connectors) == ["lift", "stairs", "stairs"]
    assert np.bincount(radio.survey_floor).tolist() == [51, 51, 51]
    for f, floor in enumerate(site.floors):
        assert floor.walkable.contains(*radio.survey_xy[radio.survey_floor == f].T).mean() > 0.95
    assert np.isfinite(radio.samples).sum(axis=2).mean() == pytest.approx(11.0, abs=0.2)


def test_who_walks_a_floor_passes_no_wall(site: Site, walks: list[Walk]) -> None:
    tested = 0
    for w in walks:
        level = np.abs(w.z - FLOOR_HEIGHT * w.floor) < 1e-9
        for f, floor in enumerate(site.floors):
            rows = np.flatnonzero(level[1:] & level[:-1] & (w.floor[1:] == f) & (w.floor[:-1] == f))
            a, b = w.xy[rows], w.xy[rows + 1]
            assert not floor.barrier_index.crosses(a[:, 0], a[:, 1], b[:, 0], b[:, 1]).any()
            tested += len(rows)
    assert tested > 1000
    assert max(np.hypot(*np.diff(w.xy, axis=0).T).max() for w in walks) < 1.3


def test_stairs_and_rides_add_up_to_the_floors_changed(radio: Radio) -> None:
    exact = BuildingModel(n_samples=2, missed=0.0, seconds=600)
    seen = set()
    for seed in range(4):
        w = walk(draw_radio(radio.building, exact, np.random.default_rng(0)), np.random.default_rng(seed))
        level = np.flatnonzero(np.abs(w.z - FLOOR_HEIGHT * w.floor) < 1e-9)
        first, last = int(level[0]), int(level[-1])
        between = slice(first + 1, last + 1)
        risen = RISER * w.stairs[between].sum() + FLOOR_HEIGHT * w.stops[between].sum()
        assert risen == pytest.approx(w.z[last] - w.z[first], abs=2.5 * RISER)
        seen |= {bool(w.stairs.any()), bool(w.rides.any()) and "lift"}
    assert {True, "lift"} <= seen


def test_the_filter_is_told_displacements_on_floors_and_reports_between(
    walks: list[Walk], radio_map: InterpolatedMap
) -> None:
    kinds = set()
    for w in walks:
        seconds = seconds_of(w, radio_map)
        assert len(seconds) == len(w.xy)
        for t, second in enumerate(seconds):
            assert second.scan is not None
            assert len(second.scan.bssid) == np.isfinite(w.levels[t]).sum()
            assert not (second.vertical and second.step is not None)
            assert not (w.on_stairs[t] and second.step is not None)
            for event in second.vertical:
                kinds.add((event.behaviour, event.is_over))
                assert event.began <= event.t == t
    assert {(Behaviour.STAIRS, True), (Behaviour.STAIRS, False), (Behaviour.LIFT, True)} <= kinds
    silent = np.zeros(len(walks[0].xy), bool)
    silent[10:20] = True
    gone = seconds_of(walks[0], radio_map, silent)
    assert all((s.step, s.vertical, s.scan) == (None, (), None) for s in gone[10:20])
    assert gone[20].scan is not None


@pytest.fixture(scope="module")
def result() -> Reproduction:
    return reproduce_building((0, 1, 2), in_turn, Experiment(seconds=240))


@pytest.mark.slow
def test_sensors_and_walls_help_and_lost_tracks_come_back(result: Reproduction) -> None:
    rows = {str(row[0]): row for row in result.tables[0].rows}
    mean = {name: row[2].value for name, row in rows.items()}  # type: ignore[union-attr]
    assert mean["PFMM"] < mean["PF_MCL"] < mean["NNSS"]
    for table in result.tables[1:]:
        back = {str(row[0]): [float(str(cell).split()[0]) for cell in row[1:4]] for row in table.rows}
        assert back["PFMM with recovery"][1] == 100.0
        assert back["PFMM"][0] < back["PFMM with recovery"][0]
        assert all(a <= b for a, b in zip(back["PFMM"], back["PFMM"][1:], strict=False))


@pytest.mark.slow
def test_every_curve_is_a_growing_share(result: Reproduction) -> None:
    assert len(result.curves) == 6
    for curve in result.curves:
        assert len(curve.x) == len(curve.y) == 121
        assert all(0.0 <= a <= b <= 1.0 for a, b in zip(curve.y, curve.y[1:], strict=False))


def test_the_picture_is_drawn_from_the_curves(tmp_path: Path) -> None:
    curves = tuple(
        Curve(PICTURE, panel, label, (0.0, 1.0, 2.0), (0.0, 0.5, 1.0))
        for panel in ("a wrong floor", "silence")
        for label in ("with", "without")
    )
    (file,) = write_pictures(chu2009, Reproduction("chu2009", (0,), (), (), (), curves), tmp_path)
    assert file == tmp_path / PICTURE
    assert file.read_bytes()[:4] == b"\x89PNG"
    assert f"({PICTURE})" in page("chu2009")
