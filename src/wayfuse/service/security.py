"""Who may do what: bearer tokens, looked up and remembered for seconds; and the headers of every answer."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Mapping
from types import MappingProxyType

from fastapi import Request
from fastapi.concurrency import run_in_threadpool
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from wayfuse.service.limits import RateLimit
from wayfuse.service.problems import Problem
from wayfuse.storage.tokens import Token, TokenStore

__all__ = ["HEADERS", "Authority", "SecurityHeaders", "bearer"]

_REMEMBERED_S = 5.0  # a revoked token works for so long
_CACHE = 10_000
_GUESSES = (2.0, 20)  # wrong tokens per second and address, and at once

# one page, its own scripts and styles, data from here alone; nobody frames it; nothing of it is cached by others
HEADERS: Mapping[str, str] = MappingProxyType(
    {
        "Content-Security-Policy": "; ".join(
            (
                "default-src 'none'",
                "script-src 'self'",
                "style-src 'self'",
                "img-src 'self' data: blob:",
                "connect-src 'self'",
                "font-src 'self'",
                "worker-src 'self'",
                "manifest-src 'self'",
                "base-uri 'none'",
                "form-action 'none'",
                "frame-ancestors 'none'",
            )
        ),
        "X-Content-Type-Options": "nosniff",
        "Referrer-Policy": "no-referrer",
        "Cross-Origin-Resource-Policy": "same-origin",
        "Cache-Control": "no-store",
    }
)

# browsers leave it out, with a warning on their console, where the page came unencrypted from another machine
_OPENER_POLICY = (b"cross-origin-opener-policy", b"same-origin")
_LOOPBACK = (b"localhost", b"127.0.0.1", b"[::1]")


class SecurityHeaders:
    """ASGI middleware: the headers on every answer, also those of errors, unless a route gave its own."""

    def __init__(self, app: ASGIApp) -> None:
        self._app = app
        self._headers = [(k.lower().encode(), v.encode()) for k, v in HEADERS.items()]

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve one request."""
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        wanted = [*self._headers, _OPENER_POLICY] if _is_trusted(scope) else self._headers

        async def sent(message: Message) -> None:
            if message["type"] == "http.response.start":
                given = list(message.get("headers", ()))
                names = {name for name, _ in given}
                message["headers"] = given + [h for h in wanted if h[0] not in names]
            await send(message)

        await self._app(scope, receive, sent)


def _is_trusted(scope: Scope) -> bool:
    """Whether a browser trusts the way of a request: encrypted, also by a proxy before us, or of this machine."""
    headers = dict(scope["headers"])
    is_encrypted = scope["scheme"] == "https" or headers.get(b"x-forwarded-proto") == b"https"
    host: bytes = headers.get(b"host", b"")
    return is_encrypted or any(host == name or host.startswith(name + b":") for name in _LOOPBACK)


class Authority:
    """Checks tokens; ``clock`` gives Unix s."""

    def __init__(self, store: TokenStore, limit: RateLimit, clock: Callable[[], float]) -> None:
        self._store, self._limit, self._clock = store, limit, clock
        self._guesses = RateLimit(*_GUESSES, clock)
        self._known: OrderedDict[str, tuple[float, Token]] = OrderedDict()

    async def token(self, text: str, scope: str, site: str, client: str) -> Token:
        """The token of a text, for a scope (empty: any) at a site.

        Raises
        ------
        Problem : 401 it is none, 403 it may not, 429 too often.
        """
        now = self._clock()
        kept = self._known.get(text)
        if kept is not None and kept[0] > now and (kept[1].expires is None or kept[1].expires > now):
            found: Token | None = kept[1]
        else:
            found = await self._looked_up(text, client, now)
        if found is None:
            raise Problem(
                401,
                "no valid token",
                "send 'Authorization: Bearer TOKEN'",
                {"WWW-Authenticate": "Bearer"},
            )
        wait = self._limit.wait(found.id)
        if wait > 0.0:
            raise Problem(
                429, "too many requests", "send fewer, or larger ones", {"Retry-After": f"{wait:.0f}"}
            )
        if scope and not found.allows(scope, site):
            raise Problem(403, f"this token may not {scope} here", "ask the operator for one that may")
        return found

    async def _looked_up(self, text: str, client: str, now: float) -> Token | None:
        found = await run_in_threadpool(self._store.verify, text, now) if text else None
        self._known.pop(text, None)
        if found is not None:
            self._known[text] = (now + _REMEMBERED_S, found)
            while len(self._known) > _CACHE:
                self._known.popitem(last=False)
        elif self._guesses.wait(client) > 0.0:
            raise Problem(429, "too many wrong tokens", "wait a minute", {"Retry-After": "60"})
        return found

    def forget(self) -> None:
        """Look every token up again: one was revoked."""
        self._known.clear()


def bearer(request: Request) -> str:
    """The token of a request's header; empty where there is none."""
    kind, _, text = request.headers.get("authorization", "").partition(" ")
    return text.strip() if kind.lower() == "bearer" else ""
