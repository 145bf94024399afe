"""Answers to those who administrate, for the OpenAPI description; what is sent does not pass through these types."""

from __future__ import annotations

from typing import Literal

from pydantic import BaseModel, ConfigDict

__all__ = [
    "Anchors",
    "Audit",
    "DeviceSummary",
    "Devices",
    "Forgotten",
    "Health",
    "ImportedSite",
    "InUse",
    "MadeToken",
    "PlacedAnchors",
    "RadioMaps",
    "Removed",
    "Revoked",
    "TokenSummary",
    "Tokens",
    "Uploaded",
]


class Health(BaseModel):
    """applied : last entry of the log that is in the tracks. waiting : batches that wait to be written."""

    status: Literal["ok", "broken"]
    applied: int = 0
    waiting: int = 0


class TokenSummary(BaseModel):
    """A token without its text. site : empty for all. created, expires, revoked : Unix s; null: never."""

    model_config = ConfigDict(
        json_schema_extra={
            "examples": [
                {
                    "id": "3f9a1c22d07e",
                    "scopes": ["ingest"],
                    "site": "",
                    "label": "phones of the museum",
                    "created": 1763801000.0,
                    "expires": None,
                    "revoked": None,
                }
            ]
        }
    )

    id: str
    scopes: list[Literal["ingest", "read", "survey", "admin"]]
    site: str
    label: str
    created: float
    expires: float | None
    revoked: float | None


class MadeToken(TokenSummary):
    """The same, with the text, which cannot be asked for again."""

    model_config = ConfigDict(json_schema_extra={})

    token: str


class Tokens(BaseModel):
    """Tokens, the oldest first."""

    tokens: list[TokenSummary]


class Revoked(BaseModel):
    """revoked : identifier of the token that has ended."""

    revoked: str


class DeviceSummary(BaseModel):
    """An enrolled phone. device : its pseudonym. platform : empty where not stated. enrolled : Unix s."""

    device: str
    platform: Literal["", "android", "ios"]
    standardised: bool
    label: str
    enrolled: float


class Devices(BaseModel):
    """Enrolled phones, in the order of their enrolment."""

    devices: list[DeviceSummary]


class Forgotten(BaseModel):
    """What was deleted: tracks, and files of surveys."""

    tracks: int
    survey_files: int


class RadioMapSummary(BaseModel):
    """A version of a radio map. created : Unix s. sha256 : of its file."""

    site: str
    version: int
    sha256: str
    created: float
    note: str


class RadioMaps(BaseModel):
    """Versions, the oldest first. published : the one in use, null for none."""

    site: str
    published: int | None
    versions: list[RadioMapSummary]


class Uploaded(BaseModel):
    """version : what the radio map became; it is not yet in use."""

    site: str
    version: int


class InUse(BaseModel):
    """published : the version that is in use now."""

    site: str
    published: int


class Deed(BaseModel):
    """at : Unix s. actor : identifier of a token."""

    at: float
    actor: str
    action: str
    subject: str
    detail: str


class Audit(BaseModel):
    """Who did what, the newest first."""

    audit: list[Deed]


class ImportedFloor(BaseModel):
    """A floor. What was drawn on it and what its import met is not said of a folder that wayfuse wrote."""

    floor: str
    level: int
    width_m: float = 0.0
    height_m: float = 0.0
    elevation_m: float = 0.0
    units: int = 0
    walls: int = 0
    doors: int = 0
    connectors: int = 0
    walkable_share: float = 0.0
    anchor_residual_m: float | None = None
    warnings: list[str] = []


class ImportedSite(BaseModel):
    """A site that is served now. warnings : of the import. errors : how many the plan has. problems : the first of
    them.
    """

    site: str
    floors: list[ImportedFloor]
    warnings: list[str]
    errors: int
    problems: list[str]


class Removed(BaseModel):
    """removed : name of the site, or identifier of the part of a survey."""

    removed: str


class Anchors(BaseModel):
    """Anchors of a site. anchors : how many have a place. channel_anchors : how many have a channel model.

    is_of_folder : they are changed in the folder of the site. unplaced : those of the channel model without a place;
    no ranges come of them.
    """

    site: str
    is_of_folder: bool
    anchors: int
    channel_anchors: int
    unplaced: list[str]


class PlacedAnchor(BaseModel):
    """x, y : m, frame of the floor. height_m : above the floor, null where nobody measured it."""

    bssid: str
    x: float
    y: float
    floor: int
    level: str
    height_m: float | None


class PlacedAnchors(Anchors):
    """The same, and where each hangs."""

    places: list[PlacedAnchor]
