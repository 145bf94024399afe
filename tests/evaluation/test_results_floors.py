"""The sections of docs/results.md on buildings of several floors."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from wayfuse.cli.results_page import page
from wayfuse.core.errors import DataMissingError
from wayfuse.evaluation.intervals import Bootstrap
from wayfuse.evaluation.report import plain
from wayfuse.evaluation.results import absent, measure
from wayfuse.evaluation.results_ipin2023 import ALL, CONNECTORS, SINGLE, measure_ipin2023, of_walks
from wayfuse.evaluation.results_pool import paired, pool
from wayfuse.evaluation.results_repetitions import Repetitions, end_shift, gather, key_of, track
from wayfuse.models.survey_walk import survey_walk

DRAW = Bootstrap(100)
NAMES = ("Trial01_repetition01", "Trial01_repetition02", "Trial02_repetition02", "Trial51_repetition01")


@pytest.fixture(scope="module")
def repetitions(world: Any) -> Repetitions:
    """Four simulated walks as trials and repetitions; the last one is said to change floors."""
    recordings = tuple(replace(r, name=name) for r, name in zip(world.walks, NAMES, strict=True))
    walks = [survey_walk(world.site, r)[0] for r in recordings]
    return Repetitions(world.site, recordings, tuple(w for w in walks if w is not None))


def test_a_survey_is_made_once(repetitions: Repetitions) -> None:
    assert repetitions.survey(1) is repetitions.survey(1)
    assert len({id(repetitions.survey(*key)) for key in ((1, 0), (1, 2), (2, 0))}) == 3


def test_names_tell_trial_and_repetition() -> None:
    assert key_of("IPIN2023_T3_TrainingTrial27_repetition03") == (27, 3)
    assert [key_of(name).changes_floors for name in NAMES] == [False, False, False, True]
    with pytest.raises(DataMissingError, match="no trial"):
        key_of("walk")


def test_the_survey_leaves_the_repetition_and_off_route_the_trial_out(repetitions: Repetitions) -> None:
    assert repetitions.numbers == (1, 2)
    assert set(repetitions.survey(1).walks) == set(NAMES[1:3])
    assert set(repetitions.survey(1, without_trial=1).walks) == {NAMES[2]}
    assert set(repetitions.survey(2).walks) == {NAMES[0], NAMES[3]}


def test_each_recording_is_tracked_once_for_each_seed(repetitions: Repetitions) -> None:
    on = track(repetitions, ("fused", "wknn"), (0, 1))
    assert sorted(t.walk for t in on.tracks) == sorted(NAMES * 3)
    assert {t.method for t in on.tracks} == {"fused#0", "fused#1", "wknn#0"}
    assert len(on.scores) == 2
    off = track(repetitions, ("wknn",), (0,), off_route=True)
    assert {t.walk for t in off.tracks} == set(NAMES[:3])
    assert len(off.scores) == 3
    assert all(len(s.walks) == 1 for s in off.scores)


def test_the_section_becomes_a_page(repetitions: Repetitions) -> None:
    found = measure_ipin2023(
        repetitions, ("fused", "fused-no-barometer", "wknn"), ("fused", "wknn"), (0, 1), DRAW
    )
    section = {"measured": True, **plain(found)}
    json.dumps(section, allow_nan=False)
    assert list(section["figures"]) == [ALL, SINGLE, CONNECTORS]
    walks = [
        section["figures"][group]["waypoints"]["fused"]["n_walks"] for group in (ALL, SINGLE, CONNECTORS)
    ]
    assert walks == [4, 3, 1]
    n = [section["figures"][group]["1hz"]["wknn"]["n"] for group in (ALL, SINGLE, CONNECTORS)]
    assert n[0] == n[1] + n[2]
    assert len(section["bars"]) == 10
    assert section["changes"]["fused"]["level_runs"] == 6
    text = page({"ipin2023": section}, "1")
    assert "nan" not in text
    assert "None" not in text
    tables = [block.splitlines() for block in text.split("\n\n") if block.startswith("|")]
    assert len(tables) == 15
    assert all(len({line.count(" | ") for line in block}) == 1 for block in tables)


def test_walks_are_selected_with_all_seeds(repetitions: Repetitions) -> None:
    scores = track(repetitions, ("fused", "wknn"), (0, 1)).scores
    pooled = pool(scores)
    names = [walk for s in scores for walk in s.walks]
    wanted = np.array([name == NAMES[2] for name in names])
    only = of_walks(pooled["fused"], wanted)
    for seed, whole in zip(only.seeds, pooled["fused"].seeds, strict=True):
        rows = whole["waypoints"].walk == names.index(NAMES[2])
        assert seed["waypoints"].error.tolist() == whole["waypoints"].error[rows].tolist()
    a, b = paired(only, of_walks(pooled["wknn"], wanted), "waypoints")
    assert len(a) == len(b) == sum(len(p) for p in only.used("waypoints")) > 0
    assert np.unique(a.t).size == len(a)
    assert a.t.tolist() == b.t.tolist()


def test_the_shift_of_a_phone_that_hears_less_is_found(repetitions: Repetitions) -> None:
    survey = repetitions.survey(2)
    recording = repetitions.of(2)[0]
    deaf = replace(recording, wifi=tuple(replace(s, rssi=s.rssi - 8.0) for s in recording.wifi))
    shift = end_shift(deaf, survey) - end_shift(recording, survey)
    assert shift[0] == pytest.approx(8.0, abs=3.0)


def test_missing_logs_are_said(tmp_path: Path) -> None:
    for name in ("ipin2023", "behaviours", "hcu"):
        section = measure(tmp_path, [name])[name]
        assert section["measured"] is False
        assert "fetch" in section["why"]
    logs = tmp_path / "ipin2023-track3" / "logs"
    logs.mkdir(parents=True)
    (logs / "IPIN2023_T3_TrainingTrial01_repetition01.txt").write_text("%\n")
    assert "38 of 39 files" in absent("ipin2023-track3", tmp_path, "logs/")


def needs(data_root: Path, *parts: tuple[str, str]) -> None:
    for name, below in parts:
        if why := absent(name, data_root, below):
            pytest.skip(f"REAL DATA ABSENT: {why}")


@pytest.mark.real_data
@pytest.mark.slow
def test_the_walk_to_the_fourth_floor_holds_its_bars(data_root: Path) -> None:
    needs(data_root, ("maps", "hcu_ipin21/"))
    section = measure(data_root, ["hcu"])["hcu"]
    assert all(bar["met"] for bar in section["bars"])
    assert "| fused-no-wifi | EG 1OG 4OG |" in page({"hcu": section}, "1")


@pytest.mark.real_data
@pytest.mark.slow
def test_behaviours_hold_their_bars(data_root: Path) -> None:
    needs(data_root, ("ipin2023-track3", "logs/"), ("maps", "hcu_ipin21/"))
    section = measure(data_root, ["behaviours"])["behaviours"]
    assert all(bar["met"] for bar in section["bars"])
    assert "| barometer | lift | 4 of 4 |" in page({"behaviours": section}, "1")


@pytest.mark.real_data
@pytest.mark.slow
def test_stairs_and_lift_of_ipin2023_are_followed(data_root: Path, read_log: Callable[..., Any]) -> None:
    needs(data_root, ("ipin2023-track3", "logs/"))
    repetitions = gather(data_root / "ipin2023-track3" / "logs", lambda _, paths, __: map(read_log, paths))
    section = measure_ipin2023(repetitions, ("fused",), ("wknn",), (0,), DRAW)
    changes = section["changes"]["fused"]
    assert (changes["true"], changes["right"], changes["extra"], changes["invented"]) == (16, 16, 0, 0)
    assert section["figures"][ALL]["waypoints"]["fused"]["figures"]["ipin"]["value"] <= 2.5
