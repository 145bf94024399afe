"""What phones and anchors post."""

from __future__ import annotations

from typing import Annotated, Any

from fastapi import APIRouter, Depends, Query, Request
from fastapi.responses import JSONResponse, PlainTextResponse, Response
from pydantic import BaseModel

from wayfuse.service.access import SCHEME, allowed, client_of, server_of, site_of
from wayfuse.service.ingest import Accepted, ingest
from wayfuse.service.limits import read_body
from wayfuse.service.message import Profile, SayToUserError
from wayfuse.service.problems import Problem, responses
from wayfuse.service.routes.examples import EXAMPLES
from wayfuse.storage.tokens import Token

__all__ = ["router"]

router = APIRouter(tags=["in"])

_UPLOADS = {"getsensordata"}
_SAY_TO_USER = 499  # Sensor Logger shows the text of this answer on the phone
_MEDIA = {"getsensordata": "text/plain"}
_REFUSALS = responses(400, 401, 403, 408, 413, 415, 422, 429, 503)

Site = Annotated[str, Query(max_length=200, description="Name of the site; not needed where there is one.")]
Device = Annotated[str, Query(max_length=200, description="Name of the phone, for bodies that have none.")]
Track = Annotated[str, Query(max_length=200, description="Name of the session, for bodies that have none.")]
Platform = Annotated[
    str,
    Query(pattern="^(android|ios)?$", description="Whose axes, where the body does not say: android or ios."),
]
Standardised = Annotated[bool, Query(description="Whether the app converts to Android's axes.")]


class AcceptedMessage(BaseModel):
    """A message in the log."""

    seq: int
    track: str
    records: int
    left_out: dict[str, int]


class AcceptedBody(BaseModel):
    """A body that is in the log, on the disk."""

    accepted: list[AcceptedMessage]


_INGEST = Depends(allowed("ingest"))
_SCHEME = Depends(SCHEME)


def _described(adapter: str) -> dict[str, Any]:
    media = _MEDIA.get(adapter, "application/json")
    example = {"example": EXAMPLES[adapter]}
    schema = {"type": "string"} if media == "text/plain" else {"type": "object"}
    return {"requestBody": {"required": True, "content": {media: {"schema": schema, **example}}}}


async def _take(request: Request, token: Token, adapter: str, site: str, profile: Profile) -> list[Accepted]:
    server = server_of(request)
    limit = server.settings.max_upload_bytes if adapter in _UPLOADS else server.settings.max_body_bytes
    body = await read_body(request, limit)
    return await ingest(server, site_of(server, token, site), adapter, body, profile)


def _answer(accepted: list[Accepted]) -> AcceptedBody:
    return AcceptedBody(accepted=[AcceptedMessage(**a._asdict()) for a in accepted])


def _add(adapter: str, summary: str) -> None:
    """The route of an adapter, with the token in the header."""

    @router.post(
        f"/api/v1/in/{adapter}",
        summary=summary,
        name=f"post {adapter}",
        response_model=AcceptedBody,
        responses=_REFUSALS
        | ({_SAY_TO_USER: {"content": {"text/plain": {}}}} if adapter == "sensor-logger" else {}),
        openapi_extra=_described(adapter),
        dependencies=[_SCHEME],
    )
    async def post(
        request: Request,
        token: Annotated[Token, _INGEST],
        site: Site = "",
        device: Device = "",
        track: Track = "",
        platform: Platform = "",
        standardised: Standardised = False,
    ) -> Any:
        profile = Profile(device, track, platform, standardised)
        try:
            return _answer(await _take(request, token, adapter, site, profile))
        except SayToUserError as error:
            if adapter != "sensor-logger":
                raise
            return PlainTextResponse(f"{error.what}: {error.remedy}", _SAY_TO_USER)


_add("own", "The own envelope: raw samples, scans and ranges of a phone")
_add("sensor-logger", "Sensor Logger's HTTP push")
_add("find3", "A scan as FIND3's clients send it")
_add("getsensordata", "A GetSensorData log, whole")
_add("anchors", "Frames of targets that an anchor overheard")

_BY_PATH = {"sensor-logger": "sensor-logger", "data": "find3", "passive": "find3", "own": "own"}


@router.post("/in/{token}/{way}", include_in_schema=False)
async def post_by_path(request: Request, token: str, way: str) -> Response:
    """For clients that send no header: the token in the address. ``data`` and ``passive`` are FIND3's own words."""
    if way not in _BY_PATH:
        raise Problem(404, "no such way in", f"use one of {', '.join(_BY_PATH)}")
    server, query = server_of(request), request.query_params
    site = query.get("site", "")
    found = await server.authority.token(token, "ingest", site, client_of(request))
    platform = query.get("platform", "")
    if platform not in {"", "android", "ios"}:
        raise Problem(422, "platform must be android or ios")
    is_standardised = query.get("standardised", "").lower() in {"1", "true", "yes"}
    profile = Profile(query.get("device", "")[:200], query.get("track", "")[:200], platform, is_standardised)
    try:
        accepted = await _take(request, found, _BY_PATH[way], site, profile)
    except SayToUserError as error:
        return PlainTextResponse(f"{error.what}: {error.remedy}", _SAY_TO_USER)
    if _BY_PATH[way] == "find3":
        return JSONResponse({"success": True, "message": "inserted data"})
    return JSONResponse(_answer(accepted).model_dump())
