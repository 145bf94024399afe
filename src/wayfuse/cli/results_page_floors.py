"""The sections of docs/results.md on buildings of several floors: no arithmetic."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from wayfuse.cli.results_page_cells import error_table, metres, percent, signed, span, table, whole

__all__ = ["behaviours", "hcu", "ipin2023"]

Section = Mapping[str, Any]

_AT = {"waypoints": "At the points", "1hz": "Once a second"}


# --- ipin2023 -----------------------------------------------------------------------------------------------


def ipin2023(section: Section) -> list[str]:
    """Errors, floor changes and phones."""
    seeds = ", ".join(map(str, section["seeds"]))
    parts = [
        (
            f"{section['recordings']} recordings ({section['minutes']:.0f} minutes) in a museum on three levels: trials"
            " 01-05 on floor 0, 21-27 on floor -2, 51 over stairs and a mezzanine, 52 over stairs, 53 by lift; two "
            "phones. Leave one repetition out: a recording is tracked with a survey of the recordings that bear "
            "another number of repetition, so no flight and no ride that is tracked was surveyed. Online; start, "
            "heading, floor and phone unknown. Scored at the surveyor's points (the last estimate at or before); the "
            "first of them comes after a minute, so start-up is not scored."
        ),
        (
            f"Seeds {seeds} are pooled as above. What flatters: every repetition walks the same line as the survey "
            "(off route, below, does not); parameters of `fused` were looked at on these recordings and on ms-indoor;"
            " the ends of stairs and lift in the map come from the points of these same recordings, for the set has "
            "no plan. Trials 51-53 are three recordings: their intervals say little."
        ),
        _surveys(section["surveys"]),
    ]
    for group, tables in section["figures"].items():
        parts += [
            f"### Errors, {group}",
            f"{_AT['waypoints']}:",
            error_table(tables["waypoints"], up_to="p90"),
        ]
        parts += [
            f"{_AT['1hz']}, less the moments between points on different floors:",
            error_table(tables["1hz"], up_to="p90"),
        ]
    parts += [
        "### Errors, off route",
        (
            "Trials on one floor; all recordings of the tested trial are left out of the survey as well, so that "
            "most of the way nobody surveyed the line that is walked."
        ),
        *(
            f
            for at, words in _AT.items()
            for f in (f"{words}:", error_table(section["off_route"][at], up_to="p90"))
        ),
        "Mean / median error once a second (points), by distance of the true place to the survey on its floor:",
        _by_distance(section["off_route_by_distance"]),
        "### Paired differences at the points",
        _comparisons(section["comparisons"]),
    ]
    parts += ["### Floor changes", *_changes(section["changes"])]
    return [*parts, "### How phones differ", *_phones(section["phones"])]


def _surveys(surveys: Sequence[Section]) -> str:
    rows = []
    for s in surveys:
        others = {
            m: shift for m, shift in s["shifts"].items() if m != s["reference"] and not m.startswith("?")
        }
        shown = ", ".join(f"{m} {_decibels(shift)}" for m, shift in others.items())
        rows.append([str(s["repetition"]), str(s["recordings"]), str(s["survey_walks"]), str(s["fingerprints"]),
                     str(s["access_points"]), s["reference"], shown or "-"])  # fmt: skip
    head = [
        "repetition",
        "recordings",
        "survey walks",
        "fingerprints",
        "access points",
        "levels of",
        "added to others",
    ]
    return table(head, rows)


def _decibels(shift: Sequence[float | None]) -> str:
    return " / ".join("-" if value is None else f"{value:+.1f}" for value in shift) + " dB"


def _by_distance(methods: Section) -> str:
    labels = list(dict.fromkeys(label for of in methods.values() for label in of))
    rows = [
        [name, *(f"{metres(of[k]['mean'])} / {metres(of[k]['p50'])} ({of[k]['n']})" for k in labels)]
        for name, of in methods.items()
    ]
    return table(["method", *labels], rows)


def _comparisons(groups: Mapping[str, Sequence[Section]]) -> str:
    rows = [
        [group, f"{c['method']} against {c['baseline']}", str(c["n_walks"]),
         *(span(c[k]["difference"], signed) for k in ("mean", "ipin")),
         *(span(c[k]["reduction"], whole) for k in ("mean", "ipin"))]
        for group, found in groups.items()
        for c in found
    ]  # fmt: skip
    head = [
        "recordings",
        "methods",
        "walks",
        "mean difference (m)",
        "IPIN difference (m)",
        "mean below",
        "IPIN below",
    ]
    return table(head, rows)


def _changes(methods: Section) -> list[str]:
    rows = []
    for name, of in methods.items():
        row = [name, *(str(of[k]) for k in ("true", "right", "missed", "extra"))]
        row += [
            f"{of['invented']} in {of['level_runs']}",
            _seconds(of["delay"]["median"]),
            _seconds(of["delay"]["p90"]),
        ]
        rows.append(row)
    head = ["method", "true changes", "said once, right", "missed", "others said", "invented on one floor (runs)",
            "delay, median (s)", "delay, 90 % (s)"]  # fmt: skip
    trials = [
        [r["recording"], name, str(r["true"]), str(r["right"]), str(r["missed"]), str(r["extra"])]
        for name, of in methods.items()
        for r in of["by_recording"]
    ]
    return [
        (
            "Trials 51-53, all seeds summed: a true change lies between two points on different floors. It is right "
            "when its floor is said once, the right way, and nothing else is said of it. The delay counts from the "
            "point of arrival to the first estimate on the right floor: negative is before it, while the person is on "
            "the way. Without an entry it is infinite, for more changes than that were missed."
        ),
        table(head, rows),
        "By recording, where there are true changes or any were said:",
        table(["recording", "method", "true changes", "said once, right", "missed", "others said"], trials),
    ]


def _seconds(value: float | None) -> str:
    return "-" if value is None else f"{value:+.1f}"


def _phones(rows: Sequence[Section]) -> list[str]:
    shown = [
        [str(r["repetition"]), r["model"] or "not named", str(r["n"]), *(_pair(r, band) for band in (0, 1))]
        for r in rows
    ]
    return [
        (
            "Shift added to the levels of a phone, as the estimator of the tracker gives it by the end of a recording "
            "from its scans alone: mean and standard deviation over recordings. The surveys are at the levels of the "
            "phone named above."
        ),
        table(["repetition", "phone", "recordings", "2.4 GHz (dB)", "5 GHz (dB)"], shown),
    ]


def _pair(row: Section, band: int) -> str:
    mean, sd = row["mean"][band], row["sd"][band]
    return f"{mean:+.1f}" if sd is None else f"{mean:+.1f} ± {sd:.1f}"


# --- behaviours ---------------------------------------------------------------------------------------------


def behaviours(section: Section) -> list[str]:
    """Flights, rides and standing found."""
    rows = []
    for name, of in section["scores"].items():
        for kind, c in of["classes"].items():
            counts = [f"{c[k]} of {c['n']}" for k in ("right", "signed", "wrong_sign")]
            rows.append([name, kind, *counts])
    late = [
        [name, f"{of['false_alarms']} ({of['false_alarms_per_hour']:.2f} per hour)",
         *(_seconds(of[k]) for k in ("declared_after", "over_after", "declared_before_arrival"))]
        for name, of in section["scores"].items()
    ]  # fmt: skip
    s = section["standing"]
    walks = [
        [r["walk"], ", ".join(r["floors"]), "yes" if r["barometer"] else "no",
         "; ".join(f"{f['behaviour']} {f['rise']:+.1f} ± {f['sigma']:.1f} m, {f['steps']} steps" for f in r["found"])
         or "nothing"]
        for r in section["hcu"]
    ]  # fmt: skip
    return [
        (
            f"All {section['recordings']} recordings of ipin2023-track3 ({section['hours']:.1f} hours). Right: found, "
            "class and sign right, and nothing else found there. False alarms: whatever is found where the points "
            "tell of no change, shaking the phone at the beginning included."
        ),
        (
            "Thresholds come from physics, building rules, ms-indoor, the trials on one floor and the HCU walks. With "
            "a barometer the rules were first found by a prototype that had seen all of these recordings; without one "
            "the flights and rides scored here were in view while five parameters got their values (notes in "
            "`inertial/vertical_config.py`): figures without a barometer flatter."
        ),
        table(["sensors", "movement", "class and sign right", "sign right", "sign wrong"], rows),
        "Medians in seconds; a negative time before arrival would be too late:",
        table(["sensors", "false alarms", "declared after", "over after", "declared before arrival"], late),
        (
            f"Standing, told by steps: {percent(s['standing_found'])} of {s['standing']:.0f} s of standing is found, "
            f"{percent(s['walking_called_standing'])} of {s['walking']:.0f} s of walking is called standing."
        ),
        "HCU Hamburg (floors at 1.3, 7.6 and 19.6 m):",
        table(["walk", "floors", "barometer", "found"], walks),
    ]


# --- hcu ----------------------------------------------------------------------------------------------------


def hcu(section: Section) -> list[str]:
    """The walks without Wi-Fi."""
    parts = [
        (
            "Motion sensors, barometer and floor plans, from a start that is told (not the heading). The logs hold no "
            "rotation vector, and heading is the weak side here: the question is the floors. Seeds "
            f"{', '.join(map(str, section['seeds']))} pooled. A walk is one case, and has no interval."
        )
    ]
    for walk, of in section["walks"].items():
        parts += [
            f"### {walk}",
            f"{of['minutes']:.1f} minutes; floors by the points: {' '.join(of['floors'])}.",
        ]
        parts.append(_methods(of["methods"]))
    kinds = [[c["id"], c["kind"], " ".join(c["floors"])] for c in section["connectors"]]
    return [*parts, "Stairs and lifts of the plans:", table(["id", "kind", "floors"], kinds)]


def _methods(methods: Section) -> str:
    rows = [
        [name, "; ".join(dict.fromkeys(" ".join(run) for run in of["floors"])),
         f"{of['right']} of {of['true']}", str(of["extra"]),
         *(percent(of[at]["floor_accuracy"]) for at in _AT),
         *(f"{metres(of[at]['mean'])} / {metres(of[at]['p50'])}" for at in _AT)]
        for name, of in methods.items()
    ]  # fmt: skip
    head = ["method", "floors said", "changes right", "others said", "right floor, points", "right floor, 1 Hz",
            "mean / median error, points", "mean / median error, 1 Hz"]  # fmt: skip
    return table(head, rows)
