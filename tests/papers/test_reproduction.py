"""What every reproduction is made of, and the command that prints it."""

from __future__ import annotations

import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from wayfuse.core.errors import UsageError
from wayfuse.evaluation.results_bars import at_most
from wayfuse.papers import reproduction
from wayfuse.papers.reproduction import (
    EXPERIMENTS,
    Interval,
    Reproduction,
    Table,
    mean_interval,
    paper,
    write_pictures,
)


def made_up(limit: float) -> Any:
    def reproduce(seeds: Any, mapper: Any) -> Reproduction:
        errors = list(mapper(float, [1.0 + s for s in seeds], "runs"))
        table = Table(
            "errors", ("row", "paper", "ours"), (("all", 2.0, mean_interval(errors)),), "fitted: none"
        )
        bars = (at_most("mean", limit, sum(errors) / len(errors), "m"),)
        return Reproduction("liu2017", tuple(seeds), (table,), bars, ("row all: 1 of 3 runs",))

    return SimpleNamespace(SEEDS=3, reproduce=reproduce)


def test_the_interval_is_that_of_the_mean() -> None:
    found = mean_interval([1.0, 2.0, 3.0])
    assert (found.value, found.low, found.high) == pytest.approx(
        (2.0, 2.0 - 1.645 / 3**0.5, 2.0 + 1.645 / 3**0.5)
    )
    assert mean_interval([4.0]) == Interval(4.0, 4.0, 4.0)


def test_an_unknown_paper_is_an_error_that_lists_the_known() -> None:
    with pytest.raises(UsageError, match="no paper 'smith2020'.*" + ", ".join(EXPERIMENTS)):
        paper("smith2020")


@pytest.mark.parametrize(("limit", "code"), [(2.0, 0), (1.9, 1)])
def test_the_command_prints_tables_and_bars(
    limit: float, code: int, run_cli: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(reproduction, "paper", lambda _: made_up(limit))
    said = run_cli(
        "reproduce", "liu2017", "--out", str(tmp_path), "--json", str(tmp_path / "x.json"), "--jobs", "1"
    )
    assert said.code == code
    assert "all  2.00   2.00 [1.05, 2.95]" in said.out
    assert f"{1 - code} of 1 bars hold, 3 seeds" in said.out
    assert "lost: row all: 1 of 3 runs" in said.out
    page = (tmp_path / "liu2017.md").read_text(encoding="utf-8")
    assert page.startswith("# liu2017")
    assert "\n\n## Figures" in page
    assert "| all | 2.00 | 2.00 [1.05, 2.95] |" in page
    (document,) = json.loads((tmp_path / "x.json").read_text(encoding="utf-8"))
    assert document["bars"][0]["met"] is (code == 0)


def test_the_command_writes_the_pictures_of_papers_that_draw(
    run_cli: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def pictures(result: Reproduction, folder: Path) -> list[Path]:
        (folder / "a.png").write_text(f"{len(result.seeds)} seeds")
        return [folder / "a.png"]

    module = made_up(2.0)
    assert write_pictures(module, module.reproduce((0,), lambda f, items, _: map(f, items)), tmp_path) == []
    module.pictures = pictures
    monkeypatch.setattr(reproduction, "paper", lambda _: module)
    said = run_cli("reproduce", "liu2017", "--out", str(tmp_path), "--jobs", "1")
    assert f"written to {tmp_path / 'a.png'}" in said.out
    assert (tmp_path / "a.png").read_text() == "3 seeds"
