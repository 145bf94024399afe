"""Scans of placed access points as observations, and the clouds they begin with."""

from __future__ import annotations

import numpy as np
import pytest

from wayfuse.core.errors import ConfigError
from wayfuse.core.philox import Noise
from wayfuse.filters.cloud import Cloud
from wayfuse.maps.walkable import Walkable
from wayfuse.models.initial import KnownStart
from wayfuse.models.observation.placed_aps import PathLossLikelihood, SequenceLikelihood
from wayfuse.models.placed_start import AnywhereOnFloor, SequenceStart, ToldStart
from wayfuse.radio.ap_places import ApPlaces
from wayfuse.radio.path_loss import PathLoss
from wayfuse.radio.survey import Fingerprint

RNG = np.random.default_rng(8)
AP_XY = np.concatenate([RNG.uniform(0.0, 20.0, (8, 2))] * 2)  # the same places on two floors
FLOOR = np.repeat([0, 1], 8).astype(np.int32)
PLACES = ApPlaces(np.arange(1, 17, dtype=np.uint64), *AP_XY.T, FLOOR, np.full(16, np.nan))
BANDS = (PathLoss(-35.0, 0.2, 4.0), PathLoss(-40.0, 0.3, 4.0))
EXTENTS = ((0.0, 0.0, 20.0, 20.0),) * 2
SEQUENCES = SequenceLikelihood(places=PLACES, extents=EXTENTS, cell=1.0, k=4, precision=0.25)
PATH_LOSS = PathLossLikelihood(places=PLACES, bands=BANDS, n_floors=2)
WALKABLE = tuple(Walkable((0.0, 0.0), 0.5, np.ones((40, 40), np.uint8)) for _ in range(2))
PLACE = np.array([6.0, 13.0])


def scan(floor: int = 0, louder: float = 0.0, n: int = 8) -> Fingerprint:
    rows = np.flatnonzero(floor == FLOOR)[:n]
    frequency = np.where(rows % 2, 5180, 2412).astype(np.int32)
    away = np.hypot(*(AP_XY[rows] - PLACE).T)
    rssi = np.array([BANDS[int(f > 5000)].at(d) for d, f in zip(away, frequency, strict=True)]) + louder
    return Fingerprint(PLACES.bssid[rows], rssi.astype(np.float32), frequency)


def cloud(n: int = 4000, floors: tuple[int, ...] = (0,)) -> Cloud:
    xy = np.random.default_rng(1).uniform(0.0, 20.0, (n, 2)).astype(np.float32)
    one = np.ones(n, np.float32)
    return Cloud.on_floors(xy[:, 0], xy[:, 1], 0.0 * one, one, np.resize(np.array(floors, np.int32), n))


def best(found: np.ndarray, of: Cloud) -> np.ndarray:
    k = int(np.argmax(found))
    return np.array([of.x[k], of.y[k]])


@pytest.mark.parametrize("model", [SEQUENCES, PATH_LOSS])
def test_the_likeliest_particle_is_near_the_place(model: SequenceLikelihood | PathLossLikelihood) -> None:
    particles, out = cloud(), np.zeros(4000)
    assert model.log_likelihood(particles, scan(), out)
    assert np.all(np.isfinite(out))
    assert np.hypot(*(best(out, particles) - PLACE)) < (1.0 if model is PATH_LOSS else 4.0)


@pytest.mark.parametrize("model", [SEQUENCES, PATH_LOSS])
def test_it_adds_and_goes_with_its_particle(model: SequenceLikelihood | PathLossLikelihood) -> None:
    particles = cloud(300, (0, 1))
    first, again = np.zeros(300), np.ones(300)
    model.log_likelihood(particles, scan(), first)
    model.log_likelihood(particles, scan(), again)
    np.testing.assert_allclose(again, 1.0 + first)
    mixed = np.random.default_rng(2).permutation(300)
    shuffled = np.zeros(300)
    model.log_likelihood(particles.take(mixed), scan(), shuffled)
    np.testing.assert_allclose(shuffled, first[mixed], atol=1e-9)


@pytest.mark.parametrize("model", [SEQUENCES, PATH_LOSS])
def test_the_floor_that_is_heard_wins(model: SequenceLikelihood | PathLossLikelihood) -> None:
    particles = cloud(2000, (0, 1))
    for floor in (0, 1):
        out = np.zeros(2000)
        assert model.log_likelihood(particles, scan(floor), out)
        assert particles.floor[int(np.argmax(out))] == floor
        weight = np.exp(out - out.max())
        assert weight[particles.floor == floor].sum() > 0.95 * weight.sum()


@pytest.mark.parametrize("model", [SEQUENCES, PATH_LOSS])
def test_too_few_or_unknown_access_points_add_nothing(model: SequenceLikelihood | PathLossLikelihood) -> None:
    unknown = Fingerprint(np.array([900], np.uint64), np.array([-40.0], np.float32), np.zeros(1, np.int32))
    for said in (scan(n=2), unknown, scan(n=0)):
        out = np.zeros(50)
        assert not model.log_likelihood(cloud(50), said, out)
        assert not out.any()


def test_a_louder_phone_matters_to_path_loss_unless_an_offset_is_allowed() -> None:
    particles = cloud()
    plain, louder, allowed = np.zeros(4000), np.zeros(4000), np.zeros(4000)
    PATH_LOSS.log_likelihood(particles, scan(), plain)
    PATH_LOSS.log_likelihood(particles, scan(louder=9.0), louder)
    free = PathLossLikelihood(places=PLACES, bands=BANDS, n_floors=2, offset_sigma=100.0)
    free.log_likelihood(particles, scan(louder=9.0), allowed)
    assert np.hypot(*(best(louder, particles) - PLACE)) > 1.0
    assert np.hypot(*(best(allowed, particles) - PLACE)) < 1.0
    order = [np.zeros(4000), np.zeros(4000)]
    for out, by in zip(order, (0.0, 9.0), strict=True):
        SEQUENCES.log_likelihood(particles, scan(louder=by), out)
    np.testing.assert_allclose(order[0], order[1], atol=1e-3)  # the floors share a little otherwise


def test_powers_of_access_points_are_taken_off() -> None:
    power = np.linspace(-10.0, 10.0, 16)
    said = scan()
    uneven = said._replace(rssi=(said.rssi + power[PLACES.rows(said.bssid)]).astype(np.float32))
    for model, kind in ((SEQUENCES, SequenceLikelihood), (PATH_LOSS, PathLossLikelihood)):
        names = [name for name in model.__slots__ if name != "power"]
        levelled = kind(**{name: getattr(model, name) for name in names}, power=power)
        expected, found = np.zeros(500), np.zeros(500)
        model.log_likelihood(cloud(500), said, expected)
        levelled.log_likelihood(cloud(500), uneven, found)
        np.testing.assert_allclose(found, expected, atol=1e-3)


def test_a_scan_that_heard_many_counts_for_some() -> None:
    whole, part = np.zeros(500), np.zeros(500)
    PATH_LOSS.log_likelihood(cloud(500), scan(), whole)
    PathLossLikelihood(places=PLACES, bands=BANDS, n_floors=2, most=2.0).log_likelihood(
        cloud(500), scan(), part
    )
    np.testing.assert_allclose(np.ptp(part), 0.25 * np.ptp(whole))
    for wrong in ({"bands": BANDS[:1]}, {"most": 0.0}):
        with pytest.raises(ConfigError):
            PathLossLikelihood(**({"places": PLACES, "bands": BANDS, "n_floors": 2} | wrong))


def test_the_first_cloud_of_a_sequence_lies_about_it_and_the_compass_counts() -> None:
    start = SequenceStart(observation=SEQUENCES, bias_sigma=0.2)
    drawn = start.draw(Noise.of(0, "a"), scan(1), 3000, heading_known=True)
    assert drawn is not None
    assert set(drawn.floor.tolist()) == {1}
    assert np.hypot(drawn.x.mean() - PLACE[0], drawn.y.mean() - PLACE[1]) < 4.0
    assert 0.0 <= drawn.x.min() < drawn.x.max() <= 20.0
    assert float(drawn.heading_bias.std()) == pytest.approx(0.2, rel=0.1)
    lost = start.draw(Noise.of(0, "a"), scan(1), 3000, heading_known=False)
    assert lost is not None
    assert float(lost.heading_bias.std()) == pytest.approx(np.pi / 3**0.5, rel=0.1)
    for nothing in (None, scan(n=2), ()):
        assert start.draw(Noise.of(0, "a"), nothing, 30, heading_known=True) is None


def test_an_unknown_start_is_anywhere_on_the_floor_that_is_heard_in_any_direction() -> None:
    start = AnywhereOnFloor(places=PLACES, walkable=WALKABLE)
    drawn = start.draw(Noise.of(0, "b"), scan(1), 4000, heading_known=True)
    assert drawn is not None
    assert set(drawn.floor.tolist()) == {1}
    for column, spread in ((drawn.x, 20.0), (drawn.y, 20.0), (drawn.heading_bias, 2.0 * np.pi)):
        assert float(column.std()) == pytest.approx(spread / 12**0.5, rel=0.05)
    assert start.draw(Noise.of(0, "b"), scan(n=0), 40, heading_known=True) is None
    assert start.draw(Noise.of(0, "b"), None, 40, heading_known=True) is None


def test_a_told_start_is_where_it_is_told() -> None:
    known = KnownStart(x=3.0, y=4.0, floor=1, sigma=0.5, scale_sigma=0.0)
    drawn = ToldStart(about=known, has_compass=False).draw(Noise.of(0, "c"), None, 4000, heading_known=True)
    assert float(drawn.x.mean()) == pytest.approx(3.0, abs=0.1)
    assert float(drawn.heading_bias.std()) > 1.5
    assert (
        float(
            ToldStart(about=known).draw(Noise.of(0, "c"), None, 4000, heading_known=True).heading_bias.std()
        )
        < 0.5
    )
