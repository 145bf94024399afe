"""What goes over MQTT, apart from the connection: topics and bodies that come in, and what is published of an event."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple
from urllib.parse import unquote, urlsplit

import msgspec

from wayfuse.core.errors import ConfigError
from wayfuse.service.adapters.espresense import espresense_body
from wayfuse.service.events import Event
from wayfuse.service.message import Profile

__all__ = ["Broker", "Inbound", "Outbound", "broker_of", "discovery", "inbound", "outbound", "subscriptions"]

_ESPRESENSE = "espresense/devices"
_ADAPTERS = ("own", "anchors", "find3")
_PLATFORMS = ("android", "ios")
NOT_IN_A_ROOM = "not_home"  # Home Assistant's word for nowhere known


@dataclass(frozen=True, slots=True)
class Broker:
    """Where a broker is, and who we are to it."""

    host: str
    port: int
    user: str | None
    password: str | None
    is_tls: bool


class Inbound(NamedTuple):
    """A body that came over MQTT. site : empty where the topic does not say."""

    site: str
    adapter: str
    body: bytes
    profile: Profile


class Outbound(NamedTuple):
    """A message to publish. is_kept : the broker gives it to those who subscribe later."""

    topic: str
    body: bytes
    is_kept: bool = False


def broker_of(url: str) -> Broker:
    """The broker of ``mqtt://USER:PASSWORD@HOST:PORT``, or ``mqtts://`` with TLS.

    Raises
    ------
    ConfigError : it is none.
    """
    remedy = "use mqtt://USER:PASSWORD@HOST:PORT, or mqtts:// with TLS"
    try:
        parts = urlsplit(url)
        port = parts.port
    except ValueError:
        raise ConfigError("not the URL of a broker", where="mqtt", remedy=remedy) from None
    if parts.scheme not in {"mqtt", "mqtts"} or not parts.hostname or parts.path not in {"", "/"}:
        raise ConfigError("not the URL of a broker", where="mqtt", remedy=remedy)
    is_tls = parts.scheme == "mqtts"
    user, password = (unquote(p) if p else None for p in (parts.username, parts.password))
    return Broker(parts.hostname, port or (8883 if is_tls else 1883), user, password, is_tls)


def subscriptions(prefix: str) -> tuple[str, ...]:
    """What is listened to."""
    own = (f"{prefix}/in/+/{adapter}" for adapter in _ADAPTERS)
    pushes = (f"{prefix}/in/+/sensor-logger/{platform}" for platform in _PLATFORMS)
    return (*own, *pushes, f"{_ESPRESENSE}/+/+")


def inbound(prefix: str, topic: str, payload: bytes) -> Inbound | None:
    """What came on a topic; None where the topic is none of ours.

    Raises
    ------
    BadBodyError : a node's message that is none.
    """
    match topic.removeprefix(f"{prefix}/in/").split("/"):
        case [site, adapter] if adapter in _ADAPTERS:
            return Inbound(site, adapter, payload, Profile())
        case [site, "sensor-logger", platform] if platform in _PLATFORMS:
            return Inbound(site, "sensor-logger", payload, Profile(platform=platform))
        case ["espresense", "devices", device, node]:
            return Inbound("", "espresense", espresense_body(device, node, payload), Profile())
    return None


def outbound(prefix: str, event: Event) -> Iterator[Outbound]:
    """What is published of an event: itself, and a position also for OwnTracks and Home Assistant."""
    said = msgspec.json.decode(event.data)
    if event.kind == "zone":
        yield Outbound(f"{prefix}/out/{event.site}/zone/{event.track}", event.data)
        return
    feature = said.get("feature")
    if not feature:
        return
    yield Outbound(f"{prefix}/out/{event.site}/position/{event.track}", msgspec.json.encode(feature))
    p, device = feature["properties"], feature["properties"]["device"]
    yield Outbound(f"{prefix}/out/{event.site}/room/{device}", _room(p).encode(), is_kept=True)
    if feature["geometry"] is None:
        return
    lon, lat = feature["geometry"]["coordinates"]
    accuracy = round(p["radius_m_68"]) if p["radius_m_68"] is not None else 0
    attributes = {"latitude": lat, "longitude": lon, "gps_accuracy": accuracy}
    attributes |= {"floor": p["level"], "room": _room(p), "state": p["state"]}
    place = f"{prefix}/out/{event.site}/attributes/{device}"
    yield Outbound(place, msgspec.json.encode(attributes), is_kept=True)
    location = {"_type": "location", "tid": device[:2], "lat": lat, "lon": lon, "acc": accuracy}
    location |= {"tst": int(p["at"] if p["at"] is not None else p["heard"]), "inregions": p["zones"]}
    yield Outbound(f"owntracks/{event.site}/{device}", msgspec.json.encode(location), is_kept=True)


def _room(properties: dict[str, Any]) -> str:
    zones: list[str] = properties["zones"]
    return zones[0] if zones else NOT_IN_A_ROOM


def discovery(prefix: str, home_assistant: str, site: str, device: str) -> tuple[Outbound, Outbound]:
    """What Home Assistant needs to know of a phone, once: a tracker on its map, and a sensor of the room."""
    common = {
        "availability_topic": f"{prefix}/status",
        "device": {
            "identifiers": [f"wayfuse_{device}"],
            "name": f"Phone {device[:6]}",
            "manufacturer": "wayfuse",
        },
    }
    out = f"{prefix}/out/{site}"
    tracker = {
        "unique_id": f"wayfuse_{device}",
        "name": "Position",
        "json_attributes_topic": f"{out}/attributes/{device}",
        "source_type": "gps",  # it takes latitude and longitude of no other kind
    }
    sensor = {"unique_id": f"wayfuse_{device}_room", "name": "Room", "state_topic": f"{out}/room/{device}"}
    return (
        Outbound(
            f"{home_assistant}/device_tracker/wayfuse_{device}/config",
            msgspec.json.encode(tracker | common),
            True,
        ),
        Outbound(
            f"{home_assistant}/sensor/wayfuse_{device}_room/config",
            msgspec.json.encode(sensor | common),
            True,
        ),
    )
