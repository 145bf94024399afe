"""Anchors that measure ranges, of a site that was imported: uploaded, shown and taken away."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from fastapi import APIRouter, Depends, Request
from fastapi.concurrency import run_in_threadpool

from wayfuse.sensors.records import bssid_text
from wayfuse.service.access import SCHEME, SiteName, Surveyor, server_of, site_of
from wayfuse.service.anchor_changes import change_anchors
from wayfuse.service.limits import read_body
from wayfuse.service.problems import Problem, responses
from wayfuse.service.routes.answers import answer
from wayfuse.service.routes.answers_admin import Anchors, PlacedAnchors
from wayfuse.service.server import Server
from wayfuse.service.site_anchors import SiteAnchors
from wayfuse.storage.anchors import NONE, AnchorFiles
from wayfuse.storage.tokens import Token

__all__ = ["router"]

router = APIRouter(
    prefix="/api/v1/anchors",
    tags=["administration"],
    dependencies=[Depends(SCHEME)],
    responses=responses(400, 401, 403, 404, 408, 409, 413, 415, 422, 429),
)

_MOST_TOLD = 100  # anchors without a place
_EXAMPLE = "bssid,x,y,floor,height\n00:1b:63:00:00:01,2.5,3.0,1,2.2\nan-07,14.0,3.0,1,\n"


def _body(media: str, schema: dict[str, Any]) -> dict[str, Any]:
    return {"requestBody": {"required": True, "content": {media: schema}}}


@router.get("", summary="Anchors of a site", responses=answer(PlacedAnchors), response_model=None)
def anchors(request: Request, token: Surveyor, site: SiteName = "") -> dict[str, Any]:
    """Where they hang, and which of them have a channel model."""
    server = server_of(request)
    name = site_of(server, token, site)
    world = server.worlds[name]
    found = world.anchors(server.anchors.version(name))
    return {
        **_said(server, name, found),
        "places": [] if found is None else _places(found, world.site.floor_names),
    }


@router.put(
    "",
    summary="Upload the places of anchors",
    responses=answer(Anchors),
    response_model=None,
    openapi_extra=_body("text/csv", {"schema": {"type": "string"}, "example": _EXAMPLE}),
)
async def put_places(request: Request, token: Surveyor, site: SiteName = "") -> dict[str, Any]:
    """A CSV as the whole body: ``bssid,x,y,floor,height``, measured, in metres of the frame of the floor, which is
    named; the height above it may be empty. Tracks that begin from now on use ranges to these anchors, without a radio
    map too; those before them are gone.
    """
    server = server_of(request)
    name = site_of(server, token, site)
    body = await read_body(request, server.settings.max_body_bytes)
    if not body.strip():
        raise Problem(422, "the body is empty", "send the lines bssid,x,y,floor,height")
    return await _changed(server, name, token, "upload anchors", lambda files: files._replace(places=body))


@router.delete("", summary="Take anchors away", responses=answer(Anchors), response_model=None)
async def remove(request: Request, token: Surveyor, site: SiteName = "") -> dict[str, Any]:
    """Their channel model as well. Tracks under way keep them."""
    server = server_of(request)
    name = site_of(server, token, site)
    return await _changed(server, name, token, "remove anchors", lambda _: NONE)


@router.put(
    "/channel",
    summary="Upload a channel model of anchors",
    responses=answer(Anchors),
    response_model=None,
    openapi_extra=_body("application/octet-stream", {"schema": {"type": "string", "format": "binary"}}),
)
async def put_channel(request: Request, token: Surveyor, site: SiteName = "") -> dict[str, Any]:
    """The file that `wayfuse survey channel` writes, as the whole body; it makes ranges of the channel state that
    anchors send. Their places have to be there before.
    """
    server = server_of(request)
    name = site_of(server, token, site)
    body = await read_body(request, server.settings.max_upload_bytes)

    def put(files: AnchorFiles) -> AnchorFiles:
        if not files.places:
            raise Problem(422, "a channel model without the places of its anchors", "upload the places first")
        if not body:
            raise Problem(422, "the body is empty", "send the file of `wayfuse survey channel`")
        return files._replace(channel=body)

    return await _changed(server, name, token, "upload channel model", put)


@router.delete(
    "/channel", summary="Take a channel model away", responses=answer(Anchors), response_model=None
)
async def remove_channel(request: Request, token: Surveyor, site: SiteName = "") -> dict[str, Any]:
    """The places stay."""
    server = server_of(request)
    name = site_of(server, token, site)
    return await _changed(
        server, name, token, "remove channel model", lambda files: files._replace(channel=b"")
    )


async def _changed(
    server: Server, site: str, token: Token, action: str, change: Callable[[AnchorFiles], AnchorFiles]
) -> dict[str, Any]:
    found = await run_in_threadpool(change_anchors, server, site, token.id, action, change)
    return _said(server, site, found)


def _said(server: Server, site: str, found: SiteAnchors | None) -> dict[str, Any]:
    modelled = () if found is None else found.modelled
    rows = [] if found is None else found.places.rows(np.array(modelled, np.uint64)).tolist()
    unplaced = [bssid_text(a) for a, row in zip(modelled, rows, strict=True) if row < 0]
    return {
        "site": site,
        "is_of_folder": site in server.given,
        "anchors": 0 if found is None else len(found.places),
        "channel_anchors": len(modelled),
        "unplaced": unplaced[:_MOST_TOLD],
    }


def _places(found: SiteAnchors, levels: tuple[str, ...]) -> list[dict[str, Any]]:
    p = found.places
    columns = (p.bssid.tolist(), p.x.tolist(), p.y.tolist(), p.floor.tolist(), p.height.tolist())
    return [
        {
            "bssid": bssid_text(bssid),
            "x": x,
            "y": y,
            "floor": floor,
            "level": levels[floor],
            "height_m": height if np.isfinite(height) else None,
        }
        for bssid, x, y, floor, height in zip(*columns, strict=True)
    ]
