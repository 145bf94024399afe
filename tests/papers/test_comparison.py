"""The last table: who may enter a column, and that every method sees the same walks."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from wayfuse.core.errors import DataMissingError
from wayfuse.evaluation.results_folds import in_turn
from wayfuse.papers import comparison
from wayfuse.papers.comparison import _bars, _Column, reproduce
from wayfuse.papers.comparison_runs import Group, can_enter, run_groups, simulated_group
from wayfuse.radio.ap_places import ApPlaces
from wayfuse.sensors.records import Range


@pytest.fixture(scope="module")
def group(world: Any) -> Group:
    return Group(world.site, world.survey, world.walks[:2])


def anchored(group: Group) -> Group:
    one = np.array([1], np.uint64)
    places = ApPlaces(one, np.ones(1), np.ones(1), np.zeros(1, np.int32), np.full(1, np.nan))
    t = group.recordings[0].wifi[0].t
    recordings = tuple(replace(r, ranges=(Range(t, 1, 5.0),)) for r in group.recordings)
    return replace(group, places=places, recordings=recordings)


def test_a_method_enters_where_it_finds_its_inputs(group: Group) -> None:
    for name in ("fused", "wknn", "pdr", "chu2009", "liu2017"):
        assert can_enter(name, [group])
    for name in ("li2015", "fused-ranges"):
        assert not can_enter(name, [group])
        assert can_enter(name, [anchored(group)])
        assert not can_enter(name, [group, anchored(group)])
    bare = replace(group, survey=None)
    assert not can_enter("fused", [bare])
    assert not can_enter("liu2017", [bare])
    deaf = replace(group, recordings=tuple(replace(r, wifi=()) for r in group.recordings))
    assert not can_enter("fused", [deaf])
    assert can_enter("pdr", [deaf])


def test_all_methods_are_scored_on_the_same_walks(group: Group) -> None:
    found = run_groups([group], ("fused", "wknn", "pdr"), (0, 1), in_turn, "test")
    assert set(found) == {"fused", "wknn", "pdr"}
    assert [len(found[name].seeds) for name in ("fused", "wknn", "pdr")] == [2, 1, 1]
    n = {name: len(pooled.used("waypoints")[0]) for name, pooled in found.items()}
    assert n["fused"] == n["wknn"] > 5
    one, other = (p.error for p in found["fused"].used("waypoints"))
    assert not np.array_equal(one, other)


def test_the_bar_takes_our_better_row_and_their_best() -> None:
    (bar,) = _bars("x", {"fused": 2.0, "fused-ranges": 1.0, "chu2009": 3.0, "li2015": 1.5, "wknn": 0.1})
    assert bar.what == "x: fused-ranges against li2015"
    assert (bar.value, bar.met) == (1.0, True)
    (bar,) = _bars("x", {"fused": 2.0, "chu2009": 1.9})
    assert not bar.met
    assert not _bars("x", {"fused": 2.0, "wknn": 1.0})


def test_columns_without_data_are_said_and_left_out(group: Group, monkeypatch: pytest.MonkeyPatch) -> None:
    def missing(*_: Any) -> list[Group]:
        raise DataMissingError("no such folder", where="x")

    columns = (_Column("here", lambda *_: [group], "small"), _Column("gone", missing, "never seen"))
    monkeypatch.setattr(comparison, "_COLUMNS", columns)
    monkeypatch.setattr(comparison, "ROWS", ("fused", "wknn", "li2015", "pdr"))
    result = reproduce((0,), in_turn)
    (table,) = result.tables
    assert table.columns == ("system", "here")
    assert [row[0] for row in table.rows] == ["fused", "wknn", "pdr"]
    assert "gone: not measured" in table.note
    assert "2 walks; small" in table.note
    assert result.bars == ()


@pytest.mark.slow
def test_ranges_make_the_difference_in_a_warehouse() -> None:
    group = simulated_group("warehouse-rtt", 0, in_turn)
    assert group.places is not None
    found = run_groups([group], ("fused", "li2015", "wknn"), (0,), in_turn, "test")
    mean = {name: float(pooled.joined("waypoints").error.mean()) for name, pooled in found.items()}
    assert mean["fused"] < mean["li2015"] < mean["wknn"]
