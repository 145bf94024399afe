"""A surveyor's recording on a site: waypoints in the frames of the site's floors."""

from __future__ import annotations

import math

import numpy as np

from wayfuse.core.errors import MapError
from wayfuse.maps.site import Site
from wayfuse.radio.walk_survey import SurveyWalk
from wayfuse.sensors.recording import Recording
from wayfuse.sensors.records import Waypoint

__all__ = ["place_of", "survey_walk"]

_MARGIN = 5.0  # m; a waypoint farther than this outside the plan belongs to another building


def place_of(site: Site, waypoint: Waypoint) -> tuple[float, float, int]:
    """x, y (m, frame of the floor) and floor index of a waypoint.

    Raises
    ------
    MapError : the site has no such floor, or the waypoint has only degrees and the floor no anchor.
    """
    floor = site.floor_index(waypoint.floor)
    if math.isfinite(waypoint.x) and math.isfinite(waypoint.y):
        return waypoint.x, waypoint.y, floor
    anchor = site.floors[floor].anchor
    if anchor is None:
        raise MapError(
            f"waypoint in degrees, but floor {waypoint.floor} of site {site.name} has no anchor",
            remedy="import a plan with coordinates",
        )
    x, y = anchor.to_xy(np.array([waypoint.lon, waypoint.lat]))
    return float(x), float(y), floor


def survey_walk(site: Site, recording: Recording) -> tuple[SurveyWalk | None, list[str]]:
    """The walk of a recording, or None where it cannot survey; and what was odd, a line each."""
    notes: list[str] = []
    where = recording.path or recording.name
    rows: list[tuple[float, float, float, int]] = []
    outside = 0
    for waypoint in recording.waypoints:
        try:
            x, y, floor = place_of(site, waypoint)
        except MapError as error:
            return None, [f"{where}: {error}"]
        plan = site.floors[floor]
        if not (-_MARGIN <= x <= plan.width + _MARGIN and -_MARGIN <= y <= plan.height + _MARGIN):
            outside += 1
            continue
        rows.append((waypoint.t, x, y, floor))
    if outside:
        notes.append(
            f"{where}: {outside} of {len(recording.waypoints)} waypoints lie outside the map: left out"
        )
    if len(rows) < 2:
        return None, [*notes, f"{where}: fewer than two waypoints on the site: nothing surveyed"]
    if not recording.wifi:
        return None, [*notes, f"{where}: no Wi-Fi scan: nothing surveyed"]
    table = np.array(rows)
    keep = np.concatenate([[True], np.diff(table[:, 0]) > 0.0])
    table = table[keep]
    if len(table) < 2:
        return None, [*notes, f"{where}: all waypoints at one time: nothing surveyed"]
    return SurveyWalk(
        recording.name,
        table[:, 0],
        table[:, 1:3],
        table[:, 3].astype(np.int32),
        recording.wifi,
        recording.device.model,
    ), notes
