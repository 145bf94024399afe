"""Answers to those who survey, for the OpenAPI description; what is sent does not pass through these types."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BaseModel, Field

__all__ = [
    "AccessPoints",
    "Coverage",
    "Heat",
    "JobSummary",
    "KeptRecording",
    "KeptWalk",
    "SurveySummary",
]

Pair = Annotated[list[float], Field(min_length=2, max_length=2, description="x, y (m), frame of the floor.")]


class Phone(BaseModel):
    """A phone that pushes scans. device : its pseudonym. heard : Unix s."""

    device: str
    heard: float
    scans: int


class KeptTap(BaseModel):
    """Where the phone was. t : Unix s. x, y : m, frame of the floor."""

    t: float
    floor: int
    x: float
    y: float


class Walk(BaseModel):
    """A walk pressed on the map."""

    id: str
    device: str
    taps: list[KeptTap]


class RecordingFile(BaseModel):
    """A recording that was uploaded."""

    id: str
    name: str
    bytes: int


class Room(BaseModel):
    """Held-out errors in a room (empty name: outside all). median, p90 : m, null where that fix is on a wrong floor.

    n : fingerprints looked up. right_floor : share of them.
    """

    level: str
    name: str
    n: int
    median: float | None
    p90: float | None
    right_floor: float


class BuiltMap(BaseModel):
    """A radio map that a job built. version : what it became; it is not yet in use."""

    version: int
    fingerprints: int
    access_points: int
    walks: int
    notes: list[str]
    rooms: list[Room]


class JobSummary(BaseModel):
    """share : 0 to 1. doing : what, or what went wrong. started : Unix s. result : null until it is done."""

    id: int
    site: str
    state: Literal["running", "done", "failed"]
    share: float
    doing: str
    started: float
    result: BuiltMap | None


class SurveySummary(BaseModel):
    """What the survey of a site has. now : Unix s of the server. job : the last one, null before the first."""

    site: str
    now: float
    phones: list[Phone]
    walks: list[Walk]
    recordings: list[RecordingFile]
    job: JobSummary | None


class KeptWalk(BaseModel):
    """id : of the walk, to delete it by."""

    site: str
    id: str


class KeptRecording(KeptWalk):
    """What was found in the recording."""

    waypoints: int
    scans: int


class Raster(BaseModel):
    """values : rows from y = origin upwards; null where there is nothing to say."""

    origin: Pair
    cell_m: float
    values: list[list[float | None]]


class NextPlace(BaseModel):
    """A place where a fingerprint would help. distance_m : to the nearest one, null where there is none."""

    x: float
    y: float
    distance_m: float | None


class Coverage(Raster):
    """values : m to the nearest fingerprint. version : of the radio map, null for none. places : of fingerprints."""

    site: str
    floor: int
    version: int | None
    fingerprints: int
    places: list[Pair]
    next: list[NextPlace]


class AccessPoint(BaseModel):
    """fingerprints, loudest_dbm : by floor; null where none heard it. mhz : 0 unknown."""

    bssid: str
    mhz: int
    fingerprints: list[int]
    loudest_dbm: list[float | None]


class AccessPoints(BaseModel):
    """The most heard first. n : how many the radio map has."""

    site: str
    version: int
    levels: list[str]
    n: int
    access_points: list[AccessPoint]


class Heat(Raster):
    """values : level (dBm) of an access point. fingerprints : that heard it on this floor."""

    site: str
    floor: int
    version: int
    bssid: str
    fingerprints: int
