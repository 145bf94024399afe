"""From what a survey collected to a radio map and its held-out errors, room by room."""

from __future__ import annotations

import math
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np

from wayfuse.core.errors import WayfuseError
from wayfuse.formats.reading import read
from wayfuse.maps.site import Site
from wayfuse.models.survey_rooms import RoomAccuracy, held_out_by_room
from wayfuse.models.survey_walk import survey_walk
from wayfuse.radio.walk_survey import SurveyParameters, SurveyWalk, WalkRadioMap, survey_from_walks
from wayfuse.sensors.records import WifiScan
from wayfuse.service.adapters.parts import identifier
from wayfuse.service.web.survey_store import Push, SurveyStore, TappedWalk
from wayfuse.service.wire import Scan

__all__ = ["Built", "build", "tapped_walk"]

_AROUND = 10.0  # s of scans kept before and after a walk
Progress = Callable[[float, str], None]


class Built(NamedTuple):
    """A radio map, as a file, and what is known of it."""

    archive: bytes
    fingerprints: int
    access_points: int
    walks: int
    notes: list[str]
    rooms: list[RoomAccuracy]


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
