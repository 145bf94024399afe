"""Pictures of a survey by arithmetic: coverage, levels, and held-out errors by room."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from wayfuse.maps.areas import distance_to_area
from wayfuse.maps.site import Site
from wayfuse.models.survey_coverage import coverage, heard_at, level_of, next_places
from wayfuse.models.survey_rooms import held_out_by_room
from wayfuse.radio.survey import Survey
from wayfuse.radio.survey_accuracy import held_out


@pytest.fixture(scope="module")
def site(world: Any) -> Site:
    return world.site


def test_coverage_is_the_distance_to_the_nearest_fingerprint(site: Site) -> None:
    floor = site.floors[0]
    places = floor.walkable.centres()[[0, 500, 900]]
    grid = coverage(floor, places)
    ny, nx = grid.values.shape
    n = 0
    for j in range(0, ny, 3):
        for i in range(0, nx, 3):
            x, y = (i + 0.5) * grid.cell, (j + 0.5) * grid.cell
            if floor.walkable.contains(x, y):
                assert grid.values[j, i] == pytest.approx(np.hypot(*(places - (x, y)).T).min())
                n += 1
            else:
                assert np.isnan(grid.values[j, i])
    assert n > 100
    assert np.isinf(coverage(floor, np.empty((0, 2))).values[~np.isnan(grid.values)]).all()


def test_the_next_places_are_far_from_fingerprints_and_from_each_other(site: Site) -> None:
    floor = site.floors[0]
    places = floor.walkable.centres()[:1]
    found = next_places(floor, places)
    xy = np.array([p[:2] for p in found])
    assert len(found) == 5
    assert all(floor.walkable.contains(xy[:, 0], xy[:, 1]))
    assert found[0][2] == pytest.approx(np.nanmax(coverage(floor, places).values))
    between = np.hypot(*(xy[:, None] - np.concatenate([places, xy])).transpose(2, 0, 1))
    assert between[between > 0].min() >= 5.0
    assert next_places(floor, floor.walkable.centres()) == []
    assert np.isinf(next_places(floor, np.empty((0, 2)))[0][2])


def test_the_level_of_an_access_point_is_that_of_the_fingerprints(site: Site) -> None:
    floor = site.floors[0]
    places = floor.walkable.centres()[::40]
    levels = -40.0 - places[:, 0]
    levels[-1] = np.nan
    survey = Survey.from_dense(
        np.column_stack([np.full(len(places), -50.0), levels]),
        places,
        np.zeros(len(places), np.int32),
        site.floor_names,
    )
    xy, heard = heard_at(survey, 1, 0)
    np.testing.assert_allclose(heard, levels, rtol=1e-6)
    grid = level_of(floor, xy, heard)
    spots = [
        (int(y // grid.cell), int(x // grid.cell), level)
        for (x, y), level in zip(places, levels, strict=True)
    ]
    inner = [(grid.values[j, i], level) for j, i, level in spots[10:-10] if np.isfinite(grid.values[j, i])]
    assert len(inner) > 10
    assert np.median([abs(a - b) for a, b in inner]) < 2.0
    far = coverage(floor, xy).values > 5.0
    assert np.isnan(grid.values[far]).all()
    assert np.isnan(level_of(floor, xy, np.full(len(xy), np.nan)).values).all()


def test_held_out_errors_are_told_by_room(world: Any) -> None:
    site, survey = world.site, world.survey
    rooms = held_out_by_room(site, survey)
    assert sum(room.n for room in rooms) == len(held_out(survey, 1000).rows) > 100
    assert rooms == sorted(rooms, key=lambda room: -room.n)
    for room in rooms:
        assert 0.0 <= room.right_floor <= 1.0
        assert room.median is None or room.p90 is None or room.median <= room.p90
    names = {(site.floors[i].name, u.name) for i in range(len(site.floors)) for u in site.floors[i].units}
    assert {(r.level, r.name) for r in rooms if r.name} <= names


def test_a_place_in_a_hole_is_outside_by_the_distance_to_its_edge() -> None:
    square = np.array([[0.0, 0.0], [10.0, 0.0], [10.0, 10.0], [0.0, 10.0], [0.0, 0.0]])
    rings = (square, 4.0 + 0.2 * square[::-1])
    places = [(2.0, 2.0), (5.0, 5.0), (5.5, 5.0), (13.0, 14.0), (-2.0, 5.0)]
    found = [distance_to_area(rings, np.array(place)) for place in places]
    assert found == pytest.approx([0.0, 1.0, 0.5, 5.0, 2.0])
