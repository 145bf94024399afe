"""What routes need of a request: the server, the token, the site."""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from typing import Annotated

from fastapi import Depends, Query, Request
from fastapi.security import HTTPBearer

from wayfuse.service.ingest import the_site
from wayfuse.service.problems import Problem
from wayfuse.service.security import bearer
from wayfuse.service.server import Server
from wayfuse.storage.tokens import Token

__all__ = [
    "SCHEME",
    "Admin",
    "Reader",
    "SiteName",
    "Surveyor",
    "allowed",
    "check_all_sites",
    "client_of",
    "server_of",
    "site_of",
]

# describes the scheme in OpenAPI; the check itself is `allowed`
SCHEME = HTTPBearer(auto_error=False, description="A token: `Authorization: Bearer wf_...`")


def server_of(request: Request) -> Server:
    """The server of an application."""
    server: Server = request.app.state.server
    return server


def client_of(request: Request) -> str:
    """The address a request came from."""
    return request.client.host if request.client is not None else ""


def allowed(scope: str) -> Callable[[Request], Awaitable[Token]]:
    """A dependency: the request's token, which must have a scope."""

    async def check(request: Request) -> Token:
        site = request.query_params.get("site", "")
        return await server_of(request).authority.token(bearer(request), scope, site, client_of(request))

    return check


Reader = Annotated[Token, Depends(allowed("read"))]
Surveyor = Annotated[Token, Depends(allowed("survey"))]
Admin = Annotated[Token, Depends(allowed("admin"))]
SiteName = Annotated[
    str, Query(max_length=200, description="Name of the site; not needed where there is one.")
]


def check_all_sites(token: Token) -> None:
    """Refuse a token of one site what concerns all of them.

    Raises
    ------
    Problem : 403, it is one.
    """
    if token.site:
        raise Problem(403, "this token is of one site alone", "ask for one of all sites")


def site_of(server: Server, token: Token, site: str) -> str:
    """The site a request means: named, that of its token, or the only one.

    Raises
    ------
    Problem : 403, the token is of another site.
    UsageError : there is no such site, or several to choose from.
    """
    found = the_site(server, site, token.site)
    if token.site and token.site != found:
        raise Problem(403, "this token is of another site", "ask the operator for one of this site")
    return found
