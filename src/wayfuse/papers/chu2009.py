"""chu2009: chapter 4, the simulated field (Figures 4.2, 4.3, 4.5, 4.6), and chapter 5 (`chu2009_building`)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from wayfuse.core.types import Array
from wayfuse.evaluation.results_bars import Bar, at_most, within
from wayfuse.evaluation.results_folds import Mapper
from wayfuse.maps.walls import WallIndex
from wayfuse.papers.chu2009_building import PICTURE, reproduce_building
from wayfuse.papers.chu2009_building import Experiment as BuildingExperiment
from wayfuse.papers.reproduction import Interval, Reproduction, Table, mean_interval
from wayfuse.presets.chu2009 import Config, nnss, pf_mcl, pfmm
from wayfuse.radio.level_grid import LevelGrid
from wayfuse.simulator.chu2009_world import FieldModel, draw_field, room_walls, walk

__all__ = ["SEEDS", "Experiment", "pictures", "reproduce"]

SEEDS = 20
METHODS = ("NNSS", "PF_MCL", "PFMM")
NOISES = (0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0)
GRAINS = (1.0, 5.0)
AP_COUNTS = (4, 6, 8, 12)
WAFS = (0.0, 2.0, 4.0, 6.0)
ANGLES = (0.0, 10.0, 20.0, 30.0, 45.0)  # degrees
DISTANCES = (0.1, 0.3, 0.5)
_LOST = 20.0  # m: an error over the last minute of a walk that no filter comes back from
_FAST = 5.0  # m/s, Figure 4.6
_FAST_R_MAX = 8.0  # m: PF_MCL has to be able to follow 5 m/s


class Condition(NamedTuple):
    """One setting of a figure: what is other than the defaults, and noise of the sensors (rad, share)."""

    figure: str
    at: float
    model: FieldModel
    angle: float = 0.0
    distance: float = 0.0


def _conditions() -> tuple[Condition, ...]:
    base = FieldModel()
    out = [
        Condition(f"4.3 grain {grain:g}", noise, replace(base, noise=noise, grain=grain))
        for grain in GRAINS
        for noise in NOISES
    ]
    out += [Condition("4.2", float(n), replace(base, n_aps=n)) for n in AP_COUNTS]
    out += [Condition("4.5", waf, replace(base, waf=waf)) for waf in WAFS]
    fast = replace(base, speed=_FAST)
    out += [Condition("4.6 angle", a, fast, angle=np.deg2rad(a)) for a in ANGLES]
    out += [Condition("4.6 distance", d, fast, distance=d) for d in DISTANCES]
    return tuple(out)


class Experiment:
    """Every method on one walk of one condition; travels to the worker processes."""

    def __init__(self, seconds: int = 300) -> None:
        self.seconds = seconds

    def __call__(
        self, item: tuple[Condition, int]
    ) -> tuple[tuple[float, float, float], tuple[bool, bool, bool]]:
        """Mean error (m) of each of `METHODS`, and whether it was lost at the end."""
        condition, seed = item
        model = replace(condition.model, seconds=self.seconds)
        rng = np.random.default_rng([2009, seed])
        field = draw_field(model, rng)
        walked = walk(field, rng)
        grid = LevelGrid(field.levels, model.grain)
        config = Config(kernel_sigma=max(model.noise, 1.0))
        free = replace(config, r_max=_FAST_R_MAX if model.speed > 1.0 else config.r_max)
        moved = _sensed(walked.moved, condition, rng)
        tracks = (
            nnss(grid, walked.levels),
            pf_mcl(grid, walked.levels, free, seed),
            pfmm(grid, walked.levels, moved, WallIndex.build(room_walls()), config, seed),
        )
        errors = [np.hypot(*(track - walked.xy).T) for track in tracks]
        a, b, c = (float(e.mean()) for e in errors)
        x, y, z = (bool(e[-60:].min() > _LOST) for e in errors)
        return (a, b, c), (x, y, z)


def _sensed(moved: Array, condition: Condition, rng: np.random.Generator) -> Array:
    """Displacements as the phone's sensors tell them."""
    turn = condition.angle * rng.standard_normal(len(moved))
    stretch = 1.0 + condition.distance * rng.standard_normal(len(moved))
    c, s = stretch * np.cos(turn), stretch * np.sin(turn)
    return np.column_stack([c * moved[:, 0] - s * moved[:, 1], s * moved[:, 0] + c * moved[:, 1]])


def reproduce(
    seeds: Sequence[int],
    mapper: Mapper,
    experiment: Experiment | None = None,
    building: BuildingExperiment | None = None,
) -> Reproduction:
    """Run every condition of chapter 4, the building and the lost tracks with every seed."""
    conditions = _conditions()
    items = [(condition, seed) for condition in conditions for seed in seeds]
    found = list(mapper(experiment or Experiment(), items, "chu2009"))
    errors: dict[tuple[str, float], Array] = {}
    lost = dict.fromkeys(METHODS, 0)
    n_runs = len(seeds)
    for k, condition in enumerate(conditions):
        part = found[k * n_runs : (k + 1) * n_runs]
        errors[condition.figure, condition.at] = np.array([e for e, _ in part])
        for _, gone in part:
            for method, is_lost in zip(METHODS, gone, strict=True):
                lost[method] += is_lost
    total = len(found)
    said = tuple(f"{method}: {n} of {total} runs ended lost" for method, n in lost.items() if n)
    storeys = reproduce_building(seeds, mapper, building)
    return Reproduction(
        "chu2009",
        tuple(seeds),
        (*_tables(errors), *storeys.tables),
        (*_bars(errors, lost["PFMM"]), *storeys.bars),
        (*said, *storeys.lost),
        storeys.curves,
    )


def pictures(result: Reproduction, folder: Path) -> list[Path]:
    """Draw how soon a lost track is found again; the files written."""
    from wayfuse.evaluation.plot_recovery import Returns, draw_returns

    curves = [c for c in result.curves if c.picture == PICTURE]
    panels = {c.panel: [Returns(d.label, d.x, d.y) for d in curves if d.panel == c.panel] for c in curves}
    return [draw_returns(panels, folder / PICTURE)]


_FIGURES = {
    "4.3 grain 1": ("Figure 4.3, left: noise (dB), grain 1 m", "sigma_f"),
    "4.3 grain 5": ("Figure 4.3, right: noise (dB), grain 5 m", "sigma_f"),
    "4.2": ("Figure 4.2: access points", "APs"),
    "4.5": ("Figure 4.5: wall attenuation (dB)", "WAF"),
    "4.6 angle": ("Figure 4.6: noise of the direction (degrees), 5 m/s", "angle"),
    "4.6 distance": ("Figure 4.6: noise of the distance (share), 5 m/s", "distance"),
}
_SAID = {
    ("4.3 grain 1", 3.0): "PFMM < 3, about NNSS / 2, more than 25 % below PF_MCL",
    ("4.3 grain 5", 3.0): "PFMM < 3, about NNSS / 2, more than 25 % below PF_MCL",
    ("4.2", 12.0): "falls as APs increase",
    ("4.5", 6.0): "falls as WAF increases",
    ("4.6 angle", 30.0): "angle matters more than distance",
}


def _tables(errors: Mapping[tuple[str, float], Array]) -> tuple[Table, ...]:
    out = []
    for figure, (title, symbol) in _FIGURES.items():
        rows: list[tuple[str | float | Interval, ...]] = []
        for (of, at), values in errors.items():
            if of == figure:
                cells = [mean_interval(column) for column in values.T]
                rows.append((f"{at:g}", _SAID.get((of, at), ""), *cells))
        out.append(Table(title, (symbol, "the thesis says", *METHODS), tuple(rows), "Mean errors in metres."))
    return tuple(out)


def _bars(errors: Mapping[tuple[str, float], Array], n_lost: int) -> tuple[Bar, ...]:
    def high(figure: str, at: float, method: int) -> float:
        return mean_interval(errors[figure, at][:, method]).high

    def ratio(figure: str, at: float, of: int) -> float:
        e = errors[figure, at]
        return mean_interval(e[:, 2]).high / float(e[:, of].mean())

    bars = []
    for grain in GRAINS:
        name = f"4.3 grain {grain:g}"
        worst = max(high(name, noise, 2) for noise in NOISES)
        bars.append(
            at_most(f"PFMM, noise 0 to 6 dB, grain {grain:g} m, upper limit", 3.0, worst, "m", strict=True)
        )
        bars.append(at_most(f"PFMM over NNSS, noise 3 dB, grain {grain:g} m", 0.5, ratio(name, 3.0, 0), "of"))
        bars.append(
            at_most(f"PFMM over PF_MCL, noise 3 dB, grain {grain:g} m", 0.75, ratio(name, 3.0, 1), "of")
        )
    bars.append(within("NNSS at the defaults", 5.0, 6.2, float(errors["4.3 grain 1", 3.0][:, 0].mean()), "m"))
    for figure, at, what in (("4.2", AP_COUNTS, "access points"), ("4.5", WAFS, "wall attenuation")):
        for k, method in enumerate(METHODS):
            first, last = (float(errors[figure, float(a)][:, k].mean()) for a in (at[0], at[-1]))
            bars.append(at_most(f"{method}: last over first, {what}", 1.0, last / first, "of", strict=True))
    for figure, at_all in (("4.6 angle", ANGLES[:3]), ("4.6 distance", DISTANCES)):
        worst = max(ratio(figure, at, 1) for at in at_all)
        bars.append(
            at_most(f"PFMM over PF_MCL, Figure {figure}, to {at_all[-1]:g}", 1.0, worst, "of", strict=True)
        )
    angle, distance = (
        float(errors[f, at][:, 2].mean()) for f, at in (("4.6 angle", 30.0), ("4.6 distance", 0.3))
    )
    bars.append(at_most("PFMM: 30 % of distance over 30 degrees", 1.0, distance / angle, "of", strict=True))
    bars.append(at_most("PFMM: lost runs", 0.0, float(n_lost), "runs"))
    return tuple(bars)
