"""``wayfuse send``: recordings to a server in a process of its own."""

from __future__ import annotations

import json
import socket
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

sys.path.insert(0, str(Path(__file__).parents[1] / "service"))
from service_running import Running, running

Run = Callable[..., Any]


@pytest.fixture(scope="module")
def server(world: Any, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Running]:
    data = tmp_path_factory.mktemp("send") / "data"
    with running(world.folder, data, "--radio-map", world.folder / "map.npz", particles=100) as one:
        yield one


@pytest.fixture(autouse=True)
def direct(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("no_proxy", "*")


def walks(world: Any) -> list[Path]:
    return [r.path if isinstance(r.path, Path) else Path(r.path) for r in world.walks][:2]


def test_recordings_become_tracks(
    world: Any, server: Running, run_cli: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("WAYFUSE_TOKEN", server.token)
    said = run_cli("send", *walks(world), "--to", server.address, "--speed", 0, "--json")
    assert said.code == 0, said.err
    sent = json.loads(said.out)
    assert [one["recording"] for one in sent] == [r.name for r in world.walks[:2]]
    with server.client() as client:
        tracks = {t["track"] for t in client.get("/api/v1/tracks").json()["tracks"]}
        assert {one["track"] for one in sent} <= tracks
        server.wait_applied(client.get("/health").json()["applied"])
        said_of = client.get(f"/api/v1/tracks/{sent[0]['track']}/estimates").json()
    assert len(said_of["features"]) > 10
    assert sent[0]["batches"] >= 10
    assert sent[0]["records"] > 100


def test_speed_is_that_of_the_recording_times_the_factor(world: Any, server: Running, run_cli: Run) -> None:
    fast = run_cli(
        "send", walks(world)[0], "--to", server.address, "--token", server.token, "--speed", 50, "--every", 5
    )
    assert fast.code == 0, fast.err
    assert "batches" in fast.out
    assert "track" in fast.out


def test_wrong_use_is_one_line_and_status_2(
    world: Any, server: Running, run_cli: Run, tmp_path: Path
) -> None:
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        nobody = f"http://127.0.0.1:{free.getsockname()[1]}"
    walk = walks(world)[0]
    for arguments, message in (
        ((walk, "--to", "machine:80", "--token", "x"), "is no address"),
        ((walk, "--to", nobody, "--token", "x", "--speed", 0), "is `wayfuse serve` running?"),
        ((walk, "--to", server.address, "--token", "wf_0_0", "--speed", 0), "401"),
        (
            (walk, "--to", server.address, "--token", server.token, "--site", "moon", "--speed", 0),
            "no site 'moon'",
        ),
        ((tmp_path / "gone", "--token", "x"), "gone"),
    ):
        said = run_cli("send", *arguments)
        assert said.code == 2, message
        assert message in said.err
        assert "Traceback" not in said.err
