"""The anchors of a served site: files beside its plan, in its folder.

``access_points.csv`` says where they hang (bssid,x,y,floor,height), measured; ``channel.npz``, of `wayfuse survey
channel`, makes ranges of the channel state they send. Both may be absent.
"""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

from wayfuse.core.errors import UsageError
from wayfuse.maps.site import Site
from wayfuse.radio.ap_places import ApPlaces, read_ap_places
from wayfuse.radio.channel_model import load_channel_model
from wayfuse.radio.channel_ranging import ChannelRanging

__all__ = ["CHANNEL", "PLACES", "SiteAnchors", "read_site_anchors"]

PLACES, CHANNEL = "access_points.csv", "channel.npz"


class SiteAnchors(NamedTuple):
    """Where the anchors are, and what makes ranges of their channel state (None: nothing does)."""

    places: ApPlaces
    channel: ChannelRanging | None = None


def read_site_anchors(folder: Path, site: Site) -> SiteAnchors | None:
    """The anchors of a site's folder; None where it has no file of them.

    Raises
    ------
    UsageError : places that were estimated, or on floors that the site does not have; a channel model without places.
    RadioMapError : a channel model of another site.
    """
    model = load_channel_model(folder / CHANNEL, site.name) if (folder / CHANNEL).exists() else None
    if not (folder / PLACES).exists():
        if model is not None:
            raise UsageError(
                "a channel model without the places of its anchors", where=folder, remedy=f"add {PLACES}"
            )
        return None
    places = read_ap_places(folder / PLACES, site.floor_names)
    if places.is_estimated:
        raise UsageError(
            "places of anchors have to be measured",
            where=folder / PLACES,
            remedy="measure them, or take it away",
        )
    return SiteAnchors(places, None if model is None else ChannelRanging(model=model))
