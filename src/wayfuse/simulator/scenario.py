"""A scenario: every number of a simulated site, its walkers and their phones, on one screen with its source.

The numbers live where they are used (`WalkerModel`, `ImuModel`, `RadioModel`, `ScannerModel`), each with its
unit and where it comes from; a scenario gathers them. `wayfuse.simulator.scenario_file` reads them from TOML.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from wayfuse.core.errors import ConfigError
from wayfuse.simulator.barometer import BarometerModel
from wayfuse.simulator.imu import ImuModel
from wayfuse.simulator.radio_field import RadioModel
from wayfuse.simulator.rides import LiftModel
from wayfuse.simulator.routes import Manner
from wayfuse.simulator.scanner import ScannerModel
from wayfuse.simulator.walker import Person, WalkerModel

__all__ = ["Scenario"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Scenario:
    """What is simulated."""

    survey_walks: int = 40  # over all floors
    test_walks: int = 12
    duration_s: tuple[float, float] = (
        40.0,
        60.0,
    )  # walks of the public recordings: median 30 s, longest 119 s
    manner: Manner = field(default_factory=lambda: Manner(pause_share=0.12))
    stated_sigma: float = 0.1  # m, how well a surveyor states where he is
    changes: int = 2  # of floors on a walk to track, where there are stairs or lifts
    visit_m: tuple[float, float] = (14.0, 34.0)  # shortest and longest way on each of its floors
    tracked_offset_db: tuple[float, float] = (
        0.0,
        0.0,
    )  # of the phone tracked against the survey's; 2.4, 5 GHz
    walker: WalkerModel = field(default_factory=WalkerModel)
    imu: ImuModel = field(default_factory=ImuModel)
    radio: RadioModel = field(default_factory=RadioModel)
    scanner: ScannerModel = field(default_factory=ScannerModel)
    barometer: BarometerModel = field(default_factory=BarometerModel)
    lift: LiftModel = field(default_factory=LiftModel)

    def __post_init__(self) -> None:
        if not 0.0 < self.duration_s[0] <= self.duration_s[1]:
            raise ConfigError(
                f"duration_s: {self.duration_s}", remedy="shortest and longest walk in s, positive"
            )
        if self.survey_walks < 0 or self.test_walks < 0 or self.changes < 0:
            raise ConfigError("survey_walks, test_walks and changes must not be negative")
        if not 0.0 <= self.visit_m[0] <= self.visit_m[1]:
            raise ConfigError(f"visit_m: {self.visit_m}", remedy="shortest and longest way on a floor in m")

    def way_length(self, person: Person, rng: np.random.Generator) -> float:
        """Length (m) of a walk of the duration drawn; stops and first steps take some of the time."""
        return float(rng.uniform(*self.duration_s)) * person.step_rate * person.step_length * 0.85

    def tracked(self) -> Scenario:
        """The scenario of the walks to track: their phone hears ``tracked_offset_db`` more than the survey's."""
        low, high = np.add(self.scanner.device_offset_db, self.tracked_offset_db).tolist()
        return replace(self, scanner=replace(self.scanner, device_offset_db=(low, high)))
