"""The last table: the five published systems and ``fused`` on the same walks, real and simulated."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from wayfuse.core.errors import DataMissingError, MapError
from wayfuse.evaluation import results_folds, results_repetitions
from wayfuse.evaluation.errors import PointErrors, summarise
from wayfuse.evaluation.intervals import Bootstrap, error_intervals
from wayfuse.evaluation.results_bars import Bar, at_most
from wayfuse.evaluation.results_folds import Mapper
from wayfuse.evaluation.results_pool import Pooled
from wayfuse.formats.datasets import data_root
from wayfuse.papers.comparison_runs import Group, can_enter, run_groups, simulated_group
from wayfuse.papers.reproduction import Reproduction, Table
from wayfuse.papers.wifi_rtt_groups import TEST, walk_groups
from wayfuse.presets.catalogue import METHODS, PAPERS

__all__ = ["ROWS", "SEEDS", "reproduce"]

SEEDS = 3  # of the random numbers of the filters; walks are what intervals are drawn over
ROWS = ("fused", "fused-ranges", *PAPERS, "wknn", "pdr")
_OURS = ("fused", "fused-ranges")
_DEVELOPMENT = 1  # the fold of ms-indoor that parameters may be chosen on
_WORLDS = (0, 1, 2)  # seeds of the simulated worlds
_DRAW = Bootstrap()


@dataclass(frozen=True, slots=True)
class _Column:
    """A set of walks: what it is called, how to read it, and what the reader should know."""

    name: str
    groups: Callable[[Path, Mapper], list[Group]]
    note: str


def reproduce(seeds: Sequence[int], mapper: Mapper) -> Reproduction:
    """Track all walks of all columns by every method that finds its inputs there."""
    cells: dict[str, dict[str, str]] = {name: {} for name in ROWS}
    bars: list[Bar] = []
    notes: list[str] = []
    for column in _COLUMNS:
        try:
            groups = column.groups(data_root(), mapper)
        except (DataMissingError, MapError) as error:
            notes.append(f"{column.name}: not measured, {error}.")
            continue
        methods = [name for name in ROWS if can_enter(name, groups)]
        found = run_groups(groups, methods, seeds, mapper, column.name)
        n_walks = sum(len(group.recordings) for group in groups)
        notes.append(f"{column.name}: {n_walks} walks; {column.note}.")
        means = {}
        for name, pooled in found.items():
            means[name], cells[name][column.name] = _cell(pooled)
        bars += _bars(column.name, means)
    names = [column.name for column in _COLUMNS if any(column.name in row for row in cells.values())]
    rows = tuple((name, *(cells[name].get(column, "-") for column in names)) for name in ROWS if cells[name])
    note = (
        "Mean error (m) at the waypoints with the 90 % interval over walks, and how often the floor is right. "
        "-: lacks what it needs there. pdr is told its start, nobody else is. " + " ".join(notes)
    )
    table = Table("All systems on the same walks", ("system", *names), rows, note)
    return Reproduction("comparison", tuple(seeds), (table,), tuple(bars))


def _cell(pooled: Pooled) -> tuple[float, str]:
    points = pooled.joined("waypoints")
    mean = error_intervals(points, _DRAW)["mean"]
    return mean.value, f"{mean.value:.2f} [{mean.low:.2f}, {mean.high:.2f}], {_floors(points)}"


def _floors(points: PointErrors) -> str:
    share = summarise(points).floor_accuracy
    return "floor not known" if not np.isfinite(share) else f"{100.0 * share:.0f} %"


def _bars(column: str, means: Mapping[str, float]) -> list[Bar]:
    """The better of ours against the best published system of a column."""
    ours = {name: means[name] for name in _OURS if name in means}
    others = {name: means[name] for name in PAPERS if name in means}
    if not ours or not others:
        return []
    best, rival = min(ours, key=ours.__getitem__), min(others, key=others.__getitem__)
    return [at_most(f"{column}: {best} against {rival}", others[rival], ours[best], "m")]


def _scenario(name: str) -> Callable[[Path, Mapper], list[Group]]:
    """The worlds of a scenario that comes with wayfuse, one for each seed of `_WORLDS`."""

    def groups(_root: Path, mapper: Mapper) -> list[Group]:
        return [simulated_group(name, seed, mapper) for seed in _WORLDS]

    return groups


def _ms_indoor(root: Path, mapper: Mapper) -> list[Group]:
    folds = results_folds.gather(root / "ms-indoor" / "site1", (_DEVELOPMENT,), mapper)
    return [Group(folds.site, folds.surveys[_DEVELOPMENT], tuple(folds.of(_DEVELOPMENT)))]


def _ipin2023(root: Path, mapper: Mapper) -> list[Group]:
    all_of = results_repetitions.gather(root / "ipin2023-track3" / "logs", mapper)
    return [Group(all_of.site, all_of.survey(k), tuple(all_of.of(k))) for k in all_of.numbers]


def _wifi_rtt(root: Path, _mapper: Mapper) -> list[Group]:
    return walk_groups(root / "wifi-rtt", TEST)


_COLUMNS = (
    _Column(
        "ms-indoor, development split",
        _ms_indoor,
        "survey of the other walks; places of access points estimated from it",
    ),
    _Column(
        "ipin2023-track3",
        _ipin2023,
        "one repetition left out of the survey in turn; places of access points estimated from the survey",
    ),
    _Column(
        "wifi-rtt, test loops",
        _wifi_rtt,
        "real ranges by round-trip time as measured, no line told; places of anchors known; no plan, an open floor",
    ),
    *(
        _Column(name, _scenario(name), f"simulated, worlds of seeds {', '.join(map(str, _WORLDS))}; {what}")
        for name, what in (
            ("house-two-phones", "three floors; places of access points known"),
            ("throttled-phone", "a scan every half minute; places of access points known"),
            ("moved-access-points", "after the survey; places of access points known, as they are now"),
            ("warehouse-rtt", "ranges by round-trip time; places of anchors known"),
        )
    ),
)
assert set(ROWS) <= set(METHODS)  # noqa: S101 (a row is a method)
