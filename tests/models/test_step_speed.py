"""The speed filter step by step: particles far from where the step leads are filtered, a wrong disc filters none."""

from __future__ import annotations

import numpy as np
import pytest

from wayfuse.core.errors import ConfigError
from wayfuse.filters.cloud import Cloud
from wayfuse.filters.particle_filter import FilterState, ParticleFilter
from wayfuse.filters.widening import WideningFilter, scaling
from wayfuse.models.constraint.step_speed import StepSpeedFilter
from wayfuse.models.motion.displaced_disc import StepDisc
from wayfuse.models.motion.pdr import StepInput

WIDE = WideningFilter(wider=scaling("r_max"), filter=ParticleFilter())


def state_of(x: np.ndarray) -> FilterState:
    zero = np.zeros(len(x), np.float32)
    cloud = Cloud.on_floors(x.astype(np.float32), zero, zero, zero + 1, zero.astype(np.int32))
    return FilterState(cloud, np.zeros(len(x)), 0)


def test_those_far_from_the_step_lose_weight_and_nobody_is_moved_by_it() -> None:
    x = np.concatenate([np.zeros(90), np.full(10, 40.0)])  # mean 4
    step, motion = StepInput(1.0, 0.0), StepDisc(r_max=0.5)
    plain, _ = WIDE.predict((1, 2), state_of(x), motion, step, None)
    after, n = StepSpeedFilter(filter=WIDE, least=8.0, penalty=20.0).predict(
        (1, 2), state_of(x), motion, step, None
    )
    np.testing.assert_array_equal(after.cloud.x, plain.cloud.x)
    assert n == 10
    assert np.all(after.log_weights[:90] == 0.0)
    assert np.all(after.log_weights[90:] == -20.0)


def test_a_disc_without_particles_filters_nobody() -> None:
    x = np.concatenate([np.zeros(50), np.full(50, 40.0)])  # nobody near 20
    after, n = StepSpeedFilter(filter=WIDE, least=5.0).predict(
        (1, 2), state_of(x), StepDisc(r_max=0.5), StepInput(1.0, 0.0), None
    )
    assert n == 0
    assert np.all(after.log_weights == 0.0)


def test_parameters_are_checked() -> None:
    with pytest.raises(ConfigError, match="least"):
        StepSpeedFilter(filter=WIDE, least=0.0)
