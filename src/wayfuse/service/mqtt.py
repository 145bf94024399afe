"""MQTT: a connection to a broker that is made again whenever it is lost; bodies in, events out.

A batch that comes over MQTT goes the way of all others. There is no answer to it: what is refused is counted in the
metrics. Who may send and listen is the broker's to say; give it an access list.
"""

from __future__ import annotations

import asyncio
import logging
import ssl

import aiomqtt
from sqlalchemy.exc import SQLAlchemyError

from wayfuse.core.errors import WayfuseError
from wayfuse.service.events import Event
from wayfuse.service.ingest import ingest, the_site
from wayfuse.service.mqtt_topics import (
    Broker,
    Outbound,
    broker_of,
    discovery,
    inbound,
    outbound,
    subscriptions,
)
from wayfuse.service.server import Server

__all__ = ["keep_connected"]

_log = logging.getLogger(__name__)
_RETRY_S = (0.5, 30.0)  # first and longest wait before the broker is tried again
_AT_ONCE = 64  # batches under way
_BEAT_S = 15.0
_DEVICES = 10_000  # announced to Home Assistant and remembered


async def keep_connected(server: Server) -> None:
    """Be connected until cancelled, or until the server ends: a connection that breaks just then hides the first."""
    broker, wait = broker_of(server.settings.mqtt), _RETRY_S[0]
    while not server.is_ending:
        try:
            async with _client(broker, server.settings.mqtt_prefix) as client:
                wait = _RETRY_S[0]
                await _talk(client, server)
        except* aiomqtt.MqttError as errors:
            _log.warning("no connection to the MQTT broker: %s", errors.exceptions[0])
        if not server.is_ending:
            await asyncio.sleep(wait)
        wait = min(2.0 * wait, _RETRY_S[1])


def _client(broker: Broker, prefix: str) -> aiomqtt.Client:
    return aiomqtt.Client(
        broker.host,
        broker.port,
        username=broker.user,
        password=broker.password,
        tls_context=ssl.create_default_context() if broker.is_tls else None,
        will=aiomqtt.Will(f"{prefix}/status", "offline", qos=1, retain=True),
    )


async def _talk(client: aiomqtt.Client, server: Server) -> None:
    prefix = server.settings.mqtt_prefix
    await client.publish(f"{prefix}/status", "online", qos=1, retain=True)
    async with asyncio.TaskGroup() as tasks:
        tasks.create_task(_listen(client, server))
        tasks.create_task(_tell(client, server))


async def _listen(client: aiomqtt.Client, server: Server) -> None:
    """Take bodies, some at once, begun in the order in which they came."""
    for topic in subscriptions(server.settings.mqtt_prefix):
        await client.subscribe(topic, qos=1)
    free = asyncio.Semaphore(_AT_ONCE)
    async with asyncio.TaskGroup() as tasks:
        async for message in client.messages:
            await free.acquire()
            task = tasks.create_task(_take(server, str(message.topic), message.payload))
            task.add_done_callback(lambda _: free.release())


async def _take(server: Server, topic: str, payload: object) -> None:
    if not isinstance(payload, bytes) or len(payload) > server.settings.max_body_bytes:
        server.metrics.bodies.labels("mqtt", "refused").inc()
        return
    try:
        found = inbound(server.settings.mqtt_prefix, topic, payload)
        if found is not None:
            site = the_site(server, found.site)
            await ingest(server, site, found.adapter, found.body, found.profile)
    except (WayfuseError, SQLAlchemyError) as error:
        server.metrics.bodies.labels("mqtt", "refused").inc()
        _log.debug("a message on %s is left out: %s", topic, error)


async def _tell(client: aiomqtt.Client, server: Server) -> None:
    """Publish events; where they come faster than the broker takes them, some are left out."""
    known: dict[str, None] = {}
    while not server.is_ending:  # an event that comes as the task is cancelled can hide that from Python 3.11
        async for some in server.hub.after(server.hub.last, _BEAT_S):
            for event in some:
                for message in _messages(server, event, known):
                    await client.publish(message.topic, message.body, retain=message.is_kept)
        await asyncio.sleep(_RETRY_S[0])  # the ring has moved on, or the server is going down


def _messages(server: Server, event: Event, known: dict[str, None]) -> list[Outbound]:
    settings = server.settings
    out = list(outbound(settings.mqtt_prefix, event))
    device = next((m.topic.rpartition("/")[2] for m in out if "/room/" in m.topic), "")
    if device and settings.mqtt_discovery and device not in known:
        known[device] = None
        if len(known) > _DEVICES:
            del known[next(iter(known))]
        out = [*discovery(settings.mqtt_prefix, settings.mqtt_discovery, event.site, device), *out]
    return out
