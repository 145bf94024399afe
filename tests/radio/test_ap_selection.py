"""A survey of the access points heard most."""

from __future__ import annotations

import numpy as np
import pytest

from wayfuse.core.errors import ConfigError
from wayfuse.radio.ap_selection import most_heard
from wayfuse.radio.survey import Survey


def test_the_columns_heard_most_stay_with_their_readings() -> None:
    rng = np.random.default_rng(0)
    rssi = rng.normal(-70.0, 5.0, (30, 6))
    rssi[rng.random((30, 6)) < [0.9, 0.1, 0.5, 0.2, 0.95, 0.4]] = np.nan
    survey = Survey.from_dense(rssi, rng.uniform(0, 9, (30, 2)), np.zeros(30, int), ("EG",))
    few = most_heard(survey, 3)
    assert few.bssid.tolist() == survey.bssid[[1, 3, 5]].tolist()
    np.testing.assert_array_equal(few.dense(), survey.dense()[:, [1, 3, 5]])
    np.testing.assert_array_equal(few.xy, survey.xy)
    assert most_heard(survey, 6) is survey
    with pytest.raises(ConfigError, match="n must"):
        most_heard(survey, 0)
