r"""Where every particle is blocked, sample again and more widely: chu2009 Section 3.3.2.

A constraint filters particles whose move is impossible. Sometimes it filters all: the walker has turned the corner that
no particle had reached. The paper then restarts the sampling with a larger disturbance "until at least one particle is
reserved":

.. math:: P_i(t_b) = P_i(t_a) + d + R, \quad |R| \le r_{max}, \quad r_{max} \leftarrow g \, r_{max}  \quad (3.3)

Departure from the paper, where r grows without limit: the number of rounds is bounded, and a cloud that cannot move at
all is left as the constraint leaves it. A soft constraint leaves those blocked where they were, at a lower weight,
rather than none: the one that passed carries the cloud after the next resampling.

References
----------
.. [1] Chu, Wireless location tracking by a sensor-enhanced particle filter in 2.5D buildings, thesis, National
   Chiao Tung University, 2009.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any, TypeVar

from wayfuse.core.errors import ConfigError
from wayfuse.core.types import Array
from wayfuse.filters.particle_filter import (
    Constraint,
    FilterInfo,
    FilterState,
    MotionModel,
    ParticleFilter,
)

__all__ = ["WideningFilter", "scaling"]

E = TypeVar("E")
Wider = Callable[[Any, float], Any]


def scaling(*names: str) -> Wider:
    """A way to widen motion models that are dataclasses: the fields of these names are multiplied.

    ``scaling("length_sigma", "heading_sigma")`` widens steps, ``scaling("sigma")`` a random walk.
    """

    def wider(motion: Any, factor: float) -> Any:
        return replace(motion, **{name: factor * getattr(motion, name) for name in names})

    return wider


@dataclass(frozen=True, slots=True, kw_only=True)
class WideningFilter:
    """A particle filter whose prediction is made again, more widely, while all particles are blocked.

    Parameters
    ----------
    wider : (motion model, factor) to a model with a disturbance so many times larger, such as `scaling`. growth : g,
    from one round to the next. rounds : most rounds after the first. filter : what does the rest.
    """

    wider: Wider
    growth: float = 2.0
    rounds: int = 5
    filter: ParticleFilter = field(default_factory=ParticleFilter)

    def __post_init__(self) -> None:
        if not self.growth > 1.0 or self.rounds < 0:
            raise ConfigError(
                f"growth must be above 1, rounds not negative, got {self.growth}, {self.rounds}",
                where="WideningFilter",
            )

    def predict(
        self,
        key: tuple[int, int],
        state: FilterState,
        motion: MotionModel[E],
        event: E,
        constraint: Constraint | None,
    ) -> tuple[FilterState, int]:
        """Move the cloud as `ParticleFilter.predict` does, and again where nobody came through.

        Every round has draws of its own, so the same state gives the same bits.

        Returns
        -------
        the state after the last round, and how many of its moves were undone: all of them where no round helped.
        """
        after, n_blocked = self.filter.predict(key, state, motion, event, constraint)
        for k in range(1, self.rounds + 1):
            if n_blocked < state.cloud.n:
                break
            again = state._replace(draw=after.draw)
            wide: MotionModel[E] = self.wider(motion, self.growth**k)
            after, n_blocked = self.filter.predict(key, again, wide, event, constraint)
        return after, n_blocked

    def update(
        self,
        key: tuple[int, int],
        state: FilterState,
        log_likelihood: Array,
        *,
        always_resample: bool = False,
    ) -> tuple[FilterState, FilterInfo]:
        """Weigh and resample, as `ParticleFilter.update` does."""
        return self.filter.update(key, state, log_likelihood, always_resample=always_resample)
