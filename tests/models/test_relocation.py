"""Recovery: few fresh particles while scans agree, many where they contradict, and they take over a lost cloud."""

from __future__ import annotations

import numpy as np
import pytest

from wayfuse.core.errors import ConfigError
from wayfuse.filters.cloud import Cloud
from wayfuse.filters.particle_filter import FilterState, ParticleFilter
from wayfuse.models.observation.mapped import MapLikelihood
from wayfuse.models.relocation import Relocation
from wayfuse.models.scan_start import LikelyPlaces
from wayfuse.radio.interpolated_map import InterpolatedMap, fit
from wayfuse.radio.survey import Fingerprint, Survey

N = 400
KEY = (3, 4)


def radio_map() -> InterpolatedMap:
    x, y = np.meshgrid(np.arange(0.0, 41.0, 4.0), np.arange(0.0, 21.0, 4.0))
    xy = np.column_stack([x.ravel(), y.ravel()])
    level = -40.0 - np.column_stack([xy[:, 0], 40.0 - xy[:, 0], 2 * xy[:, 1]])
    return fit(Survey.from_dense(level, xy, np.zeros(len(xy), int), ("EG",)))


def cloud_at(x: float, y: float) -> FilterState:
    rng = np.random.default_rng(0)
    zero = np.zeros(N, np.float32)
    at = (rng.normal((x, y), 0.5, (N, 2))).astype(np.float32)
    cloud = Cloud.on_floors(at[:, 0], at[:, 1], zero, zero + 1, zero.astype(np.int32))
    return FilterState(cloud, np.zeros(N), 0)


def scan_at(m: InterpolatedMap, x: float, y: float) -> Fingerprint:
    level = m.characteristic(np.array([(x, y)]), np.zeros(1, int))[0]
    return Fingerprint(m.bssid, level, np.zeros(3, np.int32))


def test_the_share_grows_with_the_contradiction() -> None:
    m = radio_map()
    relocation = Relocation(first=LikelyPlaces(radio_map=m), least=0.01, most=0.2, gap=3.0)
    state, shares = cloud_at(20.0, 8.0), []
    for x in (20.0, 23.0, 40.0):
        scan, out = scan_at(m, x, 8.0), np.zeros(N)
        MapLikelihood(radio_map=m).log_likelihood(state.cloud, scan, out)
        shares.append(relocation.share(state, scan, out))
    assert shares[0] == pytest.approx(0.01, abs=0.02)
    assert shares[0] < shares[1] < shares[2] == pytest.approx(0.2)
    unknown = scan_at(m, 0.0, 0.0)._replace(bssid=m.bssid + np.uint64(50))
    assert relocation.share(state, unknown, np.zeros(N)) == 0.0


def test_a_lost_cloud_finds_back_and_a_right_one_stays() -> None:
    m = radio_map()
    relocation, plain = Relocation(first=LikelyPlaces(radio_map=m)), ParticleFilter(ess_ratio=1.0)
    for begins in ((4.0, 16.0), (36.0, 4.0)):
        state = cloud_at(*begins)
        for _ in range(6):
            scan, out = scan_at(m, 36.0, 4.0), np.zeros(N)
            MapLikelihood(radio_map=m).log_likelihood(state.cloud, scan, out)
            share = relocation.share(state, scan, out)
            state, _ = plain.update(KEY, state, out, always_resample=True)
            before = [column.copy() for column in state.cloud]
            after = relocation.renew(KEY, state, scan, share)
            for now, then in zip(state.cloud, before, strict=True):
                np.testing.assert_array_equal(now, then)
            state = after
        assert np.median(np.hypot(state.cloud.x - 36.0, state.cloud.y - 4.0)) < 3.0
    same = relocation.renew(KEY, state, scan, 0.0)
    assert same is state


def test_parameters_are_checked() -> None:
    with pytest.raises(ConfigError, match="least"):
        Relocation(first=LikelyPlaces(radio_map=radio_map()), least=0.5, most=0.1)
