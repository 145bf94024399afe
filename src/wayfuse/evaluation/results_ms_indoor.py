"""Tracking on ms-indoor site1: errors of every method on three folds, what each part is worth, coverage, bars."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, fields, is_dataclass
from typing import Any

from wayfuse.evaluation.errors import Scores
from wayfuse.evaluation.intervals import Bootstrap
from wayfuse.evaluation.results_bars import Bar, at_least, at_most, within
from wayfuse.evaluation.results_folds import (
    FIRST,
    FOLDS,
    LAG,
    METHODS,
    SEEDS,
    Folds,
    Mapper,
    in_turn,
    minutes_of,
    track_fold,
)
from wayfuse.evaluation.results_pool import Pooled, comparison, coverage_of, figures_of_all, pool, splits
from wayfuse.presets import baselines, fused

__all__ = ["DEVELOPMENT", "POOLED", "measure_ms_indoor"]

DEVELOPMENT = "development set"
POOLED = "all folds pooled"
_BASELINES = (FIRST, "nnss", "wknn", "random-walk", "fused-no-map", "fused-barriers", "fused-no-steps", "fused-2.4ghz",
              "fused-5ghz")  # fmt: skip
_STATED = ("fused", f"fused --lag {LAG:g}", "random-walk")  # whose radii are looked at


def measure_ms_indoor(
    folds: Folds,
    methods: Sequence[str] = tuple(METHODS),
    seeds: Sequence[int] = SEEDS,
    bootstrap: Bootstrap | None = None,
    mapper: Mapper = in_turn,
) -> dict[str, Any]:
    """Track the folds by every method and seed; all figures as plain values."""
    draw = Bootstrap() if bootstrap is None else bootstrap
    scores = {fold: track_fold(folds, fold, methods, seeds, mapper) for fold in folds.paths}
    sets = _sets(scores)
    shown = [name for name in (DEVELOPMENT, POOLED) if name in sets]
    section: dict[str, Any] = {
        "folds": [_describe(folds, fold) for fold in folds.paths],
        "n_read": folds.n_read,
        "n_notes": folds.n_notes,
        "seeds": list(seeds),
        "bootstrap": asdict(draw),
        "parameters": {"fused": _stated(fused.Config()), "random-walk": _changed()},
        "figures": {name: figures_of_all(name, of, draw, mapper) for name, of in sets.items()},
        "comparisons": {name: _comparisons(sets[name], draw) for name in shown},
        "coverage": {
            name: {m: coverage_of(of[m], draw) for m in _STATED if m in of} for name, of in sets.items()
        },
        "splits": {name: {m: splits(sets[name][m]) for m in sets[name]} for name in shown},
    }
    return section | {"bars": [asdict(bar) for bar in _bars(section)]}


def _sets(scores: Mapping[int, Scores]) -> dict[str, dict[str, Pooled]]:
    """Methods over each fold, and over all where there are several."""
    out = {DEVELOPMENT if f == FOLDS[0] else f"fold {f}": pool([of_fold]) for f, of_fold in scores.items()}
    if len(scores) > 1:
        out[POOLED] = pool(list(scores.values()))
    return out


def _describe(folds: Folds, fold: int) -> dict[str, Any]:
    survey, recordings = folds.surveys[fold], folds.of(fold)
    return {
        "fold": fold,
        "walks": len(recordings),
        "minutes": minutes_of(recordings),
        "survey_walks": len(survey.walks),
        "fingerprints": len(survey),
        "access_points": len(survey.bssid),
    }


def _changed() -> dict[str, Any]:
    """What the random walk has other than ``fused``."""
    plain, other = fused.Config(), baselines.RANDOM_WALK
    names = (f.name for f in fields(fused.Config) if getattr(other, f.name) != getattr(plain, f.name))
    return {name: _stated(getattr(other, name)) for name in names}


def _stated(value: Any) -> Any:
    """A configuration as plain values, without what it derives from them."""
    if not is_dataclass(value):
        return value
    return {f.name: _stated(getattr(value, f.name)) for f in fields(value) if f.init}


def _comparisons(of: Mapping[str, Pooled], draw: Bootstrap) -> list[dict[str, Any]]:
    lagged = f"fused --lag {LAG:g}"
    pairs = [("fused", name) for name in _BASELINES] + [(lagged, "fused")]
    return [comparison(of[a], of[b], draw) for a, b in pairs if a in of and b in of]


def _bars(section: Mapping[str, Any]) -> list[Bar]:
    """The bounds that were set, on the development set."""
    of = section["figures"].get(DEVELOPMENT, {}).get("1hz", {})
    lagged = f"fused --lag {LAG:g}"
    bars: list[Bar] = []
    if "fused" in of:
        f = of["fused"]["figures"]
        bars += [
            at_most("fused: mean error", 4.0, f["mean"]["value"], "m"),
            at_most("fused: median error", 2.6, f["p50"]["value"], "m"),
            at_least("fused: right floor", 0.99, f["floor_accuracy"]["value"], "%"),
        ]
    if lagged in of:
        f = of[lagged]["figures"]
        bars += [
            at_most(f"{lagged}: mean error", 3.7, f["mean"]["value"], "m"),
            at_most(f"{lagged}: median error", 2.4, f["p50"]["value"], "m"),
        ]
    for found in section["comparisons"].get(DEVELOPMENT, ()):
        limit = {"nnss": 0.30, "random-walk": 0.25}.get(found["baseline"])
        if limit is not None:
            r = found["reduction"]["mean"]
            bars.append(
                at_least(f"fused: mean error below {found['baseline']}", limit, r["value"], "%", low=r["low"])
            )
    bars += [
        at_most(
            f"fused: mean error above the {FIRST.partition(', ')[2]}'s, lower end of the interval, {name}",
            0.0,
            found["difference"]["mean"]["low"],
            "m",
        )
        for name, all_found in section["comparisons"].items()
        for found in all_found
        if found["baseline"] == FIRST
    ]
    return bars + [
        within(
            f"fused: points within r95, {name}", 0.90, 0.98, c["fused"]["overall"]["within95"]["value"], "%"
        )
        for name, c in section["coverage"].items()
        if name in (DEVELOPMENT, POOLED) and c.get("fused")
    ]
