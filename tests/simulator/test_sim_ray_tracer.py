"""The ray tracer against the images of an empty room, and what walls, metal and slabs do to waves."""

from __future__ import annotations

import numpy as np
import pytest

from ray_tracing import skip_without_tracer
from wayfuse.core.errors import ConfigError
from wayfuse.simulator.experiment import make_world, plan_walks, simulate_plan
from wayfuse.simulator.free_space import LIGHT, first_metre_db
from wayfuse.simulator.geometry import clearance, inside
from wayfuse.simulator.hall import hall
from wayfuse.simulator.he2014_world import Room, strength
from wayfuse.simulator.ray_tracer import Antennas, Work, trace_rays
from wayfuse.simulator.rays import SILENT_DB, RaysModel
from wayfuse.simulator.scenario_file import load_scenario_file
from wayfuse.simulator.storeys import three_storeys

pytestmark = pytest.mark.slow

CARRIER = 2.437e9
CONCRETE = 5.24  # relative permittivity, ITU-R P.2040
AT = np.array([[1.0, 1.0, 2.5], [23.0, 15.0, 2.5]])
THICK = RaysModel(  # so thick that nothing comes back from the other side: the flat half-space of the images
    wall_material="concrete", wall_m=5.0, slab_m=5.0, interactions=2, samples=300_000
)


def _traced():
    antennas = Antennas(AT, np.full(2, CARRIER), np.array([True, False]))
    return trace_rays(hall(24.0, 16.0, 0), THICK, antennas, (1.2, 3.0), 7)


@pytest.fixture(scope="module")
def rays():
    skip_without_tracer()
    return _traced()


def _images(places):
    room = Room(
        size=(24.0, 16.0, 3.0),
        ap_xy=tuple((x, y) for x, y, _ in AT.tolist()),
        permittivity=CONCRETE,
        frequency=CARRIER,
        power_dbm=first_metre_db(CARRIER),
    )
    return strength(room, places)


def test_levels_are_those_of_the_images(rays):
    raster = rays.rasters[0]
    apart = rays.gain[0].reshape(2, -1).T - _images(raster.places)
    assert abs(apart.mean()) < 0.05  # two ray tracers that share nothing
    assert apart.std() < 0.4


def test_the_rays_of_the_channel_are_those_of_the_images(rays):
    channels = rays.channels[0]
    power = np.sum(np.abs(channels.amplitude[0]) ** 2, axis=1)
    gain = 10.0 * np.log10(power) + first_metre_db(CARRIER)
    assert np.abs(gain - _images(channels.raster.places)[:, 0]).std() < 0.1
    direct = np.linalg.norm(
        np.column_stack([channels.raster.places, np.full(len(gain), 1.2)]) - AT[0], axis=1
    )
    there = channels.amplitude[0] != 0.0
    first = np.where(there, channels.delay[0], np.inf).min(axis=1)
    assert np.allclose(first, 1e9 * direct / LIGHT, atol=0.01)
    assert there.sum(axis=1).max() == 25  # direct, 6 reflected once, 18 twice
    assert not channels.amplitude[1].any()  # not asked for


def test_the_same_seed_gives_the_same_bits(rays):
    again = _traced()
    assert np.array_equal(again.gain[0], rays.gain[0])
    for name in ("delay", "amplitude", "azimuth"):
        assert np.array_equal(getattr(again.channels[0], name), getattr(rays.channels[0], name))


def test_slabs_weaken():
    skip_without_tracer()
    building = three_storeys(np.random.default_rng(0), with_escalator=False)
    antennas = Antennas(np.array([[30.0, 2.0, 3.0]]), np.array([CARRIER]), np.array([False]))
    field = trace_rays(building, RaysModel(raster_m=2.0, samples=100_000), antennas, (1.2, 3.5), 1)
    near = np.hypot(*(field.rasters[0].places - (30.0, 2.0)).T) < 8.0
    own, above, top = (float(np.mean(gain[0].ravel()[near])) for gain in field.gain)
    assert own > above + 10.0 > top + 15.0


def test_metal_shuts_out_what_a_board_lets_through():
    skip_without_tracer()
    building = hall(24.0, 20.0, 1)
    rack = building.storeys[0].rooms[0].polygon
    antennas = Antennas(np.array([[2.0, 2.0, 2.5]]), np.array([CARRIER]), np.array([False]))
    heard = []
    for material in ("plasterboard", "metal"):
        model = RaysModel(wall_material=material, samples=100_000)
        field = trace_rays(building, model, antennas, (1.2, 3.0), 1)
        places = field.rasters[0].places
        within = inside(rack, places) & (clearance(places, building.storeys[0].walls) > 0.75)
        heard.append(float(np.mean(field.gain[0].ravel()[within] > SILENT_DB)))
    assert heard[0] > 0.9
    assert heard[1] == 0.0


def test_a_scenario_with_rays_gives_levels_and_channel_state(tmp_path):
    skip_without_tracer()
    path = tmp_path / "scenario.toml"
    path.write_text(
        '[site]\nbuilding = "hall"\nsize = [16.0, 12.0]\n[walkers]\nnumber = 1\nduration_s = [10.0, 12.0]\n'
        '[radio]\nmodel = "rays"\nap_height = 2.5\naccess_points = [[1, 1, "0"], [15, 11, "0"]]\n'
        "[radio.rays]\nsamples = 50_000\n[csi]\nperiod_s = 0.5\n[survey]\nwalks = 1\nduration_s = [10.0, 12.0]\n"
    )
    told = []

    def progress(done, n):
        for one in done:
            told.append(n)
            yield one

    _, world = make_world(load_scenario_file(path), 5, tmp_path, Work(progress=progress))
    walk = simulate_plan(world, plan_walks(world)[-1]).recording
    assert len(told) == told[0] > 0
    assert len(walk.csi) > 20
    heard = {int(network) for scan in walk.wifi for network in scan.bssid}
    assert len(heard) >= 8  # three networks on each of four radios, less a few


def test_a_library_that_cannot_be_loaded_is_named(monkeypatch, tmp_path):
    skip_without_tracer()
    monkeypatch.setenv("DRJIT_LIBLLVM_PATH", str(tmp_path / "libLLVM.so"))
    with pytest.raises(ConfigError, match="could not start") as caught:
        _traced()
    assert "DRJIT_LIBLLVM_PATH" in caught.value.remedy
