"""Fixed lag: where today's particles came from, kept from the time they were marked until it is asked for.

A filter without a cloud yet marks times too; they have no snapshot, and it is the number of marks that tells.

References
----------
.. [1] Kitagawa, Monte Carlo filter and smoother for non-Gaussian nonlinear state space models, JCGS 1996.
"""

from __future__ import annotations

from wayfuse.filters.particle_filter import FilterState, Snapshot

__all__ = ["recalled", "remembered"]


def remembered(state: FilterState | None, t: float) -> FilterState | None:
    """The filter with where its particles are now, at time t (s), kept; resampling keeps it up to date."""
    if state is None:
        return None
    cloud = state.cloud
    return state._replace(history=(*state.history, Snapshot(t, cloud.x, cloud.y, cloud.floor)))


def recalled(state: FilterState | None, n_marks: int) -> tuple[FilterState | None, Snapshot | None]:
    """The filter without its oldest snapshot, and that; None for a mark made before there was a cloud.

    n_marks : marks not yet recalled, this one among them.
    """
    if state is None or len(state.history) < n_marks:
        return state, None
    return state._replace(history=state.history[1:]), state.history[0]
