"""A radio map as an observation: it adds, it counts access points, it says when it knows nothing."""

from __future__ import annotations

import numpy as np
import pytest

from wayfuse.core.errors import ConfigError
from wayfuse.filters.cloud import Cloud
from wayfuse.models.observation.mapped import MapLikelihood
from wayfuse.radio.interpolated_map import fit
from wayfuse.radio.survey import Fingerprint, Survey


def test_it_adds_the_map_and_lowers_it_where_many_were_heard() -> None:
    xy = np.array([(0.0, 0.0), (10.0, 0.0), (0.0, 10.0)])
    survey = Survey.from_dense(-50.0 - xy.sum(axis=1)[:, None] * [1.0, 2.0], xy, np.zeros(3, int), ("EG",))
    radio_map = fit(survey)
    zero = np.zeros(2, np.float32)
    cloud = Cloud.on_floors(np.array([1.0, 6.0], np.float32), zero, zero, zero + 1, np.zeros(2, np.int32))
    z = Fingerprint(survey.bssid, np.array([-51.0, -54.0], np.float32), np.zeros(2, np.int32))
    bare = radio_map.log_likelihood(z, np.column_stack([cloud.x, cloud.y]), cloud.floor)
    out = np.ones(2)
    assert MapLikelihood(radio_map=radio_map).log_likelihood(cloud, z, out)
    np.testing.assert_allclose(out, 1.0 + bare)
    out = np.zeros(2)
    assert MapLikelihood(radio_map=radio_map, most=1.0).log_likelihood(cloud, z, out)
    np.testing.assert_allclose(out, 0.5 * bare)
    assert not MapLikelihood(radio_map=radio_map).log_likelihood(
        cloud, z._replace(bssid=z.bssid + np.uint64(9)), out
    )
    np.testing.assert_allclose(out, 0.5 * bare)
    with pytest.raises(ConfigError, match="most"):
        MapLikelihood(radio_map=radio_map, most=0.0)
