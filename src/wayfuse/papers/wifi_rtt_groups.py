"""The walks of ``wifi-rtt`` for methods that track recordings: each room a site of one open floor about its anchors.

The set has no plans. The floor is the rectangle of the anchors and `MARGIN` around it, without walls; waypoints are on
it, one for each row of a table. The ranges are as measured: no line is told.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from wayfuse.core.errors import DataMissingError
from wayfuse.formats import wifi_rtt
from wayfuse.maps.build import build_floor
from wayfuse.maps.site import Polygon, Site
from wayfuse.papers.comparison_runs import Group
from wayfuse.presets.methods import build_method
from wayfuse.radio.ap_places import ApPlaces
from wayfuse.sensors.recording import Recording

__all__ = ["DEVELOPMENT", "MARGIN", "ROOMS", "TEST", "TrackedWalks", "walk_groups"]

ROOMS = ("Laboratory", "Conference Room")
DEVELOPMENT, TEST = "1", "2345"  # loops, first letter of a walk's name
MARGIN = 3.0  # m
_FLOOR = "0"


def walk_groups(root: Path, loops: str) -> list[Group]:
    """A group per room with the walks of some loops, below the folder of the data set.

    Raises
    ------
    DataMissingError : a room is not there.
    """
    return [_group(root, room, loops) for room in ROOMS]


class TrackedWalks:
    """Mean error (m) of each recording of some groups by a method, at its waypoints; travels to the workers."""

    def __init__(self, method: str, groups: Sequence[Group]) -> None:
        self.method, self.groups = method, tuple(groups)

    @property
    def items(self) -> list[tuple[int, int]]:
        """Group and recording of each walk."""
        return [(g, i) for g, group in enumerate(self.groups) for i in range(len(group.recordings))]

    def __call__(self, item: tuple[int, int]) -> float:
        """Of one walk; a waypoint has the newest estimate of its time, those before the first have the first."""
        group = self.groups[item[0]]
        recording = group.recordings[item[1]]
        tracker = build_method(self.method, group.site, group.survey, places=group.places)
        said = tracker.run(recording, 0).estimates
        true = np.array([(w.t, w.x, w.y) for w in recording.waypoints])
        newest = np.searchsorted([e.t for e in said], true[:, 0], side="right") - 1
        places = np.array([(e.x, e.y) for e in said])[np.maximum(newest, 0)]
        return float(np.hypot(*(places - true[:, 1:]).T).mean())


def _group(root: Path, room: str, loops: str) -> Group:
    folders = sorted(root.glob(f"*/raw_data/{room}"))
    if not folders:
        remedy = "fetch with `wayfuse datasets fetch wifi-rtt`"
        raise DataMissingError(f"no walks of the {room}", where=root, remedy=remedy)
    paths = sorted(folders[0].glob("*/[0-9][0-9][0-9].csv"))
    recordings = tuple(_on_floor(wifi_rtt.read(path)) for path in paths if path.stem[0] in loops)
    site, places = _placed(room, wifi_rtt.read_places(folders[0]))
    return Group(site, None, recordings, places)


def _placed(room: str, anchors: tuple[wifi_rtt.PlacedAnchor, ...]) -> tuple[Site, ApPlaces]:
    xy = np.array([(a.x, a.y) for a in anchors])
    (x0, y0), (x1, y1) = xy.min(axis=0) - MARGIN, xy.max(axis=0) + MARGIN
    outline = Polygon(np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1], [x0, y0]]))
    ids = np.array([a.anchor for a in anchors], np.uint64)
    on_floor, no_height = np.zeros(len(ids), np.int32), np.full(len(ids), np.nan)
    return Site(room, (build_floor(_FLOOR, 0, [outline]),)), ApPlaces(
        ids, xy[:, 0], xy[:, 1], on_floor, no_height
    )


def _on_floor(recording: Recording) -> Recording:
    """With the name of the floor at its waypoints: the tables have none."""
    return replace(recording, waypoints=tuple(w._replace(floor=_FLOOR) for w in recording.waypoints))
