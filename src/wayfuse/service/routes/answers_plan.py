"""Answers with plans, zones and particles, for the OpenAPI description; what is sent does not pass through these types.

Shapes are GeoJSON: longitude and latitude in degrees.
"""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BaseModel, Field

__all__ = ["Floors", "Particles", "PlanOfFloor", "ZoneShapes"]

Degrees = Annotated[
    list[float], Field(min_length=2, max_length=2, description="Longitude and latitude, degrees.")
]
Metres = Annotated[list[float], Field(min_length=2, max_length=2)]


class FloorFrame(BaseModel):
    """``origin`` (degrees) and ``matrix`` (degrees per metre) take x, y (m) of the floor to longitude and latitude.

    is_on_earth : the plan says where it is; else the floor is drawn about longitude and latitude 0.
    """

    floor: int
    level: str
    elevation_m: float
    width_m: float
    height_m: float
    is_on_earth: bool
    origin: Degrees
    matrix: Annotated[list[Metres], Field(min_length=2, max_length=2)]


class Floors(BaseModel):
    """Floors of a site, bottom up."""

    site: str
    floors: list[FloorFrame]


class Polygon(BaseModel):
    """Closed rings, the outer one first."""

    type: Literal["Polygon"]
    coordinates: list[list[Degrees]]


class Lines(BaseModel):
    """Segments."""

    type: Literal["MultiLineString"]
    coordinates: list[list[Degrees]]


class Spot(BaseModel):
    """A point."""

    type: Literal["Point"]
    coordinates: Degrees


class Part(BaseModel):
    """kind : what it is. id, name, category : of units, connectors and landings. levels : that a connector joins."""

    kind: Literal["outline", "unit", "wall", "door", "connector", "landing"]
    id: str = ""
    name: str = ""
    category: str = ""
    levels: list[str] = []


class PlanFeature(BaseModel):
    """A GeoJSON Feature."""

    type: Literal["Feature"]
    geometry: Polygon | Lines | Spot
    properties: Part


class PlanOfFloor(BaseModel):
    """A GeoJSON FeatureCollection."""

    type: Literal["FeatureCollection"]
    features: list[PlanFeature]


class ZoneSummary(BaseModel):
    """A room of the plan, or a geofence."""

    id: str
    name: str
    kind: Literal["room", "geofence"]
    floor: int
    level: str


class ZoneFeature(BaseModel):
    """A GeoJSON Feature."""

    type: Literal["Feature"]
    geometry: Polygon
    properties: ZoneSummary


class ZoneShapes(BaseModel):
    """A GeoJSON FeatureCollection."""

    type: Literal["FeatureCollection"]
    features: list[ZoneFeature]


class Particles(BaseModel):
    """Columns, a value per particle. x, y : m, frame of the floor. weight : sum 1. t : s of the phone's clock."""

    track: str
    site: str
    t: float | None
    x: list[float]
    y: list[float]
    floor: list[int]
    weight: list[float]
