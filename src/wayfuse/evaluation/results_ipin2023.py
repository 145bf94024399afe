"""Tracking on ipin2023-track3, three levels joined by stairs and a lift: errors, floor changes, phones, bars."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from typing import Any

import numpy as np

from wayfuse.core.types import BoolArray
from wayfuse.evaluation.errors import PointErrors, Scores
from wayfuse.evaluation.floor_changes import score_changes
from wayfuse.evaluation.intervals import Bootstrap, compare
from wayfuse.evaluation.results_bars import Bar, at_least, at_most
from wayfuse.evaluation.results_folds import SEEDS, Mapper, in_turn, minutes_of
from wayfuse.evaluation.results_pool import Pooled, figures_of_all, paired, pool_known, splits
from wayfuse.evaluation.results_repetitions import (
    METHODS,
    OFF_ROUTE,
    Repetitions,
    Tracked,
    end_shift,
    key_of,
    track,
)
from wayfuse.radio.device_survey import device_shifts
from wayfuse.radio.walk_survey import SurveyParameters

__all__ = ["ALL", "CONNECTORS", "SINGLE", "measure_ipin2023", "of_walks"]

ALL, SINGLE, CONNECTORS = "all recordings", "trials on one floor", "trials 51-53"
_OFF_ROUTE = "off route"
_FUSED, _BARE = "fused", "fused-no-barometer"
_LIMITS = {"ipin": 2.5, "mean": 1.8, "floor": 0.995, "off_route": 7.0, "bare_floor": 0.85, "delay": 3.0}


def measure_ipin2023(
    repetitions: Repetitions,
    methods: Sequence[str] = METHODS,
    off_route: Sequence[str] = OFF_ROUTE,
    seeds: Sequence[int] = SEEDS,
    bootstrap: Bootstrap | None = None,
    mapper: Mapper = in_turn,
) -> dict[str, Any]:
    """Track all recordings by every method and seed; all figures as plain values."""
    draw = Bootstrap() if bootstrap is None else bootstrap
    tracked = track(repetitions, methods, seeds, mapper)
    away = track(repetitions, off_route, seeds, mapper, off_route=True)
    groups = _groups(tracked.scores)
    off = pool_known(away.scores)
    section: dict[str, Any] = {
        "recordings": len(repetitions.recordings),
        "minutes": minutes_of(repetitions.recordings),
        "n_notes": sum(len(r.report.describe()) for r in repetitions.recordings),
        "seeds": list(seeds),
        "bootstrap": asdict(draw),
        "surveys": [_survey(repetitions, number) for number in repetitions.numbers],
        "figures": {name: figures_of_all(name, of, draw, mapper) for name, of in groups.items()},
        "off_route": figures_of_all(_OFF_ROUTE, off, draw, mapper),
        "off_route_by_distance": {name: splits(p)["by_survey_distance"] for name, p in off.items()},
        "comparisons": {
            name: [_comparison(of[_FUSED], base, draw) for m, base in of.items() if m != _FUSED]
            for name, of in {**groups, _OFF_ROUTE: off}.items()
            if _FUSED in of
        },
        "changes": {m: _changes(repetitions, tracked, m) for m in methods},
        "phones": _phones(repetitions),
    }
    return section | {"bars": [asdict(bar) for bar in _bars(section)]}


# --- errors -------------------------------------------------------------------------------------------------


def _groups(scores: Sequence[Scores]) -> dict[str, dict[str, Pooled]]:
    """Methods over all recordings, over those that stay on a floor, and over those that do not."""
    changes = np.array([key_of(walk).changes_floors for of in scores for walk in of.walks])
    pooled = pool_known(scores)
    wanted = {ALL: np.ones(len(changes), np.bool_), SINGLE: ~changes, CONNECTORS: changes}
    return {
        group: {name: of_walks(p, rows) for name, p in pooled.items()}
        for group, rows in wanted.items()
        if rows.any()
    }


def of_walks(pooled: Pooled, wanted: BoolArray) -> Pooled:
    """The points of the walks for which ``wanted`` (n_walks,) holds."""
    return pooled.each(lambda points: points.select(np.asarray(wanted[points.walk])))


def _comparison(method: Pooled, base: Pooled, draw: Bootstrap) -> dict[str, Any]:
    """Paired difference at the waypoints: mean error, and 75th percentile with 15 m per wrong floor."""
    points, base_points = paired(method, base, "waypoints")
    plain = compare(method.name, points, base.name, base_points, draw)
    floors = compare(method.name, _penalised(points), base.name, _penalised(base_points), draw)
    return {
        "method": method.name,
        "baseline": base.name,
        "n_walks": plain.n_walks,
        "mean": {
            "difference": asdict(plain.difference["mean"]),
            "reduction": asdict(plain.reduction["mean"]),
        },
        "ipin": {
            "difference": asdict(floors.difference["p75"]),
            "reduction": asdict(floors.reduction["p75"]),
        },
    }


def _penalised(points: PointErrors) -> PointErrors:
    return replace(points, error=points.combined)


# --- floor changes ------------------------------------------------------------------------------------------


def _changes(repetitions: Repetitions, tracked: Tracked, method: str) -> dict[str, Any]:
    """Sums over all seeds of a method, and each recording that has true changes or for which some were said."""
    mine = [one for one in tracked.tracks if one.method.partition("#")[0] == method]
    by_name = score_changes(repetitions.site, repetitions.recordings, mine)
    moving = [s for name, scores in by_name.items() if key_of(name).changes_floors for s in scores]
    level = [s for name, scores in by_name.items() if not key_of(name).changes_floors for s in scores]
    delays = np.concatenate([s.delays for s in moving]) if moving else np.empty(0)
    return {
        "true": sum(len(s.truths) for s in moving),
        "right": sum(s.n_right for s in moving),
        "missed": sum(s.n_missed for s in moving),
        "extra": sum(s.n_extra for s in moving),
        "level_runs": len(level),
        "invented": sum(s.n_extra for s in level),
        "delay": {"median": _percentile(delays, 50.0), "p90": _percentile(delays, 90.0)},
        "by_recording": [
            {
                "recording": name,
                "true": sum(len(s.truths) for s in scores),
                "right": sum(s.n_right for s in scores),
                "missed": sum(s.n_missed for s in scores),
                "extra": sum(s.n_extra for s in scores),
            }
            for name, scores in by_name.items()
            if any(s.truths or s.n_extra for s in scores)
        ],
    }


def _percentile(values: Any, percent: float) -> float:
    """Percentile, lower of two neighbours (missed changes are infinitely late); NaN without values."""
    return float(np.percentile(values, percent, method="lower")) if len(values) else float("nan")


# --- phones -------------------------------------------------------------------------------------------------


def _survey(repetitions: Repetitions, number: int) -> dict[str, Any]:
    """What the recordings of a repetition are tracked with, and how its phones were brought to one level."""
    raw = repetitions.survey(number, parameters=SurveyParameters(normalise_devices=False))
    models = {walk.name: walk.device for walk in repetitions.walks}
    reference, shifts = device_shifts(raw, [models[name] for name in raw.walks])
    return {
        "repetition": number,
        "recordings": len(repetitions.of(number)),
        "survey_walks": len(raw.walks),
        "fingerprints": len(raw),
        "access_points": len(raw.bssid),
        "reference": reference,
        "shifts": {model: shift.tolist() for model, shift in shifts.items()},
    }


def _phones(repetitions: Repetitions) -> list[dict[str, Any]]:
    """Shifts estimated by the end of the recordings, by repetition (a survey each) and model of the phone."""
    rows = []
    for number in repetitions.numbers:
        survey = repetitions.survey(number)
        mine = repetitions.of(number)
        for model in sorted({r.device.model for r in mine}):
            shifts = np.array([end_shift(r, survey) for r in mine if r.device.model == model])
            spread = shifts.std(axis=0, ddof=1) if len(shifts) > 1 else np.full(shifts.shape[1], np.nan)
            rows.append({"repetition": number, "model": model, "n": len(shifts),
                         "mean": shifts.mean(axis=0).tolist(), "sd": spread.tolist()})  # fmt: skip
    return rows


# --- bars ---------------------------------------------------------------------------------------------------


def _bars(section: Mapping[str, Any]) -> list[Bar]:
    """The bounds of the issue, at the waypoints."""

    def figure(group: str, method: str, name: str) -> float:
        of = section["figures"].get(group, {}).get("waypoints", {}).get(method)
        return float("nan") if of is None else float(of["figures"][name]["value"])

    off = section["off_route"]["waypoints"].get(_FUSED)
    changes = section["changes"][_FUSED]
    share = changes["right"] / changes["true"] if changes["true"] else float("nan")
    limit = _LIMITS
    return [
        at_most(f"ipin2023, {ALL}: IPIN", limit["ipin"], figure(ALL, _FUSED, "ipin"), "m"),
        at_most(f"ipin2023, {SINGLE}: mean error", limit["mean"], figure(SINGLE, _FUSED, "mean"), "m"),
        at_least(
            f"ipin2023, {SINGLE}: right floor", limit["floor"], figure(SINGLE, _FUSED, "floor_accuracy"), "%"
        ),
        at_most(
            "ipin2023, off route: mean error",
            limit["off_route"],
            float("nan") if off is None else float(off["figures"]["mean"]["value"]),
            "m",
        ),
        at_least(
            f"ipin2023, {CONNECTORS}: right floor", 1.0, figure(CONNECTORS, _FUSED, "floor_accuracy"), "%"
        ),
        at_least(
            f"ipin2023, {CONNECTORS}: right floor without barometer",
            limit["bare_floor"],
            figure(CONNECTORS, _BARE, "floor_accuracy"),
            "%",
        ),
        at_least(f"ipin2023, {CONNECTORS}: floor changes said once, right", 1.0, share, "%"),
        at_most(f"ipin2023, {CONNECTORS}: other floor changes said", 0.0, changes["extra"], "changes"),
        at_most(f"ipin2023, {SINGLE}: floor changes invented", 0.0, changes["invented"], "changes"),
        at_most(
            "ipin2023: delay from arrival to the right floor, median",
            limit["delay"],
            changes["delay"]["median"],
            "s",
        ),
    ]
