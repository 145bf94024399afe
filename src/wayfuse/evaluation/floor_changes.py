"""Floor changes of a track against the true ones: found, missed, too many, and how late.

Two successive waypoints on different floors are a true change that *left* at the first and *arrived* at the second.
From `EARLY` before a change left until `EARLY` before the next one leaves, every change of the floor said counts for
it. The first of these that reaches the true floor is the one found; all others, and those before the first true
change, are extra. A change is *right* when it is found, by one change the right way, and nothing else was said of it.
A trip over an intermediate floor (0, -1, -2 for 0, -2) thus has one change found and one extra.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from wayfuse.core.types import Array, IntArray
from wayfuse.evaluation.estimates_file import WalkEstimates
from wayfuse.maps.site import Site
from wayfuse.models.survey_walk import place_of
from wayfuse.sensors.recording import Recording

__all__ = [
    "EARLY",
    "ChangeScore",
    "SaidChange",
    "TrueChange",
    "match_changes",
    "said_changes",
    "true_changes",
]

EARLY = 3.0  # s before a stated point that its floor may be left: points are stated to a second or so


class TrueChange(NamedTuple):
    """A change of floors by the waypoints: times of the points before and after it (s), floors (ordinal)."""

    left: float
    arrived: float
    before: int
    after: int


class SaidChange(NamedTuple):
    """A change of the floor said: time (s) of the first estimate on the new floor, floors (ordinal)."""

    t: float
    before: int
    after: int


@dataclass(frozen=True, slots=True)
class ChangeScore:
    """One track: the true changes, what was found of each (None = missed), how many were said for each, and how many
    were said before the first of them.
    """

    truths: tuple[TrueChange, ...]
    found: tuple[SaidChange | None, ...]
    n_said: tuple[int, ...]
    n_before: int = 0

    @property
    def n_missed(self) -> int:
        """True changes whose floor was not said in time."""
        return sum(found is None for found in self.found)

    @property
    def n_right(self) -> int:
        """True changes said once, the right way, and nothing else said of them."""
        return sum(
            found is not None and n == 1 and (found.after > found.before) == (truth.after > truth.before)
            for truth, found, n in zip(self.truths, self.found, self.n_said, strict=True)
        )

    @property
    def n_extra(self) -> int:
        """Changes said that are not the one that was found."""
        return self.n_before + sum(self.n_said) - (len(self.truths) - self.n_missed)

    @property
    def delays(self) -> Array:
        """(n,) s from each arrival until its floor was said, negative before it; infinite where it was missed."""
        return np.array(
            [
                np.inf if found is None else found.t - truth.arrived
                for truth, found in zip(self.truths, self.found, strict=True)
            ]
        )


def true_changes(t: Array, floor: IntArray) -> tuple[TrueChange, ...]:
    """Changes by waypoints at times ``t`` (n,) s on floors ``floor`` (n,), ordinal."""
    points = pairwise(zip(t.tolist(), floor.tolist(), strict=True))
    return tuple(TrueChange(left, arrived, a, b) for (left, a), (arrived, b) in points if a != b)


def said_changes(t: Array, floor: IntArray, start: float) -> tuple[SaidChange, ...]:
    """Changes of the floor in estimates at times ``t`` (n,) s, after a time (s): before it nothing is scored."""
    rows = np.flatnonzero(floor[1:] != floor[:-1]) + 1
    return tuple(SaidChange(float(t[i]), int(floor[i - 1]), int(floor[i])) for i in rows if t[i] > start)


def match_changes(truths: Sequence[TrueChange], said: Sequence[SaidChange]) -> ChangeScore:
    """Give each change said to the last true change that had begun; both in time order."""
    begins = np.array([truth.left - EARLY for truth in truths])
    owner = np.searchsorted(begins, [change.t for change in said], side="right") - 1
    found: list[SaidChange | None] = []
    n_said: list[int] = []
    for k, truth in enumerate(truths):
        mine = [change for change, of in zip(said, owner.tolist(), strict=True) if of == k]
        found.append(next((change for change in mine if change.after == truth.after), None))
        n_said.append(len(mine))
    return ChangeScore(tuple(truths), tuple(found), tuple(n_said), int(np.sum(owner < 0)))


def score_changes(
    site: Site, recordings: Sequence[Recording], tracks: Sequence[WalkEstimates]
) -> dict[str, list[ChangeScore]]:
    """Changes in tracks against the waypoints, by recording; before its first waypoint nothing is scored."""
    by_name = {recording.name: recording for recording in recordings}
    out: dict[str, list[ChangeScore]] = {}
    for track in tracks:
        points = by_name[track.walk].waypoints
        t = np.array([point.t for point in points])
        truths = true_changes(t, np.array([place_of(site, point)[2] for point in points]))
        floor = np.array([site.floor_index(name) for name in track.floor.tolist()])
        said = said_changes(track.t, floor, float(t[0]))
        out.setdefault(track.walk, []).append(match_changes(truths, said))
    return out
