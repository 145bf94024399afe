"""liu2017 and karlsson2015 on real data: absent data are said to be absent; orders that hold on the real ones."""

from __future__ import annotations

import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from wayfuse.evaluation.results_folds import in_turn
from wayfuse.evaluation.results_repetitions import Repetitions, key_of
from wayfuse.formats.reading import read
from wayfuse.inertial.derivative_steps import count_steps
from wayfuse.maps.importers.ipin2023 import import_site
from wayfuse.models.survey_walk import place_of, survey_walk
from wayfuse.papers import karlsson2015_real, liu2017_real
from wayfuse.papers.ipin2023_walks import WalkMethod, fused_beside, measure, steps_alone
from wayfuse.papers.oxford_counts import step_count_table
from wayfuse.papers.sodindoorloc_buildings import read_buildings
from wayfuse.presets import karlsson2015_tracker, liu2017_tracker
from wayfuse.presets.methods import begun_at
from wayfuse.tracking.dead_reckoning import Start


def test_absent_data_are_said_to_be_absent(tmp_path: Path) -> None:
    for paper in (liu2017_real, karlsson2015_real):
        tables = paper.real_tables(tmp_path, in_turn)
        assert len(tables) == 3
        for table in tables:
            assert table.columns == ("not measured",)
            assert "wayfuse datasets fetch" in str(table.rows[0][0])


@pytest.mark.real_data
def test_sequences_on_points_of_known_access_points(data_root: Path) -> None:
    buildings = read_buildings(data_root / "sodindoorloc")
    if not buildings:
        pytest.skip("REAL DATA ABSENT: `wayfuse datasets fetch sodindoorloc`")
    assert [b.name for b in buildings] == ["CETC331", "HCXY", "SYL"]
    errors = liu2017_real.fix_errors(buildings[0])
    assert all(len(of) > 80 for of in errors.values())
    assert 3.0 < errors["sequences"].mean() < 9.0  # a wrong frame or column gives 15 m and more
    assert errors["fingerprints"].mean() < errors["sequences"].mean()
    placed, sigma = liu2017_real.estimated_places_errors(buildings[0])
    assert np.median(placed) < 4.0
    assert np.all(sigma > 0.0)


@pytest.fixture(scope="module")
def museum(data_root: Path) -> Repetitions:
    """The walks of three trials of ipin2023-track3, one of which changes floors."""
    folder = data_root / "ipin2023-track3" / "logs"
    if not folder.is_dir():
        pytest.skip("REAL DATA ABSENT: `wayfuse datasets fetch ipin2023-track3`")
    site, _ = import_site(folder)
    recordings = tuple(read(p) for p in sorted(folder.glob("*.txt")) if key_of(p.stem).trial in (1, 21, 53))
    walks = (survey_walk(site, recording)[0] for recording in recordings)
    return Repetitions(site, recordings, tuple(walk for walk in walks if walk is not None))


@pytest.mark.real_data
def test_walks_that_stay_on_a_floor_are_tracked_without_their_own_repetition(museum: Repetitions) -> None:
    methods = {"steps": WalkMethod(steps_alone, from_waypoint=True), "fused": WalkMethod(fused_beside)}
    pickle.dumps(methods)  # goes to other processes
    found = measure(museum, methods, (0,), in_turn)
    assert list(found) == ["steps", "fused"]
    for pooled in found.values():
        points = pooled.joined("waypoints")
        assert len(np.unique(points.walk)) == sum(key_of(r.name).trial < 51 for r in museum.recordings)
        assert np.isfinite(points.error).all()
    means = {name: float(pooled.joined("waypoints").error.mean()) for name, pooled in found.items()}
    assert means["fused"] < min(4.0, means["steps"])


@pytest.mark.real_data
@pytest.mark.parametrize("build", [liu2017_tracker.build, karlsson2015_tracker.build])
def test_one_real_walk_from_its_start(museum: Repetitions, build: Any) -> None:
    walk = next(r for r in museum.recordings if key_of(r.name) == (1, 1))
    start = Start(*place_of(museum.site, walk.waypoints[0]))
    tracker = begun_at(build(museum.site, museum.survey(1)), start)
    found = tracker.run(walk).estimates
    t = np.array([e.t for e in found])
    off = []
    for waypoint in walk.waypoints:
        x, y, _ = place_of(museum.site, waypoint)
        last = found[max(int(np.searchsorted(t, waypoint.t, side="right")) - 1, 0)]
        off.append(float(np.hypot(last.x - x, last.y - y)))
    assert len(off) > 5
    assert np.mean(off) < 16.0  # of 124 m x 72 m; guessing is 40 m


@pytest.mark.real_data
def test_steps_of_every_way_to_carry_are_counted(data_root: Path) -> None:
    if not (data_root / "oxford-steps").is_dir():
        pytest.skip("REAL DATA ABSENT: `wayfuse datasets fetch oxford-steps`")
    table = step_count_table(data_root, lambda acceleration: len(count_steps(acceleration)), "")
    rows = {str(row[0]): row for row in table.rows}
    assert int(str(rows["all"][1])) == sum(int(str(row[1])) for row in table.rows) / 2 > 10
    assert float(str(rows["hand"][2]).removesuffix(" %")) < 2.0
    none = step_count_table(data_root, lambda _: 0, "")
    assert all(row[2] == "100.0 %" and row[3] == "-100.0 %" for row in none.rows)
