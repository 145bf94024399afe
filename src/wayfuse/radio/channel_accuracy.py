"""How wrong the ranges of a channel model are on walks it has not seen: each walk by the model of the others."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from wayfuse.core.types import Array
from wayfuse.radio.channel_model import fit_channel_model
from wayfuse.radio.channel_ranging import ChannelRanging, ChannelState
from wayfuse.sensors.records import CsiFrame

__all__ = ["range_errors"]


def range_errors(walks: Sequence[tuple[Sequence[CsiFrame], Array]], moment: float = 0.5) -> Array:
    """Ranges minus distances (n,) m, one per moment and anchor, of all walks.

    Parameters
    ----------
    walks : frames in time order and their distances (m, NaN unknown). moment : s, as of `ChannelRanging`.

    Raises
    ------
    RadioMapError : without one of the walks an anchor is surveyed at fewer than two distances.
    """
    out: list[float] = []
    for k, (frames, distances) in enumerate(walks):
        others = [walk for i, walk in enumerate(walks) if i != k]
        model = fit_channel_model(
            [frame for of, _ in others for frame in of], np.concatenate([d for _, d in others])
        )
        out += _errors(ChannelRanging(model=model, moment=moment), frames, distances)
    return np.array(out)


def _errors(ranging: ChannelRanging, frames: Sequence[CsiFrame], distances: Array) -> list[float]:
    state: ChannelState | None = None
    out: list[float] = []
    within: dict[int, list[float]] = {}
    for frame, distance in zip(frames, distances.tolist(), strict=True):
        if state is not None and frame.t >= ranging.end_of(state):
            out += _of_moment(ranging, state, within)
            state, within = None, {}
        state, _ = ranging.step(state, frame)
        within.setdefault(frame.anchor, []).append(distance)
    return out if state is None else out + _of_moment(ranging, state, within)


def _of_moment(ranging: ChannelRanging, state: ChannelState, within: dict[int, list[float]]) -> list[float]:
    errors = [r.distance - float(np.mean(within[r.anchor])) for r in ranging.ranges(state, state.start)]
    return [error for error in errors if np.isfinite(error)]
