"""What is kept of a person: given out when they ask, deleted when they say so, and by itself when it is old."""

from __future__ import annotations

import csv
import io
import json
import os
import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
import pytest
from service_running import App, started

from wayfuse.core.errors import ConfigError
from wayfuse.service.replay import envelopes
from wayfuse.service.settings import Settings
from wayfuse.service.web.survey_store import Push, SurveyStore, TappedWalk, Waypoint
from wayfuse.service.web.surveys import Surveys
from wayfuse.service.wire import Ap, Scan, encode

DAY = 86_400.0
DEVICE, OTHER = "ab" * 8, "cd" * 8


def _push(arrived: float) -> Push:
    return Push(arrived, arrived, [Scan(arrived, [Ap("02:00:00:00:00:01", -50.0)])])


def _walk(device: str, t: float) -> TappedWalk:
    return TappedWalk(device, [Waypoint(t - 9.0, 0, 1.0, 2.0), Waypoint(t, 0, 3.0, 2.0)])


# --- the survey's files ---------------------------------------------------------------------------------------


def test_old_parts_of_a_survey_go_and_new_ones_stay(tmp_path: Path) -> None:
    store = SurveyStore(tmp_path)
    for arrived in (1.0, 2.0, 3.0):
        store.add_push(DEVICE, _push(arrived))
    store.add_push(OTHER, _push(1.5))
    old, new = store.add_walk(_walk(DEVICE, 2.4)), store.add_walk(_walk(OTHER, 2.6))
    (gone, before), (_, after) = store.add_recording("a", b"a"), store.add_recording("b", b"b")
    os.utime(before, (2.0, 2.0))
    os.utime(after, (3.0, 3.0))
    store.trim(2.5)
    for one in (store, SurveyStore(tmp_path)):  # as it is now, and as it is read again
        assert [p.arrived for p in one.pushes(DEVICE)] == [3.0]
        assert [(p.device, p.scans) for p in one.phones()] == [(DEVICE, 1)]
        assert set(one.walks()) == {new} != {old}
        assert list(one.recordings().values()) == [after]
        assert gone not in one.recordings()
    store.add_push(DEVICE, _push(4.0))
    assert [p.arrived for p in store.pushes(DEVICE)] == [3.0, 4.0]


def test_a_forgotten_phone_is_in_no_survey(tmp_path: Path) -> None:
    store = SurveyStore(tmp_path)
    for device in (DEVICE, OTHER):
        store.add_push(device, _push(1.0))
        store.add_walk(_walk(device, 2.0))
    assert store.forget(DEVICE) == 2
    assert store.forget(DEVICE) == 0
    assert not list(store.pushes(DEVICE))
    assert [p.device for p in store.phones()] == [OTHER]
    assert [w.device for w in store.walks().values()] == [OTHER]


def test_a_line_that_a_crash_cut_off_takes_no_other_with_it(tmp_path: Path) -> None:
    SurveyStore(tmp_path).add_push(DEVICE, _push(1.0))
    with (tmp_path / "scans" / f"{DEVICE}.jsonl").open("ab") as out:
        out.write(encode(_push(2.0))[:-9])
    store = SurveyStore(tmp_path)
    store.add_push(DEVICE, _push(3.0))
    store.add_push(DEVICE, _push(4.0))
    assert [p.arrived for p in store.pushes(DEVICE)] == [1.0, 3.0, 4.0]


# --- the server -------------------------------------------------------------------------------------------------


@pytest.fixture
def small(world: Any, tmp_path: Path) -> Iterator[App]:
    with started(world, tmp_path) as app:
        yield app


def _walks_and_surveys(app: App, world: Any, name: str) -> str:
    """A phone walks, and pushes scans for the survey; its track."""
    for envelope in envelopes(world.walks[1], name, "s", 5.0):
        track = app.post("/api/v1/in/own", encode(envelope)).json()["accepted"][0]["track"]
    scan = {"t": 9.0, "aps": [["00:00:00:00:00:99", -50.0]]}
    pushed = app.client.post(
        f"/in/{app.tokens['ingest']}/survey/own", json={"v": 1, "device": name, "wifi": [scan]}
    )
    assert pushed.json()["scans"] == 1
    app.settle()
    return str(track)


def test_all_of_a_phone_is_given_out_and_then_deleted(small: App, world: Any) -> None:
    track, other = (_walks_and_surveys(small, world, name) for name in ("leaver", "stayer"))
    small.client.put(
        "/api/v1/devices", json={"name": "leaver", "platform": "ios"}, headers=small.headers("survey")
    )
    path = "/api/v1/devices/export?name=leaver"
    assert small.get(path, "survey").status_code == 403
    with zipfile.ZipFile(io.BytesIO(small.get(path, "admin").content)) as archive:
        said = json.loads(archive.read("phone.json"))
        (scans,) = [n for n in archive.namelist() if n.startswith("survey/")]
        assert track in {row["track"] for row in said["tracks"]}
        assert other not in {row["track"] for row in said["tracks"]}
        assert said["enrolment"][0]["platform"] == "ios"
        rows = list(csv.DictReader(archive.read(f"tracks/{track}.csv").decode().splitlines()))
        features = small.get(f"/api/v1/tracks/{track}/estimates").json()["features"]
        assert [float(row["x"]) for row in rows] == [f["properties"]["x"] for f in features]
        table = pq.read_table(io.BytesIO(archive.read(f"observations/{track}.parquet")))
        assert table.num_rows > 1000
        assert archive.read(scans).count(b"\n") == 1
    gone = small.post("/api/v1/devices/forget?name=leaver", {}, "admin").json()
    assert gone == {"tracks": len(said["tracks"]), "survey_files": 1}
    with zipfile.ZipFile(io.BytesIO(small.get(path, "admin").content)) as archive:
        assert json.loads(archive.read("phone.json")) == {"enrolment": [], "tracks": []}
        assert archive.namelist() == ["phone.json"]
    assert small.get(f"/api/v1/tracks/{other}").status_code == 200
    assert len(small.get("/api/v1/survey", "survey").json()["phones"]) == 1


def test_what_is_old_is_deleted_by_itself(world: Any, tmp_path: Path) -> None:
    with started(world, tmp_path, retain_survey_d=2.0, retain_audit_d=2.0) as app:
        surveys = Surveys(app.server)
        now = app.server.clock()
        surveys.store("one that is gone").add_push(DEVICE, _push(now - 3.0 * DAY))
        surveys.store(world.site.name).add_push(DEVICE, _push(now - DAY))
        app.server.audit.add(now - 3.0 * DAY, "a", "too old", "s")
        app.server.audit.add(now - DAY, "a", "young", "s")
        surveys.clean()
        app.server.clean()
        assert surveys.store("one that is gone").phones() == []
        assert [p.scans for p in surveys.store(world.site.name).phones()] == [1]
        actions = [row.action for row in app.server.audit.newest()]
        assert "young" in actions
        assert "too old" not in actions


def test_a_retention_has_to_be_positive() -> None:
    with pytest.raises(ConfigError, match="retain_survey_d must be positive"):
        Settings(retain_survey_d=0.0)


# --- who may make tokens ----------------------------------------------------------------------------------------


def test_who_surveys_makes_tokens_of_phones_and_no_others(small: App) -> None:
    made = small.post("/api/v1/tokens", {"scopes": ["ingest"]}, "survey")
    assert made.status_code == 201
    assert made.json()["scopes"] == ["ingest"]
    for scopes in (["survey"], ["ingest", "read"], ["admin"]):
        assert small.post("/api/v1/tokens", {"scopes": scopes}, "survey").status_code == 403
    assert small.post("/api/v1/tokens", {"scopes": ["ingest"]}, "read").status_code == 403


def test_who_runs_one_site_reads_no_others_deeds(small: App, world: Any) -> None:
    text, _ = small.server.tokens.create({"admin"}, small.server.clock(), site=world.site.name)
    headers = {"Authorization": f"Bearer {text}"}
    for path in ("/api/v1/audit", "/api/v1/devices/export?name=a"):
        assert small.client.get(path, headers=headers).status_code == 403
    assert small.client.get("/api/v1/tokens", headers=headers).status_code == 200
