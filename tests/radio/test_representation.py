"""Representations of strengths."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wayfuse.core.errors import ConfigError
from wayfuse.radio.representation import KINDS, Representation

_DBM = st.lists(st.one_of(st.floats(-110, -1), st.just(float("nan"))), min_size=1, max_size=8)


def test_values_by_hand() -> None:
    x = np.array([-52.0, -104.0, -110.0, np.nan])
    np.testing.assert_allclose(Representation("positive")(x), [52, 0, 0, 0])
    np.testing.assert_allclose(Representation("powed")(x), [0.5**np.e, 0, 0, 0])
    np.testing.assert_allclose(Representation("powed", parameter=2.0)(x), [0.25, 0, 0, 0])
    np.testing.assert_allclose(Representation("exponential")(x), [np.exp(-52 / 24), 0, 0, 0])
    np.testing.assert_allclose(Representation("raw")(x), [-52, -104, -110, -104])


@pytest.mark.parametrize("kind", KINDS)
@given(values=_DBM)
def test_order_is_kept_and_unheard_is_lowest(kind: str, values: list[float]) -> None:
    x = np.array(values)
    shown = Representation(kind, -104.0)(x)  # type: ignore[arg-type]
    assert shown.shape == x.shape
    assert np.all(np.isfinite(shown))
    if kind != "raw":
        assert np.all(shown >= 0)
        assert np.all(shown[~np.isfinite(x)] == 0)
    heard = np.sort(x[np.isfinite(x)])
    assert np.all(np.diff(Representation(kind, -104.0)(heard)) >= 0)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    "wrong", [{"kind": "cubed"}, {"missing": 100.0}, {"parameter": 0.0}, {"parameter": -1.0}]
)
def test_parameters_out_of_range_are_refused(wrong: dict) -> None:  # type: ignore[type-arg]
    with pytest.raises(ConfigError):
        Representation(**wrong)
