"""Scenario files: what is simulated, in TOML, every key with a default (`docs/simulator.md` has the table).

::

    title = "two phones in the house"
    [site]
    building = "house"
    [phone]
    models = [{ name = "a" }, { name = "b", rss_offset_db = [-6.0, -3.0] }]
    [scan]
    throttle_scans = 4

Unknown keys and values that cannot be are errors that name the file, the key and the remedy.
"""

from __future__ import annotations

import tomllib
from dataclasses import dataclass, field
from importlib import resources
from pathlib import Path
from typing import NamedTuple

from wayfuse.core.errors import ConfigError, DataMissingError
from wayfuse.simulator.barometer import BarometerModel
from wayfuse.simulator.channel_state import ChannelModel
from wayfuse.simulator.imu import ImuModel
from wayfuse.simulator.radio_field import RadioModel
from wayfuse.simulator.rides import LiftModel
from wayfuse.simulator.round_trip import RangesModel
from wayfuse.simulator.scanner import ScannerModel
from wayfuse.simulator.toml_tables import no_negative, read_table, require
from wayfuse.simulator.walker import WalkerModel

__all__ = [
    "FORMATS",
    "ChangesPart",
    "OutputPart",
    "PhoneModel",
    "PhonePart",
    "Place",
    "ScenarioFile",
    "SitePart",
    "SurveyPart",
    "WalkersPart",
    "find_scenario",
    "load_scenario_file",
    "shipped_scenarios",
]

FORMATS = ("wayfuse", "getsensordata", "ms-indoor")
_SUFFIX = ".toml"


class Place(NamedTuple):
    """A place on a way: metres of the site and the floor's name."""

    x: float
    y: float
    floor: str


@dataclass(frozen=True, slots=True, kw_only=True)
class SitePart:
    """Where: a site folder, or one of the buildings built in."""

    building: str = field(default="house", metadata={"one_of": ("house", "mall", "hall")})  # built in
    folder: str = ""  # of a site, relative to the scenario's file; then ``building`` does not count
    escalator: bool = False  # in the house
    size: tuple[float, float] = (40.0, 25.0)  # m, of the hall
    racks: int = 0  # rows of them in the hall

    def __post_init__(self) -> None:
        no_negative(self)


@dataclass(frozen=True, slots=True, kw_only=True)
class WalkersPart:
    """The walks to track."""

    number: int = 6  # of walks
    waypoints: tuple[Place, ...] = field(
        default=(), metadata={"of": Place}
    )  # one way for all; else at random
    changes: int = 2  # of floors, on a way at random, where the building has ways between them
    connectors: str = field(default="both", metadata={"one_of": ("both", "stairs", "lift")})  # to take
    visit_m: tuple[float, float] = (14.0, 34.0)  # shortest and longest way on each floor of such a walk
    duration_s: tuple[float, float] = (60.0, 90.0)  # of a walk on one floor
    wander_m: float = 0.6  # how far beside a way's nodes people pass
    pause_share: float = 0.12  # of inner way points at which they stand
    pause_s: tuple[float, float] = (2.0, 5.0)  # how long
    phones: tuple[str, ...] = field(default=(), metadata={"of": str})  # carried in turn; none: all models
    gait: WalkerModel = field(default_factory=WalkerModel)
    lift: LiftModel = field(default_factory=LiftModel)

    def __post_init__(self) -> None:
        no_negative(self)
        _span("duration_s", self.duration_s)
        _span("visit_m", self.visit_m)
        _span("pause_s", self.pause_s)
        require("pause_share", self.pause_share <= 1.0, self.pause_share, "from 0 to 1")
        require(
            "waypoints", len(self.waypoints) != 1, list(self.waypoints), "give at least two places, or none"
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class PhoneModel:
    """What tells one phone from another."""

    name: str = "phone"
    rss_offset_db: tuple[float, float] = (0.0, 0.0)  # at 2.4 and 5 GHz, on what it hears
    pressure_hpa: float = 0.0  # of its barometer


@dataclass(frozen=True, slots=True, kw_only=True)
class PhonePart:
    """The phones and their sensors."""

    models: tuple[PhoneModel, ...] = field(default=(PhoneModel(),), metadata={"of": PhoneModel})  # see above
    imu: ImuModel = field(default_factory=ImuModel)
    barometer: BarometerModel = field(default_factory=BarometerModel)

    def __post_init__(self) -> None:
        names = [model.name for model in self.models]
        require("models", 0 < len(set(names)) == len(names), names, "name at least one, each name once")


@dataclass(frozen=True, slots=True, kw_only=True)
class ChangesPart:
    """What happens to the access points between survey and walks."""

    moved: int = 0  # access points that hang elsewhere on their floor
    removed: int = 0  # and that are gone

    def __post_init__(self) -> None:
        no_negative(self)


@dataclass(frozen=True, slots=True, kw_only=True)
class SurveyPart:
    """The walks for the radio map, whose recordings hold waypoints."""

    walks: int = 24  # on the floors in turn, the least walked corridors first
    connectors: bool = True  # and one walk through each stairway and lift
    duration_s: tuple[float, float] = (40.0, 60.0)  # of a walk on a floor
    throttled: bool = False  # whether scan.throttle_scans holds for surveyors too; they can switch it off
    stated_sigma: float = 0.1  # m, how well a surveyor states where he is
    phone: str = ""  # name of a model; empty: the first

    def __post_init__(self) -> None:
        no_negative(self)
        _span("duration_s", self.duration_s)


@dataclass(frozen=True, slots=True, kw_only=True)
class OutputPart:
    """What is written."""

    formats: tuple[str, ...] = field(
        default=("wayfuse",), metadata={"of": str}
    )  # the first into survey, walks
    truth_hz: float = 10.0  # rows of truth.csv a second

    def __post_init__(self) -> None:
        known = 0 < len(set(self.formats)) == len(self.formats) and set(self.formats) <= set(FORMATS)
        require("formats", known, list(self.formats), f"some of {', '.join(FORMATS)}, each once")
        require("truth_hz", 0.0 < self.truth_hz <= 100.0, self.truth_hz, "above 0, at most 100")


@dataclass(frozen=True, slots=True, kw_only=True)
class ScenarioFile:
    """A scenario: all of a file."""

    title: str = ""  # for readers
    seed: int = 0  # of all random numbers; --seed goes before it
    version: str = ""  # of wayfuse, in the copy it writes; without influence
    site: SitePart = field(default_factory=SitePart)
    walkers: WalkersPart = field(default_factory=WalkersPart)
    phone: PhonePart = field(default_factory=PhonePart)
    radio: RadioModel = field(default_factory=RadioModel)
    scan: ScannerModel = field(default_factory=ScannerModel)
    changes: ChangesPart = field(default_factory=ChangesPart)
    ranges: RangesModel = field(default_factory=RangesModel)
    csi: ChannelModel = field(default_factory=ChannelModel)
    survey: SurveyPart = field(default_factory=SurveyPart)
    output: OutputPart = field(default_factory=OutputPart)

    def __post_init__(self) -> None:
        names = [model.name for model in self.phone.models]
        for key, wanted in (("walkers.phones", self.walkers.phones), ("survey.phone", (self.survey.phone,))):
            unknown = [name for name in wanted if name and name not in names]
            require(key, not unknown, unknown, "names in phone.models: " + ", ".join(names))
        require("seed", self.seed >= 0, self.seed, "a whole number from 0 on")
        if self.radio.model == "images":
            is_empty = self.site.building == "hall" and not self.site.racks and not self.site.folder
            require("radio.model", is_empty, "images", 'site.building = "hall" with racks = 0: an empty room')


def load_scenario_file(path: Path) -> ScenarioFile:
    """Read a scenario; what the file does not name keeps its default.

    Raises
    ------
    ConfigError : the file is no TOML, names what no scenario has, or a value that cannot be.
    """
    try:
        table = tomllib.loads(path.read_text(encoding="utf-8"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise ConfigError(f"not TOML: {error}", where=path, remedy="see docs/simulator.md") from error
    return read_table(ScenarioFile(), table, str(path))


def shipped_scenarios() -> tuple[str, ...]:
    """Names of the scenarios that come with the package."""
    folder = resources.files("wayfuse.simulator") / "scenarios"
    return tuple(sorted(p.name.removesuffix(_SUFFIX) for p in folder.iterdir() if p.name.endswith(_SUFFIX)))


def find_scenario(name: str) -> Path:
    """The file of a scenario: a path, or the name of one of `shipped_scenarios`.

    Raises
    ------
    DataMissingError : there is neither.
    """
    if Path(name).is_file():
        return Path(name)
    if name in shipped_scenarios():
        return Path(str(resources.files("wayfuse.simulator") / "scenarios" / f"{name}{_SUFFIX}"))
    known = ", ".join(shipped_scenarios())
    raise DataMissingError("no such scenario", where=name, remedy=f"a TOML file, or one of {known}")


def _span(key: str, pair: tuple[float, float]) -> None:
    require(key, pair[0] <= pair[1], list(pair), "the smaller number first")
