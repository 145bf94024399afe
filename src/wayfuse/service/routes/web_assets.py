"""Files of the page that are built rather than written: the map library and its licences."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Annotated

from fastapi import APIRouter, Header
from fastapi.responses import Response

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
def asset(
    name: str,
    accept_encoding: Annotated[str, Header()] = "",
    if_none_match: Annotated[str, Header()] = "",
) -> Response:
    """A built file, packed where that is understood; 404 where nothing was built, upon which the page says how to.

    Browsers keep it, for it is large, and ask whether it is still the one.
    """
    path = ASSETS / name
    if not _NAME.fullmatch(name) or path.suffix not in _TYPES or not path.is_file():
        raise Problem(404, "no such file", "build the page: make web")
    packed = path.with_name(f"{name}.gz")
    is_packed = "gzip" in accept_encoding and packed.is_file()
    sent = packed if is_packed else path
    said = sent.stat()
    tag = f'"{said.st_size:x}-{said.st_mtime_ns:x}"'
    headers = {"Cache-Control": "no-cache", "ETag": tag, "Vary": "Accept-Encoding"}
    if tag in if_none_match:
        return Response(status_code=304, headers=headers)
    if is_packed:
        headers["Content-Encoding"] = "gzip"
    return Response(sent.read_bytes(), media_type=_TYPES[path.suffix], headers=headers)
