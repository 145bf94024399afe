"""Surveying with a phone and the map: scans in, walks tapped on the map, recordings, and the job that builds."""

from __future__ import annotations

import math
from typing import Annotated, Any

from fastapi import APIRouter, Depends, Query, Request
from fastapi.concurrency import run_in_threadpool
from fastapi.responses import JSONResponse, PlainTextResponse, Response
from pydantic import BaseModel, ConfigDict, Field

from wayfuse.formats.reading import read
from wayfuse.models.survey_walk import survey_walk
from wayfuse.sensors.records import WifiScan, bssid_text
from wayfuse.service.access import SCHEME, SiteName, Surveyor, client_of, server_of, site_of
from wayfuse.service.adapters import ADAPTERS
from wayfuse.service.ingest import completed, ingest
from wayfuse.service.limits import read_body
from wayfuse.service.message import Message, Profile, SayToUserError
from wayfuse.service.problems import Problem, responses
from wayfuse.service.routes.answers import answer
from wayfuse.service.routes.answers_admin import Removed
from wayfuse.service.routes.answers_survey import JobSummary, KeptRecording, KeptWalk, SurveySummary
from wayfuse.service.server import Server
from wayfuse.service.web.survey_build import build
from wayfuse.service.web.survey_store import Push, TappedWalk, Waypoint
from wayfuse.service.web.surveys import Surveys, surveys_of
from wayfuse.service.wire import Ap, Scan

__all__ = ["by_path", "router"]


_WAYS = {"sensor-logger": "sensor-logger", "own": "own", "data": "find3"}
_SAY_TO_USER = 499  # Sensor Logger shows the text of this answer on the phone
router = APIRouter(
    prefix="/api/v1/survey",
    tags=["survey"],
    dependencies=[Depends(SCHEME)],
    responses=responses(400, 401, 403, 404, 408, 413, 415, 422, 429),
)
by_path = APIRouter()  # with the token in the address
Seconds = Annotated[float, Field(ge=0.0, le=1e11, allow_inf_nan=False)]
Metres = Annotated[float, Field(ge=-1e5, le=1e5, allow_inf_nan=False)]
Identifier = Annotated[str, Field(pattern="^[0-9a-f]{16}$")]


class Tap(BaseModel):
    """Where the phone was at a time of the browser's clock (Unix s)."""

    t: Seconds
    floor: Annotated[int, Field(ge=0, le=1000)]
    x: Metres
    y: Metres


class NewWalk(BaseModel):
    """Taps in order; ``now`` is the browser's clock when it sends them, by which it is set right."""

    model_config = ConfigDict(
        json_schema_extra={
            "examples": [
                {
                    "device": "0123456789abcdef",
                    "now": 1700000012.0,
                    "taps": [
                        {"t": 1700000000.0, "floor": 0, "x": 2.0, "y": 3.0},
                        {"t": 1700000010.0, "floor": 0, "x": 12.0, "y": 3.0},
                    ],
                }
            ]
        }
    )

    device: Identifier
    now: Seconds
    taps: Annotated[list[Tap], Field(min_length=2, max_length=10_000)]


@router.get("", summary="What the survey has", responses=answer(SurveySummary), response_model=None)
def survey(request: Request, token: Surveyor, site: SiteName = "") -> dict[str, Any]:
    """Phones that push scans, walks, recordings, and the last job."""
    server, surveys = server_of(request), surveys_of(request)
    name = site_of(server, token, site)
    store, job = surveys.store(name), surveys.jobs.last(name)
    return {
        "site": name,
        "now": server.clock(),
        "phones": [{"device": p.device, "heard": p.heard, "scans": p.scans} for p in store.phones()],
        "walks": [_walk(k, w) for k, w in store.walks().items()],
        "recordings": [
            {"id": k, "name": p.name[17:], "bytes": p.stat().st_size} for k, p in store.recordings().items()
        ],
        "job": None if job is None else job._asdict(),
    }


@router.post(
    "/walks",
    status_code=201,
    summary="Keep a walk tapped on the map",
    responses=answer(KeptWalk, 201),
    response_model=None,
)
def add_walk(request: Request, token: Surveyor, walk: NewWalk, site: SiteName = "") -> dict[str, Any]:
    """A place where somebody stood is two taps at one place; between two taps the way is straight and even."""
    server = server_of(request)
    name = site_of(server, token, site)
    floors = server.worlds[name].site.floors
    for tap in walk.taps:
        if tap.floor >= len(floors):
            raise Problem(422, f"no floor {tap.floor}", "see /api/v1/plan")
    if (
        any(b.t < a.t for a, b in zip(walk.taps, walk.taps[1:], strict=False))
        or walk.taps[-1].t <= walk.taps[0].t
    ):
        raise Problem(422, "the taps are not in the order of their times", "send them as they were made")
    ahead = server.clock() - walk.now
    kept = [Waypoint(tap.t + ahead, tap.floor, tap.x, tap.y) for tap in walk.taps]
    identifier = surveys_of(request).store(name).add_walk(TappedWalk(walk.device, kept))
    server.audit.add(server.clock(), token.id, "add survey walk", name, identifier)
    return {"site": name, "id": identifier}


@router.post(
    "/recordings",
    status_code=201,
    summary="Upload a survey recording",
    responses=answer(KeptRecording, 201),
    response_model=None,
    openapi_extra={
        "requestBody": {
            "required": True,
            "content": {"application/octet-stream": {"schema": {"type": "string", "format": "binary"}}},
        }
    },
)
async def add_recording(
    request: Request,
    token: Surveyor,
    site: SiteName = "",
    name: Annotated[str, Query(max_length=200, description="Of the file; its ending may matter.")] = "",
) -> dict[str, Any]:
    """A recording with waypoints of any format `wayfuse survey build` reads, whole; it is read before it is kept."""
    server = server_of(request)
    of = site_of(server, token, site)
    body = await read_body(request, server.settings.max_upload_bytes)
    return await run_in_threadpool(_keep_recording, server, surveys_of(request), of, name, body, token.id)


def _keep_recording(
    server: Server, surveys: Surveys, site: str, name: str, body: bytes, actor: str
) -> dict[str, Any]:
    store = surveys.store(site)
    identifier, path = store.add_recording(name, body)
    try:
        recording = read(path)
        walk, notes = survey_walk(server.worlds[site].site, recording)
        if walk is None:
            raise Problem(
                422, notes[-1].replace(f"{path}: ", ""), "send a recording with waypoints and Wi-Fi"
            )
    except Exception:
        store.remove(identifier)
        raise
    server.audit.add(server.clock(), actor, "add survey recording", site, identifier)
    return {"site": site, "id": identifier, "waypoints": len(walk.t), "scans": len(walk.scans)}


@router.delete(
    "/parts/{identifier}",
    summary="Delete a walk or a recording",
    responses=answer(Removed),
    response_model=None,
)
def remove(request: Request, token: Surveyor, identifier: str, site: SiteName = "") -> dict[str, Any]:
    """Radio maps built with it stay as they are."""
    server = server_of(request)
    name = site_of(server, token, site)
    if not surveys_of(request).store(name).remove(identifier):
        raise Problem(404, "no such walk or recording", "list them at /api/v1/survey")
    server.audit.add(server.clock(), token.id, "remove survey part", name, identifier)
    return {"removed": identifier}


@router.post(
    "/jobs",
    status_code=202,
    summary="Build a radio map of what the survey has",
    responses=answer(JobSummary, 202),
    response_model=None,
)
def start_job(request: Request, token: Surveyor, site: SiteName = "") -> dict[str, Any]:
    """The job's result names the new version, which is not yet published, and its held-out errors room by room."""
    server, surveys = server_of(request), surveys_of(request)
    name = site_of(server, token, site)
    plan, store = server.worlds[name].site, surveys.store(name)

    def work(progress: Any) -> dict[str, Any]:
        built = build(plan, store, progress)
        note = f"{built.walks} walks, {built.fingerprints} fingerprints"
        version = server.add_radio_map(plan, built.archive, token.id, note)
        said = built._asdict() | {"version": version, "rooms": [r._asdict() for r in built.rooms]}
        del said["archive"]
        return said

    return surveys.jobs.start(name, work)._asdict()


@router.get(
    "/jobs/{job}",
    summary="How far a job is",
    responses=answer(JobSummary),
    response_model=None,
)
def job(request: Request, token: Surveyor, job: int) -> dict[str, Any]:
    """``state`` is running, done or failed; ``share`` runs from 0 to 1."""
    found = surveys_of(request).jobs.get(job)
    if found is None or token.site not in {"", found.site}:
        raise Problem(404, "no such job", "start one")
    return found._asdict()


@by_path.post("/in/{token}/survey/{way}", include_in_schema=False)
async def take(request: Request, token: str, way: str) -> Response:
    """Scans for the survey, from a client without headers; where a radio map is in use, the phone is tracked too."""
    if way not in _WAYS:
        raise Problem(404, "no such way in", f"use one of {', '.join(_WAYS)}")
    server, query = server_of(request), request.query_params
    found = await server.authority.token(token, "ingest", query.get("site", ""), client_of(request))
    platform = query.get("platform", "")
    if platform not in {"", "android", "ios"}:
        raise Problem(422, "platform must be android or ios")
    name = site_of(server, found, query.get("site", ""))
    body = await read_body(request, server.settings.max_body_bytes)
    asked = Profile(query.get("device", "")[:200], query.get("track", "")[:200], platform)
    profile = await completed(server, _WAYS[way], body, asked)
    arrived = server.clock()
    try:
        messages = await run_in_threadpool(ADAPTERS[_WAYS[way]].read, body, profile, arrived)
    except SayToUserError as error:
        return PlainTextResponse(f"{error.what}: {error.remedy}", _SAY_TO_USER)
    store = surveys_of(request).store(name)
    n = 0
    for message in messages:
        push = _push(message, arrived)
        if push is not None:
            await run_in_threadpool(store.add_push, server.pseudonyms.device(message.device), push)
            n += len(push.scans)
    if await run_in_threadpool(server.published, name) is not None:
        await ingest(server, name, _WAYS[way], body, profile)
    return JSONResponse({"success": True, "scans": n})


def _walk(identifier: str, walk: TappedWalk) -> dict[str, Any]:
    taps = [{"t": p.t, "floor": p.floor, "x": p.x, "y": p.y} for p in walk.waypoints]
    return {"id": identifier, "device": walk.device, "taps": taps}


def _push(message: Message, arrived: float) -> Push | None:
    records = [record for part in message.parts for record in part.records]
    times = [record.t for record in records if abs(record.t) < 1e12]
    if not times:
        return None
    return Push(arrived, max(times), [_scan(r) for r in records if isinstance(r, WifiScan) and len(r.bssid)])


def _scan(scan: WifiScan) -> Scan:
    columns = (scan.bssid.tolist(), scan.rssi.tolist(), scan.frequency.tolist(), scan.last_seen.tolist())
    readings = zip(*columns, strict=True)
    return Scan(
        scan.t, [Ap(bssid_text(b), r, f, None if math.isnan(seen) else seen) for b, r, f, seen in readings]
    )
