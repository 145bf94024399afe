"""Sites brought in and taken away while the server works."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from fastapi import APIRouter, Depends, Query, Request
from fastapi.concurrency import run_in_threadpool

from wayfuse.service.access import SCHEME, Admin, check_all_sites, server_of
from wayfuse.service.limits import read_body
from wayfuse.service.problems import responses
from wayfuse.service.routes.answers import answer
from wayfuse.service.routes.answers_admin import ImportedSite, Removed
from wayfuse.service.site_changes import add_site, remove_site
from wayfuse.service.uploaded_sites import read_upload

__all__ = ["router"]

router = APIRouter(
    prefix="/api/v1/sites",
    tags=["administration"],
    dependencies=[Depends(SCHEME)],
    responses=responses(400, 401, 403, 404, 408, 409, 413, 415, 422, 429, 503),
)

Format = Literal["hcu", "image", "imdf", "ipin2023", "ms-indoor", "osm", "simpleloc", "wayfuse"]
_BODY = {
    "requestBody": {
        "required": True,
        "content": {"application/octet-stream": {"schema": {"type": "string", "format": "binary"}}},
    }
}


@router.post(
    "",
    status_code=201,
    summary="Import a site",
    openapi_extra=_BODY,
    responses=answer(ImportedSite, 201),
    response_model=None,
)
async def upload(
    request: Request,
    admin: Admin,
    plan_format: Annotated[Format, Query(alias="format", description="As of `wayfuse site import`.")],
    file: Annotated[str, Query(max_length=200, description="Its name; the ending may matter.")] = "",
    name: Annotated[str, Query(max_length=200, description="Of the site, instead of its own.")] = "",
    replace: Annotated[bool, Query(description="A site of this name that was imported before.")] = False,
) -> dict[str, Any]:
    """The floor plans as the whole body: the file, or a ZIP archive of the folder, that `wayfuse site import` takes;
    ``wayfuse`` is an archive of a folder that it wrote. The site is served at once, and after a restart.

    Where there was one site and now are two, phones have to say which they mean.
    """
    server = server_of(request)
    check_all_sites(admin)
    body = await read_body(request, server.settings.max_upload_bytes)
    site, said = await run_in_threadpool(read_upload, plan_format, body, file, name)
    await run_in_threadpool(add_site, server, site, admin.id, replace=replace)
    return said


@router.delete("", summary="Take away an imported site", responses=answer(Removed), response_model=None)
def remove(request: Request, admin: Admin, site: Annotated[str, Query(max_length=200)]) -> dict[str, Any]:
    """Its tracks, radio maps and survey stay where they are, and are there again if it is imported again."""
    check_all_sites(admin)
    remove_site(server_of(request), site, admin.id)
    return {"removed": site}
