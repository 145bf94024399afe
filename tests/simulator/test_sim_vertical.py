"""Barometer, accelerometer and radio on stairs and in the lift agree with the heights of the walk."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from wayfuse.simulator.barometer import BarometerModel
from wayfuse.simulator.imu import ImuModel
from wayfuse.simulator.journeys import Trip
from wayfuse.simulator.passages import Activity
from wayfuse.simulator.scanner import ScannerModel, between_floors
from wayfuse.simulator.scenario import Scenario
from wayfuse.simulator.simulate_journey import Phone, simulate_journey, simulate_stay

HEIGHT = 4.42  # m


def heights(recording):
    """Height (n,) m over the first sample, by the pressure."""
    p = recording.pressure.values[:, 0]
    return -8435.0 * np.log(p / p[0])


def spans(truth, activity):
    """First and last times (s) of each spell of an activity."""
    on = np.concatenate([[0], (truth.activity == activity).astype(int), [0]])
    return [
        (truth.t[a], truth.t[b - 1])
        for a, b in zip(np.flatnonzero(np.diff(on) > 0), np.flatnonzero(np.diff(on) < 0), strict=True)
    ]


def vertical(recording):
    """Vertical acceleration (n,) m/s² without gravity, by the phone's own orientation."""
    w, x, y, z = recording.orientation.values.T
    up = np.column_stack([2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)])
    return np.sum(up * recording.acceleration.values, axis=1) - 9.80665


@pytest.fixture(scope="module")
def calm(sim_scenario):
    """No draughts, no weather, no noise: only the walk moves the barometer."""
    still = BarometerModel(noise_m=0.0, drift_m_per_min=0.0, draughts_per_min=0.0)
    return replace(sim_scenario, barometer=still)


def test_pressure_follows_the_height(sim_house, calm):
    for seed in range(3):
        recording, truth = simulate_journey(
            sim_house, calm, np.random.default_rng(seed), "calm", lift_first=seed == 1
        )
        t = recording.pressure.t
        climbed = truth.at(t - calm.barometer.lag_s)[:, 2] - truth.z[0]
        np.testing.assert_allclose(heights(recording), climbed, atol=0.08)  # the lag in the lift's jerks


def test_the_barometer_has_the_noise_swings_and_rate_of_the_public_ones(journeys):
    noise, level = [], []
    for recording, truth in journeys:
        t, z = recording.pressure.t, heights(recording)
        assert np.median(np.diff(t)) == pytest.approx(0.1, abs=1e-3)
        noise.append(np.std(np.diff(z)) / np.sqrt(2.0))
        error = z - (truth.at(t)[:, 2] - truth.z[0])
        smooth = np.convolve(error, np.ones(10) / 10, mode="valid")
        level.append(np.max(np.abs(smooth[100:] - smooth[:-100])))  # within 10 s
    assert np.median(noise) == pytest.approx(0.04, rel=0.2)
    assert 0.3 < np.max(level) < 1.6


def test_pressure_is_plausible_and_a_phones_offset_is_its_own(sim_house, calm):
    plain, shifted = (
        simulate_stay(sim_house, calm, np.random.default_rng(4), "w", floor=0, phone=Phone(pressure_hpa=hpa))[
            0
        ]
        for hpa in (0.0, 0.5)
    )
    assert plain.pressure.values.min() > 950.0
    assert plain.pressure.values.max() < 1050.0
    np.testing.assert_allclose(shifted.pressure.values - plain.pressure.values, 0.5, atol=1e-3)


def test_a_phone_without_a_barometer_records_no_pressure(sim_house, sim_scenario):
    without = replace(sim_scenario, barometer=BarometerModel(rate_hz=0.0))
    recording, _ = simulate_stay(sim_house, without, np.random.default_rng(4), "w", floor=1)
    assert len(recording.pressure) == 0
    assert len(recording.acceleration) > 1000


@pytest.mark.parametrize("way", [(0, 2), (2, 0), (0, 1)])
def test_twice_integrated_acceleration_of_a_ride_is_the_height_of_the_storeys(sim_house, sim_scenario, way):
    start, stop = way
    (lift,) = [k for k, passage in enumerate(sim_house.building.passages) if passage.is_lift]
    perfect = replace(sim_scenario, imu=ImuModel(accel_noise=0.0, accel_bias=0.0, level_sigma=0.0))
    recording, truth = simulate_journey(
        sim_house, perfect, np.random.default_rng(5), "ride", trips=(start, [Trip(lift, stop)])
    )
    ((t0, t1),) = spans(truth, Activity.LIFT)
    t, a = recording.acceleration.t, vertical(recording)
    here = (t > t0 - 1.0) & (t < t1 + 1.0)
    dt = np.gradient(t[here])
    risen = np.sum(np.cumsum(a[here] * dt) * dt)
    assert risen == pytest.approx((stop - start) * HEIGHT, rel=0.05)
    speed = np.cumsum(a[here] * dt)
    assert np.abs(speed).max() == pytest.approx(1.0, rel=0.05)


def test_the_noise_of_a_cheap_phone_still_shows_both_pushes_of_a_ride(journeys):
    shown = 0
    for recording, truth in journeys:
        t, a = recording.acceleration.t, vertical(recording)
        smooth = np.convolve(a, np.ones(40) / 40, mode="same")
        for t0, t1 in spans(truth, Activity.LIFT):
            up = np.sign(truth.at(np.array([t1]))[0, 2] - truth.at(np.array([t0]))[0, 2])
            middle = 0.5 * (t0 + t1)
            first, last = (t > t0) & (t < middle), (t > middle) & (t < t1)
            assert (up * smooth[first]).max() - (up * smooth[last]).min() > 0.6
            shown += 1
    assert shown >= 4


def test_stairs_are_stepped_as_the_public_logs_say(sim_house, sim_scenario):
    """Amplitude 1.5 to 2.8 m/s² at 1.5 to 1.9 Hz; going down the foot lands harder."""
    rates, sizes, peaks = [], [], {1: [], -1: []}
    for seed in range(4):
        start, stop = (0, 1) if seed % 2 else (1, 0)
        recording, truth = simulate_journey(
            sim_house, sim_scenario, np.random.default_rng(300 + seed), "s", trips=(start, [Trip(0, stop)])
        )
        t, a = recording.acceleration.t, vertical(recording)
        for t0, t1 in spans(truth, Activity.STAIRS):
            here = (t > t0 + 0.5) & (t < t1 - 0.5)
            x = a[here] - a[here].mean()
            power = np.abs(np.fft.rfft(x * np.hanning(len(x)), 4096)) ** 2
            hz = np.fft.rfftfreq(4096, 0.02)
            rates.append(hz[np.argmax(np.where((hz > 1.0) & (hz < 2.5), power, 0.0))])
            sizes.append(np.sqrt(2.0) * x.std())
            peaks[1 if stop > start else -1].append(np.percentile(x, 99))
    assert 1.5 < np.min(rates) <= np.max(rates) < 2.0
    assert 1.3 < np.mean(sizes) < 3.2
    assert np.mean(peaks[-1]) > 1.1 * np.mean(peaks[1])


def test_every_floor_hears_its_own_access_points_best_and_its_neighbours_weaker(sim_house, sim_scenario):
    heard = np.full((3, 3), np.nan)
    radios = sim_house.radios
    floor_of = {
        int(b): int(radios.ap_floor[radios.ap[r]]) for b, r in zip(radios.bssid, radios.radio, strict=True)
    }
    for floor in range(3):
        recording, _ = simulate_stay(sim_house, sim_scenario, np.random.default_rng(floor), "w", floor=floor)
        ids = np.concatenate([scan.bssid for scan in recording.wifi])
        rssi = np.concatenate([scan.rssi for scan in recording.wifi])
        source = np.array([floor_of[int(b)] for b in ids])
        for other in range(3):
            strongest = np.sort(rssi[source == other])[::-1][:200]
            heard[floor, other] = strongest.mean() if len(strongest) else -100.0
    own = np.diag(heard)
    for floor in range(3):
        for other in range(3):
            if other != floor:
                assert heard[floor, other] < own[floor] - 8.0
    assert heard[0, 2] < heard[0, 1] - 5.0  # two slabs against one


def test_on_stairs_the_radio_goes_over_from_one_floor_to_the_next(sim_house):
    radios = sim_house.radios
    radio = np.arange(radios.n_radios)
    xy = np.tile([14.0, 13.0], (len(radio), 1))
    low, high = radios.rssi(radio, xy, 0), radios.rssi(radio, xy, 1)
    for share in (0.0, 0.25, 0.5, 1.0):
        np.testing.assert_allclose(
            between_floors(radios, radio, xy, np.full(len(radio), share * HEIGHT)),
            (1.0 - share) * low + share * high,
        )


def test_the_cabin_of_the_lift_swallows_some_of_it(sim_house, sim_scenario):
    (lift,) = [k for k, passage in enumerate(sim_house.building.passages) if passage.is_lift]
    scanner = ScannerModel(
        hit_rate=1.0, softness_db=0.01, sensitivity_dbm=-300.0, weakest_dbm=-300.0, memory_s=2.0
    )
    scans = []
    for loss in (0.0, 12.0):
        scenario = replace(
            sim_scenario, scanner=scanner, lift=replace(sim_scenario.lift, loss_db=(loss, loss))
        )
        recording, truth = simulate_journey(
            sim_house, scenario, np.random.default_rng(6), "ride", trips=(0, [Trip(lift, 2)])
        )
        scans.append(recording.wifi)
    ((t0, t1),) = spans(truth, Activity.LIFT)
    for a, b in zip(*scans, strict=True):
        lost = a.rssi[np.argsort(a.bssid)] - b.rssi[np.argsort(b.bssid)]
        if t0 + 2.5 < a.t < t1:
            np.testing.assert_array_equal(lost, 12.0)
        elif a.t < t0 - 10.0:
            np.testing.assert_array_equal(lost, 0.0)


def test_the_phone_tracked_hears_less_by_band_where_the_scenario_says_so():
    scenario = Scenario(tracked_offset_db=(-4.0, -2.0), scanner=ScannerModel(device_offset_db=(1.0, 1.0)))
    assert scenario.tracked().scanner.device_offset_db == (-3.0, -1.0)
    assert scenario.tracked().imu == scenario.imu
