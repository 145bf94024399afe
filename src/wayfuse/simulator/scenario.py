"""A scenario: every number of a simulated site, its walkers and their phones, on one screen with its source.

The numbers live where they are used (`WalkerModel`, `ImuModel`, `RadioModel`, `ScannerModel`), each with its
unit and where it comes from; a scenario gathers them. A TOML file may change any of them::

    test_walks = 4
    [radio]
    shadow_sigma = 6.0
    [scanner]
    period_s = 30.0    # Android throttles background scans to four in two minutes
"""

from __future__ import annotations

import tomllib
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from wayfuse.core.errors import ConfigError
from wayfuse.simulator.barometer import BarometerModel
from wayfuse.simulator.imu import ImuModel
from wayfuse.simulator.radio_field import RadioModel
from wayfuse.simulator.rides import LiftModel
from wayfuse.simulator.scanner import ScannerModel
from wayfuse.simulator.walker import Person, WalkerModel

__all__ = ["Scenario", "load_scenario"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Scenario:
    """What is simulated."""

    survey_walks: int = 40  # over all floors
    test_walks: int = 12
    duration_s: tuple[float, float] = (
        40.0,
        60.0,
    )  # walks of the public recordings: median 30 s, longest 119 s
    wander_m: float = 0.6  # how far beside a corridor's way-point people pass
    pause_share: float = 0.12  # of inner way-points at which they stand
    pause_s: tuple[float, float] = (2.0, 5.0)
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
        if self.scanner.period_s <= 0.0 or self.imu.rate_hz <= 0.0:
            raise ConfigError("scanner.period_s and imu.rate_hz must be positive")
        if self.barometer.rate_hz < 0.0:
            raise ConfigError("barometer.rate_hz must not be negative", remedy="0 is a phone without one")
        moved = self.lift.speed, self.lift.acceleration[0], self.lift.jerk, self.lift.escalator_speed
        if min(moved) <= 0.0:
            raise ConfigError("speeds, acceleration and jerk of the lift must be positive")

    def way_length(self, person: Person, rng: np.random.Generator) -> float:
        """Length (m) of a walk of the duration drawn; stops and first steps take some of the time."""
        return float(rng.uniform(*self.duration_s)) * person.step_rate * person.step_length * 0.85

    def tracked(self) -> Scenario:
        """The scenario of the walks to track: their phone hears ``tracked_offset_db`` more than the survey's."""
        low, high = np.add(self.scanner.device_offset_db, self.tracked_offset_db).tolist()
        return replace(self, scanner=replace(self.scanner, device_offset_db=(low, high)))


T = TypeVar("T")


def load_scenario(path: Path) -> Scenario:
    """Read a scenario from TOML; what the file does not name keeps its default.

    Raises
    ------
    ConfigError : the file is no TOML, or names what no scenario has, or a value of the wrong kind.
    """
    try:
        table = tomllib.loads(path.read_text(encoding="utf-8"))
    except tomllib.TOMLDecodeError as error:
        raise ConfigError(f"not TOML: {error}", where=path) from error
    return _changed(Scenario(), table, str(path))


def _changed(base: T, table: dict[str, Any], where: str) -> T:
    known = {f.name: getattr(base, f.name) for f in fields(base)}  # type: ignore[arg-type]
    changes: dict[str, Any] = {}
    for key, value in table.items():
        if key not in known:
            raise ConfigError(f"unknown key {key!r}", where=where, remedy="one of " + ", ".join(known))
        changes[key] = _value(known[key], value, f"{where}: {key}")
    return replace(base, **changes)  # type: ignore[type-var]


def _value(default: Any, value: Any, where: str) -> Any:
    """The value in the kind of its default."""
    if isinstance(value, dict):
        if not hasattr(default, "__dataclass_fields__"):
            raise ConfigError("a table where a number belongs", where=where)
        return _changed(default, value, where)
    if isinstance(default, tuple):
        if isinstance(value, list) and len(value) == len(default) and all(_is_number(v) for v in value):
            return tuple(float(v) for v in value)
        raise ConfigError(f"{value!r}", where=where, remedy=f"a list of {len(default)} numbers")
    if (
        isinstance(default, int | float)
        and _is_number(value)
        and (isinstance(default, float) or value == int(value))
    ):
        return type(default)(value)
    raise ConfigError(f"{value!r}", where=where, remedy=f"a number such as {default!r}")


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)
