"""Step-count error of the front end on the validation walks of oxford-steps, per carrying position.

The validation walks are for reporting: thresholds were set on the optimisation walks of the same data set.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from wayfuse.formats.oxford_steps import validation_walks
from wayfuse.inertial.config import InertialConfig
from wayfuse.inertial.steps import detect_steps

__all__ = ["StepCount", "StepCountTable", "score"]


class StepCount(NamedTuple):
    """One walk: reference steps, steps found here, by the data set's algorithm and by the phone (0: none)."""

    name: str
    user: str
    position: str
    steps: int
    found: int
    algorithm: int
    phone: int

    @property
    def error(self) -> float:
        """Relative error, signed: positive where too many steps are found."""
        return (self.found - self.steps) / self.steps


@dataclass(frozen=True, slots=True)
class StepCountTable:
    """Counts of all walks."""

    counts: tuple[StepCount, ...]

    @property
    def positions(self) -> tuple[str, ...]:
        """Carrying positions, sorted."""
        return tuple(sorted({c.position for c in self.counts}))

    def mean_error(self, position: str | None = None) -> float:
        """Mean absolute relative error of a carrying position, or of all walks."""
        return float(np.mean([abs(c.error) for c in self.counts if position in (None, c.position)]))

    def describe(self) -> list[str]:
        """Lines of a table: walks, then means per position and over all."""
        ordered = sorted(self.counts, key=lambda c: (c.position, c.user))
        return [
            f"{'walk':12s}{'position':12s}{'steps':>6s}{'found':>6s}{'error':>8s}",
            *(f"{c.user:12s}{c.position:12s}{c.steps:6d}{c.found:6d}{100 * c.error:+7.1f}%" for c in ordered),
            *(f"{'mean':12s}{p:12s}{'':12s}{100 * self.mean_error(p):7.1f}%" for p in self.positions),
            f"{'mean':12s}{'all':12s}{'':12s}{100 * self.mean_error():7.1f}%",
        ]


def score(root: str | Path, config: InertialConfig | None = None) -> StepCountTable:
    """Count the steps of the validation walks below a folder.

    Raises
    ------
    DataMissingError : there are none.
    """
    return StepCountTable(
        tuple(
            StepCount(
                walk.recording.name,
                walk.user,
                walk.position,
                walk.steps,
                len(detect_steps(walk.recording.acceleration, config)),
                walk.algorithm_steps,
                walk.phone_steps,
            )
            for walk in validation_walks(root)
        )
    )
