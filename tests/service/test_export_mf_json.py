"""Moving Features JSON: every estimate with a place on earth, in strictly rising time, as the standard wants it."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from typing import Any

import numpy as np

from wayfuse.service.export import to_mf_json
from wayfuse.tracking.tracker import Tracker


def test_a_track_comes_back_as_a_moving_point(tracker: Tracker, world: Any) -> None:
    said = [e._replace(t=1.7e9 + n) for n, e in enumerate(tracker.run(world.walks[0]).estimates)]
    odd = [
        said[3]._replace(x=math.nan, t=1.7e9 + 0.5),
        said[3]._replace(t=-1.0),
        said[3]._replace(t=math.inf),
    ]
    again = said[5]._replace(x=said[5].x + 1.0)  # of the same time: the later one counts
    feature = json.loads(to_mf_json(world.site, [*said, *odd, again], "0123"))
    moving = feature["temporalGeometry"]
    assert feature["type"] == "Feature"
    assert moving["type"] == "MovingPoint"
    assert moving["datetimes"][0] == "2023-11-14T22:13:20.000Z"
    assert len(moving["coordinates"]) == len(moving["datetimes"]) == len(said)
    assert all(a < b for a, b in zip(moving["datetimes"], moving["datetimes"][1:], strict=False))
    floors = world.site.floors
    said[5] = again
    for e, lonlat in zip(said, moving["coordinates"], strict=True):
        np.testing.assert_allclose(floors[e.floor].anchor.to_xy(lonlat), (e.x, e.y), atol=1e-3)
    values = feature["temporalProperties"][0]
    assert values["datetimes"] == moving["datetimes"]
    assert values["level"]["values"] == [floors[e.floor].name for e in said]
    assert values["state"]["values"] == [e.state.value for e in said]


def test_a_floor_without_a_place_on_earth_gives_no_points(tracker: Tracker, world: Any) -> None:
    floors = tuple(replace(floor, anchor=None) for floor in world.site.floors)
    feature = json.loads(
        to_mf_json(replace(world.site, floors=floors), tracker.run(world.walks[0]).estimates, "0")
    )
    assert feature["temporalGeometry"]["coordinates"] == []
