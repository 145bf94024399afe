"""Changes as they come: Server-Sent Events with resume, and a WebSocket that also takes envelopes."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from contextlib import suppress
from typing import Annotated, Any

import msgspec
from fastapi import APIRouter, Depends, Header, Query, Request, WebSocket
from fastapi.concurrency import run_in_threadpool
from fastapi.responses import StreamingResponse
from starlette.websockets import WebSocketDisconnect

from wayfuse.core.errors import WayfuseError
from wayfuse.service.access import SCHEME, allowed, server_of, site_of
from wayfuse.service.events import Event
from wayfuse.service.ingest import ingest
from wayfuse.service.message import Profile
from wayfuse.service.problems import Problem, responses
from wayfuse.service.server import Server
from wayfuse.storage.tokens import Token

__all__ = ["router"]

router = APIRouter(prefix="/api/v1", tags=["out"])

_BEAT_S = 15.0  # proxies close what is silent for longer
_HELLO_S = 10.0  # for a WebSocket to say who it is
_NUMBER = "^[0-9]{0,18}$"
_EVENT = {"type": "object", "properties": {name: {"type": "string"} for name in ("id", "event", "data")}}
_POLICY, _BUSY = 1008, 1013  # codes a WebSocket is closed with


@router.get(
    "/events",
    summary="Positions as they change (Server-Sent Events)",
    response_class=StreamingResponse,
    dependencies=[Depends(SCHEME)],
    responses=responses(401, 403, 422, 429) | {200: {"content": {"text/event-stream": {"schema": _EVENT}}}},
)
async def events(
    request: Request,
    token: Annotated[Token, Depends(allowed("read"))],
    site: Annotated[str, Query(max_length=200)] = "",
    track: Annotated[str, Query(max_length=200)] = "",
    once: Annotated[bool, Query(description="End after what is there already.")] = False,
    last_event_id: Annotated[str, Header(pattern=_NUMBER)] = "",
) -> StreamingResponse:
    """``position`` events; their id is the place in the log of the batch that caused them. Before them come ``zone``
    events: rooms and geofences that the batch made somebody enter or leave.

    A client that sends Last-Event-ID gets what it missed. Where that is no longer known, or at the first time, it gets
    a ``snapshot`` event with everybody's latest position instead.
    """
    server = server_of(request)
    wanted = site_of(server, token, site) if site or token.site else ""
    last = int(last_event_id) if last_event_id else None
    return StreamingResponse(
        _lines(server, wanted, track, last, once=once),
        media_type="text/event-stream",
        headers={"X-Accel-Buffering": "no"},
    )


async def _lines(
    server: Server, site: str, track: str, last: int | None, *, once: bool
) -> AsyncIterator[bytes]:
    hub = server.hub
    if last is None or not hub.holds_after(last):
        last = hub.last  # events after it may be in the snapshot too: then they say the same again
        body = await run_in_threadpool(_snapshot, server, site, track)
        yield f"id: {last}\nevent: snapshot\ndata: ".encode() + body + b"\n\n"
    if once:
        yield _block(hub.held_after(last), site, track)
        return
    clock = asyncio.get_running_loop().time
    spoke = clock()
    async for some in hub.after(last, _BEAT_S):
        block = _block(some, site, track)
        # who asks for one track is not told of all others, and yet hears that the server is there
        if block or not some or clock() - spoke >= _BEAT_S:
            spoke = clock()
            yield block or b": still here\n\n"


def _snapshot(server: Server, site: str, track: str) -> bytes:
    views = [v for v in server.live.views(site) if track in {"", v.row.track}]
    return msgspec.json.encode([f for v in views if (f := server.feature(v)) is not None])


def _block(events: list[Event], site: str, track: str) -> bytes:
    return b"".join(_line(e) for e in events if _is_wanted(e, site, track))


def _line(event: Event) -> bytes:
    # the position comes last of its batch and has the id: who resumes in between gets all of the batch
    number = f"id: {event.id}\n" if event.kind == "position" else ""
    return f"{number}event: {event.kind}\ndata: ".encode() + event.data + b"\n\n"


def _is_wanted(event: Event, site: str, track: str) -> bool:
    return site in {"", event.site} and track in {"", event.track}


class _Hello(msgspec.Struct, frozen=True):
    token: str
    site: str = ""
    track: str = ""
    last: int | None = None
    listen: bool = True


@router.websocket("/ws")
async def talk(socket: WebSocket) -> None:
    """First message: ``{"token": ..., "site": ..., "last": ...}``; then envelopes in (each answered), positions out."""
    await socket.accept()
    server: Server = socket.app.state.server
    client = socket.client.host if socket.client is not None else ""
    with suppress(WebSocketDisconnect):
        try:
            async with asyncio.timeout(_HELLO_S):
                hello = msgspec.json.decode(await _received(socket, server), type=_Hello)
            scope = "read" if hello.listen else "ingest"
            token = await server.authority.token(hello.token, scope, hello.site, client)
            site = site_of(server, token, hello.site) if hello.site or token.site else ""
        except (
            TimeoutError,
            msgspec.DecodeError,
            UnicodeDecodeError,
            RecursionError,
            Problem,
            WayfuseError,
        ) as no:
            await socket.close(_POLICY, str(no)[:100] or "no greeting")
            return
        tasks = [asyncio.create_task(_listen(socket, server, hello, client))]
        if hello.listen:
            tasks.append(asyncio.create_task(_tell(socket, server, site, hello)))
        try:
            await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
        finally:
            for task in tasks:
                task.cancel()
            await asyncio.wait(tasks)  # not gather: that would put the tasks' cancellation for our own
        for task in tasks:
            if not task.cancelled():
                task.result()
        with suppress(RuntimeError):  # closed by the other side already
            await socket.close(_BUSY)


async def _received(socket: WebSocket, server: Server) -> bytes:
    message = await socket.receive()
    if message["type"] == "websocket.disconnect":
        raise WebSocketDisconnect(message.get("code", 1000))
    body = message.get("bytes")
    if body is None:
        body = (message.get("text") or "").encode("utf-8", "replace")
    if len(body) > server.settings.max_body_bytes:
        raise WebSocketDisconnect(1009)
    return bytes(body)


async def _listen(socket: WebSocket, server: Server, hello: _Hello, client: str) -> None:
    """Take envelopes until the other side goes."""
    while True:
        body = await _received(socket, server)
        answer: dict[str, Any]
        try:
            token = await server.authority.token(hello.token, "ingest", hello.site, client)
            site = site_of(server, token, hello.site)
            accepted = await ingest(server, site, "own", body, Profile("", hello.track))
            answer = {"type": "accepted", "accepted": [a._asdict() for a in accepted]}
        except Problem as no:
            answer = {"type": "refused", "error": no.error, "remedy": no.remedy}
        except WayfuseError as no:
            answer = {"type": "refused", "error": str(no.what), "remedy": no.remedy}
        await socket.send_text(msgspec.json.encode(answer).decode())


async def _tell(socket: WebSocket, server: Server, site: str, hello: _Hello) -> None:
    """Send positions until the ring has moved on."""
    hub, last = server.hub, hello.last
    if last is None or not hub.holds_after(last):
        last = hub.last
        body = await run_in_threadpool(_snapshot, server, site, hello.track)
        await socket.send_text(f'{{"type":"snapshot","id":{last},"features":{body.decode()}}}')
    async for some in hub.after(last, _BEAT_S):
        for e in some:
            if _is_wanted(e, site, hello.track):
                await socket.send_text(f'{{"type":"{e.kind}","id":{e.id},"data":{e.data.decode()}}}')
