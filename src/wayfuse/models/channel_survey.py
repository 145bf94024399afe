"""How far the anchors were when their frames were heard on a surveyed walk: what channel models are fitted to."""

from __future__ import annotations

import numpy as np

from wayfuse.core.types import Array
from wayfuse.maps.site import Site
from wayfuse.models.survey_walk import place_of
from wayfuse.radio.ap_places import ApPlaces
from wayfuse.sensors.recording import Recording

__all__ = ["anchor_distances"]


def anchor_distances(site: Site, recording: Recording, places: ApPlaces, phone_height: float = 1.2) -> Array:
    """Distance (n,) m in space from the surveyor to the anchor of each frame of a recording.

    The surveyor goes straight from one stated place to the next. NaN before the first and after the last, between
    places on different floors, for anchors of other floors or unknown places. An anchor of unknown height is level
    with the phone, which is ``phone_height`` (m) above the floor, as in `models.observation.anchored_ranges`.

    Raises
    ------
    MapError : a waypoint is on no floor of the site.
    """
    out = np.full(len(recording.csi), np.nan)
    waypoints = recording.waypoints
    rows = places.rows(np.array([frame.anchor for frame in recording.csi], np.uint64))
    if len(waypoints) < 2 or not len(places) or not len(out):
        return out
    stated = np.array([place_of(site, waypoint) for waypoint in waypoints])
    t, heard = np.array([w.t for w in waypoints]), np.array([frame.t for frame in recording.csi])
    leg = np.clip(np.searchsorted(t, heard, side="right") - 1, 0, len(t) - 2)
    x, y = (np.interp(heard, t, stated[:, k], np.nan, np.nan) for k in (0, 1))
    floor = stated[leg, 2]
    same = (rows >= 0) & (floor == stated[leg + 1, 2]) & (places.floor[rows] == floor)
    dz = np.where(np.isfinite(places.height), places.height - phone_height, 0.0)[rows]
    distance = np.sqrt((places.x[rows] - x) ** 2 + (places.y[rows] - y) ** 2 + dz**2)
    out[same] = distance[same]
    return out
