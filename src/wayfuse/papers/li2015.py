"""li2015: Table 1 and what the exponents 1/d are good for; `papers.li2015_real` has the real data."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from wayfuse.core.philox import Noise
from wayfuse.core.types import Array
from wayfuse.evaluation.results_bars import Bar, at_least, at_most, within
from wayfuse.evaluation.results_folds import Mapper
from wayfuse.formats.datasets import data_root
from wayfuse.models.observation.ranges import Exponents
from wayfuse.papers.li2015_channel import channel_table
from wayfuse.papers.li2015_real import captures, range_tables
from wayfuse.papers.reproduction import Interval, Reproduction, Table, mean_interval
from wayfuse.presets.li2015 import R_PF, Config, dead_reckon, track
from wayfuse.radio.multilateration import (
    constrained_least_squares,
    weighted_centroid,
    weighted_least_squares,
)
from wayfuse.simulator.li2015_world import (
    EQUAL_ERRORS,
    GROWING_ERRORS,
    LOS_NLOS,
    PATHS,
    Scenario,
    simulate_run,
)

__all__ = ["SEEDS", "Experiment", "reproduce"]

SEEDS = 20
_LOST = 6.0  # m; a run whose mean error is above it is counted as lost, and stays in every figure
_NATURAL = 0.3  # m/s, sigma_v that steps and a good compass deserve
_SHARP = f"FW-PF sigma_v {_NATURAL:g}"

_SCENARIOS = {
    "LOS/NLOS": LOS_NLOS,
    "equal": EQUAL_ERRORS,
    "growing": GROWING_ERRORS,
}
_METHODS: dict[str, Config | None] = {
    "PDR": None,
    "R-PF": replace(R_PF, exponents=Exponents.ONE),
    "R-PF 1/d": R_PF,
    "FW-PF": Config(),
    "FW-PF 1/N": Config(exponents=Exponents.EQUAL),
    "FW-PF 1": Config(exponents=Exponents.ONE),
    _SHARP: Config(velocity_sigma=_NATURAL),
    f"{_SHARP}, 1/N": Config(velocity_sigma=_NATURAL, exponents=Exponents.EQUAL),
}
_FIXES: Mapping[str, Callable[[Array, Array], Array]] = {  # places without memory
    "weighted centroid": weighted_centroid,
    "WLS": weighted_least_squares,
    "WC-CWLS": constrained_least_squares,
}
_EXPONENTS = ("FW-PF", "FW-PF 1/N", "FW-PF 1")
_USED = {
    "LOS/NLOS": (*_METHODS, *_FIXES),
    "equal": _EXPONENTS,
    "growing": (_SHARP, f"{_SHARP}, 1/N"),
}
_PAPER = {  # Table 1: mean, standard deviation, 90 %, and whether a parameter was fitted to it
    ("PDR", None): ("1.6 / 2.5 / 4", "F"),
    ("R-PF", 1): ("1.7 / 1.5 / 3", "F"),
    ("R-PF", 0): ("1.8 / 1.0 / 3", "F"),
    ("FW-PF", 1): ("1.3 / 0.7 / 2.2", "F"),
    ("FW-PF", 0): ("1.6 / 0.9 / 2.8", "T"),
}
_Key = tuple[str, int, str]  # errors, scenario (0: 4 anchors, 1: 5), method


@dataclass(frozen=True, slots=True)
class Experiment:
    """All runs of one seed: for each (errors, scenario, method) mean, sd, 90 % (m) and the number of lost runs."""

    n_particles: int = Config().n_particles

    def __call__(self, seed: int) -> dict[_Key, tuple[float, float, float, int]]:
        """Run one seed; every method sees the same walks, errors and random numbers."""
        out = {}
        for name, scenarios in _SCENARIOS.items():
            for s, scenario in enumerate(scenarios):
                runs = self._runs(scenario, seed, name, s)
                for method, errors in runs.items():
                    every = np.concatenate(errors)
                    lost = sum(float(e.mean()) > _LOST for e in errors)
                    figures = float(every.mean()), float(every.std()), float(np.percentile(every, 90.0))
                    out[name, s, method] = (*figures, lost)
        return out

    def _runs(self, scenario: Scenario, seed: int, name: str, s: int) -> dict[str, list[Array]]:
        errors: dict[str, list[Array]] = {method: [] for method in _USED[name]}
        for path, repeat in product(range(len(PATHS)), range(scenario.repeats)):
            run = simulate_run(scenario, path, np.random.default_rng([seed, s, path, repeat]))
            start = (float(run.xy[0, 0]), float(run.xy[0, 1]))
            for method in _USED[name]:
                config = _METHODS.get(method)
                if method in _FIXES:
                    places = _FIXES[method](scenario.anchors, run.ranges)
                elif config is None:
                    places = dead_reckon(run.velocity, start, run.dt)
                else:
                    config = replace(config, n_particles=self.n_particles)
                    noise = Noise.of(seed, f"{s} {path} {repeat}")
                    places = track(scenario.anchors, run.ranges, run.velocity, start, run.dt, noise, config)
                errors[method].append(np.hypot(*(places - run.xy).T))
        return errors


class _Figures:
    """What the seeds gave, by key."""

    def __init__(self, seeds: list[dict[_Key, tuple[float, float, float, int]]]) -> None:
        self._of = {key: np.array([s[key] for s in seeds]) for key in seeds[0]}

    def means(self, key: _Key) -> Array:
        """Mean error (m) of each seed."""
        return np.asarray(self._of[key][:, 0])

    def mean(self, key: _Key) -> float:
        """Mean error (m) over seeds."""
        return float(self.means(key).mean())

    def cells(self, *keys: _Key) -> tuple[str, str, str]:
        """Mean with its interval, standard deviation, 90 %; several keys are averaged seed by seed."""
        rows = np.mean([self._of[key] for key in keys], axis=0)
        return str(mean_interval(rows[:, 0])), f"{rows[:, 1].mean():.2f}", f"{rows[:, 2].mean():.2f}"

    def lost(self) -> tuple[str, ...]:
        """A line for each key with lost runs."""
        return tuple(
            f"{method}, {4 + s} anchors, {name}: {int(v[:, 3].sum())} runs with a mean error above {_LOST:g} m"
            for (name, s, method), v in self._of.items()
            if v[:, 3].sum()
        )


def reproduce(seeds: Sequence[int], mapper: Mapper) -> Reproduction:
    """Table 1 and the exponents on simulated walks; ranges from the real captures where they are there."""
    figures = _Figures(list(mapper(Experiment(), seeds, "li2015")))
    tables = [_table_1(figures), _exponents(figures), _further(figures)]
    bars = _bars(figures)
    table, met = captures(data_root() / "csi" / "intel5300-distance")
    tables += [channel_table(mapper), table, *range_tables(data_root() / "wifi-rtt", mapper)]
    bars += met
    return Reproduction("li2015", tuple(seeds), tuple(tables), tuple(bars), figures.lost())


def _table_1(figures: _Figures) -> Table:
    rows: list[tuple[str | float | Interval, ...]] = []
    for (method, s), (paper, kind) in _PAPER.items():
        keys = [("LOS/NLOS", k, method) for k in ((0, 1) if s is None else (s,))]
        label = method if s is None else f"{method} ({4 + s} ANs)"
        rows.append((label, paper, *figures.cells(*keys), kind))
    note = (
        "F: parameters of the world or the filter were fitted to this row; T: the row is a test. "
        "PDR is the mean of both scenarios."
    )
    columns = ("row", "paper: mean / sd / 90 %, m", "mean, m", "sd, m", "90 %, m", "F/T")
    return Table("Table 1", columns, tuple(rows), note)


def _exponents(figures: _Figures) -> Table:
    rows: list[tuple[str | float | Interval, ...]] = []
    for (name, label), s in product(
        (("LOS/NLOS", "LOS/NLOS"), ("equal", "independent, equal (2 m)")), (0, 1)
    ):
        cells = tuple(mean_interval(figures.means((name, s, m))) for m in _EXPONENTS)
        rows.append((f"{label}, {4 + s} ANs", *cells))
    for s in (0, 1):
        cells = tuple(mean_interval(figures.means(("growing", s, m))) for m in _USED["growing"])
        rows.append((f"20 % of the range, {4 + s} ANs, sigma_v {_NATURAL:g}", *cells, "-"))
    note = "Mean error of FW-PF, m. 1/d is Eq. 12, 1/N has the same sum without a preference, 1 is Eq. 8."
    columns = ("errors of the ranges", "1/d", "1/N", "1")
    return Table("What the exponents are good for", columns, tuple(rows), note)


def _further(figures: _Figures) -> Table:
    rows: list[tuple[str | float | Interval, ...]] = [
        (f"{label}, {4 + s} ANs", *figures.cells(("LOS/NLOS", s, method)))
        for (label, method), s in product(
            (
                ("R-PF with exponents 1/d", "R-PF 1/d"),
                (f"FW-PF, sigma_v {_NATURAL:g} m/s", _SHARP),
                *((f"{fix}, no filter", fix) for fix in _FIXES),
            ),
            (1, 0),
        )
    ]
    note = (
        "Not in the paper. With a sigma_v that steps and a good compass deserve FW-PF is better than reported, "
        "but follows a bad compass."
    )
    return Table("Further rows", ("row", "mean, m", "sd, m", "90 %, m"), tuple(rows), note)


def _bars(figures: _Figures) -> list[Bar]:
    def of(method: str, s: int, name: str = "LOS/NLOS") -> float:
        return figures.mean((name, s, method))

    bars = [
        within("R-PF, 5 ANs, mean", 0.88 * 1.7, 1.12 * 1.7, of("R-PF", 1), "m"),
        within("R-PF, 4 ANs, mean", 0.88 * 1.8, 1.12 * 1.8, of("R-PF", 0), "m"),
        within("FW-PF, 5 ANs, mean", 0.88 * 1.3, 1.12 * 1.3, of("FW-PF", 1), "m"),
        within("FW-PF, 4 ANs, mean", 0.8 * 1.6, 1.2 * 1.6, of("FW-PF", 0), "m"),
    ]
    for s in (1, 0):
        bars += [at_most(f"FW-PF over R-PF, {4 + s} ANs", 0.85, of("FW-PF", s) / of("R-PF", s), "")]
        ratio = of("FW-PF", s) / of("FW-PF 1/N", s)
        bars.append(at_most(f"1/d over 1/N, LOS/NLOS, {4 + s} ANs", 1.0, ratio, "", strict=True))
        ratio = of("FW-PF", s, "equal") / of("FW-PF 1/N", s, "equal")
        bars.append(at_least(f"1/d over 1/N, equal errors, {4 + s} ANs", 1.0, ratio, ""))
    return bars
