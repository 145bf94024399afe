"""MQTT against a real broker: bodies in, positions out, and a broker that goes and comes back."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import aiomqtt
import pytest
from benchmarks.server_broker import Mosquitto, find_mosquitto
from service_running import App, started, wait_until

from programs import skip_without
from wayfuse.core.errors import ConfigError
from wayfuse.sensors.records import BleReading, Range, bssid_id
from wayfuse.service.adapters import ADAPTERS
from wayfuse.service.adapters.espresense import espresense_body
from wayfuse.service.events import Event
from wayfuse.service.message import BadBodyError, Profile
from wayfuse.service.mqtt_topics import Broker, broker_of, inbound, outbound
from wayfuse.service.replay import envelopes
from wayfuse.service.settings import Settings
from wayfuse.service.wire import encode


@pytest.fixture(scope="module")
def broker(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Mosquitto]:
    """The broker of the tests of this file."""
    program = find_mosquitto()
    if program is None:
        skip_without("mosquitto", "it is not on this machine")
    broker = Mosquitto(program, tmp_path_factory.mktemp("broker"))
    yield broker
    broker.stop()


@pytest.fixture(scope="module")
def app(broker: Mosquitto, world: Any, tmp_path_factory: pytest.TempPathFactory) -> Iterator[App]:
    """A server that is connected."""
    with started(world, tmp_path_factory.mktemp("server"), mqtt=broker.url) as app:
        yield app


def _heard(
    broker: Mosquitto, *topics: str, until: Callable[[dict[str, list[bytes]]], bool]
) -> dict[str, list[bytes]]:
    """Messages by topic."""

    async def listen() -> dict[str, list[bytes]]:
        got: dict[str, list[bytes]] = {}
        async with asyncio.timeout(30.0), aiomqtt.Client("127.0.0.1", broker.port) as client:
            for topic in topics:
                await client.subscribe(topic)
            async for message in client.messages:
                got.setdefault(str(message.topic), []).append(bytes(message.payload))
                if until(got):
                    return got
        raise AssertionError("the broker has gone")

    return asyncio.run(listen())


def _send(broker: Mosquitto, *messages: tuple[str, bytes]) -> None:
    async def send() -> None:
        async with aiomqtt.Client("127.0.0.1", broker.port) as client:
            for topic, body in messages:
                await client.publish(topic, body, qos=1)

    asyncio.run(asyncio.wait_for(send(), 30.0))


def _online(broker: Mosquitto) -> None:
    _heard(broker, "wayfuse/status", until=lambda got: b"online" in got["wayfuse/status"])


def _accepted(app: App, adapter: str) -> float:
    return (
        app.server.metrics.registry.get_sample_value(
            "wayfuse_bodies_total", {"adapter": adapter, "outcome": "accepted"}
        )
        or 0.0
    )


def test_a_walk_over_mqtt_gives_the_estimates_of_a_replay(app: App, broker: Mosquitto, world: Any) -> None:
    _online(broker)
    walk = world.walks[0]
    bodies = [encode(e) for e in envelopes(walk, "phone", "walk", 2.0)]
    wait_until(lambda: _sent_and_taken(app, broker, bodies[0]))
    _send(broker, *((f"wayfuse/in/{world.site.name}/own", body) for body in bodies[1:]))
    wait_until(lambda: _accepted(app, "own") >= len(bodies))
    app.settle()
    view = app.server.live.views()[0]
    tracker = app.server.worlds[world.site.name].tracker(1)
    expected = tracker.run(replace(walk, name=view.row.track)).estimates
    assert view.number == len(expected) - 1
    assert view.estimate == expected[-1]


def _sent_and_taken(app: App, broker: Mosquitto, body: bytes) -> bool:
    """Again and again: the server says that it is online before it listens."""
    if not _accepted(app, "own"):
        _send(broker, ("wayfuse/in/site/own", body))
    return _accepted(app, "own") > 0


def test_home_assistant_and_owntracks_are_told(app: App, broker: Mosquitto, world: Any) -> None:
    """Kept messages: who comes late knows too."""
    kinds = ("config", "room", "attributes", "owntracks")
    got = _heard(
        broker, "homeassistant/#", "wayfuse/out/#", "owntracks/#",
        until=lambda got: all(any(kind in topic for topic in got) for kind in kinds),
    )  # fmt: skip
    configs = {topic: json.loads(said[-1]) for topic, said in got.items() if topic.endswith("/config")}
    for config in configs.values():
        assert config["availability_topic"] == "wayfuse/status"
        told = config.get("state_topic") or config["json_attributes_topic"]
        _heard(broker, told, until=bool)
    location = json.loads(next(said[-1] for topic, said in got.items() if topic.startswith("owntracks/")))
    assert location["_type"] == "location"
    lon, lat = world.site.floors[0].anchor.to_lonlat((0.0, 0.0)).tolist()
    assert abs(location["lat"] - lat) < 0.01
    assert abs(location["lon"] - lon) < 0.01
    assert not any("phone" in topic for topic in got)  # pseudonyms


def test_what_cannot_be_read_is_counted_and_ends_nothing(app: App, broker: Mosquitto) -> None:
    def refused() -> float:
        labels = {"adapter": "mqtt", "outcome": "refused"}
        return app.server.metrics.registry.get_sample_value("wayfuse_bodies_total", labels) or 0.0

    bad = [
        ("wayfuse/in/site/own", b"\xff"),
        ("wayfuse/in/elsewhere/own", b"{}"),
        ("wayfuse/in/site/sensor-logger/ios", b"[]"),
        ("espresense/devices/tag/kitchen", b"near"),
        ("wayfuse/in/site/own", b"x" * (app.server.settings.max_body_bytes + 1)),
    ]
    before = refused()
    _send(broker, *bad, ("espresense/devices/tag-1/kitchen", b'{"distance": 2.5, "rssi": -60, "mac": "x"}'))
    wait_until(lambda: refused() == before + len(bad) and _accepted(app, "espresense") == 1)


def test_a_broker_that_goes_and_comes_back_is_used_again(app: App, broker: Mosquitto, world: Any) -> None:
    broker.stop()
    before = _accepted(app, "anchors")
    broker.start()
    _online(broker)
    body = encode({"v": 1, "anchor": "a", "t": 1, "frames": [{"target": "tag", "rssi": -50.0}]})

    def is_taken() -> bool:
        _send(broker, ("wayfuse/in/site/anchors", body))
        return _accepted(app, "anchors") > before

    wait_until(is_taken)


# --- without a broker ---------------------------------------------------------------------------------------


def test_urls_of_brokers() -> None:
    assert broker_of("mqtt://host") == Broker("host", 1883, None, None, False)
    assert broker_of("mqtts://me:p%40ss@host:99/") == Broker("host", 99, "me", "p@ss", True)
    for bad in ("host", "http://host", "mqtt://", "mqtt://host/topic", "mqtt://host:port"):
        with pytest.raises(ConfigError, match="broker"):
            broker_of(bad)
    for bad in ("", "a/#", "+"):
        with pytest.raises(ConfigError, match="mqtt_prefix"):
            Settings(mqtt_prefix=bad)


def test_a_node_s_message_is_a_range_and_a_level_at_its_arrival() -> None:
    body = espresense_body("tag-1", "kitchen", b'{"distance": 6.0, "rssi": -70.5, "other": []}')
    message = ADAPTERS["espresense"].read(body, Profile(), 7.0)[0]
    node = bssid_id("kitchen")
    assert message.parts[0].records == (BleReading(7.0, node, -70.5, pytest.approx(float("nan"), nan_ok=True)),
                                        Range(7.0, node, 6.0, 3.0, -70.5))  # fmt: skip
    assert ADAPTERS["espresense"].read(message.body, Profile(), 7.0)[0].device == "tag-1"
    random = espresense_body("da:a1:19:00:00:01", "kitchen", b'{"distance": 1}')
    assert ADAPTERS["espresense"].read(random, Profile(), 7.0) == []
    far = espresense_body("tag-1", "kitchen", b'{"distance": -1}')
    assert ADAPTERS["espresense"].read(far, Profile(), 7.0)[0].notes == {"range: out of range": 1}
    with pytest.raises(BadBodyError):
        espresense_body("tag-1", "kitchen", b"[]")


@pytest.mark.parametrize("topic", ["", "wayfuse/in/site", "wayfuse/in/site/other", "wayfuse/in/s/sensor-logger/symbian",
                                   "espresense/devices/a", "espresense/devices/a/b/c"])  # fmt: skip
def test_other_topics_are_none_of_ours(topic: str) -> None:
    assert inbound("wayfuse", topic, b"{}") is None


def test_a_place_off_the_earth_is_told_in_metres_alone() -> None:
    feature = {"geometry": None, "properties": {"device": "d", "zones": [], "radius_m_68": None}}
    topics = [m.topic for m in outbound("w", Event(1, "s", "t", encode({"feature": feature})))]
    assert topics == ["w/out/s/position/t", "w/out/s/room/d"]
    assert list(outbound("w", Event(1, "s", "t", b"{}"))) == []
    assert [m.topic for m in outbound("w", Event(1, "s", "t", b"{}", "zone"))] == ["w/out/s/zone/t"]
