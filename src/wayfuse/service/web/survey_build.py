"""From what a survey collected to a radio map and its held-out errors, room by room."""

from __future__ import annotations

import math
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from wayfuse.core.errors import WayfuseError
from wayfuse.formats.reading import read
from wayfuse.maps.site import Site
from wayfuse.models.survey_walk import survey_walk
from wayfuse.radio.survey import Survey
from wayfuse.radio.survey_accuracy import held_out
from wayfuse.radio.walk_survey import SurveyParameters, SurveyWalk, WalkRadioMap, survey_from_walks
from wayfuse.sensors.records import WifiScan
from wayfuse.service.adapters.parts import identifier
from wayfuse.service.web.survey_store import Push, SurveyStore, TappedWalk
from wayfuse.service.wire import Scan

__all__ = ["Built", "Room", "build", "held_out_by_room", "tapped_walk"]

_AROUND = 10.0  # s of scans kept before and after a walk
_HELD_OUT = 1000  # fingerprints looked up again at most
Progress = Callable[[float, str], None]


class Room(NamedTuple):
    """Held-out errors in a room (empty name: outside all units). median, p90 : m, wrong floors count infinite."""

    level: str
    name: str
    n: int
    median: float | None
    p90: float | None
    right_floor: float


class Built(NamedTuple):
    """A radio map, as a file, and what is known of it."""

    archive: bytes
    fingerprints: int
    access_points: int
    walks: int
    notes: list[str]
    rooms: list[Room]


def build(site: Site, store: SurveyStore, progress: Progress) -> Built:
    """Build a radio map of all that was collected; ``progress`` is told a share and what is being done.

    Raises
    ------
    RadioMapError : nothing of it gives a fingerprint.
    """
    walks: list[SurveyWalk] = []
    notes: list[str] = []
    tapped, files = store.walks(), store.recordings()
    n = len(tapped) + len(files)
    for k, (name, walk) in enumerate(tapped.items()):
        progress(0.6 * k / n, f"walk {k + 1} of {len(tapped)}")
        made = tapped_walk(name, walk, list(store.pushes(walk.device)))
        walks.append(made)
        if not made.scans:
            notes.append(f"walk {name}: no Wi-Fi scan of its phone")
    for k, (name, path) in enumerate(files.items()):
        progress(0.6 * (len(tapped) + k) / n, f"recording {k + 1} of {len(files)}")
        found, said = _recorded(site, path)
        notes += [f"recording {name}: {line}" for line in said]
        if found is not None:
            walks.append(found)
    progress(0.6, "fingerprints")
    parameters = SurveyParameters()
    survey = survey_from_walks(walks, site.floor_names, parameters)
    progress(0.8, "held-out errors")
    rooms = held_out_by_room(site, survey)
    progress(0.95, "writing")
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "map.npz"
        WalkRadioMap(survey, parameters, site.name).save(path)
        archive = path.read_bytes()
    return Built(archive, len(survey), len(survey.bssid), len(survey.walks), notes, rooms)


def tapped_walk(name: str, walk: TappedWalk, pushes: list[Push]) -> SurveyWalk:
    """A walk in the phone's clock, with the phone's scans.

    The phone's clock is ahead of the server's by at least newest - arrived of every push; the greatest of them is of
    the push that travelled fastest.
    """
    ahead = max((p.newest - p.arrived for p in pushes), default=0.0)
    t = np.array([w.t + ahead for w in walk.waypoints])
    keep = np.concatenate([[True], np.diff(t) > 0.0])
    scans = [s for p in pushes for s in p.scans if t[0] - _AROUND <= s.t <= t[-1] + _AROUND]
    return SurveyWalk(
        name,
        t[keep],
        np.array([(w.x, w.y) for w in walk.waypoints])[keep],
        np.array([w.floor for w in walk.waypoints], np.int32)[keep],
        tuple(_scan(s) for s in sorted(scans, key=lambda s: s.t)),
        walk.device,
    )


def _scan(scan: Scan) -> WifiScan:
    return WifiScan(
        scan.t,
        np.array([identifier(ap.bssid) for ap in scan.aps], np.uint64),
        np.array([ap.rssi for ap in scan.aps], np.float32),
        np.array([ap.mhz for ap in scan.aps], np.int32),
        np.array([math.nan if ap.seen is None else ap.seen for ap in scan.aps]),
    )


def _recorded(site: Site, path: Path) -> tuple[SurveyWalk | None, list[str]]:
    try:
        recording = read(path)
    except WayfuseError as error:
        return None, [error.what]
    walk, notes = survey_walk(site, recording)
    return walk, [*recording.report.describe(), *(note.replace(f"{path}: ", "") for note in notes)]


def held_out_by_room(site: Site, survey: Survey) -> list[Room]:
    """Errors of fingerprints found by the other walks, by floor and unit, most fingerprints first."""
    found = held_out(survey, _HELD_OUT)
    of: dict[tuple[int, str], list[float]] = {}
    for row, error in zip(found.rows.tolist(), found.errors.tolist(), strict=True):
        floor = int(survey.floor[row])
        of.setdefault((floor, _unit_at(site, floor, survey.xy[row])), []).append(error)
    rooms = [_room(site.floors[floor].name, name, errors) for (floor, name), errors in of.items()]
    return sorted(rooms, key=lambda room: (-room.n, room.level, room.name))


def _room(level: str, name: str, errors: list[float]) -> Room:
    ordered = np.sort(errors)
    median, p90 = (float(ordered[math.ceil(q * len(ordered)) - 1]) for q in (0.5, 0.9))
    right = float(np.mean(np.isfinite(ordered)))
    return Room(level, name, len(errors), _finite(median), _finite(p90), right)


def _unit_at(site: Site, floor: int, xy: Any) -> str:
    for unit in site.floors[floor].units:
        inside = [_is_in(ring, float(xy[0]), float(xy[1])) for ring in unit.polygon.rings]
        if inside[0] and not any(inside[1:]):
            return unit.name or unit.category or unit.id
    return ""


def _is_in(ring: Any, x: float, y: float) -> bool:
    """Whether a place lies in a closed ring (k, 2): a ray to the right meets its edges an odd number of times."""
    x0, y0, x1, y1 = ring[:-1, 0], ring[:-1, 1], ring[1:, 0], ring[1:, 1]
    spans = (y0 > y) != (y1 > y)
    at = x0[spans] + (y - y0[spans]) * (x1[spans] - x0[spans]) / (y1[spans] - y0[spans])
    return bool(np.count_nonzero(at > x) % 2)


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None
