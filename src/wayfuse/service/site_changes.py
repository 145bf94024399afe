"""Sites that come and go while phones are tracked: never under the feet of a track."""

from __future__ import annotations

import threading

from wayfuse.core.errors import MapError
from wayfuse.maps.site import Site
from wayfuse.service.problems import Problem
from wayfuse.service.server import Server
from wayfuse.service.world import World
from wayfuse.storage.anchors import NONE

__all__ = ["add_site", "remove_site"]

_WRITING = threading.Lock()  # two sites of one name at once would be written into one place


def add_site(server: Server, site: Site, actor: str, *, replace: bool = False) -> None:
    """Serve a site from now on, and after a restart.

    Raises
    ------
    Problem : 409, there is a site of this name, and it may not or cannot be replaced.
    MapError, RadioMapError : it has other floors than the one it replaces, or the radio map in use is not of it.
    """
    known = server.worlds.get(site.name)
    if known is not None:
        _check_not_given(server, site.name)
        if not replace:
            raise Problem(409, f"there is a site {site.name}", "give another name, or add replace=true")
        if known.site.floor_names != site.floor_names:
            raise MapError(
                f"its floors are {', '.join(site.floor_names)}, those of the site it replaces "
                f"{', '.join(known.site.floor_names)}",
                remedy="give it another name",
            )
    world = server.world_of(site)
    with _WRITING:
        server.uploads.write(site)  # all that takes long is done before the tracks wait
        server.between(lambda: _put(server, world))
    server.audit.add(server.clock(), actor, "import site", site.name)


def remove_site(server: Server, name: str, actor: str) -> None:
    """Serve a site no longer.

    Raises
    ------
    Problem : 404, there is none of this name; 409, it came from the command line, or somebody is tracked there.
    """
    if name not in server.worlds:
        raise Problem(404, "no such site", "list them at /api/v1/sites")
    _check_not_given(server, name)

    def take() -> None:
        _check_empty(server, name)
        server.uploads.remove(name)
        del server.worlds[name]
        if server.anchors.files(name) != NONE:  # they may not fit what is imported under this name next
            server.anchors.put(name, NONE, server.clock())

    server.between(take)
    server.audit.add(server.clock(), actor, "remove site", name)


def _put(server: Server, world: World) -> None:
    name = world.site.name
    if name in server.worlds:
        _check_empty(server, name)
    server.uploads.put(name)
    server.worlds[name] = world


def _check_not_given(server: Server, name: str) -> None:
    if name in server.given:
        raise Problem(
            409, f"site {name} is of the command line of the server", "import it anew there, and start again"
        )


def _check_empty(server: Server, name: str) -> None:
    n = len(server.live.views(name))
    if n:
        raise Problem(
            409, f"{n} tracks of site {name} are in memory", "wait until nobody has sent for a while"
        )
