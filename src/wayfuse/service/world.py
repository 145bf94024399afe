"""A site as the server holds it: its plan, and a tracker per version of its radio map."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from wayfuse.core.errors import RadioMapError
from wayfuse.maps.site import Site
from wayfuse.presets.given import check_floors
from wayfuse.presets.methods import build_method
from wayfuse.radio.survey import Survey
from wayfuse.radio.walk_survey import load
from wayfuse.service.site_anchors import SiteAnchors
from wayfuse.service.warm import warm
from wayfuse.service.zones import Zone, Zones, rooms_of
from wayfuse.tracking.tracker import Tracker

__all__ = ["NO_MAP", "World", "survey_of"]

NO_MAP = 0  # in place of the version of a radio map: tracks that go by ranges alone; versions begin with 1
_BY_RANGES = "fused-ranges"  # the method that does without a radio map


def survey_of(site: Site, archive: bytes) -> Survey:
    """The survey of a radio map's archive (`wayfuse survey build`), checked against a site.

    Raises
    ------
    RadioMapError : it is none, or of another site.
    """
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "radio-map.npz"
        path.write_bytes(archive)
        made = load(path)
    check_floors(site, made.survey)
    if made.site != site.name:
        raise RadioMapError(
            f"radio map of site {made.site}, not of {site.name}", remedy="build the radio map with this site"
        )
    return made.survey


class World:
    """A site with its trackers.

    Parameters
    ----------
    site : its plan. archive : gives the bytes of a version of its radio map. method : of `presets.methods`.
    fences : besides the rooms of the plan. anchors : that measure ranges; with them it tracks without a radio map too.
    """

    def __init__(
        self,
        site: Site,
        archive: Callable[[int], bytes],
        *,
        method: str = "fused",
        n_particles: int = 1000,
        fences: Sequence[Zone] = (),
        anchors: SiteAnchors | None = None,
    ) -> None:
        self.site, self.anchors = site, anchors
        self.zones = Zones([*rooms_of(site), *fences])
        self._archive, self._method, self._n_particles = archive, method, n_particles
        self._trackers: dict[int, Tracker[Any]] = {}

    def tracker(self, version: int) -> Tracker[Any]:
        """The tracker with a version of the radio map, or with `NO_MAP`; built when first asked for."""
        if version not in self._trackers:
            survey = None if version == NO_MAP else survey_of(self.site, self._archive(version))
            places, channel = self.anchors or (None, None)
            method = self._method if survey is not None else _BY_RANGES
            made = build_method(method, self.site, survey, places=places, n_particles=self._n_particles)
            tracker = replace(made, channel=channel)
            warm(tracker, survey, places)
            self._trackers[version] = tracker
        return self._trackers[version]
