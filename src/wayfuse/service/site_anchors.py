"""The anchors of a served site: two files, beside its plan in its folder, or uploaded.

``access_points.csv`` says where they hang (bssid,x,y,floor,height), measured; ``channel.npz``, of `wayfuse survey
channel`, makes ranges of the channel state they send. Both may be absent.
"""

from __future__ import annotations

import re
import tempfile
from pathlib import Path
from typing import NamedTuple

import numpy as np

from wayfuse.core.errors import RadioMapError, UsageError, WayfuseError
from wayfuse.maps.site import Site
from wayfuse.radio.ap_places import ApPlaces, read_ap_places
from wayfuse.radio.channel_model import ChannelModel, load_channel_model
from wayfuse.radio.channel_ranging import ChannelRanging
from wayfuse.radio.csi import subcarriers_of
from wayfuse.storage.anchors import AnchorFiles

__all__ = ["CHANNEL", "PLACES", "SiteAnchors", "read_site_anchors", "uploaded_anchors"]

PLACES, CHANNEL = "access_points.csv", "channel.npz"
_MOST_TOLD = 300  # characters of a fault: it may quote what is in the file


class SiteAnchors(NamedTuple):
    """Where the anchors are, and what makes ranges of their channel state (None: nothing does)."""

    places: ApPlaces
    channel: ChannelRanging | None = None

    @property
    def modelled(self) -> tuple[int, ...]:
        """Identifiers of the anchors that have a channel model."""
        return () if self.channel is None else tuple(self.channel.model.anchors)


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


def uploaded_anchors(files: AnchorFiles, site: Site) -> SiteAnchors | None:
    """The anchors of files that came from outside, with all that is read of them checked; None where there is no file.

    Raises
    ------
    UsageError : what is wrong, and in which line.
    """
    with tempfile.TemporaryDirectory() as folder:
        at = Path(folder)
        for name, content in ((PLACES, files.places), (CHANNEL, files.channel)):
            if content:
                (at / name).write_bytes(content)
        try:
            found = read_site_anchors(at, site)
        except WayfuseError as error:  # where it lay here is nobody's business
            line = re.search(r":(\d+)$", error.where)
            said = f"line {line[1]}: {error.what}" if line else error.what
            raise UsageError(said[:_MOST_TOLD], remedy=error.remedy[:_MOST_TOLD]) from error
        except (OverflowError, ValueError) as error:
            raise UsageError(f"cannot be read: {error}"[:_MOST_TOLD], remedy="make it again") from error
    if found is not None and not len(found.places):
        raise UsageError("there is no anchor in it", remedy="give a line for each: bssid,x,y,floor,height")
    if found is not None and found.channel is not None:
        _check_model(found.channel.model)
    return found


def _check_model(model: ChannelModel) -> None:
    """Refuse what no survey makes: frames would be read by it."""
    is_known = np.array_equal(model.subcarriers, subcarriers_of(len(model.subcarriers)))
    if not is_known or not model.anchors or not all(model.anchors.values()):
        raise RadioMapError(
            "a channel model that no survey makes", remedy="make it again: `wayfuse survey channel`"
        )
