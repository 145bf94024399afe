"""Anchors that come and go while phones are tracked: tracks under way keep those they began with."""

from __future__ import annotations

import threading
from collections.abc import Callable

from wayfuse.service.problems import Problem
from wayfuse.service.server import Server
from wayfuse.service.site_anchors import SiteAnchors, uploaded_anchors
from wayfuse.service.world import NO_MAP, Basis
from wayfuse.storage.anchors import AnchorFiles

__all__ = ["change_anchors"]

_CHANGING = threading.Lock()  # the second of two changes builds on the first


def change_anchors(
    server: Server, site: str, actor: str, action: str, change: Callable[[AnchorFiles], AnchorFiles]
) -> SiteAnchors | None:
    """Check changed files of a site's anchors, put them to use for tracks that begin from now on, and keep them.

    Parameters
    ----------
    action : what is done, for the list of who did what. change : the files from those in use.

    Raises
    ------
    Problem : 409, the anchors are those of a folder. UsageError, RadioMapError : what is wrong with a file.
    """
    if site in server.given:
        raise Problem(
            409,
            f"the anchors of site {site} are those of its folder, from the command line of the server",
            "change access_points.csv and channel.npz there, and start it again",
        )
    world = server.worlds[site]
    with _CHANGING:
        known = server.anchors.files(site)
        files = change(known)
        found = uploaded_anchors(files, world.site)
        if files == known:
            return found
        published = server.published(site)
        map_version = NO_MAP if published is None else published
        tracker = None if published is None and found is None else world.build(map_version, found)
        basis = Basis(map_version, server.anchors.put(site, files, server.clock()))
        if tracker is not None:
            world.hold(basis, tracker)
        server.make_ready(world)  # a radio map may have been published meanwhile
    said = "no anchors" if found is None else f"{len(found.places)} anchors"
    server.audit.add(server.clock(), actor, action, site, said)
    return found
