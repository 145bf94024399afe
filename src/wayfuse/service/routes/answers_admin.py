"""Answers to those who administrate, for the OpenAPI description; what is sent does not pass through these types."""

from __future__ import annotations

from pydantic import BaseModel

__all__ = ["Anchors", "PlacedAnchors"]


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
