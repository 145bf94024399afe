"""The walk of HCU Hamburg to the 4th floor, by motion sensors and floor plans alone from a start that is told.

Ground floor, stairs to the first, lift to the fourth; nobody surveyed radio there. `fused-no-wifi` knows the plans
and their stairs and lifts, `pdr` only adds up steps. The second walk of the set stays on the 4th floor.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np

from wayfuse.evaluation.errors import MethodScores, PointErrors, Scores, score, summarise
from wayfuse.evaluation.estimates_file import WalkEstimates, from_track
from wayfuse.evaluation.floor_changes import score_changes
from wayfuse.evaluation.results_bars import Bar, at_least, at_most
from wayfuse.evaluation.results_folds import SEEDS
from wayfuse.evaluation.truth import TIMES
from wayfuse.formats.reading import expand, read
from wayfuse.maps.importers.hcu import import_site
from wayfuse.maps.site import Site
from wayfuse.models.survey_walk import place_of
from wayfuse.presets import baselines, fused
from wayfuse.sensors.recording import Recording
from wayfuse.tracking.dead_reckoning import Start
from wayfuse.tracking.tracker import Tracker

__all__ = ["METHODS", "measure_hcu"]

_FUSED = "fused-no-wifi"
METHODS = (_FUSED, "fused-no-wifi, no barometer", "pdr")
_SEEDED = METHODS[:2]


def measure_hcu(folder: Path, seeds: Sequence[int] = SEEDS) -> dict[str, Any]:
    """Track the walks from their first waypoint by every method and seed; all figures as plain values.

    folder : of the data set, with the plans in ``MapMaterial`` and the walks in ``SensorLog``.
    """
    site, _ = import_site(folder)
    recordings = [read(path) for path in expand([folder / "SensorLog"])]
    tracks = [track for recording in recordings for track in _track(site, recording, seeds)]
    scores = score(tracks, recordings, site)
    walks = {r.name: _walk(site, r, scores, tracks) for r in recordings}
    section = {"seeds": list(seeds), "floors": list(site.floor_names), "connectors": _connectors(site)}
    return section | {"walks": walks, "bars": [asdict(bar) for bar in _bars(walks)]}


def _build(method: str, site: Site, start: Start) -> Tracker[Any]:
    if method == "pdr":
        return baselines.dead_reckoning(site, start)
    config = fused.Config()
    return fused.build_from_start(
        site, start, config if method == _FUSED else replace(config, use_pressure=False)
    )


def _track(site: Site, recording: Recording, seeds: Sequence[int]) -> list[WalkEstimates]:
    start = Start(*place_of(site, recording.waypoints[0]))
    out = []
    for method in METHODS:
        tracker = _build(method, site, start)
        for seed in seeds if method in _SEEDED else seeds[:1]:
            done = tracker.run(recording, seed)
            out.append(from_track(recording.name, f"{method}#{seed}", done.estimates, site.floor_names))
    return out


def _connectors(site: Site) -> list[dict[str, Any]]:
    return [
        {"id": c.id, "kind": c.kind.value, "floors": [site.floor_names[k] for k in c.floors]}
        for c in site.connectors
    ]


def _walk(
    site: Site, recording: Recording, scores: Scores, tracks: Sequence[WalkEstimates]
) -> dict[str, Any]:
    """Figures of each method on a walk, its seeds pooled, and the floors that each seed went through."""
    index = scores.walks.index(recording.name)
    return {
        "minutes": (recording.span[1] - recording.span[0]) / 60.0,
        "floors": _runs([w.floor for w in recording.waypoints]),
        "methods": {
            method: _figures(
                site, recording, index, _of(method, scores), _mine(method, recording.name, tracks)
            )
            for method in METHODS
        },
    }


def _of(method: str, scores: Scores) -> list[MethodScores]:
    return [m for m in scores.methods if m.name.partition("#")[0] == method]


def _mine(method: str, walk: str, tracks: Sequence[WalkEstimates]) -> list[WalkEstimates]:
    return [t for t in tracks if t.walk == walk and t.method.partition("#")[0] == method]


def _figures(
    site: Site,
    recording: Recording,
    walk: int,
    scored: Sequence[MethodScores],
    tracks: Sequence[WalkEstimates],
) -> dict[str, Any]:
    changes = score_changes(site, [recording], tracks)[recording.name]
    delays = np.concatenate([c.delays for c in changes])
    out: dict[str, Any] = {
        "seeds": len(tracks),
        "floors": [_runs(track.floor.tolist()) for track in tracks],
        "true": sum(len(c.truths) for c in changes),
        "right": sum(c.n_right for c in changes),
        "extra": sum(c.n_extra for c in changes),
        "delays": delays.tolist(),
    }
    for at in TIMES:
        points = PointErrors.join([m.points[at].used() for m in scored]).of_known_floor()
        out[at] = asdict(summarise(points.select(points.walk == walk)))
    return out


def _runs(floors: Sequence[str]) -> list[str]:
    """Floors in the order they come, each run of equals once."""
    return [name for k, name in enumerate(floors) if k == 0 or name != floors[k - 1]]


def _bars(walks: dict[str, dict[str, Any]]) -> list[Bar]:
    found = [walk["methods"][_FUSED] for walk in walks.values()]
    n_true, n_right = (sum(of[k] for of in found) for k in ("true", "right"))
    return [
        at_least(
            "HCU Hamburg, no Wi-Fi: right floor at the points",
            1.0,
            min(of["waypoints"]["floor_accuracy"] for of in found),
            "%",
        ),
        at_least(
            "HCU Hamburg, no Wi-Fi: right floor once a second",
            1.0,
            min(of["1hz"]["floor_accuracy"] for of in found),
            "%",
        ),
        at_least(
            "HCU Hamburg, no Wi-Fi: floor changes said once, right",
            1.0,
            n_right / n_true if n_true else float("nan"),
            "%",
        ),
        at_most(
            "HCU Hamburg, no Wi-Fi: other floor changes said",
            0.0,
            sum(of["extra"] for of in found),
            "changes",
        ),
    ]
