"""The state of a track as a value, and what batches of records give and need."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING, Any, Generic, NamedTuple, TypeVar

import numpy as np

from wayfuse.core.types import Array
from wayfuse.inertial.front_end import FrontEndState
from wayfuse.inertial.vertical_front_end import VerticalState
from wayfuse.radio.scans import ScanState
from wayfuse.sensors.quality import Verdict
from wayfuse.sensors.recording import Recording
from wayfuse.sensors.records import Range
from wayfuse.tracking.estimate import Estimate

if TYPE_CHECKING:
    from wayfuse.radio.channel_ranging import ChannelState

__all__ = ["FAR", "LONGEST_GAP", "Batch", "Replay", "Track", "TrackState", "is_even"]

S = TypeVar("S")

LONGEST_GAP = 300.0  # s; after a longer silence the track starts anew: the person can be anywhere
FAR = 1e12  # s; times beyond are no times: float64 no longer tells milliseconds apart


class TrackState(NamedTuple, Generic[S]):
    """Everything a track needs to go on; a value: keep it and it is a checkpoint."""

    name: str
    seed: int
    front_end: FrontEndState
    vertical: VerticalState
    scans: ScanState
    engine: S
    now: float = -np.inf
    next_output: float = np.inf
    last_heard: float = np.inf
    last_motion: float = -np.inf
    diffused: float = -np.inf
    pending: tuple[float, ...] = ()
    ranges: tuple[Range, ...] = ()  # of the present moment, which may not be over
    channel: ChannelState | None = None  # the moment of channel state that is not over
    is_told: bool = False  # the phone works out its own steps, and their headings with them


class Track(NamedTuple):
    """A finished track: its estimates in time order, and what became of the scans."""

    name: str
    estimates: list[Estimate]
    verdicts: Counter[Verdict]


class Batch(NamedTuple, Generic[S]):
    """After a batch: the state, the estimates that were due, what became of its scans and of its other records."""

    state: TrackState[S]
    estimates: list[Estimate]
    scans: Counter[Verdict]
    others: Counter[Verdict]


class Replay(NamedTuple):
    """What records one by one would tell, for a batch that is at hand whole.

    motion : (n,) s, times of its accelerations. before : s, of the last one before the batch.
    """

    motion: Array
    before: float

    def last_motion(self, t: float) -> float:
        """Time (s) of the last acceleration at or before t."""
        i = int(np.searchsorted(self.motion, t, side="right"))
        return float(self.motion[i - 1]) if i else self.before


def is_even(state: TrackState[Any], recording: Recording) -> bool:
    """Whether a batch follows the state in time without long silences and odd times, so that arrays will do."""
    start, end = recording.span
    heard = np.sort(np.concatenate([recording.acceleration.t, [scan.t for scan in recording.wifi]]))
    before = start if state.now == -np.inf else min(state.now, state.last_heard)
    gaps = np.diff(np.concatenate([heard, [end]]), prepend=before)
    return bool(start >= -FAR and end <= FAR and start >= state.now and np.all(gaps <= LONGEST_GAP))
