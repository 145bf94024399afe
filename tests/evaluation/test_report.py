from __future__ import annotations

import json
import math

import numpy as np
import pytest
from made_up_walks import House, noisy_scores, recording, track

from wayfuse.core.errors import UsageError
from wayfuse.evaluation.errors import Scores, score, summarise
from wayfuse.evaluation.intervals import Bootstrap
from wayfuse.evaluation.report import build_report, plain, render
from wayfuse.radio.survey import Survey
from wayfuse.sensors.records import Waypoint

QUICK = Bootstrap(n=200)


def small() -> Scores:
    estimates = [
        track([101.0, 105.0], [(0, 0), (9, 0)], method="one"),
        track([105.0], [(5, 0)], method="two"),
    ]
    return score(estimates, [recording()])


def test_the_figures_are_those_of_the_points() -> None:
    scores = noisy_scores(6)
    report = build_report(scores, bootstrap=QUICK)
    for method in scores.methods:
        for at in ("1hz", "waypoints"):
            expected = summarise(method.points[at].used())
            for name in ("n", "mean", "p50", "p75", "p90", "p95", "floor_accuracy", "combined_mean", "ipin"):
                assert report["methods"][method.name][at][name] == pytest.approx(getattr(expected, name))


def test_the_dictionary_is_strict_json() -> None:
    # One walk: intervals, and the split by survey, are not known; that is null, never NaN.
    report = build_report(small(), bootstrap=QUICK)
    text = json.dumps(report, allow_nan=False)
    assert json.loads(text) == report
    assert report["methods"]["one"]["1hz"]["intervals"]["mean"]["low"] is None
    assert report["methods"]["one"]["by_survey_distance"] == {}
    assert report["methods"]["one"]["coverage"] is None


def test_plain_values() -> None:
    value = {"a": np.float64(1.5), "b": [math.nan, math.inf, 3], "c": (True, None, "x"), 4: {"d": -math.inf}}
    expected = {"a": 1.5, "b": [None, None, 3], "c": [True, None, "x"], "4": {"d": None}}
    assert plain(value) == expected


def test_missing_estimates_are_printed() -> None:
    report = build_report(small(), bootstrap=QUICK)
    two = report["methods"]["two"]
    assert two["availability"]["1hz"] == pytest.approx(6 / 9)
    assert two["1hz"]["n"] == 6
    assert two["1hz_all_times"]["n"] == 11
    text = render(report)
    assert "66.7 %" in text
    assert "are left out" in text
    filled = build_report(small(), missing="backfill", bootstrap=QUICK)
    assert filled["methods"]["two"]["1hz"]["n"] == 9
    assert "filled back with it" in render(filled)


def test_the_baseline_is_nnss_or_the_worst_or_the_one_asked_for() -> None:
    assert build_report(noisy_scores(4), bootstrap=QUICK)["baseline"] == "bad"
    named = noisy_scores(4, {"NNSS": 1.0, "fused": 3.0})
    assert build_report(named, bootstrap=QUICK)["baseline"] == "NNSS"
    asked = build_report(named, baseline="fused", bootstrap=QUICK)
    assert [(c["method"], c["baseline"]) for c in asked["comparisons"]] == [("NNSS", "fused")]
    with pytest.raises(UsageError, match="no method 'x'"):
        build_report(named, baseline="x", bootstrap=QUICK)
    alone = noisy_scores(3, {"only": 1.0})
    assert build_report(alone, bootstrap=QUICK)["comparisons"] == []
    with pytest.raises(UsageError, match="one method only"):
        build_report(alone, baseline="only", bootstrap=QUICK)


def test_the_comparison_reads_as_a_sentence() -> None:
    scores = noisy_scores(10, {"nnss": 3.0, "fused": 1.0, "worse": 6.0})
    report = build_report(scores, bootstrap=QUICK)
    text = render(report)
    better, worse = report["comparisons"]
    of = better["reduction"]["mean"]
    low, high = (f"{100 * of[end]:.0f}" for end in ("low", "high"))
    assert f"fused against nnss: mean {100 * of['value']:.0f} % [{low}, {high}] below" in text
    assert worse["reduction"]["mean"]["value"] < 0
    of = worse["reduction"]["mean"]
    assert f"mean {-100 * of['value']:.0f} % [{-100 * of['high']:.0f}, {-100 * of['low']:.0f}] above" in text


def test_the_split_by_distance_to_the_survey() -> None:
    survey = Survey.from_dense(np.full((1, 1), -50.0), np.array([(2.0, 0.0)]), np.array([0]), ("F1",))
    scores = score([track([102.0], [(2.0, 0.0)])], [recording()], survey=survey)
    report = build_report(scores, bootstrap=QUICK)
    split = report["methods"]["m"]["by_survey_distance"]
    assert {label: (s["n"], s["mean"]) for label, s in split.items()} == {
        "<= 2 m": (3, 1.0),
        "2-5 m": (3, 4.0),
        "> 5 m": (3, 7.0),
    }
    assert "distance of the truth to the survey" in render(report)


def test_errors_by_walk() -> None:
    report = build_report(noisy_scores(5), bootstrap=QUICK)
    rows = report["methods"]["good"]["by_walk"]
    assert [row["walk"] for row in rows] == report["walks"]
    total = sum(row["n"] * row["mean"] for row in rows) / sum(row["n"] for row in rows)
    assert total == pytest.approx(report["methods"]["good"]["1hz"]["mean"])


def test_tables_are_aligned_and_methods_in_order() -> None:
    text = render(build_report(noisy_scores(6, {"a": 1.0, "a longer name": 2.0}), bootstrap=QUICK))
    block = text.split("\n\n")[0].splitlines()
    assert block[0].startswith("1 Hz")
    assert [line.split("  ")[0] for line in block[3:]] == ["a", "a longer name"]
    assert len({len(line) for line in block[1:]}) == 1


def test_what_was_not_scored_is_named() -> None:
    points = (Waypoint(100.0, 0, 0, "B1"), Waypoint(110.0, 9, 0, "F2"))
    walks = [recording("a", points, scans=(100.0,)), recording("b", ()), recording("c")]
    estimates = [track([101.0], [(0, 0)], walk=w) for w in ("a", "b")] + [
        track([101.0], [(0, 0)], walk="c", method="other")
    ]
    scores = score(estimates, walks, House())
    report = build_report(scores, bootstrap=QUICK, notes=["A remark."])
    text = render(report)
    assert "recording without waypoints: 1 walk (b)" in text
    assert "m: no estimate for 1 walk (c)" in text
    assert "9 points at 1 Hz lie between waypoints of two floors" in text
    assert text.rstrip().endswith("A remark.")
    assert report["unscored"] == [{"walk": "b", "reason": "recording without waypoints"}]


def test_between_two_floors_nobody_is_on_the_wrong_one() -> None:
    points = (Waypoint(100.0, 0, 0, "B1"), Waypoint(104.0, 4, 0, "B1"), Waypoint(114.0, 4, 0, "F2"))
    walks = [recording("a", (*points, Waypoint(116.0, 6, 0, "F2")), scans=(100.0,))]
    # three seconds late on the upper floor, and wrong at its first waypoint
    late = [track([100.0, 114.5], [(0, 0), (4, 0)], floor=["B1", "F2"], walk="a")]
    of = build_report(score(late, walks, House()), bootstrap=QUICK)["methods"]["m"]["1hz"]
    assert (of["n"], of["n_in_transit"]) == (17, 9)
    assert of["floor_accuracy"] == pytest.approx(12 / 17)
    assert of["known_floor_accuracy"] == pytest.approx(7 / 8)


def test_long_lists_of_names_are_cut_in_the_text_only() -> None:
    walks = [recording("a"), *(recording(f"x{i}") for i in range(9))]
    report = build_report(score([track([101.0], [(0, 0)])], walks), bootstrap=QUICK)
    assert "9 walks (x0, x1, x2, x3, x4, ...)" in render(report)
    assert len(report["unscored"]) == 9


def test_coverage_table() -> None:
    report = build_report(noisy_scores(8), bootstrap=QUICK)
    text = render(report)
    assert "Coverage of the stated radii" in text
    within = report["methods"]["good"]["coverage"]["overall"]["within95"]
    assert (
        f"{100 * within['value']:.0f} % [{100 * within['low']:.0f} %, {100 * within['high']:.0f} %]" in text
    )
