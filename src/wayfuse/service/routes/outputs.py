"""Positions and tracks, asked for."""

from __future__ import annotations

import math
import re
from typing import Annotated, Any, Literal

from fastapi import APIRouter, Depends, Query, Request
from fastapi.responses import FileResponse, Response

from wayfuse.service.access import SCHEME, Reader, allowed, server_of, site_of
from wayfuse.service.export import to_csv, to_gpx, to_mf_json
from wayfuse.service.history import estimates_of
from wayfuse.service.live import Look, View
from wayfuse.service.observations import write_observations
from wayfuse.service.positions import collection, feature
from wayfuse.service.problems import Problem, responses
from wayfuse.service.routes.answers import Position, Positions, Sites, Tracks, TrackSummary, answer
from wayfuse.service.routes.sent_file import sent_file
from wayfuse.service.server import Server
from wayfuse.service.world import World
from wayfuse.storage.tokens import Token
from wayfuse.storage.tracks import TrackRow

__all__ = ["router"]

router = APIRouter(
    prefix="/api/v1", tags=["out"], dependencies=[Depends(SCHEME)], responses=responses(401, 403, 422, 429)
)

Administrator = Annotated[Token, Depends(allowed("admin"))]
Site = Annotated[str, Query(max_length=200, description="Of this site alone.")]
Time = Annotated[float | None, Query(description="s, of the phone's clock.", allow_inf_nan=False)]
_MOST = 10_000
_TRACK = re.compile("[0-9a-f]{16}")  # databases refuse some characters
_MEDIA = {"csv": "text/csv; charset=utf-8", "gpx": "application/gpx+xml", "mf-json": "application/geo+json"}
_KIND = {"csv": "string", "gpx": "string", "mf-json": "object"}  # of a body, to JSON Schema
_PARQUET = "application/vnd.apache.parquet"
_WRITERS = {"gpx": to_gpx, "mf-json": to_mf_json}


@router.get("/sites", summary="Sites that are served", responses=answer(Sites), response_model=None)
def sites(request: Request, token: Reader) -> dict[str, Any]:
    """Names, levels, versions of the radio maps, and how many anchors there are."""
    server = server_of(request)
    seen = [world for name, world in list(server.worlds.items()) if token.site in {"", name}]
    return {"sites": [_site(server, world) for world in seen]}


def _site(server: Server, world: World) -> dict[str, Any]:
    name = world.site.name
    anchors = world.anchors(server.anchors.version(name))
    return {
        "name": name,
        "levels": list(world.site.floor_names),
        "radio_map": server.published(name),
        "tracks": len(server.live.views(name)),
        "anchors": 0 if anchors is None else len(anchors.places),
        "channel_anchors": 0 if anchors is None else len(anchors.modelled),
    }


@router.get("/positions", summary="Where everybody is", responses=answer(Positions), response_model=None)
def positions(request: Request, token: Reader, site: Site = "") -> dict[str, Any]:
    """GeoJSON of the latest position of every track in memory."""
    server = server_of(request)
    wanted = _wanted(server, token, site)
    features = [f for v in server.live.views(wanted) if (f := server.feature(v)) is not None]
    return {**collection(features), "seq": _applied(server)}


@router.get("/tracks", summary="Tracks, the last heard first", responses=answer(Tracks), response_model=None)
def tracks(
    request: Request,
    token: Reader,
    site: Site = "",
    device: Annotated[str, Query(max_length=200, description="Pseudonym of a phone.")] = "",
    limit: Annotated[int, Query(ge=1, le=_MOST)] = 100,
) -> dict[str, Any]:
    """Tracks that are kept, live ones and older ones, with the counters of those that are live."""
    server = server_of(request)
    wanted = _wanted(server, token, site)
    views = {v.row.track: v for v in server.live.views(wanted)}
    kept = server.tracks.newest(limit=None if device else limit, site=wanted)
    rows = {r.track: r for r in kept} | {k: v.row for k, v in views.items()}
    of = [r for r in rows.values() if not device or r.device == device]
    newest = sorted(of, key=lambda r: (-r.heard, r.track))[:limit]
    return {"tracks": [_summary(r, views.get(r.track), is_live=r.track in views) for r in newest]}


@router.get(
    "/tracks/{track}",
    summary="One track, with its counters",
    responses=responses(404) | answer(TrackSummary),
    response_model=None,
)
def track(request: Request, token: Reader, track: str) -> dict[str, Any]:
    """What is known of a track besides its places."""
    look = _look(server_of(request), token, track)
    return _summary(look.view.row, look.view, is_live=look.is_live)


@router.get(
    "/tracks/{track}/position",
    summary="Where somebody is",
    responses=responses(404) | answer(Position),
    response_model=None,
)
def position(request: Request, token: Reader, track: str) -> dict[str, Any]:
    """GeoJSON of the latest position."""
    server = server_of(request)
    found = server.feature(_look(server, token, track).view)
    if found is None:
        raise Problem(404, "no position yet", "post a Wi-Fi scan first")
    return found


@router.get(
    "/tracks/{track}/estimates",
    summary="Where somebody was",
    responses=responses(404) | answer(Positions),
    response_model=None,
)
def estimates(
    request: Request,
    token: Reader,
    track: str,
    since: Time = None,
    until: Time = None,
    limit: Annotated[int, Query(ge=1, le=_MOST)] = _MOST,
) -> dict[str, Any]:
    """GeoJSON of the estimates of a span of time, in order; the newest ``limit`` of them."""
    server = server_of(request)
    look = _look(server, token, track)
    numbered = estimates_of(server, look, since, until)[-limit:]
    site = server.worlds[look.view.row.site].site
    return collection(feature(site, e, {"track": track, "n": n}) for n, e in numbered)


@router.get(
    "/tracks/{track}/export",
    summary="A track as a file",
    response_class=Response,
    responses=responses(404)
    | {200: {"content": {media: {"schema": {"type": _KIND[name]}} for name, media in _MEDIA.items()}}},
)
def export(
    request: Request,
    token: Reader,
    track: str,
    format: Literal["csv", "gpx", "mf-json"] = "csv",  # noqa: A002 (a word of the address)
    since: Time = None,
    until: Time = None,
) -> Response:
    """CSV with everything, GPX 1.1, or OGC MF-JSON."""
    server = server_of(request)
    look = _look(server, token, track)
    row = look.view.row
    site = server.worlds[row.site].site
    said = [e for _, e in estimates_of(server, look, since, until)]
    text = to_csv(site, said) if format == "csv" else _WRITERS[format](site, said, track)
    headers = {"Content-Disposition": f'attachment; filename="{row.track}.{format.replace("-", ".")}"'}
    return Response(text, media_type=_MEDIA[format], headers=headers)


@router.get(
    "/tracks/{track}/observations",
    summary="What a track's phone sent, as Parquet",
    response_class=FileResponse,
    responses=responses(404)
    | {200: {"content": {_PARQUET: {"schema": {"type": "string", "format": "binary"}}}}},
)
def observations(request: Request, token: Administrator, track: str) -> FileResponse:
    """A row per record of what the log still has of the track."""
    server = server_of(request)
    _look(server, token, track)
    answer = sent_file(
        lambda path: write_observations(server.log.read(track=track), path), _PARQUET, f"{track}.parquet"
    )
    server.audit.add(server.clock(), token.id, "export observations", track)
    return answer


def _wanted(server: Server, token: Token, site: str) -> str:
    """The site that is asked for; empty for all."""
    return site_of(server, token, site) if site or token.site else ""


def _look(server: Server, token: Token, track: str) -> Look:
    look = server.live.look(track) if _TRACK.fullmatch(track) else None
    if look is None or look.view.row.site not in server.worlds or token.site not in {"", look.view.row.site}:
        raise Problem(404, "no such track", "list them at /api/v1/tracks")
    return look


def _summary(row: TrackRow, view: View | None, *, is_live: bool) -> dict[str, Any]:
    out: dict[str, Any] = row._asdict()
    out["is_live"] = is_live
    if view is not None:
        out |= {"is_ended": view.is_ended, "estimates": view.number + 1, "counts": dict(view.counts)}
        out["clock_ahead_s"] = view.ahead if math.isfinite(view.ahead) else None
    return out


def _applied(server: Server) -> int:
    return server.pipeline.applied if server.pipeline is not None else 0
