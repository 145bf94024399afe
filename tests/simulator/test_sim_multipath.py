"""Channels after Saleh and Valenzuela, and what an Intel 5300 makes of them."""

from __future__ import annotations

import numpy as np
import pytest

from wayfuse.radio.csi import INTEL5300_20MHZ, direct_path_power
from wayfuse.simulator.channel_state import GROUPS, ChannelModel, measure_channels, through_card
from wayfuse.simulator.hall import hall
from wayfuse.simulator.multipath import MultipathModel, Taps, draw_taps, response
from wayfuse.simulator.radio_field import AccessPoint, RadioModel, radio_field
from wayfuse.simulator.walker import Walk

MODELS = (
    MultipathModel(),
    MultipathModel(cluster_ns=50.0, ray_ns=8.0, cluster_decay_ns=30.0, ray_decay_ns=12.0),
)


@pytest.mark.parametrize("model", MODELS)
def test_echoes_have_the_power_and_the_mean_delay_of_their_parameters(model):
    rng = np.random.default_rng(0)
    power, moment = [], []
    for _ in range(1500):
        taps = draw_taps(model, -np.inf, 0.0, rng)
        p = np.abs(taps.amplitude) ** 2
        power.append(p.sum())
        moment.append((p * taps.delay).sum())
    assert np.mean(power) == pytest.approx(1.0, abs=5.0 * np.std(power) / 1500**0.5)
    assert np.mean(moment) == pytest.approx(model.mean_delay_ns, abs=5.0 * np.std(moment) / 1500**0.5 + 0.3)


def test_the_number_of_rays_is_that_of_the_arrival_rates():
    model = MultipathModel()
    rng = np.random.default_rng(1)
    n = [len(draw_taps(model, -np.inf, 0.0, rng).delay) - 1 for _ in range(400)]
    clusters, rays = 1 + 8 * 60 / 300, 1 + 8 * 20 / 5
    assert np.mean(n) == pytest.approx(clusters * rays, rel=0.08)


def test_the_direct_path_has_its_share_and_comes_first():
    rng = np.random.default_rng(2)
    for rice in (-10.0, 0.0, 12.0):
        drawn = [draw_taps(MultipathModel(), rice, 0.3, rng) for _ in range(400)]
        direct = np.array([abs(t.amplitude[0]) ** 2 for t in drawn])
        ratio = 10 ** (0.1 * rice)
        np.testing.assert_allclose(direct, ratio / (1 + ratio))
        total = np.mean([np.sum(np.abs(t.amplitude) ** 2) for t in drawn])
        assert total == pytest.approx(1.0, abs=0.15)
        assert all(t.delay[0] == 0.0 and t.azimuth[0] == 0.3 for t in drawn)


def test_one_ray_gives_a_flat_channel_with_its_delay_and_angle():
    taps = Taps(np.array([100.0]), np.array([0.5 + 0j]), np.array([0.0]))
    f = 312_500.0 * GROUPS.astype(float)
    h = response(taps, f, 5.2e9, 3)
    np.testing.assert_allclose(np.abs(h), 0.5)
    slope = np.diff(np.unwrap(np.angle(h[0])))[1:10] / np.diff(f)[1:10]
    np.testing.assert_allclose(slope, -2 * np.pi * 100e-9, rtol=1e-6)
    np.testing.assert_allclose(np.angle(h[1] / h[0]) % (2 * np.pi), np.pi)  # half a wavelength, end on


def test_the_groups_are_those_the_reader_knows():
    np.testing.assert_array_equal(GROUPS, INTEL5300_20MHZ)


@pytest.mark.parametrize("level", [-40.0, -60.0, -80.0])
def test_the_card_levels_rounds_and_says_what_the_level_was(level):
    rng = np.random.default_rng(3)
    taps = Taps(np.array([0.0]), np.array([1.0 + 0j]), np.array([1.0]))
    h = response(taps, 312_500.0 * GROUPS.astype(float), 5.2e9, 3)
    frame = through_card(h, level, 1.0, 7, ChannelModel(), rng)
    assert frame.csi.shape == (3, 1, 30)
    assert frame.csi.dtype == np.complex64
    parts = frame.csi.view(np.float32)
    np.testing.assert_array_equal(parts, np.round(parts))
    assert np.abs(parts).max() == 100.0
    assert frame.rss == pytest.approx(
        level + 10 * np.log10(3), abs=0.8
    )  # three antennas, whole units of 1 dB
    assert frame.agc == pytest.approx(-8.0 - level, abs=1.0)
    assert direct_path_power(frame) == pytest.approx([level] * 3, abs=1.5)


def standing_at(x: float, y: float, seconds: float) -> Walk:
    t = np.arange(0.0, seconds, 0.01)
    place, zero, none = np.tile([x, y], (len(t), 1)), np.zeros(len(t)), np.empty(0)
    return Walk(t, place, zero, zero, none, none, t[:2], zero[:2], np.empty((0, 3)))


def test_packets_come_from_every_access_point_of_the_band_at_its_level():
    building = hall(24.0, 16.0, 0)
    aps = (AccessPoint(2.0, 2.0, "0"), AccessPoint(22.0, 14.0, "0"))
    field = radio_field(
        building, RadioModel(access_points=aps, single_band_share=0.0), np.random.default_rng(0)
    )
    model = ChannelModel(period_s=0.5)
    frames = measure_channels(standing_at(6.0, 5.0, 20.0), field, model, np.random.default_rng(1))
    assert [f.t for f in frames] == sorted(f.t for f in frames)
    anchors = {f.anchor for f in frames}
    assert len(anchors) == 2
    assert anchors <= {int(b) for b, r in zip(field.bssid, field.radio, strict=True) if field.band[r] == 1}
    assert len(frames) == pytest.approx(80, abs=3)
    assert (
        measure_channels(standing_at(6.0, 5.0, 20.0), field, ChannelModel(), np.random.default_rng(1)) == ()
    )


def test_a_channel_stays_while_one_stands_and_a_wall_takes_from_the_direct_path():
    building = hall(40.0, 30.0, 3)
    ap = (AccessPoint(20.0, 2.0, "0"),)
    field = radio_field(
        building, RadioModel(access_points=ap, single_band_share=0.0), np.random.default_rng(0)
    )
    quiet = {"noise_dbm": -200.0, "weakest_dbm": -200.0}
    model = ChannelModel(period_s=0.1, **quiet, multipath=MultipathModel(rice_db=20.0, wall_rice_db=20.0))
    spread = []
    for y in (2.5, 28.0):  # beside it, and behind three racks
        frames = measure_channels(standing_at(22.0, y, 3.0), field, model, np.random.default_rng(5))
        size = np.array([np.abs(f.csi[0, 0]) / np.abs(f.csi[0, 0]).mean() for f in frames])
        assert size.std(axis=0).max() < 0.2  # the same taps from packet to packet
        spread.append(float(size.mean(axis=0).std()))
    assert spread[1] > 2.0 * spread[0]
