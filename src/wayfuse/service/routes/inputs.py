"""What phones and anchors post.

The framework describes these addresses and answers what is wrong with a request. What is right does not pass through
it: `quick` takes the request where it comes in, for a phone posts every second, and finding the route, injecting what
it needs and wrapping the answer take the framework longer than reading the body takes us.
"""

from __future__ import annotations

from typing import Any

from fastapi import APIRouter, Request
from fastapi.datastructures import QueryParams
from fastapi.responses import JSONResponse, PlainTextResponse, Response
from pydantic import BaseModel
from starlette.types import Receive, Scope

from wayfuse.formats.sensor_logger import PLATFORMS
from wayfuse.service.access import SCHEME, client_of, server_of, site_of
from wayfuse.service.ingest import ingest
from wayfuse.service.limits import read_body
from wayfuse.service.message import Profile, SayToUserError
from wayfuse.service.problems import Problem, responses
from wayfuse.service.routes.bodies import BODIES
from wayfuse.service.routes.examples import EXAMPLES
from wayfuse.service.security import HEADERS, bearer
from wayfuse.service.wire import encode

__all__ = ["quick", "router"]

router = APIRouter(tags=["in"])

_UPLOADS = {"getsensordata"}
_OK = 200
_SAY_TO_USER = 499  # Sensor Logger shows the text of this answer on the phone
_MEDIA = {"getsensordata": "text/plain"}
_REFUSALS = responses(400, 401, 403, 408, 413, 415, 422, 429, 503)

# read by hand, not by dependencies: these are the addresses that are asked thousands of times a second
_PARAMETERS: dict[str, tuple[dict[str, Any], str]] = {
    "site": ({"type": "string", "maxLength": 200}, "Name of the site; not needed where there is one."),
    "device": ({"type": "string", "maxLength": 200}, "Name of the phone, for bodies that have none."),
    "track": ({"type": "string", "maxLength": 200}, "Name of the session, for bodies that have none."),
    "platform": (
        {"type": "string", "enum": ["", *PLATFORMS]},
        "Whose axes, where the body does not say: android or ios.",
    ),
    "standardised": ({"type": "boolean", "default": False}, "Whether the app converts to Android's axes."),
}
_YES, _NO = {"1", "true", "yes", "on"}, {"", "0", "false", "no", "off"}


class AcceptedMessage(BaseModel):
    """A message in the log."""

    seq: int
    track: str
    records: int
    left_out: dict[str, int]


class AcceptedBody(BaseModel):
    """A body that is in the log, on the disk."""

    accepted: list[AcceptedMessage]


def _described(adapter: str) -> dict[str, Any]:
    media = _MEDIA.get(adapter, "application/json")
    example = {"example": EXAMPLES[adapter]}
    parameters = [
        {"name": name, "in": "query", "required": False, "schema": schema, "description": what}
        for name, (schema, what) in _PARAMETERS.items()
    ]
    return {
        "requestBody": {"required": True, "content": {media: {"schema": BODIES[adapter], **example}}},
        "parameters": parameters,
        "security": [{SCHEME.scheme_name: []}],
    }


async def _take(request: Request, text: str, adapter: str) -> Response:
    """Take a request's body, with a token of this text."""
    server, query = server_of(request), request.query_params
    named = query.get("site", "")
    token = await server.authority.token(text, "ingest", named, client_of(request))
    profile = _profile(query)
    limit = server.settings.max_upload_bytes if adapter in _UPLOADS else server.settings.max_body_bytes
    body = await read_body(request, limit)
    try:
        accepted = await ingest(server, site_of(server, token, named), adapter, body, profile)
    except SayToUserError as error:
        if adapter != "sensor-logger":
            raise
        return PlainTextResponse(f"{error.what}: {error.remedy}", _SAY_TO_USER)
    said = encode({"accepted": [a._asdict() for a in accepted]})
    return Response(said, media_type="application/json")


def _profile(query: QueryParams) -> Profile:
    """What the address says of a body.

    Raises
    ------
    Problem : 422, a parameter is none of those that are described.
    """
    if not query:
        return _NOTHING
    for name in ("site", "device", "track"):
        if len(query.get(name, "")) > _PARAMETERS[name][0]["maxLength"]:
            raise Problem(
                422, f"{name}: longer than {_PARAMETERS[name][0]['maxLength']}", "see /openapi.json"
            )
    platform, standardised = query.get("platform", ""), query.get("standardised", "").lower()
    if platform not in {"", *PLATFORMS}:
        raise Problem(422, "platform must be android or ios", "see /openapi.json")
    if standardised not in _YES | _NO:
        raise Problem(422, "standardised must be true or false", "see /openapi.json")
    return Profile(query.get("device", ""), query.get("track", ""), platform, standardised in _YES)


_NOTHING = Profile()
_ERROR = "wayfuse.error"  # key in a request's scope: what the quick way met, for the framework to answer


async def quick(scope: Scope, receive: Receive) -> Response | None:
    """The answer to a post; None where it is for the framework: another address, or something is wrong with it."""
    way = _WAYS.get(scope["path"]) if scope["method"] == "POST" else None
    if way is None:
        return None
    request = Request(scope, receive)
    try:
        answer = await _take(request, bearer(request), way)
    except Exception as error:  # the framework's handlers know all of them
        scope[_ERROR] = error
        return None
    answer.headers.update(HEADERS)
    return answer


_WAYS: dict[str, str] = {}


def _add(adapter: str, summary: str) -> None:
    """The route of an adapter, with the token in the header."""
    path = f"/api/v1/in/{adapter}"
    _WAYS[path] = adapter

    @router.post(
        path,
        summary=summary,
        name=f"post {adapter}",
        response_model=AcceptedBody,
        responses=_REFUSALS
        | ({_SAY_TO_USER: {"content": {"text/plain": {}}}} if adapter == "sensor-logger" else {}),
        openapi_extra=_described(adapter),
    )
    async def post(request: Request) -> Response:
        met = request.scope.get(_ERROR)
        if met is not None:
            raise met
        return await _take(request, bearer(request), adapter)


_add("own", "The own envelope: raw samples, scans and ranges of a phone")
_add("sensor-logger", "Sensor Logger's HTTP push")
_add("find3", "A scan as FIND3's clients send it")
_add("getsensordata", "A GetSensorData log, whole")
_add("anchors", "Frames of targets that an anchor overheard")

_BY_PATH = {"sensor-logger": "sensor-logger", "data": "find3", "passive": "find3-passive", "own": "own"}


@router.post("/in/{token}/{way}", include_in_schema=False)
async def post_by_path(request: Request, token: str, way: str) -> Response:
    """For clients that send no header: the token in the address. ``data`` and ``passive`` are FIND3's own words."""
    if way not in _BY_PATH:
        raise Problem(404, "no such way in", f"use one of {', '.join(_BY_PATH)}")
    adapter = _BY_PATH[way]
    answer = await _take(request, token, adapter)
    if adapter.startswith("find3") and answer.status_code == _OK:
        return JSONResponse({"success": True, "message": "inserted data"})
    return answer
