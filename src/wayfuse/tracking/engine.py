"""What a positioning method has to offer to be tracked with: the seam between `Tracker` and the methods."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple, Protocol, TypeVar

from wayfuse.core.types import Array
from wayfuse.filters.cloud import Cloud
from wayfuse.inertial.front_end import StepEvent
from wayfuse.inertial.vertical import VerticalEvent
from wayfuse.radio.survey import Fingerprint
from wayfuse.sensors.records import Range
from wayfuse.tracking.estimate import Estimate, State

__all__ = ["Engine", "Known", "RangeObservation", "Why", "unknown"]

S = TypeVar("S")


class Why(NamedTuple):
    """What went into an estimate since the one before."""

    n_steps: int = 0
    n_aps: int = 0
    share_blocked: float = 0.0


class Known(NamedTuple):
    """What is known of the phone when a scan comes.

    heading : whether its direction is absolute. height : whether a barometer would tell a change of floor.
    """

    heading: bool = True
    height: bool = False


class RangeObservation(Protocol):
    """How likely ranges of one moment are at each particle."""

    def log_likelihood(self, cloud: Cloud, ranges: Sequence[Range], out: Array, /) -> bool:
        """Add to ``out`` (N,); False, and nothing added, where they say nothing."""
        ...


class Engine(Protocol[S]):
    """A positioning method as pure functions of its own state ``S``.

    ``uses_steps`` tells whether it moves on steps (else it diffuses with time); ``uses_scans`` whether it looks at
    scans, ``uses_ranges`` at ranges; ``supports_lag`` whether it can say later where it was; ``uses_vertical`` whether
    stairs and lifts move it.
    """

    @property
    def uses_steps(self) -> bool:
        """Whether steps move it."""
        ...

    @property
    def uses_scans(self) -> bool:
        """Whether scans change it."""
        ...

    @property
    def uses_ranges(self) -> bool:
        """Whether ranges change it."""
        ...

    @property
    def supports_lag(self) -> bool:
        """Whether `mark` and `recall` work."""
        ...

    def init(self, track: str, seed: int) -> S:
        """State before the first record."""
        ...

    def resume(self, state: S, track: str, seed: int, silence: float) -> S:
        """State after ``silence`` seconds in which the person can have gone anywhere; ``track`` is a name of its own.

        A start that was told once says nothing any more: what cannot be found again is `State.LOST`.
        """
        ...

    @property
    def uses_vertical(self) -> bool:
        """Whether movements between floors change it."""
        ...

    def on_step(self, state: S, event: StepEvent) -> S:
        """A step was made."""
        ...

    def on_vertical(self, state: S, event: VerticalEvent) -> S:
        """A movement between floors was reported; only asked where ``uses_vertical``."""
        ...

    def on_quiet(self, state: S, dt: float) -> S:
        """``dt`` seconds passed without motion sensors."""
        ...

    def on_fingerprint(self, state: S, t: float, fingerprint: Fingerprint, known: Known) -> S:
        """A scan was delivered."""
        ...

    def on_ranges(self, state: S, t: float, ranges: Sequence[Range], known: Known) -> S:
        """Ranges of one moment came in; only asked where ``uses_ranges``."""
        ...

    def estimate(self, state: S, t: float) -> tuple[S, Estimate]:
        """Where now? The counts of `Why` start anew."""
        ...

    def mark(self, state: S, t: float) -> S:
        """Remember this moment for `recall`."""
        ...

    def recall(self, state: S) -> tuple[S, Estimate]:
        """Where at the oldest remembered moment, by all that is known now; forgets it."""
        ...


def unknown(t: float, prior: Estimate) -> Estimate:
    """The estimate of somebody who knows nothing but the building."""
    return prior._replace(t=t, state=State.INITIALISING)
