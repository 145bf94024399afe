"""How steadily a track behaves, without any truth: jumps, and changes of floor that are taken back.

A jump is a displacement between consecutive estimates that no walker makes: more than 3 m/s times the time
between them plus 1 m (a correction within the noise is no jump). A floor flap is a change of floor that is
taken back within 10 s. A method that is right on average and jumps is of no use to a person with a map in
hand.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wayfuse.core.types import Array
from wayfuse.evaluation.estimates_file import WalkEstimates
from wayfuse.evaluation.truth import CommonFrame

__all__ = [
    "FLAP_WITHIN",
    "JUMP_MARGIN",
    "JUMP_SPEED",
    "Stability",
    "count_flaps",
    "jump_lengths",
    "stability",
]

JUMP_SPEED = 3.0  # m/s: a fast run indoors
JUMP_MARGIN = 1.0  # m: corrections below it are not seen as jumps
FLAP_WITHIN = 10.0  # s: no staircase is climbed and descended faster


@dataclass(frozen=True, slots=True)
class Stability:
    """Counts over tracks: jumps, changes of floor, those taken back; minutes tracked; longest jump (m)."""

    minutes: float
    n_jumps: int
    longest_jump: float
    n_floor_changes: int
    n_floor_flaps: int

    def per_minute(self, count: int) -> float:
        """A count per minute of track; NaN for tracks without duration."""
        return count / self.minutes if self.minutes > 0 else float("nan")


def jump_lengths(t: Array, xy: Array) -> Array:
    """Displacements (m) of the jumps among estimates at t (n,) s, xy (n, 2) m of one frame."""
    length = np.hypot(*np.diff(xy, axis=0).T)
    return np.asarray(length[length > JUMP_SPEED * np.diff(t) + JUMP_MARGIN])


def count_flaps(t: Array, floor: NDArray[np.str_]) -> tuple[int, int]:
    """Changes of floor, and those of them that are taken back within `FLAP_WITHIN`, of estimates at t (n,)
    s."""
    at = np.flatnonzero(floor[1:] != floor[:-1]) + 1
    back = floor[at[1:]] == floor[at[:-1] - 1] if len(at) > 1 else np.empty(0, np.bool_)
    soon = np.diff(t[at]) <= FLAP_WITHIN
    return len(at), int(np.sum(back & soon)) if len(at) > 1 else 0


def stability(tracks: Iterable[WalkEstimates], frame: CommonFrame | None = None) -> Stability:
    """Counts over tracks, from the end of their initialising state on.

    ``frame`` takes the floors of a site, which have frames of their own, into one.
    """
    frame = CommonFrame() if frame is None else frame
    seconds, jumps, changes, flaps, longest = 0.0, 0, 0, 0, 0.0
    for track in tracks:
        known = np.flatnonzero(track.states() != "initialising")
        settled = slice(int(known[0]) if len(known) else len(track), None)
        t, floor = track.t[settled], track.floor[settled]
        seconds += float(t[-1] - t[0]) if len(t) else 0.0
        lengths = jump_lengths(t, (track.xy + frame.shift(track.floor))[settled])
        n_changes, n_flaps = count_flaps(t, floor)
        jumps, changes, flaps = jumps + len(lengths), changes + n_changes, flaps + n_flaps
        longest = max(longest, float(lengths.max(initial=0.0)))
    return Stability(seconds / 60.0, jumps, longest, changes, flaps)
