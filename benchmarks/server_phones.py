"""Many phones at once against a server, each on a connection of its own that stays open, and one who watches all.

A phone sends a batch each period. A batch is due when its period is over, whether the one before was answered or not:
the time from then to the answer, and to the position, is what is measured, so a server that falls behind does not
make its own figures better. The watcher reads the stream of events; the event of a batch has its place in the log
as identifier, as the answer to the batch has.
"""

from __future__ import annotations

import asyncio
import re
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import cast

import numpy as np

from wayfuse.core.types import Array

__all__ = ["MARK", "Heard", "Phones", "Script"]

MARK = b"@@@@@@@@"  # in bodies: number of the phone and of its round
_SEQ = re.compile(rb'"seq":(\d+)')
_LENGTH = re.compile(rb"content-length: (\d+)", re.IGNORECASE)
_EVENT = re.compile(rb"id: (\d+)\nevent: position\n")
_TAIL = 64  # bytes of the stream in which an event may have begun

Script = Sequence[bytes]  # bodies, one per period


@dataclass(slots=True)
class Heard:
    """What came of all batches: when each was due, answered and placed (s of the loop), by its place in the log."""

    due: dict[int, float] = field(default_factory=dict)
    answered: dict[int, float] = field(default_factory=dict)
    placed: dict[int, float] = field(default_factory=dict)
    sent: int = 0
    refused: int = 0

    def latencies(self, since: float, until: float) -> tuple[Array, Array]:
        """Seconds to the answer and to the position of batches due in a span; infinite where none came."""
        mine = [seq for seq, t in self.due.items() if since <= t < until]
        answer = [self.answered[seq] - self.due[seq] for seq in mine]
        place = [self.placed.get(seq, np.inf) - self.due[seq] for seq in mine]
        return np.array(answer), np.array(place)


class _Phone(asyncio.Protocol):
    """One phone: what is due waits here while the batch before is under way."""

    def __init__(self, head: bytes, heard: Heard) -> None:
        self._head, self._heard = head, heard
        self._due: deque[tuple[float, bytes]] = deque()
        self._under_way: float | None = None
        self._buffer = b""
        self._transport: asyncio.Transport | None = None
        self._loop = asyncio.get_running_loop()

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        self._transport = cast("asyncio.Transport", transport)  # uvloop's own class

    def send(self, body: bytes) -> None:
        self._heard.sent += 1
        self._due.append((self._loop.time(), body))
        if self._under_way is None:
            self._next()

    def _next(self) -> None:
        self._under_way, body = self._due.popleft()
        assert self._transport is not None
        self._transport.write(self._head + b"%d\r\n\r\n" % len(body) + body)

    def data_received(self, data: bytes) -> None:
        self._buffer += data
        end = self._buffer.find(b"\r\n\r\n")
        if end < 0:
            return
        length = _LENGTH.search(self._buffer, 0, end)
        if length is None or len(self._buffer) < end + 4 + int(length[1]):
            return
        seq = _SEQ.search(self._buffer, end)
        assert self._under_way is not None
        if seq is None:
            self._heard.refused += 1
        else:
            self._heard.due[int(seq[1])] = self._under_way
            self._heard.answered[int(seq[1])] = self._loop.time()
        self._buffer, self._under_way = b"", None
        if self._due:
            self._next()

    def connection_lost(self, _error: Exception | None) -> None:
        self._heard.refused += len(self._due) + (self._under_way is not None)
        self._due.clear()

    def close(self) -> None:
        if self._transport is not None:
            self._transport.abort()


class _Watcher(asyncio.Protocol):
    """Reads the stream of events."""

    def __init__(self, head: bytes, heard: Heard) -> None:
        self._head, self._heard = head, heard
        self._buffer = b""
        self._loop = asyncio.get_running_loop()
        self._transport: asyncio.Transport | None = None

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        self._transport = cast("asyncio.Transport", transport)  # uvloop's own class
        self._transport.write(self._head)

    def data_received(self, data: bytes) -> None:
        now = self._loop.time()
        self._buffer += data
        done = 0
        for event in _EVENT.finditer(self._buffer):
            self._heard.placed[int(event[1])] = now
            done = event.end()
        self._buffer = self._buffer[max(done, len(self._buffer) - _TAIL) :]

    def close(self) -> None:
        if self._transport is not None:
            self._transport.abort()


class Phones:
    """N phones that walk by scripts, again and again.

    Parameters
    ----------
    scripts : bodies; a phone takes them in turn, from a place drawn for it. period : s between its batches. seed : of
    where and when each begins.
    """

    def __init__(self, scripts: Sequence[Script], n: int, period: float, seed: int) -> None:
        self._scripts, self._n, self._period = scripts, n, period
        self._draw = np.random.default_rng(seed)
        self.heard = Heard()

    async def walk(
        self, host: str, port: int, token: str, seconds: float, ready: Callable[[], None] = lambda: None
    ) -> tuple[float, float]:
        """Send for so long; loop times of the first and last batch due. Then waits for what is under way.

        ``ready`` is called when all phones are connected, just before the first batch is due.
        """
        loop = asyncio.get_running_loop()
        common = f"Host: {host}\r\nAuthorization: Bearer {token}\r\n"
        post = (
            f"POST /api/v1/in/own HTTP/1.1\r\n{common}Content-Type: application/json\r\nContent-Length: "
        ).encode()
        get = f"GET /api/v1/events HTTP/1.1\r\n{common}\r\n".encode()
        _, watcher = await loop.create_connection(lambda: _Watcher(get, self.heard), host, port)
        phones = [
            (await loop.create_connection(lambda: _Phone(post, self.heard), host, port))[1]
            for _ in range(self._n)
        ]
        await self._first(phones[0])
        ready()
        start = loop.time() + 0.1
        tasks = [
            loop.create_task(self._one(n, phone, start, seconds, self._draw.random(2).tolist()))
            for n, phone in enumerate(phones)
        ]
        await asyncio.gather(*tasks)
        await self._settled(loop.time() + 5.0)
        for each in (*phones, watcher):
            each.close()
        return start, start + seconds

    async def _first(self, phone: _Phone) -> None:
        """One phone's walk alone: kernels are loaded when they are first used."""
        for body in self._scripts[0][:40]:
            phone.send(body.replace(MARK, b"first000"))
        await self._settled(asyncio.get_running_loop().time() + 20.0)

    async def _one(self, n: int, phone: _Phone, start: float, seconds: float, draws: list[float]) -> None:
        loop = asyncio.get_running_loop()
        script = self._scripts[n % len(self._scripts)]
        at = int(draws[0] * len(script))
        due, turn = start + draws[1] * self._period, 0
        while due < start + seconds:
            await asyncio.sleep(due - loop.time())
            phone.send(script[at].replace(MARK, b"%05d%03d" % (n, turn)))
            due += self._period
            at += 1
            if at == len(script):
                at, turn = 0, turn + 1

    async def _settled(self, until: float) -> None:
        """Wait until all that was sent has come out, but not for ever."""
        heard, loop = self.heard, asyncio.get_running_loop()
        while loop.time() < until:
            if len(heard.due) + heard.refused >= heard.sent and heard.due.keys() <= heard.placed.keys():
                return
            await asyncio.sleep(0.05)
