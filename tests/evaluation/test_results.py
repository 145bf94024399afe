"""The figures of docs/results.md: folds, pooling of seeds, bars, and what is said where data are missing."""

from __future__ import annotations

import json
import shutil
from itertools import count
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from wayfuse.cli.main import cli
from wayfuse.cli.results_page import page
from wayfuse.core.errors import DataMissingError, UsageError
from wayfuse.evaluation.errors import Scores
from wayfuse.evaluation.intervals import Bootstrap
from wayfuse.evaluation.report import plain
from wayfuse.evaluation.results import SECTIONS, absent, measure
from wayfuse.evaluation.results_bars import at_least, at_most, within
from wayfuse.evaluation.results_folds import FIRST, Folds, gather, share_of, track_fold
from wayfuse.evaluation.results_ms_indoor import DEVELOPMENT, POOLED, measure_ms_indoor
from wayfuse.evaluation.results_pool import comparison, figures, pool
from wayfuse.evaluation.results_speed import measure_speed
from wayfuse.simulator.demo import write_demo
from wayfuse.simulator.scenario import Scenario

DRAW = Bootstrap(200)


def name_of_share(share: int) -> str:
    return next(f"x{k}" for k in count() if share_of(f"x{k}") == share)


@pytest.fixture(scope="module")
def plans(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A simulated site in the layout of the public one: plans and recordings side by side."""
    folder = tmp_path_factory.mktemp("site")
    scenario = Scenario(survey_walks=4, test_walks=2, duration_s=(20.0, 25.0))
    files = write_demo(folder, 3, scenario)
    for path in (*files.survey, *files.walks):
        target = files.site / path.parent.name / "path_data_files"
        target.mkdir(exist_ok=True)
        shutil.copy(path, target / path.name)
    extra = files.site / "F1" / "path_data_files"
    shutil.copy(files.walks[0], extra / f"{name_of_share(0)}.txt")
    shutil.copy(files.survey[0], extra / f"{name_of_share(2)}.txt")
    shutil.copy(files.survey[1], extra / f"{name_of_share(3)}.txt")
    return files.site


@pytest.fixture(scope="module")
def folds(plans: Path) -> Folds:
    return gather(plans, (1, 2))


@pytest.fixture(scope="module")
def scores(folds: Folds) -> list[Scores]:
    return [track_fold(folds, fold, ("fused", "nnss", "pdr"), (0, 1)) for fold in (1, 2)]


def test_folds_keep_tracked_and_surveyed_walks_apart(folds: Folds, plans: Path) -> None:
    assert folds.n_read == len(list(plans.rglob("*.txt"))) - 1
    for fold, survey in folds.surveys.items():
        assert {share_of(r.name) for r in folds.of(fold)} == {fold}
        assert {share_of(name) for name in survey.walks}.isdisjoint({0, fold})
    assert {share_of(name) for name in folds.surveys[2].walks} >= {1, 3}
    assert len(folds.surveys[1].walks) == folds.n_read - len(folds.paths[1])


def test_a_fold_without_walks_is_missing_data(plans: Path, tmp_path: Path) -> None:
    folder = tmp_path / "site"
    shutil.copytree(plans, folder, ignore=lambda _, names: [n for n in names if share_of(Path(n).stem) == 1
                                                            and n.endswith(".txt")])  # fmt: skip
    with pytest.raises(DataMissingError, match="share 1"):
        gather(folder, (1,))


def test_seeds_are_pooled_and_counted_once(scores: list[Scores]) -> None:
    pooled = pool(scores)
    assert {name: len(p.seeds) for name, p in pooled.items()} == {"fused": 2, "nnss": 1, "pdr": 1}
    found = figures(pooled["fused"], "1hz", DRAW)
    each = [
        np.concatenate([s.method(f"fused#{seed}").points["1hz"].used().error for s in scores])
        for seed in (0, 1)
    ]
    assert found["mean_by_seed"] == pytest.approx([e.mean() for e in each])
    assert found["figures"]["mean"]["value"] == pytest.approx(np.concatenate(each).mean())
    assert found["n"] == len(each[0])
    assert found["n_walks"] == sum(len(s.walks) for s in scores)
    assert each[0].tolist() != each[1].tolist()


def test_comparisons_pair_seed_with_seed(scores: list[Scores]) -> None:
    pooled = pool(scores)
    same = comparison(pooled["fused"], pooled["fused"], DRAW)
    assert same["difference"]["mean"] == {"value": 0.0, "low": 0.0, "high": 0.0}
    other = comparison(pooled["fused"], pooled["nnss"], DRAW)
    means = [np.mean(pooled[name].joined("1hz").error) for name in ("fused", "nnss")]
    assert other["difference"]["mean"]["value"] == pytest.approx(means[0] - means[1])
    assert other["reduction"]["mean"]["value"] == pytest.approx(1 - means[0] / means[1])


def test_all_figures_become_a_page(folds: Folds) -> None:
    methods = ("fused", "fused --lag 5", FIRST, "fused-barriers", "random-walk", "nnss", "pdr")
    section = {"measured": True, **plain(measure_ms_indoor(folds, methods, (0, 1), DRAW))}
    json.dumps(section, allow_nan=False)
    assert list(section["figures"]) == [DEVELOPMENT, "fold 2", POOLED]
    assert list(section["figures"][POOLED]["waypoints"]) == list(methods)
    assert len(section["bars"]) == 11
    above = next(b for b in section["bars"] if "first release" in b["what"] and POOLED in b["what"])
    against = next(c for c in section["comparisons"][POOLED] if c["baseline"] == FIRST)
    assert above["value"] == against["difference"]["mean"]["low"]
    assert above["met"] == (above["value"] <= 0.0)
    text = page({"ms-indoor": section}, "1.2.3", "2000-01-01")
    assert "wayfuse 1.2.3 on 2000-01-01" in text
    assert "nan" not in text
    assert "None" not in text
    mean = section["figures"][DEVELOPMENT]["1hz"]["fused"]["figures"]["mean"]["value"]
    assert f"| fused | 2, {section['figures'][DEVELOPMENT]['1hz']['fused']['n']} | {mean:.2f} [" in text
    rows = [line for line in text.splitlines() if line.startswith("|")]
    blocks = text.split("\n\n")
    tables = [block.splitlines() for block in blocks if block.startswith("|")]
    assert all(len({line.count(" | ") for line in table}) == 1 for table in tables)
    assert len(rows) == sum(map(len, tables))


def test_the_same_run_gives_the_same_figures(folds: Folds) -> None:
    first, second = (measure_ms_indoor(folds, ("fused", "nnss"), (0,), DRAW) for _ in range(2))
    assert plain(first) == plain(second)


def test_speed_is_clock_time_by_length_of_the_walks(folds: Folds) -> None:
    ticks = count()
    section = measure_speed(folds, 1, repeats=3, clock=lambda: float(next(ticks)), methods=("fused",))
    seconds = sum(r.span[1] - r.span[0] for r in folds.of(1))
    expected = pytest.approx(1000.0 / seconds)
    assert section["cpu_ms_per_s"]["fused"]["run"] == {"least": expected, "median": expected}
    assert section["cpu_ms_per_s"]["fused"]["read_and_run"]["least"] == expected
    assert not section["bars"][0]["met"]
    assert "fused" in page({"speed": {"measured": True, **section}}, "1")


def test_bars_hold_at_their_bound_and_never_for_the_unknown() -> None:
    nan = float("nan")
    assert at_most("a", 2.0, 2.0, "m").met
    assert not at_most("a", 2.0, 2.0, "m", strict=True).met
    assert at_least("a", 0.3, 0.3, "%", low=0.01).met
    assert not at_least("a", 0.3, 0.4, "%", low=-0.01).met
    assert within("a", 0.9, 0.98, 0.9, "%").met
    assert not within("a", 0.9, 0.98, 0.99, "%").met
    bars = (at_most("a", 1, nan, "m"), at_least("a", 1, nan, "m"), within("a", 0, 1, nan, "m"))
    assert not any(bar.met for bar in bars)
    assert at_least("a", 0.3, 1.0, "%", low=nan).met is False


def test_missing_data_are_said_loudly_and_nothing_is_measured(tmp_path: Path) -> None:
    out, figures_file = tmp_path / "results.md", tmp_path / "results.json"
    done = CliRunner().invoke(
        cli, ["results", "--data", str(tmp_path), "--out", str(out), "--json", str(figures_file)]
    )
    assert done.exit_code == 1
    text = out.read_text()
    assert text.count("NOT MEASURED: all files of the data set") == len(SECTIONS)
    sections = json.loads(figures_file.read_text())["sections"]
    assert all(set(section) == {"measured", "why"} for section in sections.values())
    assert all(f"NOT MEASURED: {name}" in done.output for name in SECTIONS)


def test_a_data_set_that_is_not_whole_is_not_measured(tmp_path: Path) -> None:
    place = tmp_path / "oxford-steps"
    for line in ("a.csv",):
        (place / line).parent.mkdir(parents=True, exist_ok=True)
        (place / line).write_text("1,2,3,4,5\n")
    assert "all files" in absent("oxford-steps", tmp_path)
    assert measure(tmp_path, ["oxford-steps"])["oxford-steps"]["measured"] is False


def test_an_unknown_section_is_an_error_of_use(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="no section 'speeed'"):
        measure(tmp_path, ["speeed"])


@pytest.mark.real_data
def test_step_counts_hold_their_bars(data_root: Path) -> None:
    if absent("oxford-steps", data_root):
        pytest.skip(f"REAL DATA ABSENT: {absent('oxford-steps', data_root)}")
    section = measure(data_root, ["oxford-steps"])["oxford-steps"]
    assert all(bar["met"] for bar in section["bars"])
    assert "| all |" in page({"oxford-steps": section}, "1")
