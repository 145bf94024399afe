"""The bars for behaviours on ipin2023-track3 and the walks of HCU Hamburg."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from wayfuse.evaluation.behaviours import (
    TrueMovement,
    detect,
    ipin2023_labels,
    match,
    score_behaviours,
    score_standing,
    true_movements,
)
from wayfuse.inertial.front_end import InertialFrontEnd
from wayfuse.inertial.vertical import Behaviour, VerticalEvent
from wayfuse.inertial.vertical_front_end import VerticalConfig, VerticalFrontEnd
from wayfuse.sensors.recording import Recording, Series

STAIRS, LIFT = Behaviour.STAIRS, Behaviour.LIFT
pytestmark = pytest.mark.real_data


@pytest.fixture(scope="module")
def logs(data_root: Path) -> Path:
    folder = data_root / "ipin2023-track3" / "logs"
    if not folder.is_dir():
        pytest.skip(
            f"REAL DATA ABSENT: no folder {folder}; fetch with `wayfuse datasets fetch ipin2023-track3`"
        )
    return folder


@pytest.fixture(scope="module")
def recordings(logs: Path, read_log) -> list[Recording]:
    return [read_log(path) for path in sorted(logs.glob("*.txt"))]


@pytest.fixture(scope="module")
def connectors(logs: Path, read_log) -> list[Recording]:
    return [read_log(path) for path in sorted(logs.glob("*Trial5*.txt"))]


def hcu(data_root: Path, name: str) -> Recording:
    folder = data_root / "maps" / "hcu_ipin21" / "SensorLog" / name
    if not folder.is_dir():
        pytest.skip(f"REAL DATA ABSENT: no folder {folder}; fetch with `wayfuse datasets fetch maps`")
    columns = {f: np.loadtxt(folder / f"{f}.csv", ndmin=2) for f in ("acc", "gyr", "bar", "mag")}
    start = columns["acc"][0, 0]
    series = {
        f: Series((c[:, 0] - start) / 1000.0, np.ascontiguousarray(c[:, 1:])) for f, c in columns.items()
    }
    return Recording(
        name,
        acceleration=series["acc"],
        rotation_rate=series["gyr"],
        magnetic_field=series["mag"],
        pressure=series["bar"],
    )


@pytest.mark.slow
@pytest.mark.parametrize("use_pressure", [True, False])
def test_the_bars_over_all_recordings(recordings, use_pressure):
    score = score_behaviours(recordings, ipin2023_labels(recordings), use_pressure)
    assert (score.count(STAIRS), score.count(LIFT)) == (12, 4)
    assert score.false_alarms_per_hour <= 0.5
    if use_pressure:
        assert score.n_right() == 16
        assert np.median(score.declared_after) <= 6.0
        assert np.median(score.over_after) <= 4.0
    else:
        assert score.n_signed(LIFT) >= 3
        assert score.n_wrong_sign(LIFT) == 0
        assert score.n_signed(STAIRS) >= 10
        assert np.median(score.declared_after) <= 4.0
        assert np.median(score.over_after) <= 5.0


@pytest.mark.slow
def test_accelerations_alone_find_the_lifts_and_nothing_else(recordings):
    """Without barometer and gyroscope; stairs are not looked for."""
    found, n_false = [], 0
    labels = ipin2023_labels(recordings)
    for r in recordings:
        bare = replace(r, rotation_rate=Series.empty(3), pressure=Series.empty(1))
        truths = true_movements(r, LIFT) if labels.get(r.name) == LIFT else ()
        scored, false = match(r.name, truths, detect(bare, VerticalConfig())[1])
        found += scored
        n_false += len(false)
    assert len(found) == 4
    assert sum(m.is_right for m in found) >= 3
    assert not any(m.is_wrong_sign for m in found)
    assert n_false <= 1


@pytest.mark.slow
def test_standing_is_told_from_walking(recordings):
    score = score_standing(recordings)
    assert score.standing > 600.0
    assert score.walking > 1000.0
    assert score.standing_found >= 0.9
    assert score.walking_called_standing <= 0.02


def test_rises_agree_with_the_floors(connectors):
    """Floors lie 0, -1, -2 with -1 a mezzanine: rises of both ways between two floors agree."""
    score = score_behaviours(connectors, ipin2023_labels(connectors))
    lifts = np.array([abs(m.rise) for m in score.movements if m.truth.behaviour == LIFT])
    assert np.all(np.abs(lifts - 5.9) < 0.5)
    assert all(m.rise * m.truth.sign > 1.5 for m in score.movements)


@pytest.mark.parametrize("use_pressure", [True, False])
def test_hcu_climbs_and_rides_to_the_fourth_floor(data_root, use_pressure):
    """Elevations of the set: ground 1.3 m, first floor 7.6 m, fourth 19.6 m."""
    _, events = detect(hcu(data_root, "Zero2fourExperiment"), VerticalConfig(use_pressure=use_pressure))
    stairs, lift = (e for e in events if e.is_over)
    assert (stairs.behaviour, lift.behaviour) == (STAIRS, LIFT)
    assert 4.0 < stairs.rise < 6.5
    assert 28 <= stairs.n_steps <= 42
    assert 11.0 < lift.rise < 14.0
    assert (lift.n_steps, lift.has_pressure) == (0, use_pressure)


@pytest.mark.parametrize("use_pressure", [True, False])
def test_hcu_walks_an_eight_on_the_level(data_root, use_pressure):
    assert detect(hcu(data_root, "EightExperiment"), VerticalConfig(use_pressure=use_pressure))[1] == []


@pytest.mark.parametrize("use_pressure", [True, False])
def test_records_one_by_one_give_the_same_on_a_real_walk(connectors, use_pressure):
    r = connectors[-1]
    inertial, vertical = InertialFrontEnd(), VerticalFrontEnd(VerticalConfig(use_pressure=use_pressure))
    _, steps = inertial.run(inertial.init(), r, stop=120.0)
    expected_state, expected = vertical.run(vertical.init(), r, steps, stop=120.0)
    a, b, events = inertial.init(), vertical.init(), []
    for record in r.records():
        if record.t > 120.0:
            break
        a, step = inertial.step(a, record)
        b, event = vertical.step(b, record)
        events.append(event)
        if step is not None:
            b, event = vertical.on_step(b, step)
            events.append(event)
    found = [e for e in events if e is not None]
    assert len(found) > 5
    assert np.array_equal(np.array(found), np.array(expected), equal_nan=True)
    assert np.array_equal(b.memory, expected_state.memory, equal_nan=True)


def test_the_matching_rule():
    truths = [TrueMovement(STAIRS, 1, 10.0, 20.0), TrueMovement(LIFT, -1, 40.0, 60.0)]

    def movement(began: float, ended: float, behaviour: Behaviour, rise: float) -> list[VerticalEvent]:
        base = VerticalEvent(began + 5, began, behaviour, rise / 2, 0.4, 0, False, np.nan, True)
        return [base, base._replace(t=ended + 3, rise=rise, is_over=True, ended=ended)]

    events = [
        *movement(9.0, 14.0, STAIRS, 1.5),
        *movement(15.0, 22.0, STAIRS, 1.4),
        *movement(25.0, 30.0, STAIRS, 2.0),
        *movement(50.0, 58.0, LIFT, 3.0),
    ]
    scored, false = match("x", truths, events)
    assert [len(m.found) for m in scored] == [2, 1]
    assert [m.is_right for m in scored] == [True, False]
    assert [m.is_wrong_sign for m in scored] == [False, True]
    assert [(f.first.began, f.last.ended) for f in false] == [(25.0, 30.0)]
