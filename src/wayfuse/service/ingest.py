"""A body that came in, by whatever way: read, named, handed to the pipeline, and answered when it is on the disk."""

from __future__ import annotations

import asyncio
from typing import NamedTuple

import msgspec
from fastapi.concurrency import run_in_threadpool

from wayfuse.core.errors import UsageError
from wayfuse.service.adapters import ADAPTERS
from wayfuse.service.live import profile_json
from wayfuse.service.message import BadBodyError, Message, Profile
from wayfuse.service.pipeline import BusyError, Item
from wayfuse.service.server import Server
from wayfuse.service.world import Basis
from wayfuse.storage.log import Entry

__all__ = ["Accepted", "completed", "ingest", "the_site"]

_LARGE = 200_000  # bytes; what takes longer to read goes to a thread, for others wait meanwhile


class Accepted(NamedTuple):
    """What became of one message: its place in the log, the pseudonym of its track, records, and what was left out."""

    seq: int
    track: str
    records: int
    left_out: dict[str, int]


def the_site(server: Server, *named: str) -> str:
    """The site that is meant: the first that is named, else the only one.

    Raises
    ------
    UsageError : none is named where there are several, or one that is not served.
    """
    name = next((n for n in named if n), "")
    if not name and len(server.worlds) == 1:
        return next(iter(server.worlds))
    if name not in server.worlds:
        said = f"no site {name[:100]!r}" if name else "which site?"
        raise UsageError(said, remedy="add ?site=NAME, one of /api/v1/sites")
    return name


async def ingest(server: Server, site: str, adapter: str, body: bytes, profile: Profile) -> list[Accepted]:
    """Take a body; returns when every message of it is in the log.

    Raises
    ------
    BadBodyError : it cannot be read. BusyError : too much waits. UsageError : the site has no radio map yet.
    """
    pipeline = server.pipeline
    if pipeline is None:
        raise BusyError("the server is starting", remedy="send it again in a moment")
    basis = server.in_use(site)
    if basis is None:
        raise UsageError(
            f"site {site} has no radio map yet", remedy="upload and publish one, or say where anchors hang"
        )
    arrived = server.clock()
    profile = await completed(server, adapter, body, profile)
    try:
        if len(body) > _LARGE:
            messages = await run_in_threadpool(ADAPTERS[adapter].read, body, profile, arrived)
        else:
            messages = ADAPTERS[adapter].read(body, profile, arrived)
    except BadBodyError:
        server.metrics.bodies.labels(adapter, "refused").inc()
        raise
    items = [_item(server, site, adapter, m, profile, basis, arrived) for m in messages]
    seqs: list[int] = []
    if items:
        try:
            done: asyncio.Future[list[int]] = asyncio.get_running_loop().create_future()
            pipeline.put(items, done)
            seqs = await done
        except BusyError:
            server.metrics.bodies.labels(adapter, "busy").inc()
            raise
    server.metrics.bodies.labels(adapter, "accepted").inc()
    server.metrics.records.labels(adapter).inc(sum(m.n_records for m in messages))
    return [
        Accepted(seq, item.entry.track, item.message.n_records, dict(item.message.notes))
        for seq, item in zip(seqs, items, strict=True)
    ]


def _item(
    server: Server, site: str, adapter: str, message: Message, profile: Profile, basis: Basis, arrived: float
) -> Item:
    device = server.pseudonyms.device(message.device)
    track = server.pseudonyms.track(site, message.device, message.session)
    kept = profile_json(profile, basis)
    return Item(Entry(0, arrived, site, adapter, device, track, kept, message.body), message)


class _Names(msgspec.Struct, rename="camel"):
    device_id: str = ""


async def completed(server: Server, adapter: str, body: bytes, profile: Profile) -> Profile:
    """The profile with what the phone's enrolment says, where the body's format leaves the platform open."""
    if adapter != "sensor-logger" or profile.platform:
        return profile
    try:
        name = msgspec.json.decode(body, type=_Names).device_id
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError):
        return profile  # the adapter will say what is wrong
    device = await run_in_threadpool(server.devices.get, server.pseudonyms.device(name))
    if device is None:
        return profile
    return profile._replace(platform=device.platform, standardised=device.standardised)
