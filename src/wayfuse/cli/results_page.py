"""docs/results.md from the figures of `wayfuse.evaluation.results`: Markdown tables, no arithmetic."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from wayfuse.cli.results_page_cells import (
    error_table,
    metres,
    millimetres,
    percent,
    signed,
    span,
    table,
    whole,
    with_unit,
)
from wayfuse.cli.results_page_floors import behaviours, hcu, ipin2023

__all__ = ["page"]

Section = Mapping[str, Any]

_TITLES = {
    "ms-indoor": "Tracking: ms-indoor site1",
    "speed": "CPU time: ms-indoor site1",
    "ipin2023": "Tracking over floors: ipin2023-track3",
    "behaviours": "Stairs, lifts and standing: ipin2023-track3 and HCU Hamburg",
    "hcu": "Without Wi-Fi to the 4th floor: HCU Hamburg",
    "sodindoorloc": "Radio maps on static fingerprints: SODIndoorLoc",
    "oxford-steps": "Step counts: oxford-steps",
}


def page(sections: Mapping[str, Section], version: str, date: str = "") -> str:
    """The whole page."""
    only = "" if len(sections) == len(_TITLES) else "".join(f" --only {name}" for name in sections)
    dated = f" on {date}" if date else ""
    parts = [
        "# Results",
        (
            f"Written by `wayfuse results --out docs/results.md{only}`, wayfuse {version}{dated}; not edited by "
            "hand. Every figure is measured afresh on public recordings (`wayfuse datasets fetch`); a set that is"
            " missing is not measured, and said so. Facts about step length and heading: "
            "[benchmarks/inertial.py](../benchmarks/inertial.py)."
        ),
        (
            "Errors are horizontal, in metres. Brackets are 90 % intervals: bootstrap over whole walks (test "
            "points, for static fingerprints), 2000 replicates, seed 0. IPIN is the 75th percentile of the error "
            "plus 15 m per floor of difference."
        ),
        "## Bars",
        "Bounds set before the measurement; in ms-indoor on the development set where nothing else is said.",
        _bars(sections),
    ]
    render = {
        "ms-indoor": _tracking,
        "speed": _speed,
        "ipin2023": ipin2023,
        "behaviours": behaviours,
        "hcu": hcu,
        "sodindoorloc": _static,
        "oxford-steps": _steps,
    }
    for name, section in sections.items():
        parts.append(f"## {_TITLES[name]}")
        parts += render[name](section) if section["measured"] else [f"**NOT MEASURED: {section['why']}.**"]
    return "\n\n".join(part for part in parts if part) + "\n"


def _bars(sections: Mapping[str, Section]) -> str:
    rows = []
    for name, section in sections.items():
        if not section["measured"]:
            rows.append([f"{_TITLES[name]}: **NOT MEASURED**", "-", "-", "-"])
        rows += [
            [
                bar["what"],
                bar["bound"],
                with_unit(bar["value"], bar["unit"]),
                "yes" if bar["met"] else "**NO**",
            ]
            for bar in section.get("bars", ())
        ]
    return table(["what", "bar", "measured", "holds"], rows)


# --- tracking -----------------------------------------------------------------------------------------------


def _tracking(section: Section) -> list[str]:
    folds = [
        [str(f["fold"]), str(f["walks"]), f"{f['minutes']:.1f}", str(f["survey_walks"]), str(f["fingerprints"]),
         str(f["access_points"])]
        for f in section["folds"]
    ]  # fmt: skip
    seeds = ", ".join(map(str, section["seeds"]))
    particles = section["parameters"]["fused"]["n_particles"]
    parts = [
        (
            f"{section['n_read']} walks in one shopping centre, five floors. A walk's share is h = int(sha256(file"
            " stem), 16) mod 10. Development set: h = 1, surveyed by h >= 2; fold 2 and fold 3: h = 2 and h = 3, "
            "surveyed by all other walks; h = 0 is kept out. The parameters of the presets and the radii were "
            "chosen on these three folds: the figures say what each part is worth, and are somewhat optimistic "
            "for a building never seen."
        ),
        table(["fold (h)", "walks", "minutes", "survey walks", "fingerprints", "access points"], folds),
        (
            "Online: at each time the last estimate at or before it (`--lag 5`: an estimate may use 5 s more), "
            f"once a second and at the waypoints, from the first Wi-Fi scan on. {particles} particles; seeds "
            f"{seeds} of the methods that draw random numbers are pooled (points are counted once; a replicate "
            "draws a walk with all its seeds), and the mean error of each seed is given. `fused-barriers` tests "
            "walls as lines instead of the walkable mask. `fused, first release` has the parameters from before "
            "stairs, lifts and phones were modelled. `pdr` is dead reckoning from the first waypoint, which it is "
            "told; it is no rival."
        ),
    ]
    for name, tables in section["figures"].items():
        parts += [f"### Errors, {name}", "Once a second:", error_table(tables["1hz"], up_to="p95")]
        if name in section["comparisons"]:  # the single folds are there to be seen to agree
            parts += ["At the waypoints:", error_table(tables["waypoints"], up_to="p95")]
    for name, rows in section["comparisons"].items():
        parts += [f"### Paired differences, {name}", _comparisons(rows)]
    parts += ["### Coverage of the stated radii", _coverage_words(), _coverage(section["coverage"])]
    parts += _splits(section["splits"])
    return [*parts, "### Parameters", *_parameters(section["parameters"])]


def _comparisons(found: Sequence[Section]) -> str:
    rows = [
        [
            f"{c['method']} against {c['baseline']}",
            span(c["difference"]["mean"], signed),
            *(span(c["reduction"][k], whole) for k in ("mean", "p50", "p90")),
            str(c["n_walks"]),
        ]
        for c in found
    ]
    head = ["methods", "mean difference (m)", "mean below", "median below", "90 % below", "walks"]
    return table(head, rows)


def _coverage_words() -> str:
    return (
        "Share of the points, once a second, within the radius that is to hold 68 % and 95 % of them. The radii were "
        "calibrated on these same folds: that they hold here is no proof for another building."
    )


def _coverage(sets: Section) -> str:
    rows = []
    for name, methods in sets.items():
        for method, found in methods.items():
            if found is not None:
                of = found["overall"]
                radii = [metres(of["mean_r68"]), metres(of["mean_r95"])]
                shares = [span(of[k], percent) for k in ("within68", "within95")]
                rows.append([method, name, *shares, *radii])
    return table(["method", "walks of", "within r68", "within r95", "mean r68", "mean r95"], rows)


def _splits(sets: Section) -> list[str]:
    titles = {
        "by_survey_distance": "distance of the true place to the survey",
        "by_time": "time since the first scan",
    }
    parts = ["### By distance to the survey and by time", "Mean / median error once a second (points)."]
    for name, methods in sets.items():
        for key, title in titles.items():
            labels = list(dict.fromkeys(label for of in methods.values() for label in of[key]))
            rows = [
                [method, *(_cell(of[key].get(label)) for label in labels)] for method, of in methods.items()
            ]
            parts += [f"{name[0].upper()}{name[1:]}, {title}:", table(["method", *labels], rows)]
    return parts


def _cell(of: Section | None) -> str:
    return "-" if not of or of["mean"] is None else f"{metres(of['mean'])} / {metres(of['p50'])} ({of['n']})"


def _parameters(presets: Section) -> list[str]:
    lines = []
    for name, parameters in presets.items():
        shown = ", ".join(f"{k} {_value(v)}" for k, v in parameters.items())
        lines.append(f"`{name}`{'' if name == 'fused' else ', where other than `fused`'}: {shown}.")
    return lines


def _value(value: Any) -> str:
    if isinstance(value, Mapping):
        return "(" + ", ".join(f"{k} {_value(v)}" for k, v in value.items()) + ")"
    if isinstance(value, list):
        return "/".join(_value(v) for v in value) or "()"
    return f"{value:g}" if isinstance(value, float) else str(value)


# --- the other sections -------------------------------------------------------------------------------------


def _speed(section: Section) -> list[str]:
    rows = []
    for name, of in section["cpu_ms_per_s"].items():
        both = of.get("read_and_run")
        shown = ["-", "-"] if both is None else [f"{both['least']:.2f}", f"{both['median']:.2f}"]
        rows.append([name, f"{of['run']['least']:.2f}", f"{of['run']['median']:.2f}", *shown])
    head = ["method", "tracking, least", "tracking, median", "with reading, least", "with reading, median"]
    return [
        (
            f"Process CPU time in ms per second of walk, kernels compiled, one process: {section['walks']} walks "
            f"of the development set ({section['minutes']:.1f} minutes) in {section['repeats']} repeats. It "
            "depends on the machine, and is the only section that a rerun changes."
        ),
        table(head, rows),
    ]


def _static(section: Section) -> list[str]:
    rows = [
        [s["split"], s["method"], *(span(s[k], millimetres) for k in ("mean", "p50", "p75", "p95")),
         percent(s["floor_accuracy"]), f"{s['n']}, {s['n_points']}"]
        for s in section["scores"]
    ]  # fmt: skip
    head = ["split", "method", "mean", "median", "75 %", "95 %", "right floor", "queries, points"]
    return [
        (
            "Official training and test files; every line of a test file is located alone. The intervals draw "
            "whole test points. Parameters of the maps were chosen on the training file of CETC331, those of the "
            "noise of the Gaussian process on HCXY and SYL, where its rows are optimistic."
        ),
        table(head, rows),
    ]


def _steps(section: Section) -> list[str]:
    rows = [
        [name, str(of["walks"]), str(of["steps"]), str(of["found"]), percent(of["mean_error"])]
        for name, of in section["by_position"].items()
    ]
    rows.append(["all", str(section["walks"]), "", "", percent(section["mean_error"])])
    return [
        (
            "Validation walks; thresholds were set on the optimisation walks of the same set. The error is the "
            "mean over walks of |found - true| / true."
        ),
        table(["phone", "walks", "true steps", "found", "mean error"], rows),
    ]
