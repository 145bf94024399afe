"""Files of the page that are built rather than written: the map library and its licences."""

from __future__ import annotations

import re
from pathlib import Path

from fastapi import APIRouter
from fastapi.responses import FileResponse

from wayfuse.service.problems import Problem

__all__ = ["ASSETS", "router"]

router = APIRouter()

ASSETS = Path(__file__).parent.parent / "web" / "assets"
_NAME = re.compile(r"[\w-]+(?:\.[\w-]+)+")
_TYPES = {
    ".mjs": "text/javascript; charset=utf-8",
    ".css": "text/css; charset=utf-8",
    ".txt": "text/plain; charset=utf-8",
}


@router.get("/web/assets/{name}", include_in_schema=False)
def asset(name: str) -> FileResponse:
    """A built file; 404 where nothing was built, upon which the page says how to build it."""
    path = ASSETS / name
    if not _NAME.fullmatch(name) or path.suffix not in _TYPES or not path.is_file():
        raise Problem(404, "no such file", "build the page: make web")
    return FileResponse(path, media_type=_TYPES[path.suffix])
