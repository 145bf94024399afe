"""What the page asks the server for, over HTTP."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import pytest
from service_running import running

from wayfuse.formats.reading import read
from wayfuse.service.replay import envelopes
from wayfuse.service.wire import encode

pytestmark = pytest.mark.slow  # a server in a process of its own, and radio maps that are built


@pytest.fixture(scope="module")
def client(served: Any) -> Iterator[Any]:
    with served.client() as client:
        yield client


def test_the_plan_is_for_readers_alone(client: Any) -> None:
    for path in ("/api/v1/plan", "/api/v1/plan/0", "/api/v1/survey", "/api/v1/survey/coverage?floor=0"):
        assert client.get(path).status_code == 200
        assert client.get(path, headers={"Authorization": ""}).status_code == 401
    read_token = client.post("/api/v1/tokens", json={"scopes": ["read"]}).json()["token"]
    reader = {"Authorization": f"Bearer {read_token}"}
    assert client.get("/api/v1/plan", headers=reader).status_code == 200
    assert client.get("/api/v1/survey", headers=reader).status_code == 403
    assert client.get("/api/v1/plan/7").status_code == 404
    assert client.get("/api/v1/survey/coverage?floor=7").status_code == 404


def test_particles_have_a_floor_a_place_and_a_weight(
    client: Any, new_phone: Callable[[str], Any], house: Any
) -> None:
    phone = new_phone("counted")
    place = phone.walk(15)
    of = client.get(f"/api/v1/tracks/{phone.track}/particles").json()
    assert len(of["x"]) == len(of["y"]) == len(of["floor"]) == len(of["weight"]) == 300
    assert sum(of["weight"]) == pytest.approx(1.0, abs=1e-3)
    here = [math.hypot(x - place["x"], y - place["y"]) for x, y in zip(of["x"], of["y"], strict=True)]
    assert sorted(here)[len(here) // 2] < 3 * place["radius_m_95"] + 1.0
    assert client.get("/api/v1/tracks/0000000000000000/particles").status_code == 404


def test_access_points_and_their_levels(client: Any) -> None:
    found = client.get("/api/v1/survey/access-points?limit=5").json()
    assert len(found["access_points"]) == 5 < found["n"]
    heard = [sum(ap["fingerprints"]) for ap in found["access_points"]]
    assert heard == sorted(heard, reverse=True)
    ap = found["access_points"][0]
    floor = max(range(3), key=lambda f: ap["fingerprints"][f])
    grid = client.get("/api/v1/survey/heat", params={"bssid": ap["bssid"], "floor": floor}).json()
    values = [v for row in grid["values"] for v in row if v is not None]
    assert grid["fingerprints"] == ap["fingerprints"][floor]
    assert len(values) > 50
    assert -100.0 <= min(values) < max(values) <= ap["loudest_dbm"][floor] + 0.1
    assert client.get("/api/v1/survey/heat?bssid=00:00:00:00:00:00&floor=0").status_code == 404


def _survey_by_hand(client: Any, address: str, path: Any, device: str) -> str:
    """Push a surveyor's scans and tap its waypoints, as if it had all happened just now; the walk's identifier."""
    recording = read(path)
    posts = list(envelopes(replace(recording, waypoints=()), device, "survey", 5.0))
    for envelope in posts:
        answer = client.post(f"{address}/own", content=encode(envelope))
        assert answer.status_code == 200, answer.text
    ahead = recording.span[1] - time.time()  # of the phone's clock
    floors = client.get("/api/v1/plan").json()["floors"]
    index = {f["level"]: f["floor"] for f in floors}
    frames = {f["level"]: f for f in floors}
    taps = []
    for w in recording.waypoints:
        x, y = (w.x, w.y) if math.isfinite(w.x) else _metres(frames[w.floor], w.lon, w.lat)
        taps.append({"t": w.t - ahead, "floor": index[w.floor], "x": x, "y": y})
    phones = client.get("/api/v1/survey").json()["phones"]
    body = {"device": phones[0]["device"], "now": time.time(), "taps": taps}
    answer = client.post("/api/v1/survey/walks", json=body)
    assert answer.status_code == 201, answer.text
    return str(answer.json()["id"])


def _metres(frame: Any, lon: float, lat: float) -> tuple[float, float]:
    (a, b), (c, d) = frame["matrix"]
    u, v = lon - frame["origin"][0], lat - frame["origin"][1]
    det = a * d - b * c
    return (d * u - b * v) / det, (a * v - c * u) / det


def _built(client: Any) -> Any:
    job = client.post("/api/v1/survey/jobs").json()
    for _ in range(600):
        job = client.get(f"/api/v1/survey/jobs/{job['id']}").json()
        if job["state"] != "running":
            return job
        time.sleep(0.1)
    raise AssertionError("the job does not end")


def test_a_survey_by_phone_and_map_gives_a_radio_map_that_tracks(
    client: Any, house: Any, served: Any, new_phone: Callable[[str], Any]
) -> None:
    assert _built(client)["state"] == "failed"  # there is nothing yet
    token = client.post("/api/v1/tokens", json={"scopes": ["ingest"]}).json()["token"]
    address = f"/in/{token}/survey"
    walked = [_survey_by_hand(client, address, p, f"surveyor {k}") for k, p in enumerate(house.survey[:4])]
    uploaded = []
    for path in house.survey[4:]:
        answer = client.post(
            "/api/v1/survey/recordings", params={"name": path.name}, content=path.read_bytes()
        )
        assert answer.status_code == 201, answer.text
        uploaded.append(answer.json()["id"])
    said = client.get("/api/v1/survey").json()
    assert sorted(w["id"] for w in said["walks"]) == sorted(walked)
    assert sorted(r["id"] for r in said["recordings"]) == sorted(uploaded)
    job = _built(client)
    assert job["state"] == "done", job
    result = job["result"]
    assert result["walks"] == len(walked) + len(uploaded)
    assert result["rooms"]
    of_hand = client.get("/api/v1/survey/coverage", params={"floor": 0, "version": result["version"]}).json()
    of_files = client.get("/api/v1/survey/coverage", params={"floor": 0, "version": 1}).json()
    assert of_hand["fingerprints"] == pytest.approx(of_files["fingerprints"], rel=0.1)  # of the same walks
    before = client.get("/api/v1/radio-maps").json()["published"]
    client.post("/api/v1/radio-maps/publish", json={"version": result["version"]})
    phone = new_phone("on the new map")
    last = phone.walk(len(phone.posts))
    assert last["state"] == "tracking"
    client.post("/api/v1/radio-maps/roll-back")
    assert client.get("/api/v1/radio-maps").json()["published"] == before
    old = new_phone("on the old map").walk(len(phone.posts))
    assert old["floor"] == last["floor"]
    assert math.hypot(old["x"] - last["x"], old["y"] - last["y"]) < 10.0
    for identifier in (*walked, *uploaded):
        assert client.delete(f"/api/v1/survey/parts/{identifier}").status_code == 200
    assert client.delete(f"/api/v1/survey/parts/{walked[0]}").status_code == 404


@pytest.mark.parametrize(
    ("walk", "status"),
    [
        ({"device": "0" * 16, "now": 1e9, "taps": [{"t": 1.0, "floor": 0, "x": 0, "y": 0}]}, 422),
        (
            {"device": "0" * 16, "now": 1e9, "taps": [{"t": t, "floor": 0, "x": 0, "y": 0} for t in (2, 1)]},
            422,
        ),
        (
            {"device": "0" * 16, "now": 1e9, "taps": [{"t": t, "floor": 9, "x": 0, "y": 0} for t in (1, 2)]},
            422,
        ),
        ({"device": "../x", "now": 1e9, "taps": [{"t": t, "floor": 0, "x": 0, "y": 0} for t in (1, 2)]}, 422),
        (
            {
                "device": "0" * 16,
                "now": 1e9,
                "taps": [{"t": t, "floor": 0, "x": 1e9, "y": 0} for t in (1, 2)],
            },
            422,
        ),
    ],
)
def test_walks_that_are_none_are_refused(client: Any, walk: Any, status: int) -> None:
    assert client.post("/api/v1/survey/walks", json=walk).status_code == status


def test_recordings_that_are_none_are_not_kept(client: Any) -> None:
    for body in (b"", b"\x00" * 100, b"WIFI;1.0;1.0;a;02:00:00:00:00:01;2412;-50\n"):
        answer = client.post("/api/v1/survey/recordings?name=x.txt", content=body)
        assert answer.status_code == 422, answer.text
        assert answer.json()["error"]
    assert client.get("/api/v1/survey").json()["recordings"] == []


def test_pushes_for_the_survey_need_a_token_and_a_platform(client: Any) -> None:
    token = client.post("/api/v1/tokens", json={"scopes": ["ingest"]}).json()["token"]
    push = {"deviceId": "d", "sessionId": "s", "messageId": 1, "payload": []}
    assert client.post("/in/wf_0_0/survey/sensor-logger", json=push).status_code == 401
    assert client.post(f"/in/{token}/survey/sensor-logger", json=push).status_code == 499
    assert client.post(f"/in/{token}/survey/sensor-logger?platform=android", json=push).status_code == 200
    assert client.post(f"/in/{token}/survey/nowhere", json=push).status_code == 404
    assert client.post(f"/in/{token}/survey/own", content=b"[").status_code == 400


def test_built_files_are_served_and_nothing_else(client: Any) -> None:
    for name in ("..%2fpage.js", "no.mjs", ".hidden.txt", "assets"):
        assert client.get(f"/web/assets/{name}").status_code == 404


def test_the_map_library_is_sent_packed_and_once(client: Any) -> None:
    path = "/web/assets/maplibre-gl.mjs"
    plain = client.get(path, headers={"Accept-Encoding": "identity"})
    if plain.status_code == 404:
        pytest.skip("NOT BUILT: make web")
    packed = client.get(path, headers={"Accept-Encoding": "gzip"})
    assert "content-encoding" not in plain.headers
    assert packed.headers["content-encoding"] == "gzip"
    assert int(packed.headers["content-length"]) < int(plain.headers["content-length"]) / 2
    assert packed.content == plain.content
    assert packed.headers["cache-control"] == "no-cache"
    again = client.get(path, headers={"Accept-Encoding": "gzip", "If-None-Match": packed.headers["etag"]})
    assert (again.status_code, again.content) == (304, b"")
    assert client.get("/").headers["cache-control"] == "no-store"
    assert client.get("/").headers["content-security-policy"] == packed.headers["content-security-policy"]


def test_a_site_without_a_radio_map_is_surveyed_from_nothing(house: Any, tmp_path: Any) -> None:
    with running(house.folder, tmp_path / "data", particles=100) as server, server.client() as client:
        nothing = client.get("/api/v1/survey/coverage?floor=1").json()
        assert (nothing["version"], nothing["fingerprints"]) == (None, 0)
        assert len(nothing["next"]) == 5
        refused = client.get("/api/v1/survey/access-points")
        assert refused.status_code == 422
        assert "no radio map" in refused.json()["error"]
        token = client.post("/api/v1/tokens", json={"scopes": ["ingest"]}).json()["token"]
        for k, path in enumerate(house.survey[:2]):
            _survey_by_hand(client, f"/in/{token}/survey", path, f"surveyor {k}")
        job = _built(client)
        assert job["state"] == "done", job
        client.post("/api/v1/radio-maps/publish", json={"version": job["result"]["version"]})
        found = client.get("/api/v1/survey/coverage?floor=0").json()
        assert (found["version"], found["fingerprints"] > 10) == (1, True)
