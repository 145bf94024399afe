"""Ranges from channel state as it comes: the frames of a moment give one range per anchor (li2015, Section 5.1).

The paper makes a range of every packet, a hundred a second. Their fading is alike from packet to packet, and the
regressions are fitted to median powers (`radio.csi_survey`): here the power of an antenna is the median over the frames
of a moment, and a range goes out when the moment is over. With a moment shorter than the time between packets it is
the paper's. State in, state out, as the tracker's.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from wayfuse.core.errors import ConfigError
from wayfuse.radio.channel_model import ChannelModel
from wayfuse.radio.csi import direct_path_power
from wayfuse.radio.ranging import mean_range
from wayfuse.sensors.quality import Verdict
from wayfuse.sensors.records import CsiFrame, Range

__all__ = ["ChannelRanging", "ChannelState"]

_MOST = 4096  # frames of a moment that are kept: 8,000 a second and more say no more


class ChannelState(NamedTuple):
    """The moment under way.

    start : s, of its first frame. heard : per frame the anchor and the power (dBm) of each antenna, NaN not heard.
    """

    start: float
    heard: tuple[tuple[int, tuple[float, ...]], ...]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ChannelRanging:
    """Makes ranges.

    Parameters
    ----------
    model : of the anchors. moment : s, whose frames make one range.
    """

    model: ChannelModel
    moment: float = 0.5

    def __post_init__(self) -> None:
        if not self.moment > 0.0:
            raise ConfigError(f"moment must be positive, got {self.moment} s", where="ChannelRanging")

    def step(self, state: ChannelState | None, frame: CsiFrame) -> tuple[ChannelState | None, Verdict]:
        """Take a frame of the moment under way, or the first of one (None); one that is over is to be ended before."""
        antennas = self.model.anchors.get(frame.anchor)
        if antennas is None:
            return state, Verdict.UNKNOWN_ACCESS_POINTS
        if frame.csi.ndim != 3 or frame.csi.shape[-1] != len(self.model.subcarriers):
            return state, Verdict.OUT_OF_RANGE
        if state is not None and len(state.heard) >= _MOST:
            return state, Verdict.IGNORED
        with np.errstate(invalid="ignore", over="ignore"):
            power = direct_path_power(frame, self.model.subcarriers)[: len(antennas)].tolist()
        if not np.isfinite(power).any():
            return state, Verdict.NOT_FINITE
        power += [float("nan")] * (len(antennas) - len(power))
        moment = state or ChannelState(frame.t, ())
        heard = (*moment.heard, (frame.anchor, tuple(power)))
        return moment._replace(heard=heard), Verdict.USED

    def end_of(self, state: ChannelState) -> float:
        """Time (s) at which a moment is over."""
        return state.start + self.moment

    def ranges(self, state: ChannelState, t: float) -> tuple[Range, ...]:
        """Ranges of a moment, as of t (s), in the order of the anchors in the model."""
        out = []
        for anchor, antennas in self.model.anchors.items():
            heard = np.array([power for of, power in state.heard if of == anchor])
            if len(heard):
                known = np.isfinite(heard).any(axis=0)
                power = np.full(len(antennas), np.nan)
                power[known] = np.nanmedian(heard[:, known], axis=0)
                distance = float(mean_range(antennas, power))
                if np.isfinite(distance):
                    out.append(Range(t, anchor, distance))
        return tuple(out)
