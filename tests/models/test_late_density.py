"""The density of late ranges: the compiled loop against NumPy."""

from __future__ import annotations

import numpy as np
import pytest

from wayfuse.models._kernels import late_log_density


@pytest.mark.parametrize(("sigma", "late", "lateness"), [(1.0, 0.2, 3.0), (0.3, 0.01, 10.0), (5.0, 0.9, 0.5)])
def test_it_is_its_twin(sigma: float, late: float, lateness: float) -> None:
    excess = np.concatenate([np.linspace(-60.0, 60.0, 4001), [0.0, -1e4, 1e4, 1e-30]])
    got = np.empty_like(excess)
    late_log_density(excess, sigma, late, lateness, 1e-9, got)
    on_time = (1.0 - late) / (np.sqrt(2.0 * np.pi) * sigma) * np.exp(-0.5 * (excess / sigma) ** 2)
    tail = np.where(excess > 0.0, late / lateness * np.exp(-np.maximum(excess, 0.0) / lateness), 0.0)
    np.testing.assert_allclose(got, np.log(np.maximum(on_time + tail, 1e-9)), rtol=2e-6, atol=2e-5)
    assert np.all(got >= np.log(1e-9) - 1e-4)
