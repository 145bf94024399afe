"""Answers with positions and tracks, for the OpenAPI description; what is sent does not pass through these types."""

from __future__ import annotations

from typing import Any, Literal

from pydantic import BaseModel, ConfigDict

from wayfuse.service.routes.examples import POSITION

__all__ = ["Inside", "Position", "Positions", "Sites", "TrackSummary", "Tracks", "answer"]


class Why(BaseModel):
    """steps, access_points : since the estimate before. Shares are of the particles; null where there are none."""

    steps: int
    access_points: int
    share_blocked: float | None
    effective_particles: float | None


class Place(BaseModel):
    """x, y : m, frame of the floor. Radii (m) hold the truth in 68 and 95 % of cases. t : s of the phone's clock.

    at : the same, Unix s. heard : Unix s; this, device, is_ended and zones are not told of estimates of the past.
    """

    model_config = ConfigDict(extra="allow")

    track: str
    n: int
    site: str
    level: str
    floor: int
    x: float | None
    y: float | None
    covariance_m2: list[list[float | None]]
    radius_m_68: float | None
    radius_m_95: float | None
    state: Literal["initialising", "tracking", "lost"]
    t: float
    at: float | None
    why: Why
    device: str = ""
    heard: float = 0.0
    is_ended: bool = False
    zones: list[str] = []


class Point(BaseModel):
    """Longitude and latitude, degrees."""

    type: Literal["Point"]
    coordinates: list[float | None]


class Position(BaseModel):
    """A GeoJSON Feature; the geometry is null where the plan has no place on earth."""

    model_config = ConfigDict(json_schema_extra={"examples": [POSITION]})

    type: Literal["Feature"]
    geometry: Point | None
    properties: Place


class Positions(BaseModel):
    """A GeoJSON FeatureCollection. seq : up to where the log is in it, to go on from with a stream of events."""

    type: Literal["FeatureCollection"]
    features: list[Position]
    seq: int = 0


class TrackSummary(BaseModel):
    """A track. started, heard : Unix s. counts : of its input, by what it was; of live tracks alone."""

    track: str
    site: str
    device: str
    map_version: int
    started: float
    heard: float
    anchor_version: int
    is_live: bool
    is_ended: bool = False
    estimates: int = 0
    counts: dict[str, int] = {}
    clock_ahead_s: float | None = None


class Tracks(BaseModel):
    """Tracks, the last heard first."""

    tracks: list[TrackSummary]


class SiteSummary(BaseModel):
    """A site. radio_map : version in use, null for none. tracks : how many are in memory. anchors : how many have a
    place. channel_anchors : how many have a channel model.
    """

    name: str
    levels: list[str]
    radio_map: int | None
    tracks: int
    anchors: int
    channel_anchors: int


class Sites(BaseModel):
    """The sites that a token may see."""

    sites: list[SiteSummary]


class Inside(BaseModel):
    """Tracks by identifier of the zone they are in."""

    model_config = ConfigDict(
        json_schema_extra={"examples": [{"site": "museum", "inside": {"F1/12": ["9f86d081884c7d65"]}}]}
    )

    site: str
    inside: dict[str, list[str]]


def answer(model: type[BaseModel], status: int = 200) -> dict[int | str, dict[str, Any]]:
    """The answer of a route that is right; to be used with ``response_model=None``."""
    return {status: {"model": model}}
