from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wayfuse.core.errors import MapError
from wayfuse.core.frames import GeoAnchor, metres_per_degree


@given(st.floats(-180, 180), st.floats(-70, 70), st.floats(-3.1, 3.1), st.floats(0.5, 2.0))
def test_there_and_back(lon: float, lat: float, rotation: float, scale: float) -> None:
    anchor = GeoAnchor.from_origin(lon, lat, rotation, scale)
    xy = np.array([[0.0, 0.0], [120.0, -45.0], [-3.0, 300.0]])
    np.testing.assert_allclose(anchor.to_xy(anchor.to_lonlat(xy)), xy, atol=1e-5)
    assert np.cos(anchor.rotation - rotation) == pytest.approx(1.0, abs=1e-9)


@pytest.mark.parametrize(
    ("latitude", "east", "north"),
    [(0.0, 111_319.49, 110_574.28), (45.0, 78_846.81, 111_131.78), (60.0, 55_800.00, 111_412.24)],
)
def test_metres_per_degree_of_the_ellipsoid(latitude: float, east: float, north: float) -> None:
    assert metres_per_degree(latitude) == pytest.approx((east, north), abs=0.06)


def test_a_building_turned_to_the_north() -> None:
    anchor = GeoAnchor.from_origin(10.0, 50.0, np.pi / 2)
    lon, lat = anchor.to_lonlat((100.0, 0.0))
    assert lon == pytest.approx(10.0, abs=1e-12)
    assert (lat - 50.0) * metres_per_degree(50.0)[1] == pytest.approx(100.0)


def test_a_singular_anchor_is_refused() -> None:
    with pytest.raises(MapError, match="singular"):
        GeoAnchor((0.0, 0.0), ((1e-5, 2e-5), (1e-5, 2e-5)))
