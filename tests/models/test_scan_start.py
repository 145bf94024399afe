"""Where tracks begin: anywhere on the plan, on likely training places, on the place of the nearest fingerprints."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from wayfuse.core.errors import ConfigError
from wayfuse.core.philox import Noise
from wayfuse.models.constraint.barriers import Barriers
from wayfuse.models.scan_start import AnywhereAtRest, LikelyPlaces, NearestPlaces
from wayfuse.radio import interpolated_map, knn
from wayfuse.radio.survey import Fingerprint


def row_of(survey: Any, row: int) -> Fingerprint:
    part = slice(survey.indptr[row], survey.indptr[row + 1])
    ids = survey.bssid[survey.indices[part]]
    return Fingerprint(ids, survey.rssi[part], np.zeros(len(ids), np.int32))


def test_anywhere_is_uniform_over_the_walkable_space_of_all_floors(world: Any) -> None:
    masks = tuple(floor.walkable for floor in world.site.floors)
    cloud = AnywhereAtRest(walkable=masks).draw(Noise.of(0, "a"), None, 20_000, heading_known=True)
    for f, mask in enumerate(masks):
        on = cloud.floor == f
        assert mask.contains(cloud.x[on], cloud.y[on]).all()
        assert on.mean() == pytest.approx(mask.area / sum(m.area for m in masks), abs=0.02)


def test_likely_places_are_near_the_truth_and_on_their_side_of_walls(world: Any) -> None:
    radio_map = interpolated_map.fit(world.survey, sigma=6.0, cell=2.0)
    walls = Barriers(tuple(f.barrier_index for f in world.site.floors), 30.0)
    start = LikelyPlaces(radio_map=radio_map, radius=2.0, walls=walls)
    cloud = start.draw(Noise.of(0, "a"), row_of(world.survey, 40), 500, heading_known=False)
    assert cloud is not None
    near = np.hypot(cloud.x - world.survey.xy[40, 0], cloud.y - world.survey.xy[40, 1]) < 12.0
    assert np.mean(near & (cloud.floor == world.survey.floor[40])) > 0.9
    apart = np.hypot(*(np.column_stack([cloud.x, cloud.y])[:, None] - radio_map.xy[None]).transpose(2, 0, 1))
    assert apart.min(axis=1).max() <= 2.0 + 1e-5
    strange = (
        row_of(world.survey, 40)
        ._replace(bssid=np.arange(3, dtype=np.uint64))
        ._replace(rssi=np.full(3, -50.0, np.float32), frequency=np.zeros(3, np.int32))
    )
    assert start.draw(Noise.of(0, "a"), strange, 10, heading_known=True) is None
    assert start.draw(Noise.of(0, "a"), None, 10, heading_known=True) is None
    with pytest.raises(ConfigError, match="radius"):
        LikelyPlaces(radio_map=radio_map, radius=0.0)


def test_nearest_places_are_one_place(world: Any) -> None:
    radio_map = knn.fit(world.survey, k=3)
    seen = row_of(world.survey, 12)
    cloud = NearestPlaces(radio_map=radio_map).draw(Noise.of(0, "a"), seen, 50, heading_known=True)
    fix = radio_map.locate(seen)
    assert cloud is not None
    assert {(float(x), float(y), int(f)) for x, y, f in zip(cloud.x, cloud.y, cloud.floor, strict=True)} == {
        (float(np.float32(fix.x)), float(np.float32(fix.y)), fix.floor)
    }
    assert NearestPlaces(radio_map=radio_map).draw(Noise.of(0, "a"), (), 50, heading_known=True) is None
