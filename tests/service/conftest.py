"""A site, a tracker and walks, as the server has them."""

from __future__ import annotations

import secrets
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from service_running import wait_until
from starlette.testclient import TestClient

from wayfuse.presets.methods import build_method
from wayfuse.service.app import create_app
from wayfuse.service.server import Server, SiteFiles
from wayfuse.service.settings import Settings
from wayfuse.storage.log import last_seq
from wayfuse.tracking.tracker import Tracker


@pytest.fixture(scope="session")
def tracker(world: Any) -> Tracker:
    """The tracker of the small world, with few particles: bits do not depend on how many."""
    return build_method("fused", world.site, world.survey, n_particles=200)


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
def started(world: Any, data: Path, **settings: Any) -> Iterator[App]:
    """A server of the small world in this process."""
    values = {"particles": 100, "rate_per_s": 0.0} | settings
    files = SiteFiles(world.folder / "SITE", world.folder / "map.npz")
    server = Server(Settings(data=str(data), **values), [files], clock=time.time, random=secrets.token_bytes)
    with TestClient(create_app(server), raise_server_exceptions=False) as client:
        yield App(server, client)


@pytest.fixture(scope="module")
def app(world: Any, tmp_path_factory: pytest.TempPathFactory) -> Iterator[App]:
    """One server for the tests of a file."""
    with started(world, tmp_path_factory.mktemp("server")) as app:
        yield app
