"""Anchors that come over the interface: checked, used by tracks that begin afterwards, kept, taken away."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from alembic import command
from alembic.config import Config
from service_running import App, packed, started
from sqlalchemy import create_engine, text

from csi_room import Room, make_room
from wayfuse.radio.ap_places import ApPlaces, write_ap_places
from wayfuse.radio.archive import write_archive
from wayfuse.sensors.records import bssid_text
from wayfuse.service.server import SiteFiles
from wayfuse.storage import database
from wayfuse.storage.database import open_database
from wayfuse.storage.tracks import TrackStore

PATH, CHANNEL = "/api/v1/anchors", "/api/v1/anchors/channel"


@pytest.fixture(scope="module")
def room() -> Room:
    return make_room()


@pytest.fixture(scope="module")
def files(room: Room, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The room's plan, and the two files of its anchors apart from it."""
    folder = tmp_path_factory.mktemp("room")
    room.save(folder / "SITE")
    for name in ("access_points.csv", "channel.npz"):
        (folder / "SITE" / name).rename(folder / name)
    return folder


def _imported(app: App, files: Path) -> None:
    said = app.post("/api/v1/sites?format=wayfuse", packed(files / "SITE"), "admin")
    assert said.status_code == 201, said.text


def _put(app: App, path: str, body: bytes, scope: str = "survey") -> Any:
    return app.client.put(path, content=body, headers=app.headers(scope))


def _delete(app: App, path: str, scope: str = "survey") -> Any:
    return app.client.delete(path, headers=app.headers(scope))


def _walk(app: App, room: Room, phone: str, first: int = 0, last: int = 8) -> Any:
    """Ranges that a phone measures which stands at (9, 6); the last answer."""
    for n in range(first, last):
        columns = zip(room.places.bssid, room.places.x, room.places.y, strict=True)
        ranges = [[float(n), bssid_text(int(a)), float(np.hypot(x - 9.0, y - 6.0))] for a, x, y in columns]
        said = app.post("/api/v1/in/own", {"v": 1, "device": phone, "id": n, "ranges": ranges})
        if said.status_code != 200:
            break
    return said


def _place(app: App, answer: Any) -> tuple[float, float]:
    app.settle()
    track = answer.json()["accepted"][0]["track"]
    last = app.get(f"/api/v1/tracks/{track}/estimates").json()["features"][-1]["properties"]
    return last["x"], last["y"]


def _shifted(room: Room, folder: Path, by: float) -> bytes:
    write_ap_places(folder / "shifted.csv", replace(room.places, x=room.places.x + by), room.site.floor_names)
    return (folder / "shifted.csv").read_bytes()


@pytest.fixture
def app(files: Path, tmp_path: Path) -> Iterator[App]:
    """A server to which the room was uploaded, without its anchors."""
    with started(None, tmp_path, sites=[], particles=300) as app:
        _imported(app, files)
        yield app


@pytest.fixture(scope="module")
def bare(files: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[App]:
    """The same, for tests that change nothing."""
    with started(None, tmp_path_factory.mktemp("bare"), sites=[]) as app:
        _imported(app, files)
        yield app


def test_a_phone_with_ranges_is_tracked_at_an_uploaded_site_without_a_radio_map(
    app: App, room: Room, files: Path
) -> None:
    refused = _walk(app, room, "p")
    assert (refused.status_code, "no radio map yet" in refused.json()["error"]) == (422, True)
    said = _put(app, PATH, (files / "access_points.csv").read_bytes())
    n = len(room.places)
    expected = {
        "site": room.site.name,
        "is_of_folder": False,
        "anchors": n,
        "channel_anchors": 0,
        "unplaced": [],
    }
    assert (said.status_code, said.json()) == (200, expected)
    x, y = _place(app, _walk(app, room, "p"))
    assert np.hypot(x - 9.0, y - 6.0) < 1.5
    said = _put(app, CHANNEL, (files / "channel.npz").read_bytes())
    assert (said.status_code, said.json()) == (200, expected | {"channel_anchors": n})
    (site,) = app.get("/api/v1/sites").json()["sites"]
    assert (site["anchors"], site["channel_anchors"], site["radio_map"]) == (n, n, None)
    places = app.get(PATH, "survey").json()["places"]
    assert [(p["bssid"], p["level"]) for p in places] == [
        (bssid_text(int(b)), room.site.floor_names[f])
        for b, f in zip(room.places.bssid, room.places.floor, strict=True)
    ]
    deeds = [(a["action"], a["detail"]) for a in app.get("/api/v1/audit", "admin").json()["audit"][:2]]
    assert deeds == [("upload channel model", f"{n} anchors"), ("upload anchors", f"{n} anchors")]


def test_tracks_keep_the_anchors_they_began_with_also_after_a_restart(
    room: Room, files: Path, tmp_path: Path
) -> None:
    moved = _shifted(room, tmp_path, 1.5)
    with started(None, tmp_path / "data", sites=[], particles=300) as app:
        _imported(app, files)
        assert _put(app, PATH, (files / "access_points.csv").read_bytes()).status_code == 200
        early = _walk(app, room, "early")
        assert _put(app, PATH, moved).status_code == 200
        before = _place(app, _walk(app, room, "early", 8, 10))
        late = _place(app, _walk(app, room, "late"))
        assert late[0] - before[0] == pytest.approx(1.5, abs=0.7)
        tracks = {t["track"]: t["anchor_version"] for t in app.get("/api/v1/tracks").json()["tracks"]}
        assert sorted(tracks.values()) == [1, 2]
        assert tracks[early.json()["accepted"][0]["track"]] == 1
    with started(None, tmp_path / "data", sites=[], particles=300) as app:
        assert _place(app, _walk(app, room, "early", 10, 14))[0] == pytest.approx(before[0], abs=0.5)
        assert _place(app, _walk(app, room, "third"))[0] == pytest.approx(late[0], abs=0.5)
        assert _delete(app, PATH).json()["anchors"] == 0
        assert _walk(app, room, "fourth").status_code == 422
    with started(None, tmp_path / "data", sites=[]) as app:
        assert app.get("/api/v1/sites").json()["sites"][0]["anchors"] == 0


def test_a_channel_model_needs_places_and_says_which_are_missing(app: App, room: Room, files: Path) -> None:
    model = (files / "channel.npz").read_bytes()
    refused = _put(app, CHANNEL, model)
    assert (refused.status_code, refused.json()["remedy"]) == (422, "upload the places first")
    lines = (files / "access_points.csv").read_bytes().splitlines(keepends=True)
    assert _put(app, PATH, b"".join(lines[:-1])).status_code == 200
    assert _put(app, CHANNEL, model).json()["unplaced"] == [bssid_text(int(room.places.bssid[-1]))]
    tracker = app.server.worlds[room.site.name].tracker(0, app.server.anchors.version(room.site.name))
    assert tracker.channel is not None
    assert _delete(app, CHANNEL).json()["channel_anchors"] == 0
    tracker = app.server.worlds[room.site.name].tracker(0, app.server.anchors.version(room.site.name))
    assert tracker.channel is None
    assert tracker.engine.uses_ranges


HEADER = b"bssid,x,y,floor,height\n"


@pytest.mark.parametrize(
    ("body", "said"),
    [
        (b"", "the body is empty"),
        (b" \n\n", "the body is empty"),
        (HEADER, "there is no anchor in it"),
        (b"a,b\n1,2\n", "line 1: the header lacks a column"),
        (HEADER + b"a,1,2,FLOOR,\na,1,2,FLOOR,\n", "line 3: bssid #"),
        (HEADER + b"a,1,2,FLOOR,\nb,1,2,cellar,\n", "line 3: floor 'cellar' is none of the site's"),
        (HEADER + b"a,1,2,FLOOR\n", "line 2: 4 fields"),
        (HEADER + b"a,nan,2,FLOOR,\n", "line 2: x 'nan'"),
        (HEADER + b"a,1,2," + b"x" * 5000 + b",\n", "line 2: floor 'xxx"),
        (HEADER + b"a,1,2," + b"x" * 200_000 + b",\n", "line 2: field larger"),
        (b"\xff\xfe", "is not text in UTF-8"),
        (b"bssid,x,y,floor,height,sigma\na,1,2,FLOOR,,3\n", "places of anchors have to be measured"),
        (b"x" * 1_100_000, "longer than 1048576 bytes"),
    ],
    ids=range(13),
)
def test_bad_places_are_refused_with_their_line_and_nothing_changes(
    bare: App, room: Room, body: bytes, said: str
) -> None:
    answer = _put(bare, PATH, body.replace(b"FLOOR", room.site.floor_names[0].encode()))
    assert answer.status_code == (413 if "longer" in said else 422)
    error = answer.json()
    assert said in error["error"]
    assert error["remedy"]
    assert len(answer.content) < 1000
    assert "/tmp" not in answer.text  # noqa: S108 (a word that must not be told)
    assert bare.get(PATH, "survey").json()["anchors"] == 0


def _model(folder: Path, room: Room, **changes: Any) -> bytes:
    arrays = {
        "anchor": np.array(list(room.model.anchors), np.uint64),
        "regressions": np.array([list(a) for a in room.model.anchors.values()]),
        "subcarriers": np.asarray(room.model.subcarriers, np.int64),
    }
    write_archive(folder / "m.npz", "channel-model", 1, {"site": room.site.name}, arrays | changes)
    return (folder / "m.npz").read_bytes()


def test_a_channel_model_is_not_believed(app: App, room: Room, files: Path, tmp_path: Path) -> None:
    assert _put(app, PATH, (files / "access_points.csv").read_bytes()).status_code == 200
    good = (files / "channel.npz").read_bytes()
    replace(room.model, site="elsewhere").save(tmp_path / "other.npz")
    np.savez(tmp_path / "pickled.npz", anchor=np.array([{}], dtype=object))
    n = len(room.model.anchors)
    bad = [
        b"",
        b"PK\x03\x04",
        good[:-30],
        (tmp_path / "other.npz").read_bytes(),
        (tmp_path / "pickled.npz").read_bytes(),
        _model(tmp_path, room, anchor=np.full(n, np.nan)),
        _model(tmp_path, room, subcarriers=room.model.subcarriers * 10_000_000),
        _model(tmp_path, room, subcarriers=np.arange(7)),
        _model(tmp_path, room, regressions=np.full((n, 1, 2), np.nan)),
    ]
    for body in bad:
        answer = _put(app, CHANNEL, body)
        assert answer.status_code == 422, answer.text
        assert answer.json()["error"]
        assert "/tmp" not in answer.text  # noqa: S108
    assert _put(app, CHANNEL, _model(tmp_path, room)).status_code == 200


def test_who_may_not_and_what_is_of_a_folder(app: App, room: Room, files: Path, tmp_path: Path) -> None:
    body = (files / "access_points.csv").read_bytes()
    for scope in ("read", "ingest"):
        assert _put(app, PATH, body, scope).status_code == 403
        assert _delete(app, PATH, scope).status_code == 403
        assert app.get(PATH, scope).status_code == 403
    of_another, _ = app.server.tokens.create({"survey"}, app.server.clock(), site="another")
    answer = app.client.put(
        f"{PATH}?site={room.site.name}", content=body, headers={"Authorization": f"Bearer {of_another}"}
    )
    assert answer.status_code == 403
    with started(None, tmp_path / "b", sites=[SiteFiles(room.save(tmp_path / "SITE"))]) as given:
        for answer in (_put(given, PATH, body), _put(given, CHANNEL, b"x"), _delete(given, PATH)):
            assert answer.status_code == 409
            assert "of its folder" in answer.json()["error"]
        assert given.get(PATH, "survey").json()["is_of_folder"]
        assert given.get("/api/v1/sites").json()["sites"][0]["anchors"] == len(room.places)


def test_the_same_again_changes_nothing_and_a_site_takes_its_anchors_with_it(
    app: App, room: Room, files: Path
) -> None:
    body = (files / "access_points.csv").read_bytes()
    for _ in range(2):
        assert _put(app, PATH, body).status_code == 200
    assert app.server.anchors.version(room.site.name) == 1
    assert _delete(app, f"/api/v1/sites?site={room.site.name}", "admin").status_code == 200
    _imported(app, files)
    assert app.get(PATH, "survey").json()["anchors"] == 0


def test_anchors_refine_the_tracks_of_a_radio_map(world: Any, tmp_path: Path) -> None:
    site = world.site
    places = ApPlaces(
        np.arange(1, 4, dtype=np.uint64),
        np.array([1.0, 5.0, 9.0]),
        np.array([1.0, 5.0, 2.0]),
        np.zeros(3, np.int32),
        np.full(3, np.nan),
    )
    write_ap_places(tmp_path / "a.csv", places, site.floor_names)
    with started(world, tmp_path / "data", sites=[]) as app:
        plan = packed(world.folder / "SITE")
        assert app.post("/api/v1/sites?format=wayfuse", plan, "admin").status_code == 201
        app.post("/api/v1/radio-maps", (world.folder / "map.npz").read_bytes(), "survey")
        assert _put(app, PATH, (tmp_path / "a.csv").read_bytes()).status_code == 200
        app.post("/api/v1/radio-maps/publish", {"version": 1}, "survey")
        assert app.server.in_use(site.name) == (1, 1)
        tracker = app.server.worlds[site.name].tracker(1, 1)
        assert tracker.engine.uses_ranges
        assert tracker.engine.uses_scans
        assert not app.server.worlds[site.name].tracker(1, 0).engine.uses_ranges


def test_a_database_of_before_gets_the_new_column(tmp_path: Path) -> None:
    url = f"sqlite:///{tmp_path / 'old.db'}"
    engine = create_engine(url)
    config = Config()
    config.set_main_option("script_location", str(Path(database.__file__).parent / "migrations"))
    config.set_main_option("path_separator", "os")
    with engine.begin() as connection:
        config.attributes["connection"] = connection
        command.upgrade(config, "0001")
        connection.execute(text("INSERT INTO tracks VALUES ('t', 's', 'd', 3, 1.0, 2.0)"))
    engine.dispose()
    engine = open_database(url)
    row = TrackStore(engine).row("t")
    engine.dispose()
    assert row is not None
    assert (row.map_version, row.heard, row.anchor_version) == (3, 2.0, 0)
