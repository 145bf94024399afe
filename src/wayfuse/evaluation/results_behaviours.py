"""Stairs, lifts and standing told from walking: ipin2023-track3, and the walks of HCU Hamburg, with their bars."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from wayfuse.evaluation.behaviours import (
    BehaviourScore,
    detect,
    ipin2023_labels,
    score_behaviours,
    score_standing,
)
from wayfuse.evaluation.results_bars import Bar, at_least, at_most
from wayfuse.evaluation.results_folds import Mapper, in_turn
from wayfuse.formats.reading import read
from wayfuse.inertial.vertical import Behaviour
from wayfuse.inertial.vertical_front_end import VerticalConfig
from wayfuse.sensors.recording import Recording

__all__ = ["measure_behaviours"]

_CLASSES = (Behaviour.STAIRS, Behaviour.LIFT)
_FALSE_PER_HOUR = 0.5
_STAIRS_SIGNED, _LIFTS_SIGNED = 10, 3  # of 12 and 4, without barometer


def measure_behaviours(logs: Path, walks: Path, mapper: Mapper = in_turn) -> dict[str, Any]:
    """Score the detectors with and without barometer.

    logs : folder of the ipin2023-track3 logs. walks : folder with the folders of the HCU walks.
    """
    recordings = tuple(mapper(_read, sorted(logs.glob("*.txt")), "reading"))
    labels = ipin2023_labels(recordings)
    with_it, without = (score_behaviours(recordings, labels, use_pressure=use) for use in (True, False))
    standing = score_standing(recordings)
    folders = sorted(path for path in walks.iterdir() if path.is_dir())
    return {
        "recordings": len(recordings),
        "hours": with_it.hours,
        "scores": {"barometer": _figures(with_it), "no barometer": _figures(without)},
        "standing": standing._asdict(),
        "hcu": [row for folder in folders for row in _hcu(read(folder))],
        "bars": [asdict(bar) for bar in _bars(with_it, without)],
    }


def _read(path: Path) -> Recording:
    return read(path)


def _figures(score: BehaviourScore) -> dict[str, Any]:
    return {
        "classes": {
            kind.name.lower(): {
                "n": score.count(kind),
                "right": score.n_right(kind),
                "signed": score.n_signed(kind),
                "wrong_sign": score.n_wrong_sign(kind),
            }
            for kind in _CLASSES
        },
        "false_alarms": len(score.false_alarms),
        "false_alarms_per_hour": score.false_alarms_per_hour,
        "declared_after": _median(score.declared_after),
        "over_after": _median(score.over_after),
        "declared_before_arrival": _median(score.declared_before_arrival),
    }


def _median(values: Any) -> float:
    return float(np.median(values)) if len(values) else float("nan")


def _hcu(recording: Recording) -> list[dict[str, Any]]:
    """The movements found in a walk, with and without barometer."""
    rows = []
    for use in (True, False):
        events = detect(recording, VerticalConfig(use_pressure=use))[1]
        found: Sequence[dict[str, Any]] = [
            {"behaviour": e.behaviour.name.lower(), "rise": e.rise, "sigma": e.sigma, "steps": e.n_steps}
            for e in events
            if e.is_over
        ]
        heights = sorted({w.floor for w in recording.waypoints if w.floor})
        rows.append({"walk": recording.name, "barometer": use, "floors": heights, "found": list(found)})
    return rows


def _bars(with_it: BehaviourScore, without: BehaviourScore) -> list[Bar]:
    n = with_it.count()
    stairs, lift = _CLASSES
    return [
        at_least("behaviours, barometer: right class and sign", n, with_it.n_right(), f"of {n}"),
        at_most(
            "behaviours, barometer: false alarms", _FALSE_PER_HOUR, with_it.false_alarms_per_hour, "per hour"
        ),
        at_least(
            "behaviours, no barometer: lift, right sign",
            _LIFTS_SIGNED,
            without.n_signed(lift),
            _of(without, lift),
        ),
        at_most(
            "behaviours, no barometer: lift, wrong sign", 0, without.n_wrong_sign(lift), _of(without, lift)
        ),
        at_least(
            "behaviours, no barometer: stairs, right sign",
            _STAIRS_SIGNED,
            without.n_signed(stairs),
            _of(without, stairs),
        ),
    ]


def _of(score: BehaviourScore, kind: Behaviour) -> str:
    return f"of {score.count(kind)}"
