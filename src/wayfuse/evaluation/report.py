"""The report of a scoring: one dictionary of plain values (strict JSON), and text tables made from it.

Every figure of the text stands in the dictionary, so the two cannot disagree. A value that is not known (a
share of nothing, an interval of one walk) is None in the dictionary and ``-`` in the text.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from wayfuse.core.errors import UsageError
from wayfuse.core.types import BoolArray
from wayfuse.evaluation.calibration import Calibration, calibrate, time_bins
from wayfuse.evaluation.errors import MethodScores, PointErrors, Scores, summarise
from wayfuse.evaluation.intervals import STATISTICS, Bootstrap, compare, error_intervals
from wayfuse.evaluation.stability import stability
from wayfuse.evaluation.truth import TIMES

__all__ = ["SURVEY_BINS", "build_report", "plain", "render"]

SURVEY_BINS = (2.0, 5.0)  # m from the true place to the survey: covered, near, far
_KEPT_NAMES = 5  # names of walks shown in the text; all are in the dictionary
_MISSING_WORDS = {
    "skip": "times before a method's first estimate are left out",
    "backfill": "times before a method's first estimate are filled back with it",
    "all": "all times from the first waypoint on, filled back with the first estimate",
}

Report = dict[str, Any]


# --- the dictionary -----------------------------------------------------------------------------------------


def build_report(
    scores: Scores,
    *,
    missing: str = "skip",
    baseline: str | None = None,
    bootstrap: Bootstrap | None = None,
    notes: Iterable[str] = (),
) -> Report:
    """All figures of a scoring as plain values.

    Parameters
    ----------
    missing : what becomes of times without an estimate, see `PointErrors.used`.
    baseline : the method the others are compared with; without it ``nnss`` where there is one, else the
    method with
        the largest mean error.
    bootstrap : drawing of the intervals. notes : what else the reader should know.
    """
    draw = Bootstrap() if bootstrap is None else bootstrap
    methods = {m.name: _method(m, scores, missing, draw) for m in scores.methods}
    base = _baseline(scores, methods, baseline)
    used = {m.name: m.points["1hz"].used(missing) for m in scores.methods}
    comparisons = [
        asdict(compare(name, used[name], base, used[base], draw)) for name in used if base and name != base
    ]
    report = {
        "protocol": {
            "missing": missing,
            "bootstrap": asdict(draw),
            "online": "last estimate at or before each time, from the first Wi-Fi scan on",
        },
        "n_walks": len(scores.walks),
        "walks": list(scores.walks),
        "methods": methods,
        "baseline": base,
        "comparisons": comparisons,
        "unscored": [{"walk": walk, "reason": reason} for walk, reason in scores.unscored],
        "notes": [*scores.notes, *notes],
    }
    out: Report = plain(report)
    return out


def plain(value: Any) -> Any:
    """A value of dicts, lists and numbers with None for what is not finite: strict JSON."""
    if isinstance(value, dict):
        return {str(k): plain(v) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [plain(v) for v in value]
    if isinstance(value, bool | str | int) or value is None:
        return value
    number = float(value)
    return number if math.isfinite(number) else None


def _method(method: MethodScores, scores: Scores, missing: str, draw: Bootstrap) -> Report:
    out: Report = {
        "n_walks": method.n_walks,
        "missing_walks": list(method.missing_walks),
        "availability": {at: method.points[at].availability for at in TIMES},
    }
    for at in TIMES:
        points = method.points[at].used(missing)
        intervals = {name: asdict(i) for name, i in error_intervals(points, draw).items()}
        out[at] = asdict(summarise(points)) | {
            "intervals": intervals,
            "n_in_transit": int(points.transit.sum()),
            "known_floor_accuracy": summarise(points.of_known_floor()).floor_accuracy,
        }
        out[f"{at}_all_times"] = asdict(summarise(method.points[at].used("all")))
    at_1hz = method.points["1hz"].used(missing)
    steady = stability(method.tracks, scores.frame)
    rates = {
        "jumps_per_minute": steady.per_minute(steady.n_jumps),
        "floor_changes_per_minute": steady.per_minute(steady.n_floor_changes),
    }
    return out | {
        "by_time": _split(at_1hz, time_bins(at_1hz)),
        "by_survey_distance": _split(at_1hz, survey_bins(at_1hz)),
        "coverage": _calibration(calibrate(at_1hz, draw)),
        "stability": asdict(steady) | rates,
        "by_walk": _by_walk(at_1hz, scores.walks),
    }


def survey_bins(points: PointErrors) -> list[tuple[str, BoolArray]]:
    """Label and rows of each span of distance from the true place to the survey; empty without a survey."""
    d, (near, far) = points.survey_distance, SURVEY_BINS
    if not np.any(~np.isnan(d)):
        return []
    return [
        (f"<= {near:g} m", d <= near),
        (f"{near:g}-{far:g} m", (d > near) & (d <= far)),
        (f"> {far:g} m", d > far),
    ]


def _split(points: PointErrors, rows: list[tuple[str, BoolArray]]) -> Report:
    return {label: asdict(summarise(points.select(of))) for label, of in rows}


def _calibration(found: Calibration | None) -> Report | None:
    return None if found is None else asdict(found)


def _by_walk(points: PointErrors, walks: Sequence[str]) -> list[Report]:
    out = []
    for index in np.unique(points.walk).tolist():
        of_walk = summarise(points.select(points.walk == index))
        row = {"walk": walks[index], "n": of_walk.n, "mean": of_walk.mean, "p50": of_walk.p50}
        out.append(row | {"max": float(points.error[points.walk == index].max())}
                   | {"floor_accuracy": of_walk.floor_accuracy})  # fmt: skip
    return out


def _baseline(scores: Scores, methods: dict[str, Report], wanted: str | None) -> str | None:
    names = [m.name for m in scores.methods]
    if wanted is not None:
        scores.method(wanted)  # an unknown name is an error that lists those there are
        if len(names) == 1:
            raise UsageError("there is one method only, nothing to compare", where="baseline")
        return wanted
    if len(names) == 1:
        return None
    known = [name for name in names if name.casefold() == "nnss"]
    return known[0] if known else max(names, key=lambda name: _rank(methods[name]["1hz"]["mean"]))


def _rank(value: float) -> float:
    return value if math.isfinite(value) else -math.inf


# --- the text -----------------------------------------------------------------------------------------------


def render(report: Report) -> str:
    """Text tables of a report, one row per method, and its notes."""
    level = f"{100 * report['protocol']['bootstrap']['level']:.0f} %"
    parts = [
        _error_table(report, "1hz", "1 Hz, online"),
        _error_table(report, "waypoints", "Waypoints, online"),
        _error_table(report, "1hz_all_times", "1 Hz, all times, filled back before the first estimate"),
        _interval_table(report, level),
        _comparison_lines(report, level),
        _coverage_table(report, level),
        _split_table(report, "by_time", "Mean / median error (m) by time since the first scan"),
        _split_table(
            report, "by_survey_distance", "Mean / median error (m) by distance of the truth to the survey"
        ),
        _stability_table(report),
        _notes(report),
    ]
    return "\n\n".join(part for part in parts if part) + "\n"


def table(title: str, header: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Aligned text: first column to the left, the others to the right."""
    cells = [list(header), *map(list, rows)]
    widths = [max(len(row[k]) for row in cells) for k in range(len(header))]
    lines = [
        "  ".join(
            c.ljust(w) if k == 0 else c.rjust(w) for k, (c, w) in enumerate(zip(row, widths, strict=True))
        )
        for row in cells
    ]
    return "\n".join(
        [title, *(line.rstrip() for line in [lines[0], "  ".join("-" * w for w in widths), *lines[1:]])]
    )


def _m(value: float | None, decimals: int = 2) -> str:
    return "-" if value is None else f"{value:.{decimals}f}"


def _percent(value: float | None, decimals: int = 1) -> str:
    return "-" if value is None else f"{100 * value:.{decimals}f} %"


def _span(interval: Report, show: Callable[[float | None], str]) -> str:
    if interval["low"] is None:
        return show(interval["value"])
    return f"{show(interval['value'])} [{show(interval['low'])}, {show(interval['high'])}]"


def _error_table(report: Report, at: str, title: str) -> str:
    head = [
        "method",
        "walks",
        "points",
        "available",
        "mean",
        "p50",
        "p75",
        "p90",
        "p95",
        "floor",
        "+15 m/floor",
        "IPIN",
    ]
    rows = []
    for name, m in report["methods"].items():
        of = m[at]
        share = m["availability"].get(at)
        row = [name, f"{of['n_walks']}/{report['n_walks']}", str(of["n"]), _percent(share)]
        row += [_m(of[s]) for s in STATISTICS]
        rows.append([*row, _percent(of["floor_accuracy"]), _m(of["combined_mean"]), _m(of["ipin"])])
    if not at.endswith("all_times"):
        return table(f"{title} (m)", head, rows)
    return table(f"{title} (m)", head[:3] + head[4:], [row[:3] + row[4:] for row in rows])


def _interval_table(report: Report, level: str) -> str:
    names = ("mean", "p50", "p75", "p90", "ipin")
    rows = []
    for name, m in report["methods"].items():
        of = m["1hz"]["intervals"]
        rows.append([name, *(_span(of[s], _m) for s in names), _span(of["floor_accuracy"], _percent)])
    title = f"1 Hz with {level} intervals, bootstrap over walks (m)"
    return table(title, ["method", "mean", "p50", "p75", "p90", "IPIN", "floor"], rows)


def _comparison_lines(report: Report, level: str) -> str:
    lines = [_comparison(c) for c in report["comparisons"]]
    return "\n".join([f"Paired over walks, 1 Hz ({level} intervals)", *lines]) if lines else ""


def _comparison(c: Report) -> str:
    def side(figure: str) -> str:
        of = c["reduction"][figure]
        value = of["value"]
        if value is None:
            return f"{figure} -"
        sign, word = (1.0, "below") if value >= 0 else (-1.0, "above")
        ends = sorted(sign * v for v in (of["low"], of["high"]) if v is not None)
        span = f" [{', '.join(f'{100 * e:.0f}' for e in ends)}]" if ends else ""
        return f"{figure} {100 * abs(value):.0f} %{span} {word}"

    metres = _span(c["difference"]["mean"], _m)
    figures = ", ".join(side(f) for f in ("mean", "p50", "p90"))
    return (
        f"{c['method']} against {c['baseline']}: {figures}; mean difference {metres} m; {c['n_walks']} walks"
    )


def _coverage_table(report: Report, level: str) -> str:
    rows = []
    for name, m in report["methods"].items():
        found = m["coverage"]
        if found is None:
            continue
        parts = [("all", found["overall"]), *found["by_state"].items(), *found["by_time"].items()]
        for k, (label, of) in enumerate(parts):
            shares = [_span(of[w], lambda v: _percent(v, 0)) for w in ("within68", "within95")]
            radii = [_m(of["mean_r68"]), _m(of["mean_r95"])]
            last = _m(found["mean_nees"]) if k == 0 else ""
            rows.append([f"{name}: {label}" if k == 0 else f"  {label}", str(of["n"]), *shares, *radii, last])
    head = ["method", "points", "in r68 (68 %)", "in r95 (95 %)", "mean r68", "mean r95", "NEES (2)"]
    title = f"Coverage of the stated radii at 1 Hz ({level} intervals), mean radii (m)"
    return table(title, head, rows) if rows else ""


def _split_table(report: Report, key: str, title: str) -> str:
    labels = list(dict.fromkeys(label for m in report["methods"].values() for label in m[key]))
    if not labels:
        return ""
    rows = []
    for name, m in report["methods"].items():
        of = [m[key].get(label) for label in labels]
        rows.append([name, *("-" if not s else f"{_m(s['mean'])} / {_m(s['p50'])} ({s['n']})" for s in of)])
    return table(f"{title} (points)", ["method", *labels], rows)


def _stability_table(report: Report) -> str:
    rows = []
    for name, m in report["methods"].items():
        of = m["stability"]
        jumps = [str(of["n_jumps"]), _m(of["jumps_per_minute"]), _m(of["longest_jump"], 1)]
        floors = [str(of["n_floor_changes"]), _m(of["floor_changes_per_minute"]), str(of["n_floor_flaps"])]
        rows.append([name, _m(of["minutes"], 1), *jumps, *floors])
    head = [
        "method",
        "minutes",
        "jumps",
        "per min",
        "longest (m)",
        "floor changes",
        "per min",
        "taken back in 10 s",
    ]
    return table("Stability: jumps beyond 3 m/s + 1 m, changes of floor", head, rows)


def _notes(report: Report) -> str:
    lines = [f"Missing: {_MISSING_WORDS[report['protocol']['missing']]}."]
    for name, m in report["methods"].items():
        if m["missing_walks"]:
            lines.append(f"{name}: no estimate for {_names(m['missing_walks'])}.")
    reasons: dict[str, list[str]] = {}
    for item in report["unscored"]:
        reasons.setdefault(item["reason"], []).append(item["walk"])
    lines += [f"Not scored, {reason}: {_names(walks)}." for reason, walks in reasons.items()]
    between = max((m["1hz"]["n_in_transit"] for m in report["methods"].values()), default=0)
    if between:
        shares = ", ".join(
            f"{name} {_percent(m['1hz']['known_floor_accuracy'])}" for name, m in report["methods"].items()
        )
        lines.append(
            f"{between} points at 1 Hz lie between waypoints of two floors; the nearer in time is the truth."
            f" Right floor without them: {shares}."
        )
    return "\n".join([*lines, *report["notes"]])


def _names(names: Sequence[str]) -> str:
    shown = ", ".join(names[:_KEPT_NAMES]) + (", ..." if len(names) > _KEPT_NAMES else "")
    return f"{len(names)} walk{'s' if len(names) != 1 else ''} ({shown})"
