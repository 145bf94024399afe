r"""The particle filter: predict, update, resample; it knows neither sensors nor buildings.

The state is a value: nothing is changed in place, so a state kept is a checkpoint, and the random numbers are
counted (`core.philox`), so going on from a checkpoint gives the same bits.

References
----------
.. [1] Gordon, Salmond, Smith, Novel approach to nonlinear/non-Gaussian Bayesian state estimation, IEE Proc. F 1993.
.. [2] Kitagawa, Monte Carlo filter and smoother for non-Gaussian nonlinear state space models, JCGS 1996 (fixed lag).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from wayfuse.core.errors import ConfigError
from wayfuse.core.philox import Noise
from wayfuse.core.types import Array, Array32
from wayfuse.filters._kernels import normalise
from wayfuse.filters.cloud import Cloud
from wayfuse.filters.resampling import Resampler, systematic

__all__ = [
    "Constraint",
    "FilterInfo",
    "FilterState",
    "MotionModel",
    "ObservationModel",
    "ParticleFilter",
    "Snapshot",
    "replace_particles",
]

E_contra = TypeVar("E_contra", contravariant=True)
Z_contra = TypeVar("Z_contra", contravariant=True)
A = TypeVar("A", bound=np.generic)


class MotionModel(Protocol[E_contra]):
    """p(x_t | x_{t-1}, u_t)."""

    def propagate(self, noise: Noise, cloud: Cloud, event: E_contra, /) -> Cloud:
        """A new cloud, each particle moved by the event with its own noise."""
        ...


class ObservationModel(Protocol[Z_contra]):
    """log p(z | x) up to a constant."""

    def log_likelihood(self, cloud: Cloud, observation: Z_contra, out: Array, /) -> None:
        """Add the log-likelihood of the observation at each particle to ``out`` (N,); finite, never NaN."""
        ...


class Constraint(Protocol):
    """Which moves are possible."""

    def restrict(self, before: Cloud, after: Cloud, log_weights: Array, /) -> tuple[Cloud, int]:
        """The cloud after impossible moves are undone, ``log_weights`` lowered for them, and how many."""
        ...


class Snapshot(NamedTuple):
    """Where the ancestors of today's particles were at time t: x, y (N,) m, floor (N,)."""

    t: float
    x: Array32
    y: Array32
    floor: NDArray[np.int32]


class FilterState(NamedTuple):
    """Particles, their log-weights (N,), the count of random draws so far, and the past kept for a fixed lag."""

    cloud: Cloud
    log_weights: Array
    draw: int
    history: tuple[Snapshot, ...] = ()

    @property
    def weights(self) -> Array:
        """Normalised weights (N,)."""
        out = np.empty_like(self.log_weights)
        normalise(self.log_weights, out)
        return out


class FilterInfo(NamedTuple):
    """What an operation did: effective sample size, log of the mean weight, resampled?, moves undone."""

    ess: float
    log_evidence: float
    resampled: bool
    n_blocked: int


@dataclass(frozen=True, slots=True)
class ParticleFilter:
    """Sequential importance resampling.

    Parameters
    ----------
    resample : scheme. ess_ratio : resample when the effective sample size falls below this share of N.
    """

    resample: Resampler = systematic
    ess_ratio: float = 0.5

    def __post_init__(self) -> None:
        if not 0.0 <= self.ess_ratio <= 1.0:
            raise ConfigError(f"ess_ratio must lie in [0, 1], got {self.ess_ratio}")

    def predict(
        self,
        key: tuple[int, int],
        state: FilterState,
        motion: MotionModel[E_contra],
        event: E_contra,
        constraint: Constraint | None,
    ) -> tuple[FilterState, int]:
        """Move the cloud; moves the constraint forbids are undone. Returns the state and how many were."""
        noise = Noise(key, state.draw)
        cloud = motion.propagate(noise, state.cloud, event)
        log_weights, n_blocked = state.log_weights, 0
        if constraint is not None:
            log_weights = log_weights.copy()
            cloud, n_blocked = constraint.restrict(state.cloud, cloud, log_weights)
        return FilterState(cloud, log_weights, noise.draw, state.history), n_blocked

    def update(
        self,
        key: tuple[int, int],
        state: FilterState,
        log_likelihood: Array,
        *,
        always_resample: bool = False,
    ) -> tuple[FilterState, FilterInfo]:
        """Weigh the particles by an observation's log-likelihood (N,) and resample where needed."""
        n = state.cloud.n
        log_weights = state.log_weights + log_likelihood
        weights = np.empty(n)
        top, evidence, ess = normalise(log_weights, weights)
        if not (always_resample or ess < self.ess_ratio * n):
            moved = state._replace(log_weights=log_weights - top)
            return moved, FilterInfo(ess, evidence, resampled=False, n_blocked=0)
        noise = Noise(key, state.draw)
        ancestors = self.resample(noise, weights, n)
        past = tuple(Snapshot(s.t, s.x[ancestors], s.y[ancestors], s.floor[ancestors]) for s in state.history)
        after = FilterState(state.cloud.take(ancestors), np.zeros(n), noise.draw, past)
        return after, FilterInfo(ess, evidence, resampled=True, n_blocked=0)


def spread_slots(noise: Noise, n: int, fresh: int) -> NDArray[np.int64]:
    """Distinct slots (fresh,) of n equally weighted particles to replace: a random start and an even stride."""
    start = noise.uniforms(1)[0, 0] * n
    return np.asarray(np.floor(start + np.arange(fresh) * (n / fresh)).astype(np.int64) % n)


def replace_particles(state: FilterState, slots: NDArray[np.integer], fresh: Cloud) -> FilterState:
    """Put fresh particles into slots; their past is where they are now, for they have none."""
    columns: list[NDArray[Any]] = [
        _replaced(column, slots, new) for column, new in zip(state.cloud, fresh, strict=True)
    ]
    cloud = Cloud(*columns)
    past = tuple(
        Snapshot(
            s.t,
            _replaced(s.x, slots, fresh.x),
            _replaced(s.y, slots, fresh.y),
            _replaced(s.floor, slots, fresh.floor),
        )
        for s in state.history
    )
    return state._replace(cloud=cloud, history=past)


def _replaced(column: NDArray[A], slots: NDArray[np.integer], fresh: NDArray[A]) -> NDArray[A]:
    changed = column.copy()
    changed[slots] = fresh
    return changed
