"""Which frames of several anchors are of one packet (li2015, Section 6: each anchor hears each packet of the target).

Packets are known by transmitter and sequence number; where a card does not tell the number (Intel 5300), frames of one
transmitter that come within a short window belong together. A group is complete when all anchors were heard; after
``wait`` it goes without the missing ones. What comes later still is counted and left out, so is what an anchor says
twice (a retransmission). Times have to be on one clock: that of arrival at the server, or synchronised anchors.

State in, state out, as the tracker's: `PacketGrouper.step` for live frames, `group` for a list of them.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np

from wayfuse.core.errors import ConfigError
from wayfuse.core.types import IntArray
from wayfuse.radio.csi import INTEL5300_20MHZ, direct_path_power
from wayfuse.radio.ranging import RangeRegression, mean_range
from wayfuse.sensors.records import CsiFrame, Range

__all__ = [
    "GroupCounts",
    "GroupState",
    "HeardPacket",
    "PacketGroup",
    "PacketGrouper",
    "group",
    "group_ranges",
]

_UNKNOWN = -1  # sequence number a card does not tell


class HeardPacket(Protocol):
    """A packet as an anchor heard it, such as `formats.nexmon.Packet`."""

    @property
    def target(self) -> int:
        """Identifier of the transmitter."""
        ...

    @property
    def sequence(self) -> int:
        """Sequence number, -1 unknown."""
        ...

    @property
    def frame(self) -> CsiFrame:
        """Its channel state."""
        ...


class PacketGroup(NamedTuple):
    """A packet: transmitter, sequence number (-1 unknown), time of the first frame (s), frames in anchor order."""

    target: int
    sequence: int
    t: float
    frames: tuple[CsiFrame, ...]


class GroupCounts(NamedTuple):
    """groups : given out. late, repeated, foreign : frames left out. missing : (anchor, packets it did not hear)."""

    groups: int = 0
    late: int = 0
    repeated: int = 0
    foreign: int = 0
    missing: tuple[tuple[int, int], ...] = ()


class GroupState(NamedTuple):
    """Groups that wait (complete ones too, so that a repeat is known), newest time, what was counted."""

    waiting: tuple[PacketGroup, ...] = ()
    now: float = -np.inf
    counts: GroupCounts = GroupCounts()


@dataclass(frozen=True, slots=True, kw_only=True)
class PacketGrouper:
    """Groups frames.

    Parameters
    ----------
    anchors : identifiers; frames of others are foreign. wait : s, from the first frame of a packet to giving up the
    missing ones; below the time in which numbers come again (4096 packets). window : s, within which frames without a
    number are of one packet; below half the time between packets.
    """

    anchors: tuple[int, ...]
    wait: float = 0.2
    window: float = 0.004  # 100 packets a second in the paper

    def __post_init__(self) -> None:
        if not self.anchors or len(set(self.anchors)) != len(self.anchors):
            raise ConfigError(f"anchors must be given, each once, got {self.anchors}", where="PacketGrouper")
        if not 0.0 < self.window <= self.wait:
            raise ConfigError(
                f"0 < window <= wait is needed, got {self.window} and {self.wait} s", where="PacketGrouper"
            )

    def init(self) -> GroupState:
        """State before the first frame."""
        return GroupState(counts=GroupCounts(missing=tuple((a, 0) for a in self.anchors)))

    def step(self, state: GroupState, packet: HeardPacket) -> tuple[GroupState, list[PacketGroup]]:
        """Take a frame: the state after it, and the packets that are complete or have waited long enough by it."""
        frame, counts = packet.frame, state.counts
        if frame.anchor not in self.anchors:
            return state._replace(counts=counts._replace(foreign=counts.foreign + 1)), []
        if frame.t < state.now - self.wait:
            return state._replace(counts=counts._replace(late=counts.late + 1)), []
        state, out = self._given_up(state._replace(now=max(state.now, frame.t)))
        counts, waiting = state.counts, list(state.waiting)
        place = next((k for k, g in enumerate(waiting) if self._is_of(g, packet)), None)
        if place is None:
            waiting.append(PacketGroup(packet.target, packet.sequence, frame.t, (frame,)))
            place = len(waiting) - 1
        elif frame.anchor in {f.anchor for f in waiting[place].frames}:
            return state._replace(counts=counts._replace(repeated=counts.repeated + 1)), out
        else:
            waiting[place] = self._with(waiting[place], frame)
        if len(waiting[place].frames) == len(self.anchors):
            out.append(waiting[place])
            counts = counts._replace(groups=counts.groups + 1)
        return state._replace(waiting=tuple(waiting), counts=counts), out

    def flush(self, state: GroupState) -> tuple[GroupState, list[PacketGroup]]:
        """Give up all that still wait."""
        return self._given_up(state._replace(now=np.inf))

    def _is_of(self, group: PacketGroup, packet: HeardPacket) -> bool:
        """Whether a frame is of a packet; without a number, also whether its anchor is still to be heard."""
        if (group.target, group.sequence) != (packet.target, packet.sequence):
            return False
        apart = abs(packet.frame.t - group.t)
        return apart <= (self.window if packet.sequence == _UNKNOWN else self.wait)

    def _with(self, group: PacketGroup, frame: CsiFrame) -> PacketGroup:
        frames = sorted((*group.frames, frame), key=lambda f: self.anchors.index(f.anchor))
        return group._replace(t=min(group.t, frame.t), frames=tuple(frames))

    def _given_up(self, state: GroupState) -> tuple[GroupState, list[PacketGroup]]:
        over = [g for g in state.waiting if g.t < state.now - self.wait]
        if not over:
            return state, []
        n, counts = len(self.anchors), state.counts
        out = [g for g in over if len(g.frames) < n]  # the complete ones went when they were
        heard = [{f.anchor for f in g.frames} for g in out]
        missing = tuple((a, count + sum(a not in h for h in heard)) for a, count in counts.missing)
        counts = counts._replace(groups=counts.groups + len(out), missing=missing)
        waiting = tuple(g for g in state.waiting if g.t >= state.now - self.wait)
        return state._replace(waiting=waiting, counts=counts), out


def group(grouper: PacketGrouper, packets: Iterable[HeardPacket]) -> tuple[list[PacketGroup], GroupCounts]:
    """All packets of frames in the order of their arrival, and what was counted."""
    state, out = grouper.init(), []
    for packet in packets:
        state, done = grouper.step(state, packet)
        out += done
    state, done = grouper.flush(state)
    return sorted([*out, *done], key=lambda g: g.t), state.counts


def group_ranges(
    packet: PacketGroup,
    models: Mapping[int, Sequence[RangeRegression]],
    subcarriers: IntArray = INTEL5300_20MHZ,
) -> tuple[Range, ...]:
    """Ranges of a packet, all at its time: mean over the antennas of each anchor (li2015, Section 5.1).

    models : regressions of each anchor, one per antenna. An anchor without a model or a finite range is left out.
    """
    out = []
    for frame in packet.frames:
        if frame.anchor in models:
            power = direct_path_power(frame, subcarriers)[: len(models[frame.anchor])]
            power = np.pad(power, (0, len(models[frame.anchor]) - len(power)), constant_values=np.nan)
            distance = float(mean_range(models[frame.anchor], power))
            if np.isfinite(distance):
                out.append(Range(packet.t, frame.anchor, distance, rssi=frame.rss))
    return tuple(out)
