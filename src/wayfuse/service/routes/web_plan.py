"""The floors of a site, for the map in the browser and for whoever else draws."""

from __future__ import annotations

from typing import Any

from fastapi import APIRouter, Depends, Request

from wayfuse.service.access import SCHEME, Reader, SiteName, server_of, site_of
from wayfuse.service.problems import Problem, responses
from wayfuse.service.routes.answers import answer
from wayfuse.service.routes.answers_plan import Floors, PlanOfFloor
from wayfuse.service.web.plan import floor_features, floor_frame

__all__ = ["router"]

router = APIRouter(
    prefix="/api/v1/plan",
    tags=["out"],
    dependencies=[Depends(SCHEME)],
    responses=responses(401, 403, 422, 429),
)


@router.get("", summary="Floors of a site", responses=answer(Floors), response_model=None)
def floors(request: Request, token: Reader, site: SiteName = "") -> dict[str, Any]:
    """Bottom up; ``origin`` and ``matrix`` take metres of a floor's frame to longitude and latitude."""
    server = server_of(request)
    name = site_of(server, token, site)
    found = server.worlds[name].site
    return {"site": name, "floors": [floor_frame(found, i) for i in range(len(found.floors))]}


@router.get(
    "/{floor}", summary="Plan of a floor", responses=responses(404) | answer(PlanOfFloor), response_model=None
)
def plan(request: Request, token: Reader, floor: int, site: SiteName = "") -> dict[str, Any]:
    """GeoJSON: outline, units, walls, doors, connectors and their landings."""
    server = server_of(request)
    found = server.worlds[site_of(server, token, site)].site
    if not 0 <= floor < len(found.floors):
        raise Problem(404, f"no floor {floor}", "see /api/v1/plan")
    return floor_features(found, floor)
