"""Which anchors each site has: those of its folder, which stay, or the version that was uploaded last."""

from __future__ import annotations

from collections.abc import Mapping

from wayfuse.maps.site import Site
from wayfuse.service.site_anchors import SiteAnchors, uploaded_anchors
from wayfuse.storage.anchors import AnchorFiles, AnchorStore

__all__ = ["AnchorsInUse"]


class AnchorsInUse:
    """Anchors of a server's sites; ``given`` are those of folders, by name of the site, None where one has none."""

    def __init__(self, store: AnchorStore, given: Mapping[str, SiteAnchors | None]) -> None:
        self._store, self._given = store, given
        self._versions: dict[str, int] = {}

    def version(self, site: str) -> int:
        """The version that is in use: 0 for none yet, or for those of a folder."""
        if site in self._given:
            return 0
        if site not in self._versions:
            self._versions[site] = self._store.newest(site)
        return self._versions[site]

    def of(self, site: Site, version: int) -> SiteAnchors | None:
        """A version of a site's anchors; a folder has one alone.

        Raises
        ------
        UsageError : they are not of this site.
        """
        if site.name in self._given:
            return self._given[site.name]
        return uploaded_anchors(self._store.files(site.name, version), site)

    def files(self, site: str) -> AnchorFiles:
        """The uploaded files that are in use."""
        return self._store.files(site, self.version(site))

    def put(self, site: str, files: AnchorFiles, now: float) -> int:
        """Keep files and put them to use; the number of their version."""
        self._versions[site] = self._store.add(site, files, now)
        return self._versions[site]
