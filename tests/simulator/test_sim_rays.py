"""Rasters of traced rays, surfaces of a building, and what happens where rays are missing; without the tracer."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from wayfuse.core.errors import ConfigError, UsageError
from wayfuse.simulator import ray_tracer, traced_site
from wayfuse.simulator.building import box, shopping_centre
from wayfuse.simulator.channel_state import ChannelModel
from wayfuse.simulator.extrusion import slab_surfaces, wall_surfaces
from wayfuse.simulator.hall import hall
from wayfuse.simulator.radio_field import RadioModel, changed
from wayfuse.simulator.ray_tracer import Antennas, Work, newest_library, trace_rays
from wayfuse.simulator.rays import ChannelRays, Raster, RayField, RaysModel
from wayfuse.simulator.scenario import Scenario
from wayfuse.simulator.simulate import site_in


def _area(surfaces):
    a, b, c = (surfaces.corners[surfaces.triangles[:, k]] for k in range(3))
    return 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)


# --- surfaces -----------------------------------------------------------------------------------------------


def test_the_surfaces_of_a_hall_are_its_six_sides():
    building = hall(20.0, 12.0, 0)
    assert _area(wall_surfaces(building, 3.0)).sum() == pytest.approx(2 * (20.0 + 12.0) * 3.0)
    slabs = slab_surfaces(building, 3.0)
    assert _area(slabs).sum() == pytest.approx(2 * 20.0 * 12.0)
    assert sorted(set(slabs.corners[:, 2])) == [0.0, 3.0]


def test_a_hole_in_a_slab_is_open_and_its_railing_no_wall():
    building = shopping_centre(np.random.default_rng(0))
    upper = building.storeys[1]
    slabs = slab_surfaces(building, 3.5)
    at_slab = np.all(slabs.corners[slabs.triangles][:, :, 2] == upper.elevation, axis=1)
    hole = upper.voids[0].polygon
    size = shapely.Polygon(upper.outline).area - shapely.Polygon(hole).area
    assert _area(slabs)[at_slab].sum() == pytest.approx(size)
    walls = wall_surfaces(building, 3.5)
    corners = walls.corners[walls.triangles]
    on_upper = corners[..., 2].min(axis=1) == upper.elevation
    n_upper = len(upper.walls) - len(hole)
    assert on_upper.sum() == 2 * n_upper
    assert corners[~on_upper][..., 2].max() == upper.elevation  # drawn up to the next slab
    assert corners[on_upper][..., 2].max() == upper.elevation + 3.5


# --- rasters ------------------------------------------------------------------------------------------------


@given(st.floats(1.0, 60.0), st.floats(1.0, 40.0), st.floats(0.3, 5.0), st.floats(-20.0, 20.0))
def test_a_raster_covers_its_outline_and_knows_its_places(width, height, size, x0):
    raster = Raster.over(box(x0, x0 + width, 3.0, 3.0 + height), size)
    assert raster.columns * size >= width - 1e-6
    assert (raster.columns - 1) * size < width
    assert raster.rows * size >= height - 1e-6
    column, row = raster.position(raster.places)
    assert np.allclose(row * raster.columns + column, np.arange(len(raster.places)), atol=1e-6 / size)


def test_levels_are_bilinear_and_held_at_the_edge():
    raster = Raster(0.0, 0.0, 2.0, 5, 4)
    x, y = raster.places.T
    gain = np.stack([3.0 * x - 2.0 * y, -x]).reshape(2, 4, 5).astype(np.float32)
    field = RayField((raster,), (gain,))
    xy = np.random.default_rng(1).uniform((1.0, 1.0), (9.0, 7.0), (50, 2))
    radio = np.arange(50) % 2
    expected = np.where(radio == 0, 3.0 * xy[:, 0] - 2.0 * xy[:, 1], -xy[:, 0])
    assert np.allclose(field.level(radio, xy, 0), expected, atol=1e-5)
    outside = field.level(np.array([1, 1]), np.array([[-5.0, 3.0], [50.0, 3.0]]), 0)
    assert np.allclose(outside, [-1.0, -9.0])
    one = RayField((Raster(0.0, 0.0, 2.0, 1, 1),), (np.full((1, 1, 1), -40.0, np.float32),))
    assert one.level(np.array([0]), np.array([[0.3, 1.9]]), 0) == [-40.0]


def test_the_channel_is_that_of_the_nearest_place_with_mean_power_one():
    raster = Raster(0.0, 0.0, 1.0, 2, 1)
    amplitude = np.array([[[0.3, 0.4j, 0.0], [0.0, 0.0, 0.0]]], dtype=np.complex64)
    delay = np.array([[[10.0, 12.0, 0.0], [0.0, 0.0, 0.0]]], dtype=np.float32)
    rays = ChannelRays(raster, delay, amplitude, np.zeros((1, 2, 3), np.float32))
    taps = rays.taps(0, np.array([0.2, 0.7]))
    assert np.allclose(taps.delay, [10.0, 12.0])
    assert np.allclose(taps.amplitude, [0.6, 0.8j])
    assert rays.taps(0, np.array([1.6, 0.5])) is None


# --- what is missing ----------------------------------------------------------------------------------------


def _hall_site():
    scenario = Scenario(radio=RadioModel(model="rays", aps_per_floor=5))
    return site_in(hall(20.0, 12.0, 0), scenario, np.random.default_rng(0))


def test_without_sionna_the_remedy_is_named(monkeypatch):
    monkeypatch.setattr(ray_tracer, "find_spec", lambda _: None)
    nothing = Antennas(np.zeros((1, 3)), np.array([2.4e9]), np.array([False]))
    with pytest.raises(ConfigError, match="Sionna") as caught:
        trace_rays(hall(20.0, 12.0, 0), RaysModel(), nothing, (1.2, 3.0), 0)
    assert "wayfuse[sionna]" in caught.value.remedy


def test_the_newest_library_is_taken(monkeypatch, tmp_path):
    monkeypatch.setattr(ray_tracer, "_LIBRARIES", (f"{tmp_path}/none*.so*",))
    assert newest_library() == ""
    for name in (
        "libLLVM-9.so.1",
        "libLLVM-14.0.6.so.1",
        "libLLVM-15.so",
        "libLLVM.so.19.1",
        "libLLVMjunk.so",
    ):
        (tmp_path / name).touch()
    monkeypatch.setattr(ray_tracer, "_LIBRARIES", (f"{tmp_path}/libLLVM*.so*",))
    assert newest_library() == str(tmp_path / "libLLVM.so.19.1")


def test_rays_that_were_not_traced_are_missed_and_not_made_up():
    with pytest.raises(UsageError, match="no rays"):
        _hall_site().radios.rssi(np.array([0]), np.array([[5.0, 5.0]]), 0)


@pytest.mark.parametrize("period", [0.0, 0.5])
def test_only_access_points_that_moved_are_traced_again(monkeypatch, period):
    asked = []

    def told(building, model, antennas, heights, seed, work):
        asked.append(antennas)
        raster = Raster.over(building.storeys[0].outline, 4.0)
        n, places = len(antennas.place), raster.rows * raster.columns
        mark = antennas.place[:, 0]  # what tells one antenna from another
        gain = np.broadcast_to(mark[:, None, None], (n, raster.rows, raster.columns)).astype(np.float32)
        one = np.broadcast_to(mark[:, None, None], (n, places, 1))
        rays = ChannelRays(raster, one.astype(np.float32), one.astype(np.complex64), one.astype(np.float32))
        return RayField((raster,), (gain,), (rays,) if antennas.has_channel.any() else ())

    monkeypatch.setattr(traced_site, "trace_rays", told)
    before = _hall_site()
    later = replace(before, radios=changed(before.radios, before.building, 2, 1, np.random.default_rng(3)))
    first, second = traced_site.traced(before, later, ChannelModel(period_s=period), 0, Work())
    moved = np.any(later.radios.ap_xy != before.radios.ap_xy, axis=1)[before.radios.ap]
    assert moved.any()
    assert [len(a.place) for a in asked] == [len(moved), moved.sum()]
    assert asked[0].has_channel.any() == (period > 0.0)
    for site in (first, second):
        place = site.radios.ap_xy[site.radios.ap][:, 0]
        assert np.allclose(site.radios.rays.gain[0][:, 0, 0], place)
        for rays in site.radios.rays.channels:
            wanted = site.radios.band == 1
            assert np.allclose(rays.delay[wanted, 0, 0], place[wanted])
