"""A site as the server holds it: its plan, and a tracker per version of its radio map and of its anchors."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

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

__all__ = ["NO_MAP", "Basis", "World", "survey_of"]

NO_MAP = 0  # in place of the version of a radio map: tracks that go by ranges alone; versions begin with 1
_BY_RANGES = "fused-ranges"  # the method that does without a radio map


class Basis(NamedTuple):
    """What a track goes by, from its first batch to its last: versions of the radio map and of the anchors."""

    map_version: int
    anchor_version: int = 0


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
    fences : besides the rooms of the plan. anchors : gives a version of those that measure ranges, None for none; with
    them it tracks without a radio map too.
    """

    def __init__(
        self,
        site: Site,
        archive: Callable[[int], bytes],
        *,
        method: str = "fused",
        n_particles: int = 1000,
        fences: Sequence[Zone] = (),
        anchors: Callable[[int], SiteAnchors | None] = lambda _: None,
    ) -> None:
        self.site, self.anchors = site, cache(anchors)
        self.zones = Zones([*rooms_of(site), *fences])
        self._archive, self._method, self._n_particles = archive, method, n_particles
        self._trackers: dict[Basis, Tracker[Any]] = {}

    def tracker(self, map_version: int, anchor_version: int = 0) -> Tracker[Any]:
        """The tracker with versions of the radio map (or `NO_MAP`) and of the anchors; built when first asked for."""
        basis = Basis(map_version, anchor_version)
        if basis not in self._trackers:
            self.hold(basis, self.build(map_version, self.anchors(anchor_version)))
        return self._trackers[basis]

    def build(self, map_version: int, anchors: SiteAnchors | None) -> Tracker[Any]:
        """A tracker with a version of the radio map and these anchors, ready to go.

        Raises
        ------
        WayfuseError : they are not of this site.
        """
        survey = None if map_version == NO_MAP else survey_of(self.site, self._archive(map_version))
        places, channel = anchors or (None, None)
        method = self._method if survey is not None else _BY_RANGES
        made = build_method(method, self.site, survey, places=places, n_particles=self._n_particles)
        tracker = replace(made, channel=channel)
        warm(tracker, survey, places)
        return tracker

    def hold(self, basis: Basis, tracker: Tracker[Any]) -> None:
        """Keep a tracker that was built, so that no phone waits for it."""
        self._trackers[basis] = tracker
