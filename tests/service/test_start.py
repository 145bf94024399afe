"""Starting, starting again, and what can be wrong then."""

from __future__ import annotations

import secrets
import shutil
import socket
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from service_running import started
from sqlalchemy import insert, text

from wayfuse.core.errors import ConfigError, RadioMapError, UsageError
from wayfuse.service.replay import envelopes
from wayfuse.service.run import _listen
from wayfuse.service.server import Server, SiteFiles, match_radio_maps
from wayfuse.service.settings import Settings
from wayfuse.service.wire import encode
from wayfuse.storage.audit import AuditRow
from wayfuse.storage.schema import audit


def _server(world: Any, data: Path, **settings: Any) -> Server:
    files = [SiteFiles(world.folder / "SITE")]
    return Server(Settings(data=str(data), **settings), files, clock=time.time, random=secrets.token_bytes)


def _walk(app: Any, world: Any, name: str = "phone") -> str:
    for envelope in envelopes(world.walks[0], name, "walk", 2.0):
        answer = app.post("/api/v1/in/own", encode(envelope))
        assert answer.status_code == 200, answer.text
    app.settle()
    track: str = answer.json()["accepted"][0]["track"]
    return track


def _features(app: Any, track: str) -> Any:
    return app.get(f"/api/v1/tracks/{track}/estimates").json()["features"]


def test_a_server_that_was_stopped_goes_on(world: Any, tmp_path: Path) -> None:
    with started(world, tmp_path) as app:
        track = _walk(app, world)
        before = _features(app, track)
        position = app.get(f"/api/v1/tracks/{track}/position").json()
    with started(world, tmp_path) as again:
        assert again.server.first_admin_token() is None
        assert _features(again, track) == before
        assert again.get(f"/api/v1/tracks/{track}/position").json() == position
        assert _walk(again, world) == track  # all of it repeated: nothing changes
        assert _features(again, track) == before


def test_idle_tracks_leave_the_memory_and_come_back(world: Any, tmp_path: Path) -> None:
    with started(world, tmp_path, idle_s=1e-3, checkpoint_s=1e-3) as app:
        track = _walk(app, world)
        before = _features(app, track)
    with started(world, tmp_path, idle_s=1e-3) as again:
        assert again.server.live.views() == []
        assert _features(again, track) == before
        stored = again.get(f"/api/v1/tracks/{track}/position").json()
        assert stored["properties"]["x"] is not None
        assert not again.get(f"/api/v1/tracks/{track}").json()["is_live"]
        assert _walk(again, world) == track
        assert _features(again, track) == before


def test_a_checkpoint_of_another_version_is_made_again_from_the_log(world: Any, tmp_path: Path) -> None:
    with started(world, tmp_path) as app:
        track = _walk(app, world)
        before = _features(app, track)
    server = _server(world, tmp_path)
    with server.engine.begin() as connection:
        connection.execute(text("UPDATE checkpoints SET state = :none"), {"none": b"of another version"})
    server.stop()
    with started(world, tmp_path) as again:
        assert again.server.live.counts["checkpoints of another version"] > 0
        assert _features(again, track) == before


def test_what_is_too_old_is_deleted(world: Any, tmp_path: Path) -> None:
    with started(world, tmp_path, checkpoint_s=1e-3, retain_log_h=1e-9, retain_tracks_d=1e-12) as app:
        track = _walk(app, world)
    with started(world, tmp_path, idle_s=1e-3, retain_log_h=1e-9, retain_tracks_d=1e-12) as again:
        n = len(list(again.server.log.read()))
        assert n > 5
        again.server.clean()
        assert len(list(again.server.log.read())) == 1  # the last one, for its number
        assert again.get(f"/api/v1/tracks/{track}").status_code == 404
        assert _walk(again, world) == track
        assert next(again.server.log.read()).seq == n


def test_the_place_of_what_is_deleted_is_given_back(world: Any, tmp_path: Path) -> None:
    with started(world, tmp_path) as app:
        rows = [AuditRow(1.0, "me", "dream", "s", "x" * 1000)._asdict()] * 5000
        with app.server.engine.begin() as connection:
            connection.execute(insert(audit), rows)

        def pages() -> int:
            with app.server.engine.connect() as connection:
                return int(connection.execute(text("PRAGMA page_count")).scalar_one())

        full = pages()
        app.server.clean()
        assert pages() < 0.5 * full
        assert _features(app, _walk(app, world))


def test_a_site_without_radio_map_refuses_until_one_is_published(world: Any, tmp_path: Path) -> None:
    with started(world, tmp_path, radio_map=None) as app:
        body = encode(next(envelopes(world.walks[0], "p")))
        refused = app.post("/api/v1/in/own", body)
        assert refused.status_code == 422
        assert "radio map" in refused.json()["error"]
        archive = (world.folder / "map.npz").read_bytes()
        version = app.post("/api/v1/radio-maps", archive, "survey").json()["version"]
        assert app.post("/api/v1/in/own", body).status_code == 422  # kept is not published
        app.post("/api/v1/radio-maps/publish", {"version": version}, "survey")
        assert app.post("/api/v1/in/own", body).status_code == 200


def test_two_servers_do_not_share_a_folder(world: Any, tmp_path: Path) -> None:
    first = _server(world, tmp_path)
    with pytest.raises(UsageError, match="another server"):
        _server(world, tmp_path)
    first.stop()
    _server(world, tmp_path).stop()


def test_what_cannot_be_served_is_told_before_the_start(world: Any, tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="no method"):
        _server(world, tmp_path / "a", method="guess")
    site, made = world.folder / "SITE", world.folder / "map.npz"
    assert match_radio_maps([site], [made]) == [SiteFiles(site, made)]
    assert match_radio_maps([site], []) == [SiteFiles(site, None)]
    with pytest.raises(UsageError, match="second radio map"):
        match_radio_maps([site], [made, made])
    with pytest.raises(RadioMapError, match="not served"):
        match_radio_maps([], [made])


def test_errors_of_the_command_are_one_line(run_cli: Callable[..., Any], world: Any, tmp_path: Path) -> None:
    data = ("--data", tmp_path / "data")
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        said = run_cli("serve", world.folder / "SITE", *data, "--port", taken.getsockname()[1])
    assert said.code == 2
    assert "administrator's token" in said.out
    assert said.err.splitlines()[-1].startswith("wayfuse: --port: cannot listen on 127.0.0.1")
    for arguments in (
        (tmp_path / "none",),
        (world.folder / "SITE", "--radio-map", tmp_path / "none.npz"),
        (world.folder / "SITE", "--config", tmp_path / "none.toml"),
        (world.folder / "SITE", "--database", "mysql://x/y"),
    ):
        said = run_cli("serve", *arguments, *data)
        assert said.code == 2
        assert said.err.startswith("wayfuse: ")
        assert "Traceback" not in said.err


def test_names_of_hosts_are_looked_up() -> None:
    listener = _listen("localhost", 0)
    assert listener.getsockname()[1] > 0
    listener.close()
    with pytest.raises(UsageError, match="cannot listen"):
        _listen("256.256.256.256", 0)


def test_the_data_folder_is_for_its_owner_alone(world: Any, tmp_path: Path) -> None:
    data = tmp_path / "made" / "here"
    _server(world, data).stop()
    assert data.stat().st_mode & 0o077 == 0
    shutil.rmtree(data)
