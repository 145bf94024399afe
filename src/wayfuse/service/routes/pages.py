"""The page, health, and metrics."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

from fastapi import APIRouter, Depends, Request
from fastapi.responses import FileResponse, JSONResponse, Response

from wayfuse.service.access import SCHEME, allowed, server_of
from wayfuse.service.problems import Problem, responses
from wayfuse.service.routes.answers import answer
from wayfuse.service.routes.answers_admin import Health
from wayfuse.storage.tokens import Token

__all__ = ["router"]

router = APIRouter()

_WEB = Path(__file__).parent.parent / "web"
_TYPES = {
    ".html": "text/html; charset=utf-8",
    ".js": "text/javascript; charset=utf-8",
    ".mjs": "text/javascript; charset=utf-8",
    ".css": "text/css; charset=utf-8",
    ".svg": "image/svg+xml",
}


@router.get("/", include_in_schema=False)
def page() -> FileResponse:
    """The page."""
    return FileResponse(_WEB / "index.html", media_type=_TYPES[".html"])


@router.get("/web/{name}", include_in_schema=False)
def file(name: str) -> FileResponse:
    """A file of the page."""
    path = _WEB / name
    if path.parent != _WEB or path.suffix not in _TYPES or not path.is_file():
        raise Problem(404, "no such file")
    return FileResponse(path, media_type=_TYPES[path.suffix])


@router.get(
    "/health",
    summary="Whether the server works",
    tags=["operation"],
    responses=answer(Health) | answer(Health, 503),
    response_model=None,
)
def health(request: Request) -> Response:
    """For load balancers; says nothing of what it serves."""
    pipeline = server_of(request).pipeline
    is_well = pipeline is not None and not pipeline.is_broken
    body: dict[str, Any] = {"status": "ok" if is_well else "broken"}
    if pipeline is not None:
        body |= {"applied": pipeline.applied, "waiting": pipeline.n_waiting}
    return JSONResponse(body, 200 if is_well else 503)


@router.get(
    "/metrics",
    summary="For Prometheus",
    tags=["operation"],
    response_class=Response,
    dependencies=[Depends(SCHEME)],
    responses=responses(401, 403, 429) | {200: {"content": {"text/plain": {"schema": {"type": "string"}}}}},
)
def metrics(request: Request, _: Annotated[Token, Depends(allowed("read"))]) -> Response:
    """Prometheus sends the token as ``authorization: {credentials: ...}``."""
    return Response(server_of(request).metrics.page(), media_type="text/plain; version=0.0.4; charset=utf-8")
