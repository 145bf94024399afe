"""kill -9 under load: nothing that was acknowledged is lost, and the positions are those of a run without the kill."""

from __future__ import annotations

import csv
import io
import shutil
import threading
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import httpx2
import numpy as np
import pytest
from service_running import Running, running, started, wait_until

from postgres_server import create_database, running_server
from wayfuse.presets.methods import build_method
from wayfuse.service.replay import envelopes
from wayfuse.service.wire import encode
from wayfuse.storage.database import open_database
from wayfuse.storage.log import IngestLog

PARTICLES = 100


class Phone:
    """Posts a walk, as fast as it is answered; what was not answered it posts again, to whatever server is there."""

    def __init__(self, walk: Any, n: int) -> None:
        self.walk = walk
        self.bodies = [encode(e) for e in envelopes(walk, f"phone {n}", "walk", 0.8)]
        self.acknowledged: dict[int, int] = {}  # which body, and where it is in the log
        self.track = ""
        self._draw = np.random.default_rng(n)

    def post(self, server: Running) -> None:
        """Until all is acknowledged or the server is gone."""
        with server.client() as client:
            for n, body in enumerate(self.bodies):
                again = n in self.acknowledged and self._draw.random() < 0.05  # an answer that was lost
                if n in self.acknowledged and not again:
                    continue
                try:
                    answer = client.post("/api/v1/in/own", content=body)
                except httpx2.TransportError:
                    return
                assert answer.status_code == 200, answer.text
                accepted = answer.json()["accepted"][0]
                self.acknowledged[n], self.track = accepted["seq"], accepted["track"]


def _load(server: Running, phones: list[Phone]) -> list[threading.Thread]:
    threads = [threading.Thread(target=phone.post, args=(server,)) for phone in phones]
    for thread in threads:
        thread.start()
    return threads


def _check(world: Any, data: Path, *options: object, kills: int, n_phones: int) -> None:
    phones = [Phone(world.walks[n % len(world.walks)], n) for n in range(n_phones)]
    options = ("--radio-map", world.folder / "map.npz", *options)
    settings = {"particles": PARTICLES, "checkpoint_s": 0.2, "rate_per_s": 0}
    token = ""
    for kill in range(kills):
        with running(world.folder, data, *options, token=token, **settings) as server:
            token = server.token
            threads = _load(server, phones)
            _wait_for_share(phones, (kill + 1) / (kills + 1))
            server.kill()
            for thread in threads:
                thread.join(30)
    with running(world.folder, data, *options, token=token, **settings) as server:
        for thread in _load(server, phones):
            thread.join(120)
        assert all(len(p.acknowledged) == len(p.bodies) for p in phones)
        last = max(max(p.acknowledged.values()) for p in phones)
        server.wait_applied(last)
        tracker = build_method("fused", world.site, world.survey, n_particles=PARTICLES)
        for phone in phones:
            expected = tracker.run(replace(phone.walk, name=phone.track)).estimates
            assert _places(server, phone.track) == [(e.t, e.x, e.y, e.floor, e.r95) for e in expected]


def _wait_for_share(phones: list[Phone], share: float) -> None:
    """Until so much of all bodies is acknowledged."""
    total = sum(len(p.bodies) for p in phones)
    wait_until(lambda: sum(len(p.acknowledged) for p in phones) >= share * total)


def _places(server: Running, track: str) -> list[tuple[float, ...]]:
    with server.client() as client:
        text = client.get(f"/api/v1/tracks/{track}/export").text
    names = ("t", "x", "y", "floor", "radius_95")
    return [tuple(float(row[n]) for n in names) for row in csv.DictReader(io.StringIO(text))]


def _logged(url: str) -> dict[int, bytes]:
    engine = open_database(url)
    bodies = {e.seq: e.body for e in IngestLog(engine).read()}
    engine.dispose()
    return bodies


def test_a_killed_server_loses_nothing_and_goes_on_to_the_bit(world: Any, tmp_path: Path) -> None:
    _check(world, tmp_path / "data", kills=1, n_phones=2)
    seqs = sorted(_logged(f"sqlite:///{tmp_path / 'data' / 'wayfuse.db'}"))
    assert seqs == list(range(1, len(seqs) + 1))


@pytest.fixture(scope="module")
def postgres() -> Iterator[str]:
    """URL of a running PostgreSQL server."""
    with running_server() as url:
        yield url


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["sqlite", "postgresql"])
def test_a_server_killed_again_and_again(
    world: Any, tmp_path: Path, kind: str, request: pytest.FixtureRequest
) -> None:
    options: tuple[object, ...] = ()
    if kind == "postgresql":
        options = ("--database", create_database(request.getfixturevalue("postgres"), "crash"))
    _check(world, tmp_path / "data", *options, kills=4, n_phones=6)


def test_a_stream_goes_on_over_a_crash(world: Any, tmp_path: Path) -> None:
    """The events of entries that no checkpoint holds are the same again, with the same identifiers."""
    with started(world, tmp_path / "a", checkpoint_s=3600.0) as app:
        for envelope in list(envelopes(world.walks[0], "p", "w", 2.0))[:10]:
            assert app.post("/api/v1/in/own", encode(envelope)).status_code == 200
        app.settle()
        before = _events(app, 0)
        assert [n for n, _ in before] == list(range(1, 11))
        # what a crash leaves on the disk: the database with its write-ahead log, no checkpoint
        shutil.copytree(tmp_path / "a", tmp_path / "b")
    with started(world, tmp_path / "b", checkpoint_s=3600.0) as again:
        assert _events(again, 0) == before
        assert _events(again, 6) == before[6:]


def _events(app: Any, after: int) -> list[tuple[int, str]]:
    headers = app.headers("read") | {"Last-Event-ID": str(after)}
    text = app.client.get("/api/v1/events?once=true", headers=headers).text
    blocks = [block.splitlines() for block in text.strip().split("\n\n")]
    blocks = [lines for lines in blocks if lines[0].startswith("id: ")]  # zones have none
    assert {lines[1] for lines in blocks} == {"event: position"}
    return [(int(lines[0].removeprefix("id: ")), lines[2]) for lines in blocks]
