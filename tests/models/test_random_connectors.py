"""Floors for a filter without sensors: near a landing some go elsewhere, far from it nobody."""

from __future__ import annotations

import numpy as np
import pytest
from made_up_stairs import CONNECTORS, cloud_at, site_of

from wayfuse.core.errors import ConfigError
from wayfuse.core.philox import Noise
from wayfuse.models.motion.random_connectors import RandomConnectors


def test_a_share_of_those_near_a_landing_is_at_another_landing_of_it() -> None:
    model = RandomConnectors(site=site_of(), reach=3.0, chance=0.2)
    local = CONNECTORS[5]  # a lift of three floors
    before = cloud_at(80.5, 35.0, 1, 4000)
    after = model.propagate(Noise.of(0, "a"), before, 1.0)
    went = after.floor != 1
    assert went.mean() == pytest.approx(0.2, abs=0.02)
    assert np.bincount(after.floor[went], minlength=3)[[0, 2]].min() > 0.4 * went.sum()
    assert set(zip(after.x[went].tolist(), after.y[went].tolist(), strict=True)) == {(80.0, 35.0)}
    np.testing.assert_array_equal(after.x[~went], before.x[~went])
    assert len(local.landings) == 3
    twice = model.propagate(Noise.of(0, "a"), before, 2.0)
    assert (twice.floor != 1).mean() == pytest.approx(1.0 - 0.8**2, abs=0.02)


def test_nobody_goes_from_where_there_is_no_landing() -> None:
    model = RandomConnectors(site=site_of(), reach=3.0, chance=1.0)
    away = cloud_at(25.0, 20.0, 0)
    np.testing.assert_array_equal(model.propagate(Noise.of(0, "a"), away, 5.0).floor, away.floor)
    with pytest.raises(ConfigError, match="chance"):
        RandomConnectors(site=site_of(), chance=1.5)
