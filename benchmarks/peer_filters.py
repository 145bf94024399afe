"""The same step and ranges in the particle filters of other libraries, with the models vectorised as they want them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from benchmarks.numpy_filter import SIGMAS
from benchmarks.world import RANGE_SIGMA, Moment, World
from wayfuse.core.types import Array

__all__ = ["PEER_FILTERS"]

Update = Callable[[Moment], Any]


def _moved(cloud: Array, moment: Moment, z: Array) -> Array:
    """Particles (N, 4) moved by a step, with normals (N, 4)."""
    x, y, bias, scale = cloud.T
    bias = bias + SIGMAS[2] * z[:, 2]
    scale = np.maximum(scale + SIGMAS[3] * z[:, 3], 0.4)
    length = moment.length * scale * (1.0 + SIGMAS[0] * z[:, 0])
    heading = moment.heading + bias + SIGMAS[1] * z[:, 1]
    return np.column_stack([x + length * np.cos(heading), y + length * np.sin(heading), bias, scale])


def particles_filter(world: World, cloud: Array) -> Update:
    """`particles`: a Feynman-Kac model of one's own under SMC, moments collected."""
    import particles
    from particles.collectors import Moments

    ax, ay = world.anchors.T[:, :, None]

    class Walk(particles.FeynmanKac):  # type: ignore[misc,name-defined]
        def __init__(self) -> None:
            super().__init__(T=10**9)
            self.moment = world.moments[0]

        def M0(self, N: int) -> Array:  # noqa: N802, ARG002
            return cloud.T.copy()

        def M(self, t: int, xp: Array) -> Array:  # noqa: N802, ARG002
            return _moved(xp, self.moment, np.random.standard_normal((len(xp), 4)))  # noqa: NPY002 - its own source

        def logG(self, t: int, xp: Array, x: Array) -> Array:  # noqa: N802, ARG002
            residual = self.moment.ranges[:, None] - np.sqrt((x[:, 0] - ax) ** 2 + (x[:, 1] - ay) ** 2)
            return np.asarray((-0.5 / RANGE_SIGMA**2) * np.einsum("an,an->n", residual, residual))

    model = Walk()
    filter_ = particles.SMC(
        fk=model, N=cloud.shape[1], resampling="systematic", ESSrmin=0.5, collect=[Moments()]
    )

    def update(moment: Moment) -> Array:
        model.moment = moment
        next(filter_)
        for collector in filter_.summaries._collectors:
            del collector.summary[:-1]  # it keeps all of the past: that is not to be timed
        mean: Array = filter_.summaries.moments[-1]["mean"]
        return mean[:2]

    return update


def pfilter_filter(world: World, cloud: Array) -> Update:
    """`pfilter`: dynamics, noise and weight functions of one's own; its own summary and resampling."""
    import pfilter

    now = [world.moments[0]]
    rng = np.random.Generator(np.random.SFC64(0))
    ax, ay = world.anchors.T[:, None, :]

    def weigh(hypotheses: Array, observed: Array) -> Array:
        residual = observed - hypotheses
        total = (-0.5 / RANGE_SIGMA**2) * np.einsum("na,na->n", residual, residual)
        return np.asarray(np.exp(total - total.max()))

    filter_ = pfilter.ParticleFilter(
        prior_fn=lambda n: cloud.T[:n].copy(),
        observe_fn=lambda x: np.sqrt((x[:, :1] - ax) ** 2 + (x[:, 1:2] - ay) ** 2),
        n_particles=cloud.shape[1],
        dynamics_fn=lambda x: _moved(x, now[0], rng.standard_normal(x.shape)),
        noise_fn=lambda x: x,
        weight_fn=weigh,
        resample_fn=pfilter.systematic_resample,
        resample_proportion=0.0,
        n_eff_threshold=0.5,
    )

    def update(moment: Moment) -> Array:
        now[0] = moment
        filter_.update(moment.ranges)
        return np.asarray(filter_.mean_state[:2])

    return update


def stonesoup_filter(world: World, cloud: Array) -> Update:
    """Stone Soup: its predictor, updater and resamplers, models of one's own for step and ranges."""
    from datetime import datetime, timedelta

    from stonesoup.base import Property
    from stonesoup.models.measurement.nonlinear import NonLinearGaussianMeasurement
    from stonesoup.models.transition.base import TransitionModel
    from stonesoup.predictor.particle import ParticlePredictor
    from stonesoup.resampler.particle import ESSResampler, SystematicResampler
    from stonesoup.types.array import StateVectors
    from stonesoup.types.detection import Detection
    from stonesoup.types.hypothesis import SingleHypothesis
    from stonesoup.types.state import ParticleState
    from stonesoup.updater.particle import ParticleUpdater

    now = [world.moments[0]]
    rng = np.random.Generator(np.random.SFC64(0))
    ax, ay = world.anchors.T[:, :, None]

    class Walk(TransitionModel):  # type: ignore[misc]
        @property
        def ndim_state(self) -> int:
            return 4

        def function(self, state: Any, **_: Any) -> Any:
            z = rng.standard_normal((state.state_vector.shape[1], 4))
            return StateVectors(_moved(np.asarray(state.state_vector).T, now[0], z).T)

        def rvs(self, *_: Any, **__: Any) -> Any:
            raise NotImplementedError

        def pdf(self, *_: Any, **__: Any) -> Any:
            raise NotImplementedError

    class Ranges(NonLinearGaussianMeasurement):  # type: ignore[misc]
        ndim: int = Property(default=0, doc="Number of anchors")

        @property
        def ndim_meas(self) -> int:
            return self.ndim

        def function(self, state: Any, **_: Any) -> Any:
            x, y = np.asarray(state.state_vector)[:2]
            return StateVectors(np.sqrt((x - ax) ** 2 + (y - ay) ** 2))

    n, anchors = cloud.shape[1], len(world.anchors)
    model = Ranges(ndim_state=4, mapping=(0, 1), noise_covar=np.eye(anchors) * RANGE_SIGMA**2, ndim=anchors)
    predictor = ParticlePredictor(Walk())
    updater = ParticleUpdater(model, ESSResampler(threshold=0.5 * n, resampler=SystematicResampler()))
    zero = datetime(2026, 1, 1)
    state = [ParticleState(StateVectors(cloud.copy()), weight=np.full(n, 1.0 / n), timestamp=zero)]
    count = [0]

    def update(moment: Moment) -> Array:
        now[0] = moment
        count[0] += 1
        at = zero + timedelta(seconds=0.5 * count[0])
        prediction = predictor.predict(state[0], timestamp=at)
        detection = Detection(moment.ranges[:, None], timestamp=at, measurement_model=model)
        state[0] = updater.update(SingleHypothesis(prediction, detection))
        state[0].hypothesis = None  # it would keep the whole past alive
        covariance = state[0].covar
        return np.asarray(state[0].mean[:2, 0] if covariance is not None else 0.0)

    return update


PEER_FILTERS: dict[str, Callable[[World, Array], Update]] = {
    "particles": particles_filter,
    "pfilter": pfilter_filter,
    "stonesoup": stonesoup_filter,
}
