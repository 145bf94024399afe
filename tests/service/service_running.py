"""Servers for tests: in a process of its own, as `wayfuse serve` starts it, and in this process."""

from __future__ import annotations

import io
import os
import signal
import subprocess
import sys
import time
import zipfile
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import httpx2
import numpy as np
from starlette.testclient import TestClient

from wayfuse.service.app import create_app
from wayfuse.service.server import Server, SiteFiles
from wayfuse.service.settings import Settings
from wayfuse.storage.log import last_seq

__all__ = ["App", "Running", "packed", "running", "started", "wait_until"]

_START_S = 60.0
_BEGUN: Counter[Path] = Counter()  # servers begun in this process, by their folder


@dataclass
class Running:
    """The process, its address, and the administrator's token (the one of the first start)."""

    process: subprocess.Popen[str]
    address: str
    token: str

    def client(self, **more: Any) -> httpx2.Client:
        """A client that sends the token."""
        headers = {"Authorization": f"Bearer {self.token}"}
        return httpx2.Client(base_url=self.address, headers=headers, timeout=30.0, trust_env=False, **more)

    def kill(self) -> None:
        """As a crash would."""
        self.process.send_signal(signal.SIGKILL)
        self.process.wait(30)

    def wait_applied(self, seq: int) -> None:
        """Until everything up to an entry is in the tracks."""
        with self.client() as client:
            wait_until(lambda: client.get("/health").json()["applied"] >= seq)


def wait_until(is_so: Any, seconds: float = 60.0) -> None:
    """Ask again and again."""
    end = time.monotonic() + seconds
    while not is_so():
        assert time.monotonic() < end, "waited in vain"
        time.sleep(0.02)


def packed(folder: Path, prefix: str = "") -> bytes:
    """A ZIP archive of a folder."""
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w") as archive:
        for path in sorted(p for p in folder.rglob("*") if p.is_file()):
            archive.write(path, f"{prefix}{path.relative_to(folder)}")
    return out.getvalue()


@contextmanager
def running(
    folder: Path,
    data: Path,
    *options: object,
    token: str = "",
    sites: Sequence[Path] | None = None,
    **settings: object,
) -> Iterator[Running]:
    """A server of the small world in ``folder``, or of other sites; ends with the block."""
    environment = {k: v for k, v in os.environ.items() if not k.startswith("WAYFUSE_SERVER_")}
    environment |= {f"WAYFUSE_SERVER_{k.upper()}": str(v) for k, v in settings.items()}
    command = [
        sys.executable,
        "-m",
        "wayfuse",
        "serve",
        *([folder / "SITE"] if sites is None else sites),
        "--port",
        0,
        "--data",
        data,
        *options,
    ]
    process = subprocess.Popen(
        list(map(str, command)),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=environment | {"PYTHONUNBUFFERED": "1"},
    )
    try:
        yield _ready(process, token)
    finally:
        if process.poll() is None:
            process.send_signal(signal.SIGTERM)
        try:
            out, err = process.communicate(timeout=30)
        except subprocess.TimeoutExpired:
            process.kill()
            out, err = process.communicate()
            raise AssertionError(f"the server did not stop:\n{out}\n{err}") from None
        assert "Traceback" not in err, err


def _ready(process: subprocess.Popen[str], token: str) -> Running:
    assert process.stdout is not None
    for line in process.stdout:
        if line.startswith("administrator's token"):
            token = line.split()[-1]
        if line.startswith("serving "):
            server = Running(process, line.split()[-1], token)
            with server.client() as client:
                wait_until(lambda: _is_up(client), _START_S)
            return server
    raise AssertionError(f"the server did not start: {process.communicate()[1]}")


def _is_up(client: httpx2.Client) -> bool:
    try:
        return client.get("/health").status_code == 200
    except httpx2.TransportError:
        return False


class App:
    """A server in this process, and clients of it with each scope's token."""

    def __init__(self, server: Server, client: TestClient) -> None:
        self.server, self.client = server, client
        self.tokens = {
            scope: server.tokens.create({scope}, server.clock(), label=scope)[0]
            for scope in ("ingest", "read", "survey", "admin")
        }

    def headers(self, scope: str) -> dict[str, str]:
        """The header of a scope's token."""
        return {"Authorization": f"Bearer {self.tokens[scope]}"}

    def get(self, path: str, scope: str = "read", **more: Any) -> Any:
        """Answer of a GET."""
        return self.client.get(path, headers=self.headers(scope), **more)

    def post(self, path: str, body: Any, scope: str = "ingest", **more: Any) -> Any:
        """Answer of a POST of bytes or JSON."""
        content = {"content": body} if isinstance(body, bytes) else {"json": body}
        return self.client.post(
            path, headers=self.headers(scope) | more.pop("headers", {}), **content, **more
        )

    def settle(self) -> None:
        """Wait until everything accepted is in the tracks."""
        pipeline = self.server.pipeline
        assert pipeline is not None
        wait_until(lambda: pipeline.applied == last_seq(self.server.engine))


@contextmanager
def started(
    world: Any,
    data: Path,
    radio_map: str | None = "map.npz",
    sites: Sequence[SiteFiles] | None = None,
    **settings: Any,
) -> Iterator[App]:
    """A server of the small world, or of other sites, in this process."""
    values = {"particles": 100, "rate_per_s": 0.0} | settings
    if sites is None:
        sites = [SiteFiles(world.folder / "SITE", world.folder / radio_map if radio_map else None)]
    # the names of tracks, and so their particles, come from random bytes: the same ones in each run of the tests, and
    # other ones each time that a server begins on the same data, for no two tokens may be equal
    _BEGUN[data] += 1
    random = np.random.default_rng([_BEGUN[data]]).bytes
    server = Server(Settings(data=str(data), **values), sites, clock=time.time, random=random)
    with TestClient(create_app(server), raise_server_exceptions=False) as client:
        yield App(server, client)
