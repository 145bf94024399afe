"""What an operator does: tokens, phones, radio maps, and what is kept of whom."""

from __future__ import annotations

import re
from typing import Annotated, Any, Literal

from fastapi import APIRouter, Depends, Query, Request
from fastapi.concurrency import run_in_threadpool
from fastapi.responses import FileResponse
from pydantic import BaseModel, ConfigDict, Field

from wayfuse.service.access import SCHEME, Admin, Surveyor, allowed, check_all_sites, server_of, site_of
from wayfuse.service.limits import read_body
from wayfuse.service.problems import Problem, responses
from wayfuse.service.routes.answers import answer
from wayfuse.service.routes.answers_admin import (
    Audit,
    Devices,
    DeviceSummary,
    Forgotten,
    InUse,
    MadeToken,
    RadioMaps,
    Revoked,
    Tokens,
    TokenSummary,
    Uploaded,
)
from wayfuse.service.routes.sent_file import sent_file
from wayfuse.service.server import Server
from wayfuse.service.subject import write_subject
from wayfuse.service.web.surveys import surveys_of
from wayfuse.storage.devices import Device
from wayfuse.storage.tokens import Token

__all__ = ["router"]

router = APIRouter(
    prefix="/api/v1",
    tags=["administration"],
    dependencies=[Depends(SCHEME)],
    responses=responses(400, 401, 403, 404, 413, 415, 422, 429),
)

_ZIP = "application/zip"
_PSEUDONYM = re.compile("[0-9a-f]{16}")
Text = Annotated[str, Field(max_length=200, pattern=r"^[^\x00-\x1f]*$")]
Name = Annotated[str, Field(min_length=1, max_length=200)]


class NewToken(BaseModel):
    """What a token may do, where, and until when (Unix s)."""

    model_config = ConfigDict(
        json_schema_extra={"examples": [{"scopes": ["ingest"], "label": "phones of the museum"}]}
    )

    scopes: Annotated[list[Literal["ingest", "read", "survey", "admin"]], Field(min_length=1, max_length=4)]
    site: Text = ""
    label: Text = ""
    expires: Annotated[float | None, Field(ge=0.0, le=1e11, allow_inf_nan=False)] = None


class NewDevice(BaseModel):
    """A phone by the name it calls itself; kept as a pseudonym."""

    model_config = ConfigDict(json_schema_extra={"examples": [{"name": "a1b2", "platform": "ios"}]})

    name: Name
    platform: Literal["", "android", "ios"] = ""
    standardised: bool = False
    label: Text = ""


class Publication(BaseModel):
    """The version of a radio map to put to use."""

    version: Annotated[int, Field(ge=1, le=2**31 - 1)]


@router.get(
    "/token",
    summary="What the token of this request may do",
    responses=answer(TokenSummary),
    response_model=None,
)
def own_token(token: Annotated[Token, Depends(allowed(""))]) -> dict[str, Any]:
    """For clients that show only what they can do; any token will do."""
    return _token(token)


@router.post(
    "/tokens", status_code=201, summary="Make a token", responses=answer(MadeToken, 201), response_model=None
)
def create_token(request: Request, maker: Surveyor, wanted: NewToken) -> dict[str, Any]:
    """The answer holds the token's text, which cannot be asked for again. Who surveys may make tokens with the scope
    ``ingest`` alone, for the phones that survey.
    """
    server = server_of(request)
    if not maker.allows("admin") and set(wanted.scopes) != {"ingest"}:
        raise Problem(403, "this token may make tokens with the scope ingest alone", "ask an administrator")
    if wanted.site and wanted.site not in server.worlds:
        raise Problem(422, f"no site {wanted.site!r}", "see /api/v1/sites")
    if maker.site and wanted.site != maker.site:
        raise Problem(403, "this token may make tokens of its own site alone", f"add site={maker.site}")
    text, made = server.tokens.create(
        wanted.scopes, server.clock(), site=wanted.site, label=wanted.label, expires=wanted.expires
    )
    server.audit.add(server.clock(), maker.id, "create token", made.id, " ".join(sorted(made.scopes)))
    return {"token": text, **_token(made)}


@router.get("/tokens", summary="Tokens, without their texts", responses=answer(Tokens), response_model=None)
def tokens(request: Request, admin: Admin) -> dict[str, Any]:
    """Also those that were revoked or have expired."""
    of = [t for t in server_of(request).tokens.all() if admin.site in {"", t.site}]
    return {"tokens": [_token(t) for t in of]}


@router.delete("/tokens/{token_id}", summary="Revoke a token", responses=answer(Revoked), response_model=None)
def revoke_token(request: Request, admin: Admin, token_id: str) -> dict[str, Any]:
    """It ends within seconds."""
    server = server_of(request)
    known = {t.id for t in server.tokens.all() if admin.site in {"", t.site}}
    if token_id not in known or not server.tokens.revoke(token_id, server.clock()):
        raise Problem(404, "no such token, or revoked already", "list them at /api/v1/tokens")
    server.authority.forget()
    server.audit.add(server.clock(), admin.id, "revoke token", token_id)
    return {"revoked": token_id}


@router.put("/devices", summary="Enrol a phone", responses=answer(DeviceSummary), response_model=None)
def enrol(request: Request, surveyor: Surveyor, device: NewDevice) -> dict[str, Any]:
    """Says which platform a phone is of, for formats that do not say; again to change it."""
    server = server_of(request)
    name = server.pseudonyms.device(device.name)
    kept = Device(name, device.platform, device.standardised, device.label, server.clock())
    server.devices.enrol(kept)
    server.audit.add(server.clock(), surveyor.id, "enrol device", name)
    return kept._asdict()


@router.get("/devices", summary="Enrolled phones", responses=answer(Devices), response_model=None)
def devices(request: Request, _: Surveyor) -> dict[str, Any]:
    """By their pseudonyms."""
    return {"devices": [d._asdict() for d in server_of(request).devices.all()]}


@router.post(
    "/devices/forget",
    summary="Delete all that is kept of a phone",
    responses=answer(Forgotten),
    response_model=None,
)
def forget(
    request: Request, admin: Admin, name: Annotated[str, Query(min_length=1, max_length=200)]
) -> dict[str, Any]:
    """``name`` : what the phone calls itself, or its pseudonym. Its tracks, its part of the log, its enrolment, the
    scans it pushed for surveys and the walks tapped for it. Recordings that were uploaded do not say whose they are.
    """
    server = server_of(request)
    check_all_sites(admin)
    n, files = 0, 0
    for device in _pseudonyms(server, name):
        n += server.forget(device)
        files += surveys_of(request).forget(device)
    said = f"{n} tracks, {files} files of surveys"
    server.audit.add(server.clock(), admin.id, "forget device", server.pseudonyms.device(name), said)
    return {"tracks": n, "survey_files": files}


@router.get(
    "/devices/export",
    summary="All that is kept of a phone",
    response_class=FileResponse,
    responses={200: {"content": {_ZIP: {"schema": {"type": "string", "format": "binary"}}}}},
)
def export(
    request: Request, admin: Admin, name: Annotated[str, Query(min_length=1, max_length=200)]
) -> FileResponse:
    """A ZIP archive: enrolment, tracks (CSV), what the phone sent (Parquet), and what it did for surveys."""
    server = server_of(request)
    check_all_sites(admin)
    device, stores = server.pseudonyms.device(name), surveys_of(request).everywhere()
    answer = sent_file(
        lambda path: write_subject(server, stores, _pseudonyms(server, name), path), _ZIP, f"{device}.zip"
    )
    server.audit.add(server.clock(), admin.id, "export device", device)
    return answer


@router.get(
    "/radio-maps", summary="Versions of a radio map", responses=answer(RadioMaps), response_model=None
)
def radio_maps(request: Request, surveyor: Surveyor, site: str = "") -> dict[str, Any]:
    """Oldest first, and which is in use."""
    server = server_of(request)
    name = site_of(server, surveyor, site)
    versions = [v._asdict() for v in server.sites.radio_maps(name)]
    return {"site": name, "published": server.published(name), "versions": versions}


@router.post(
    "/radio-maps",
    status_code=201,
    summary="Upload a radio map",
    responses=answer(Uploaded, 201),
    response_model=None,
    openapi_extra={
        "requestBody": {
            "required": True,
            "content": {"application/octet-stream": {"schema": {"type": "string", "format": "binary"}}},
        }
    },
)
async def add_radio_map(
    request: Request, surveyor: Surveyor, site: str = "", note: Annotated[str, Query(max_length=200)] = ""
) -> dict[str, Any]:
    """The file that `wayfuse survey build` writes, as the whole body; it is checked, kept, and not yet published."""
    server = server_of(request)
    name = site_of(server, surveyor, site)
    archive = await read_body(request, server.settings.max_upload_bytes)
    printable = "".join(c for c in note if c.isprintable())
    world = server.worlds[name]
    version = await run_in_threadpool(server.add_radio_map, world.site, archive, surveyor.id, printable)
    return {"site": name, "version": version}


@router.post(
    "/radio-maps/publish", summary="Put a version to use", responses=answer(InUse), response_model=None
)
def publish(request: Request, surveyor: Surveyor, wanted: Publication, site: str = "") -> dict[str, Any]:
    """Tracks that begin from now on go by it; those under way keep theirs."""
    server = server_of(request)
    name = site_of(server, surveyor, site)
    server.publish(name, wanted.version, surveyor.id)
    return {"site": name, "published": wanted.version}


@router.post(
    "/radio-maps/roll-back",
    summary="Put the version before to use",
    responses=answer(InUse),
    response_model=None,
)
def roll_back(request: Request, surveyor: Surveyor, site: str = "") -> dict[str, Any]:
    """The one that was in use before the present one came."""
    server = server_of(request)
    name = site_of(server, surveyor, site)
    return {"site": name, "published": server.roll_back(name, surveyor.id)}


@router.get("/audit", summary="Who did what", responses=answer(Audit), response_model=None)
def audit(
    request: Request, admin: Admin, limit: Annotated[int, Query(ge=1, le=1000)] = 100
) -> dict[str, Any]:
    """Newest first."""
    check_all_sites(admin)
    return {"audit": [row._asdict() for row in server_of(request).audit.newest(limit)]}


def _pseudonyms(server: Server, name: str) -> list[str]:
    """Under what a phone may be kept: of its name, and the name itself where it is a pseudonym already."""
    return [server.pseudonyms.device(name), *([name] if _PSEUDONYM.fullmatch(name) else [])]


def _token(token: Token) -> dict[str, Any]:
    return {**token._asdict(), "scopes": sorted(token.scopes)}
