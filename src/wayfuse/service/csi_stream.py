"""Streams of channel state over TCP: a line that says who sends, then the CSI Tool's records, without an end."""

from __future__ import annotations

import asyncio
import logging
from contextlib import suppress
from typing import NamedTuple

from wayfuse.core.errors import UsageError, WayfuseError
from wayfuse.service.adapters.intel5300 import intel5300_body
from wayfuse.service.identity import is_random_address
from wayfuse.service.ingest import ingest, the_site
from wayfuse.service.message import BadBodyError, Profile
from wayfuse.service.pipeline import BusyError
from wayfuse.service.problems import Problem
from wayfuse.service.server import Server

__all__ = ["listen_for_csi"]

_log = logging.getLogger(__name__)
_HELLO_S, _HELLO_BYTES = 10.0, 1024
_BATCH_S, _BATCH_BYTES = 0.5, 128_000  # what is gathered before it goes to the log
_IDLE_S = 300.0  # until a silent stream is closed
_RETRY_S = 1.0
_TOO_OFTEN = 429


class _Sender(NamedTuple):
    token: str
    anchor: str
    target: str
    site: str
    client: str


async def listen_for_csi(server: Server) -> asyncio.Server:
    """Listen on the setting's port.

    Raises
    ------
    UsageError : it cannot be listened on.
    """

    async def serve(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        client = str((writer.get_extra_info("peername") or ("",))[0])
        try:
            sender = await _greeted(server, reader, client)
            writer.write(b"ok\n")
            await _take_all(server, reader, sender)
        except Problem as no:
            writer.write(f"refused: {no.error}\n".encode())
        except WayfuseError as no:
            writer.write(f"refused: {no.what}\n".encode())
        except (TimeoutError, ConnectionError, ValueError, asyncio.IncompleteReadError) as error:
            _log.debug("a stream of channel state ends: %s", type(error).__name__)
        finally:
            with suppress(ConnectionError):
                writer.close()
                await writer.wait_closed()

    settings = server.settings
    try:
        return await asyncio.start_server(serve, settings.host, settings.csi_port, limit=2 * _BATCH_BYTES)
    except OSError as error:
        raise UsageError(f"cannot listen: {error.strerror or error}", where="csi_port") from error


async def _greeted(server: Server, reader: asyncio.StreamReader, client: str) -> _Sender:
    """Who sends: the first line."""
    async with asyncio.timeout(_HELLO_S):
        line = await reader.readuntil(b"\n")
    words = line[:_HELLO_BYTES].decode("utf-8", "replace").split()
    if not 3 <= len(words) <= 4:
        raise BadBodyError("the first line is to be: TOKEN ANCHOR TARGET")
    token, anchor, target, *site = words
    sender = _Sender(token, anchor, target, "".join(site), client)
    await _may(server, sender)
    intel5300_body(anchor, target, b"")
    if is_random_address(target):
        raise BadBodyError("a random address is nobody's identity")
    return sender


async def _may(server: Server, sender: _Sender) -> str:
    """The site that a sender may send to, now."""
    found = await server.authority.token(sender.token, "ingest", sender.site, sender.client)
    site = the_site(server, sender.site, found.site)
    if found.site not in {"", site}:
        raise Problem(403, "this token is of another site")
    return site


async def _take_all(server: Server, reader: asyncio.StreamReader, sender: _Sender) -> None:
    """Records until the other side ends; a batch at a time, and none is read before the one before is in the log."""
    loop = asyncio.get_running_loop()
    is_open = True
    while is_open:
        records, until = bytearray(), loop.time() + _IDLE_S
        while len(records) < _BATCH_BYTES:
            try:
                record = await _record(reader, until)
            except asyncio.IncompleteReadError:
                is_open = False
                break
            if not record:
                is_open = bool(records)  # silent for long, or the batch is full in time
                break
            if not records:
                until = loop.time() + _BATCH_S
            records += record
        if records:
            await _keep(server, sender, bytes(records))


async def _record(reader: asyncio.StreamReader, until: float) -> bytes:
    """A record with its length before it; empty where none has begun until then."""
    try:
        async with asyncio.timeout_at(until):
            head = await reader.readexactly(2)
    except TimeoutError:
        return b""
    size = int.from_bytes(head, "big")
    if size == 0:
        raise BadBodyError("a record of no length")
    async with asyncio.timeout(_IDLE_S):
        return head + await reader.readexactly(size)


async def _keep(server: Server, sender: _Sender, records: bytes) -> None:
    body = intel5300_body(sender.anchor, sender.target, records)
    while True:
        try:
            await ingest(server, await _may(server, sender), "intel5300", body, Profile())
        except BusyError:
            await asyncio.sleep(_RETRY_S)
        except Problem as no:
            if no.status != _TOO_OFTEN:
                raise
            await asyncio.sleep(_RETRY_S)
        else:
            return
