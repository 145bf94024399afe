"""Rooms and geofences of a site, and who is in which."""

from __future__ import annotations

from typing import Any

from fastapi import APIRouter, Depends, Request

from wayfuse.service.access import SCHEME, Reader, SiteName, server_of, site_of
from wayfuse.service.problems import responses
from wayfuse.service.routes.answers import Inside, answer
from wayfuse.service.routes.answers_plan import ZoneShapes
from wayfuse.service.web.plan import zone_features

__all__ = ["router"]

router = APIRouter(
    prefix="/api/v1/zones",
    tags=["out"],
    dependencies=[Depends(SCHEME)],
    responses=responses(401, 403, 422, 429),
)


@router.get("", summary="Rooms and geofences", responses=answer(ZoneShapes), response_model=None)
def zones(request: Request, token: Reader, site: SiteName = "") -> dict[str, Any]:
    """GeoJSON: ``id``, ``name``, ``kind`` (room or geofence), ``floor`` and ``level`` of each."""
    server = server_of(request)
    world = server.worlds[site_of(server, token, site)]
    return zone_features(world.site, world.zones)


@router.get(
    "/inside", summary="Who is in which room or geofence", responses=answer(Inside), response_model=None
)
def inside(request: Request, token: Reader, site: SiteName = "") -> dict[str, Any]:
    """Tracks by ``id`` of the zone; zones that nobody is in are left out, and so are tracks that have ended."""
    server = server_of(request)
    name = site_of(server, token, site)
    world = server.worlds[name]
    found: dict[str, list[str]] = {}
    for view in server.live.views(name):
        if view.estimate is not None and not view.is_ended:
            for zone in world.zones.called(view.zones, view.estimate):
                found.setdefault(zone, []).append(view.row.track)
    return {"site": name, "inside": found}
