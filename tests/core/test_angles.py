from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wayfuse.core.angles import azimuth_from_heading, heading_from_azimuth, wrap

ANGLE = st.floats(-1e6, 1e6)


@given(ANGLE)
def test_wrapped_angles_lie_in_the_interval_and_point_the_same_way(angle: float) -> None:
    wrapped = float(wrap(angle))
    assert -np.pi < wrapped <= np.pi
    np.testing.assert_allclose([np.cos(wrapped), np.sin(wrapped)], [np.cos(angle), np.sin(angle)], atol=1e-9)


def test_the_ends_of_the_interval() -> None:
    assert wrap(np.pi) == np.pi
    assert wrap(-np.pi) == np.pi
    np.testing.assert_array_equal(wrap([[0.0, 2 * np.pi]]), [[0.0, 0.0]])
    assert np.isnan(wrap(np.nan))


@given(st.floats(-3.1, 3.1))
def test_azimuth_and_heading_are_inverse(heading: float) -> None:
    assert float(heading_from_azimuth(azimuth_from_heading(heading))) == pytest.approx(heading, abs=1e-12)


@pytest.mark.parametrize(("azimuth", "heading"), [(0, 90), (90, 0), (180, -90), (270, 180), (45, 45)])
def test_compass_points(azimuth: float, heading: float) -> None:
    assert np.rad2deg(float(heading_from_azimuth(np.deg2rad(azimuth)))) == pytest.approx(heading)
