"""How well stairs, lifts and standing are found: against surveyed points on different floors.

The surveyor of ipin2023-track3 stated a point (POSI) before and after every flight of stairs and every ride. Two
successive points on different floors bracket a movement of known sign; its class follows from the trial
(`IPIN2023_CLASSES`). The bracket is generous: a lift leaves about 10 s after its first point.

A detected movement belongs to the bracket, widened by `MARGIN`, with which it shares the most time; one that touches
none is a false alarm, whatever becomes of it. A bracket may hold several movements (a flight with a landing). It is
*right* when it holds one at least and all are of its class and sign; its *sign* is that of the sum of the rises.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from wayfuse.core.types import Array, BoolArray
from wayfuse.inertial.behaviour import behaviour_at
from wayfuse.inertial.front_end import InertialFrontEnd, StepEvents
from wayfuse.inertial.vertical import Behaviour, VerticalEvent
from wayfuse.inertial.vertical_front_end import VerticalConfig, VerticalFrontEnd
from wayfuse.sensors.recording import Recording

__all__ = [
    "IPIN2023_CLASSES",
    "MARGIN",
    "BehaviourScore",
    "FalseAlarm",
    "ScoredMovement",
    "StandingScore",
    "TrueMovement",
    "detect",
    "ipin2023_labels",
    "match",
    "score_behaviours",
    "score_standing",
    "true_movements",
]

MARGIN = 3.0  # s; POSI are stated to a second or so
STANDS_BETWEEN = 8.0  # s between two POSI at one place that make a phase of standing
# Trials of ipin2023-track3 that change floors, from the organisers' technical annex: 51 by stairs over the
# mezzanine, 52 by stairs, 53 by lift. All other trials stay on a floor.
IPIN2023_CLASSES = {51: Behaviour.STAIRS, 52: Behaviour.STAIRS, 53: Behaviour.LIFT}


class TrueMovement(NamedTuple):
    """A change of floors: class, sign (1 up), and the times of the points before and after it (s)."""

    behaviour: Behaviour
    sign: int
    left: float
    arrived: float


class ScoredMovement(NamedTuple):
    """A true movement and the first and last report of each detected one in its bracket."""

    recording: str
    truth: TrueMovement
    found: tuple[tuple[VerticalEvent, VerticalEvent], ...]

    @property
    def rise(self) -> float:
        """Sum of the rises (m); 0 where nothing was found."""
        return float(sum(last.rise for _, last in self.found))

    @property
    def is_signed(self) -> bool:
        """Whether something was found and it goes the right way."""
        return self.rise * self.truth.sign > 0.0

    @property
    def is_wrong_sign(self) -> bool:
        """Whether what was found goes the wrong way."""
        return self.rise * self.truth.sign < 0.0

    @property
    def is_right(self) -> bool:
        """Whether something was found and all of it is of the true class and sign."""
        return bool(self.found) and all(
            last.behaviour == self.truth.behaviour and last.rise * self.truth.sign > 0.0
            for _, last in self.found
        )


class FalseAlarm(NamedTuple):
    """A movement where there was none: the first and last report."""

    recording: str
    first: VerticalEvent
    last: VerticalEvent


@dataclass(frozen=True, slots=True)
class BehaviourScore:
    """Movements of a set of recordings, found or not, and the false alarms; hours : length of all recordings."""

    movements: tuple[ScoredMovement, ...]
    false_alarms: tuple[FalseAlarm, ...]
    hours: float

    def count(self, behaviour: Behaviour | None = None) -> int:
        """Number of true movements of a class, or of all."""
        return len(self._of(behaviour))

    def n_right(self, behaviour: Behaviour | None = None) -> int:
        """Of these, found with the right class and sign and nothing else."""
        return sum(m.is_right for m in self._of(behaviour))

    def n_signed(self, behaviour: Behaviour | None = None) -> int:
        """Of these, found with the right sign."""
        return sum(m.is_signed for m in self._of(behaviour))

    def n_wrong_sign(self, behaviour: Behaviour | None = None) -> int:
        """Of these, found with the wrong sign."""
        return sum(m.is_wrong_sign for m in self._of(behaviour))

    @property
    def false_alarms_per_hour(self) -> float:
        """False alarms per hour of recording."""
        return len(self.false_alarms) / self.hours if self.hours > 0.0 else float("nan")

    @property
    def declared_after(self) -> Array:
        """Seconds from the (back-dated) beginning of each detected movement to its first report."""
        return np.array([a.t - b.began for m in self.movements for a, b in m.found])

    @property
    def over_after(self) -> Array:
        """Seconds from the (back-dated) end of each detected movement to its last report."""
        return np.array([b.t - b.ended for m in self.movements for _, b in m.found])

    @property
    def declared_before_arrival(self) -> Array:
        """Seconds from the first report in a bracket to the point after it: positive is in time."""
        return np.array([m.truth.arrived - m.found[0][0].t for m in self.movements if m.found])

    def _of(self, behaviour: Behaviour | None) -> list[ScoredMovement]:
        return [m for m in self.movements if behaviour in (None, m.truth.behaviour)]


class StandingScore(NamedTuple):
    """Seconds of standing and of walking by the points, and how much of each is called standing (0 to 1)."""

    standing: float
    walking: float
    standing_found: float
    walking_called_standing: float


def ipin2023_labels(recordings: Sequence[Recording]) -> dict[str, Behaviour]:
    """Class of the floor changes of each recording of ipin2023-track3, from the trial in its name."""
    labels = {}
    for recording in recordings:
        _, _, tail = recording.name.rpartition("Trial")
        trial = int(tail[:2]) if tail[:2].isdigit() else 0
        if trial in IPIN2023_CLASSES:
            labels[recording.name] = IPIN2023_CLASSES[trial]
    return labels


def true_movements(recording: Recording, behaviour: Behaviour) -> tuple[TrueMovement, ...]:
    """Pairs of successive points on different floors; floors are named by their number."""
    points = recording.waypoints
    return tuple(
        TrueMovement(behaviour, 1 if int(b.floor) > int(a.floor) else -1, a.t, b.t)
        for a, b in pairwise(points)
        if a.floor and b.floor and int(a.floor) != int(b.floor)
    )


def detect(recording: Recording, config: VerticalConfig) -> tuple[StepEvents, list[VerticalEvent]]:
    """Steps and vertical events of a recording by the default front end."""
    inertial, vertical = InertialFrontEnd(), VerticalFrontEnd(config)
    _, steps = inertial.run(inertial.init(), recording)
    state, events = vertical.run(vertical.init(), recording, steps)
    _, last = vertical.flush(state, recording.span[1])
    return steps, events + ([last] if last is not None else [])


def score_behaviours(
    recordings: Sequence[Recording], labels: Mapping[str, Behaviour], use_pressure: bool = True
) -> BehaviourScore:
    """Score the detectors on recordings.

    labels : class of the floor changes by the name of the recording; one that is not named has none, and
    everything found in it is a false alarm.
    """
    config = VerticalConfig(use_pressure=use_pressure)
    movements: list[ScoredMovement] = []
    false_alarms: list[FalseAlarm] = []
    seconds = 0.0
    for recording in recordings:
        seconds += recording.span[1] - recording.span[0]
        label = labels.get(recording.name)
        truths = () if label is None else true_movements(recording, label)
        scored, false = match(recording.name, truths, detect(recording, config)[1])
        movements += scored
        false_alarms += false
    return BehaviourScore(tuple(movements), tuple(false_alarms), seconds / 3600.0)


def match(
    name: str, truths: Sequence[TrueMovement], events: Sequence[VerticalEvent]
) -> tuple[list[ScoredMovement], list[FalseAlarm]]:
    """Give each detected movement to the bracket it shares most time with, or call it a false alarm."""
    found: list[list[tuple[VerticalEvent, VerticalEvent]]] = [[] for _ in truths]
    false_alarms = []
    first: VerticalEvent | None = None
    for event in events:
        first = first or event
        if not event.is_over:
            continue
        shared = [min(event.ended, tr.arrived + MARGIN) - max(event.began, tr.left - MARGIN) for tr in truths]
        best = int(np.argmax(shared)) if shared else -1
        if best >= 0 and shared[best] >= 0.0:
            found[best].append((first, event))
        else:
            false_alarms.append(FalseAlarm(name, first, event))
        first = None
    scored = [ScoredMovement(name, tr, tuple(f)) for tr, f in zip(truths, found, strict=True)]
    return scored, false_alarms


def score_standing(recordings: Sequence[Recording], period: float = 0.1) -> StandingScore:
    """Score `wayfuse.inertial.behaviour` on the time between points: at one place one stands, else one walks.

    Times are looked at every ``period`` s, less the two seconds that a verdict takes and one for the point.
    """
    stood: list[BoolArray] = []
    walked: list[BoolArray] = []
    inertial = InertialFrontEnd()
    for recording in recordings:
        _, steps = inertial.run(inertial.init(), recording)
        for a, b in pairwise(recording.waypoints):
            t = np.arange(a.t + 3.0, b.t - 1.0, period)
            is_still = (a.lat, a.lon, a.floor) == (b.lat, b.lon, b.floor)
            if is_still and b.t - a.t >= STANDS_BETWEEN:
                stood.append(~behaviour_at(t, steps.t))
            elif not is_still and a.floor == b.floor:
                walked.append(~behaviour_at(t, steps.t))
    still, walking = (
        np.concatenate(stood or [np.empty(0, np.bool_)]),
        np.concatenate(walked or [np.empty(0, np.bool_)]),
    )
    return StandingScore(
        len(still) * period,
        len(walking) * period,
        float(still.mean()) if len(still) else float("nan"),
        float(walking.mean()) if len(walking) else float("nan"),
    )
