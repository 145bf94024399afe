"""A hundred thousand bodies that no phone sends, on every way in of a running server, among those of a good phone.

    python -m benchmarks.server_fuzz [--bodies 100000] [--page]

Requests, WebSockets, the stream of a card over TCP, and MQTT where there is a mosquitto. Each must be answered (but
over MQTT, which has no answers), by a status that is described, without a traceback; the server must log no failure,
and the good phone's track must be that of its walk tracked alone, to the bit.
"""

from __future__ import annotations

import argparse
import asyncio
import json
import re
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import uvloop
from websockets.asyncio.client import connect

from benchmarks.report import machine
from benchmarks.server_broker import Mosquitto, find_mosquitto, free_port
from benchmarks.server_fuzz_streams import publish, stream
from benchmarks.server_hostile import hostile
from benchmarks.server_page import table, write_section
from benchmarks.server_process import Process, Scene, serving, simulated
from benchmarks.server_replay import exported, said_of, wait_applied
from wayfuse.presets.methods import build_method
from wayfuse.service.replay import envelopes
from wayfuse.service.routes.examples import EXAMPLES
from wayfuse.service.wire import encode

__all__ = ["Told", "fuzz"]

_SEED = 13
_CONNECTIONS = 6
_EXPECTED = {200, 400, 408, 413, 415, 422, 499}
_GOOD_EVERY_S = 0.2
_SHARE_SOCKET, _SHARE_STREAM, _SHARE_MQTT = 0.1, 0.05, 0.1  # of the bodies, not by requests
_HEAD = re.compile(rb"HTTP/1\.1 (\d+) ")
_LENGTH = re.compile(rb"content-length: (\d+)", re.IGNORECASE)


@dataclass
class Told:
    """What came of the bodies, by way in; wrong : first answers that should not be."""

    statuses: dict[str, Counter[str]] = field(default_factory=dict)
    wrong: list[str] = field(default_factory=list)
    closed: int = 0

    def take(self, way: str, status: str, body: bytes, answer: bytes, *, is_expected: bool) -> None:
        self.statuses.setdefault(way, Counter())[status] += 1
        if (not is_expected or b"Traceback" in answer) and len(self.wrong) < 5:
            self.wrong.append(f"{way}: {status} to {body[:300]!r}: {answer[:300]!r}")


def _ways(token: str) -> dict[str, tuple[str, str]]:
    """Way in: address and adapter."""
    ways = {name: (f"/api/v1/in/{name}?platform=android&device=hostile", name) for name in EXAMPLES}
    by_path = {"own": "own", "sensor-logger": "sensor-logger", "data": "find3", "passive": "find3"}
    for way, adapter in by_path.items():
        ways[f"/in/TOKEN/{way}"] = (f"/in/{token}/{way}?platform=ios", adapter)
    return ways


async def fuzz(scene: Scene, server: Process, n: int, csi_port: int, broker: int) -> tuple[Told, str, int]:
    """What was told, the good phone's track, and the last place in the log that it was given.

    csi_port : of the server. broker : port of the one it listens to; 0: none.
    """
    told, over = Told(), asyncio.Event()
    good = asyncio.create_task(_good(scene, server, over))
    draws = [np.random.default_rng(s) for s in np.random.SeedSequence(_SEED).spawn(_CONNECTIONS + 3)]
    n_socket, n_stream, n_mqtt = (int(share * n) for share in (_SHARE_SOCKET, _SHARE_STREAM, _SHARE_MQTT))
    n_mqtt = n_mqtt if broker else 0
    each = -(-(n - n_socket - n_stream - n_mqtt) // _CONNECTIONS)
    bad = [asyncio.create_task(_post(server, draw, each, told)) for draw in draws[3:]]
    bad.append(asyncio.create_task(_speak(server, draws[0], n_socket, told)))
    bad.append(asyncio.create_task(stream(server.host, csi_port, server.token, draws[1], n_stream, told)))
    if broker:
        bad.append(asyncio.create_task(publish(broker, scene.site.name, draws[2], n_mqtt, told)))
    await asyncio.gather(*bad)
    over.set()
    track, seq = await good
    return told, track, seq


async def _post(server: Process, draw: np.random.Generator, n: int, told: Told) -> None:
    """One connection's share of the bodies."""
    ways = list(_ways(server.token).items())
    pipe = await asyncio.open_connection(server.host, server.port)
    for _ in range(n):
        way, (path, adapter) = ways[int(draw.integers(len(ways)))]
        body = hostile(adapter, draw)
        try:
            status, answer = await _asked(pipe, server, path, body)
        except (asyncio.IncompleteReadError, OSError):
            told.closed += 1
            pipe = await asyncio.open_connection(server.host, server.port)
            continue
        told.take(way, str(status), body, answer, is_expected=status in _EXPECTED)
    pipe[1].close()


async def _asked(
    pipe: tuple[asyncio.StreamReader, asyncio.StreamWriter], server: Process, path: str, body: bytes
) -> tuple[int, bytes]:
    reader, writer = pipe
    head = (
        f"POST {path} HTTP/1.1\r\nHost: {server.host}\r\nAuthorization: Bearer {server.token}\r\n"
        f"Content-Type: application/json\r\nContent-Length: {len(body)}\r\n\r\n"
    )
    writer.write(head.encode() + body)
    said = await reader.readuntil(b"\r\n\r\n")
    status, length = _HEAD.match(said), _LENGTH.search(said)
    assert status is not None
    assert length is not None
    return int(status[1]), await reader.readexactly(int(length[1]))


async def _speak(server: Process, draw: np.random.Generator, n: int, told: Told) -> None:
    """A WebSocket's share, each answered; one that is closed is opened again."""
    done = 0
    while done < n:
        async with connect(f"ws://{server.host}:{server.port}/api/v1/ws", proxy=None) as socket:
            await socket.send(json.dumps({"token": server.token, "listen": False}))
            while done < n:
                body = hostile("own", draw)
                await socket.send(body)
                answer = str(await asyncio.wait_for(socket.recv(), 30.0)).encode()
                kind = json.loads(answer)["type"]
                told.take("WebSocket", kind, body, answer, is_expected=kind in {"accepted", "refused"})
                done += 1


async def _good(scene: Scene, server: Process, over: asyncio.Event) -> tuple[str, int]:
    """A phone that walks meanwhile; its last batches go when the others are done."""
    pipe = await asyncio.open_connection(server.host, server.port)
    track, seq = "", 0
    for body in _bodies(scene):
        status, answer = await _asked(pipe, server, "/api/v1/in/own", body)
        if status != 200:
            raise RuntimeError(f"a good body was refused: {status} {answer[:200]!r}")
        accepted = json.loads(answer)["accepted"][0]
        track, seq = accepted["track"], accepted["seq"]
        if not over.is_set():
            try:
                await asyncio.wait_for(over.wait(), _GOOD_EVERY_S)
            except TimeoutError:
                continue
    pipe[1].close()
    return track, seq


def _bodies(scene: Scene) -> Iterator[bytes]:
    return (encode(e) for e in envelopes(scene.walks[0], "good phone", "good", 0.25))


def main(arguments: list[str] | None = None) -> bool:
    """Fuzz, print, write the section of the page; whether all went well."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--bodies", type=int, default=100_000)
    parser.add_argument("--page", action="store_true", help="write docs/server-performance.md")
    options = parser.parse_args(arguments)
    before, began = machine(), time.perf_counter()
    with tempfile.TemporaryDirectory() as folder, (Path(folder) / "errors").open("w+b") as errors:
        scene = simulated(Path(folder), _SEED, walks=1)
        program = find_mosquitto()
        broker = None if program is None else Mosquitto(program, Path(folder))
        port = free_port()
        settings = {"particles": 100, "csi_port": port, "mqtt": broker.url if broker else ""}
        with serving(scene, Path(folder) / "data", errors=errors, **settings) as server:
            told, track, seq = uvloop.run(
                fuzz(scene, server, options.bodies, port, broker.port if broker else 0)
            )
            wait_applied(server, seq)
            tracker = build_method("fused", scene.site, scene.survey, n_particles=100)
            expected = [said_of(e) for e in tracker.run(replace(scene.walks[0], name=track)).estimates]
            is_exact = exported(server, track) == expected
            health = json.loads(server.get("/health"))["status"]
        if broker:
            broker.stop()
        errors.seek(0)
        logged = [
            line for line in errors.read().decode().splitlines() if " ERROR " in line or "Traceback" in line
        ]
    wrong = [*told.wrong, *logged[:5]]
    is_well = is_exact and not wrong and not told.closed and health == "ok"
    if broker is None:
        told.statuses["MQTT"] = Counter({"no mosquitto here": 0})
    text = _text(
        told, len(expected), wrong, time.perf_counter() - began, is_exact=is_exact, n_logged=len(logged)
    )
    print(text)
    if options.page:
        write_section("fuzz", "python -m benchmarks.server_fuzz --page", before, text)
    return is_well


def _text(told: Told, n_good: int, wrong: list[str], took: float, *, is_exact: bool, n_logged: int) -> str:
    kinds = sorted({kind for counts in told.statuses.values() for kind in counts})
    rows = [(way, counts.total(), *(counts[kind] for kind in kinds)) for way, counts in told.statuses.items()]
    total = sum(counts.total() for counts in told.statuses.values())
    good = f"{n_good:,} estimates of the good phone, " + (
        "equal to the bit" if is_exact else "**which differ**"
    )
    found = "".join(f"- `{line}`\n" for line in wrong)
    return (
        f"Bodies that no phone sends\n\n{total:,} random and changed bodies on {len(rows)} ways in, {took:.0f} s, seed "
        f"{_SEED}; answers that should not be: {len(told.wrong)}; connections lost: {told.closed}; failures in the "
        f"server's log: {n_logged}; {good}. 200: what was left of the body is a message.\n\n"
        + table(("way in", "bodies", *kinds), rows)
        + found
    )


if __name__ == "__main__":
    sys.exit(int(not main()))
