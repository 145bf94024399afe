"""A server that is told to stop stops at once, also while somebody listens to its events."""

from __future__ import annotations

import signal
from pathlib import Path
from typing import Any

from service_running import running


def test_an_open_stream_does_not_keep_it(world: Any, tmp_path: Path) -> None:
    radio_map = ("--radio-map", world.folder / "map.npz")
    with running(world.folder, tmp_path / "data", *radio_map, particles=50) as server:
        with server.client() as client, client.stream("GET", "/api/v1/events") as stream:
            assert stream.status_code == 200
            server.process.send_signal(signal.SIGTERM)
            assert not any(
                "error" in line for line in stream.iter_lines()
            )  # ends, and not by a broken connection
        server.process.wait(30)
        assert server.process.stderr is not None
        said = server.process.stderr.read()
    assert "timeout" not in said.lower()
    assert "Traceback" not in said
