"""Ways in without requests: the stream of an Intel 5300 card over TCP, and MQTT through a broker."""

from __future__ import annotations

import asyncio
import struct
from typing import Protocol
from urllib.parse import quote

import aiomqtt
import numpy as np

from benchmarks.server_hostile import hostile, spoiled
from wayfuse.service.routes.examples import EXAMPLES

__all__ = ["Takes", "publish", "stream"]

_ANSWER_S = 30.0
_WORDS = (b"", b"tag 1", b"\xff\xfe", b"x" * 2000, b"an-1 aa:bb:cc:dd:ee:ff", b"an-1\ttag\x00")


class Takes(Protocol):
    """Who counts what came of the bodies."""

    def take(self, way: str, status: str, body: bytes, answer: bytes, *, is_expected: bool) -> None:
        """One body."""
        ...


async def stream(host: str, port: int, token: str, draw: np.random.Generator, n: int, told: Takes) -> None:
    """So many connections, each with a first line and some records, whole or spoiled; its end is half a record."""
    for _ in range(n):
        reader, writer = await asyncio.open_connection(host, port)
        hello = b"%s an-1 tag-%d" % (token.encode(), draw.integers(3))
        if draw.random() < 0.2:
            hello = b"%s %s" % (token.encode(), _WORDS[int(draw.integers(len(_WORDS)))])
        records = b"".join(_record(draw) for _ in range(int(draw.integers(0, 5))))
        body = (spoiled(hello, draw) if draw.random() < 0.2 else hello) + b"\n"
        body += spoiled(records, draw) if records and draw.random() < 0.7 else records
        writer.write(body)
        writer.write_eof()
        try:
            answer = await asyncio.wait_for(reader.read(), _ANSWER_S)
        except OSError:  # closed while there was more to read
            answer = b""
        word = answer.partition(b"\n")[0].split(b":")[0].decode("utf-8", "replace")[:20] or "closed"
        told.take(
            "Intel 5300",
            word,
            body,
            answer,
            is_expected=answer[:3] == b"ok\n" or word in {"refused", "closed"},
        )
        writer.close()


def _record(draw: np.random.Generator) -> bytes:
    """A packet of one transmit antenna, with its length before it."""
    n_rx = int(draw.integers(1, 4))
    size = (30 * (n_rx * 16 + 3) + 7) // 8
    t = int(draw.integers(0, 2**32))
    head = struct.pack("<IHHBBBBBbBBHH", t, 0, 0, n_rx, 1, 30, 31, 0, -127, 20, 0b100100, size, 0)
    return struct.pack(">HB", len(head) + size + 1, 0xBB) + head + draw.bytes(size)


async def publish(port: int, site: str, draw: np.random.Generator, n: int, told: Takes) -> None:
    """So many messages on the topics that the server listens to; nobody answers them."""
    base = f"wayfuse/in/{quote(site, safe=' ')}"
    topics = {
        f"{base}/own": "own",
        f"{base}/anchors": "anchors",
        f"{base}/find3": "find3",
        f"{base}/sensor-logger/android": "sensor-logger",
        "wayfuse/in/nowhere/own": "own",
        "espresense/devices/tag/room": "find3",
    }
    assert set(topics.values()) <= set(EXAMPLES)
    ways = list(topics.items())
    async with aiomqtt.Client("127.0.0.1", port) as client:
        for _ in range(n):
            topic, adapter = ways[int(draw.integers(len(ways)))]
            body = hostile(adapter, draw)
            await client.publish(topic, body, qos=1)
            told.take("MQTT", "sent", body, b"", is_expected=True)
