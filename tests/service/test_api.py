"""The interface over HTTP, in this process: what comes in, what goes out, and who may."""

from __future__ import annotations

import json
import math
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import msgspec
import pytest
from service_running import started

from wayfuse.service.export import CSV_COLUMNS
from wayfuse.service.replay import envelopes
from wayfuse.service.routes.examples import EXAMPLES
from wayfuse.service.security import HEADERS
from wayfuse.service.wire import encode

Walked = dict[str, Any]


@pytest.fixture(scope="module")
def walked(app: Any, world: Any) -> Walked:
    """The answer to the last envelope of a walk that was posted whole."""
    for envelope in envelopes(world.walks[0], "walker", "session", 2.0):
        answer = app.post("/api/v1/in/own", encode(envelope))
        assert answer.status_code == 200, answer.text
    app.settle()
    return answer.json()["accepted"][0]


# --- in ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("adapter", EXAMPLES)
def test_the_examples_of_the_description_are_accepted(app: Any, adapter: str) -> None:
    body = EXAMPLES[adapter]
    content = body.encode() if isinstance(body, str) else json.dumps(body).encode()
    query = "?platform=android&device=phone-7"
    answer = app.post(f"/api/v1/in/{adapter}{query}", content)
    assert answer.status_code == 200, answer.text
    accepted = answer.json()["accepted"]
    assert len(accepted) == 1
    assert accepted[0]["records"] > 0
    assert accepted[0]["left_out"] == {}


@pytest.mark.parametrize("way", ["sensor-logger", "data", "passive", "own"])
def test_clients_without_headers_have_the_token_in_the_address(app: Any, way: str) -> None:
    adapter = {"data": "find3", "passive": "find3"}.get(way, way)
    path = f"/in/{app.tokens['ingest']}/{way}?platform=android"
    answer = app.client.post(path, json=EXAMPLES[adapter])
    assert answer.status_code == 200, answer.text
    if adapter == "find3":  # the words that its clients wait for
        assert answer.json() == {"success": True, "message": "inserted data"}
    assert app.client.post(f"/in/wf_0_0/{way}", json=EXAMPLES[adapter]).status_code in {401, 429}
    assert app.client.post(f"/in/{app.tokens['read']}/{way}", json=EXAMPLES[adapter]).status_code == 403


def test_a_phone_whose_platform_is_unknown_is_told_on_its_screen(app: Any) -> None:
    push = EXAMPLES["sensor-logger"] | {"deviceId": "new one"}
    answer = app.post("/api/v1/in/sensor-logger", push)
    assert answer.status_code == 499
    assert "Android or an iPhone" in answer.text
    enrolled = app.client.put(
        "/api/v1/devices", json={"name": "new one", "platform": "ios"}, headers=app.headers("survey")
    )
    assert enrolled.status_code == 200
    assert "new one" not in enrolled.text
    assert app.post("/api/v1/in/sensor-logger", push).status_code == 200
    assert [d["platform"] for d in app.get("/api/v1/devices", "survey").json()["devices"]] == ["ios"]


def test_frames_of_several_targets_are_apart_and_random_addresses_are_nobody(app: Any) -> None:
    frames = [
        {"target": "tag-1", "rssi": -50.0, "seq": 1},
        {"target": "da:a1:19:00:00:01", "rssi": -50.0, "seq": 2},
        {"target": "tag-2", "rssi": -60.0, "seq": 3},
        {"target": "tag-1", "rssi": -51.0, "seq": 4},
    ]
    answer = app.post("/api/v1/in/anchors", {"v": 1, "anchor": "an-1", "t": 10**18, "frames": frames})
    first, second = answer.json()["accepted"]
    assert (first["records"], second["records"]) == (2, 1)
    assert first["left_out"] == {"target with a random address": 1}
    assert first["track"] != second["track"]
    app.settle()
    stored = [e.body for e in app.server.log.read() if e.track in {first["track"], second["track"]}]
    assert [b.count(b"tag-1") for b in stored] == [2, 0]
    assert not any(b"da:a1" in b for b in stored)


BAD = [
    (b"", 400),
    (b"{", 400),
    (b"null", 400),
    (b"\xff\xfe", 400),
    (b"[" * 100_000, 400),
    (b'{"v":2,"device":"a"}', 400),
    (b'{"v":1,"device":""}', 400),
    (b'{"v":1,"device":"a","acceleration":[[1,2,3]]}', 400),
    (b'{"v":1,"device":"a","acceleration":[[1,2,3,"x"]]}', 400),
    (b'{"v":1,"device":"a","pressure":' + json.dumps([[0, 0]] * 60_000).encode() + b"}", 400),
    (b" " * 1_048_577, 413),
]


@pytest.mark.parametrize(("body", "status"), BAD, ids=range(len(BAD)))
def test_what_cannot_be_read_is_refused_in_words(app: Any, body: bytes, status: int) -> None:
    answer = app.post("/api/v1/in/own", body)
    assert answer.status_code == status
    said = answer.json()
    assert said["error"]
    assert "Traceback" not in answer.text


def test_bad_records_are_counted_and_the_good_ones_taken(app: Any) -> None:
    body = {
        "v": 1,
        "device": "half broken",
        "pressure": [[100.0, 1000.0], [101.0, 1e9], [-5.0, 1000.0]],
        "wifi": [{"t": 100.0, "aps": [["00:1b:63:00:00:01", 500.0], ["00:1b:63:00:00:02", -50.0]]}],
        "ranges": [[100.0, "a", -1.0], [100.0, "a", 2.0]],
    }
    accepted = app.post("/api/v1/in/own", body).json()["accepted"][0]
    assert accepted["records"] == 3
    assert accepted["left_out"] == {
        "pressure: out of range": 1,
        "pressure: time not finite or out of range": 1,
        "wifi: out of range": 1,
        "range: out of range": 1,
    }


def test_access_points_that_want_to_be_in_no_map_are_in_none(app: Any) -> None:
    push = json.loads(json.dumps(EXAMPLES["sensor-logger"]))
    push["payload"][1]["values"]["ssid"] = "office_nomap"
    accepted = app.post("/api/v1/in/sensor-logger?platform=android", push).json()["accepted"][0]
    assert accepted["left_out"] == {"wifi: owner wants it in no map": 1}


def test_a_packed_body_and_a_wrong_method_are_refused(app: Any) -> None:
    packed = app.post("/api/v1/in/own", b"x", headers={"Content-Encoding": "gzip"})
    assert packed.status_code == 415
    assert app.client.get("/api/v1/in/own").status_code == 405
    assert app.client.get("/nowhere").json()["error"] == "Not Found"


# --- out --------------------------------------------------------------------------------------------------


def test_positions_are_geojson_with_reasons(app: Any, walked: Walked) -> None:
    collection = app.get("/api/v1/positions").json()
    assert collection["type"] == "FeatureCollection"
    mine = [f for f in collection["features"] if f["properties"]["track"] == walked["track"]]
    assert mine == [app.get(f"/api/v1/tracks/{walked['track']}/position").json()]
    place, said = mine[0]["geometry"], mine[0]["properties"]
    floor = app.server.worlds[said["site"]].site.floors[said["floor"]]
    assert place["coordinates"] == pytest.approx(floor.to_lonlat((said["x"], said["y"])).tolist())
    assert said["level"] == floor.name
    assert 0.0 < said["radius_m_68"] <= said["radius_m_95"]
    assert said["state"] == "tracking"
    assert set(said["why"]) == {"steps", "access_points", "share_blocked", "effective_particles"}
    (xx, xy), (yx, yy) = said["covariance_m2"]
    assert xy == yx
    assert xx * yy >= xy * xy


def test_a_track_can_be_asked_in_parts(app: Any, walked: Walked) -> None:
    path = f"/api/v1/tracks/{walked['track']}/estimates"
    features = app.get(path).json()["features"]
    assert [f["properties"]["n"] for f in features] == list(range(len(features)))
    times = [f["properties"]["t"] for f in features]
    middle = times[len(times) // 2]
    assert app.get(path, params={"since": middle}).json()["features"] == [
        f for f in features if f["properties"]["t"] >= middle
    ]
    assert (
        app.get(path, params={"until": middle, "limit": 3}).json()["features"]
        == [f for f in features if f["properties"]["t"] <= middle][-3:]
    )


def test_the_counters_of_a_track_are_told(app: Any, walked: Walked, world: Any) -> None:
    said = app.get(f"/api/v1/tracks/{walked['track']}").json()
    assert said["is_live"]
    assert said["is_ended"]
    n = sum(1 for _ in world.walks[0].records())
    assert said["counts"]["records"] == n - len(world.walks[0].waypoints)
    assert said["counts"]["used"] > 0
    listed = app.get("/api/v1/tracks", params={"device": said["device"]}).json()["tracks"]
    assert [t["track"] for t in listed] == [walked["track"]]


def test_files_of_a_track(app: Any, walked: Walked) -> None:
    text = app.get(f"/api/v1/tracks/{walked['track']}/export").text
    assert text.splitlines()[0] == ",".join(CSV_COLUMNS)
    gpx = app.get(f"/api/v1/tracks/{walked['track']}/export?format=gpx")
    assert gpx.headers["content-type"].startswith("application/gpx+xml")
    points = ET.fromstring(gpx.text).findall(".//{http://www.topografix.com/GPX/1/1}trkpt")  # noqa: S314
    assert len(points) == len(text.splitlines()) - 1
    assert all(abs(float(p.attrib["lat"])) <= 90.0 for p in points)
    moving = app.get(f"/api/v1/tracks/{walked['track']}/export?format=mf-json")
    assert moving.headers["content-disposition"].endswith('.mf.json"')
    assert len(moving.json()["temporalGeometry"]["coordinates"]) > 10


def test_metrics_health_and_sites(app: Any, walked: Walked) -> None:
    page = app.get("/metrics").text
    assert 'wayfuse_bodies_total{adapter="own",outcome="accepted"}' in page
    assert "wayfuse_ingest_to_position_seconds_count" in page
    assert app.client.get("/health").json()["status"] == "ok"
    site = app.get("/api/v1/sites").json()["sites"][0]
    assert site["levels"] == ["F1", "F2"]
    assert site["radio_map"] == 1


@pytest.mark.parametrize("track", ["0" * 16, "nonsense", "%00", "a" * 5000, "..%2f.."])
def test_tracks_that_are_not_there(app: Any, track: str) -> None:
    for rest in ("", "/position", "/estimates", "/export"):
        assert app.get(f"/api/v1/tracks/{track}{rest}").status_code == 404


def _events(text: str) -> Iterator[tuple[int | None, str, Any]]:
    """Identifier, kind, and what is said; events of zones have no identifier: the position of their batch has it."""
    for block in text.strip().split("\n\n"):
        fields = dict(line.split(": ", 1) for line in block.splitlines())
        yield int(fields["id"]) if "id" in fields else None, fields["event"], json.loads(fields["data"])


def test_a_stream_of_events_is_resumed(app: Any, walked: Walked) -> None:
    first = list(_events(app.get("/api/v1/events?once=true").text))
    assert [kind for _, kind, _ in first] == ["snapshot"]
    assert walked["track"] in {f["properties"]["track"] for f in first[0][2]}
    last = app.server.hub.last
    resumed = app.client.get(
        f"/api/v1/events?once=true&track={walked['track']}",
        headers=app.headers("read") | {"Last-Event-ID": "0"},
    )
    events = list(_events(resumed.text))
    assert {kind for _, kind, _ in events} - {"zone"} == {"position"}
    assert all((i is None) == (kind == "zone") for i, kind, _ in events)
    ids = [i for i, _, _ in events if i is not None]
    assert ids == sorted(set(ids))
    assert events[-1][2]["feature"] == app.get(f"/api/v1/tracks/{walked['track']}/position").json()
    unknown = app.client.get(
        "/api/v1/events?once=true", headers=app.headers("read") | {"Last-Event-ID": str(last + 1000)}
    )
    assert [kind for _, kind, _ in _events(unknown.text)] == ["snapshot"]


def test_a_websocket_takes_envelopes_and_tells_positions(app: Any, world: Any) -> None:
    some = list(envelopes(world.walks[1], "talker", "w", 5.0))
    with app.client.websocket_connect("/api/v1/ws") as socket:
        socket.send_text(json.dumps({"token": app.tokens["admin"]}))
        assert socket.receive_json()["type"] == "snapshot"
        socket.send_bytes(encode(some[0]))
        kinds: dict[str, Any] = {}
        while not {"accepted", "position"} <= set(kinds):  # zones that it is in may come before its position
            said = socket.receive_json()
            kinds[said["type"]] = said
        assert kinds["position"]["id"] == kinds["accepted"]["accepted"][0]["seq"]
        socket.send_text("nonsense")
        assert socket.receive_json()["type"] == "refused"


def test_a_websocket_without_a_token_is_closed(app: Any) -> None:
    for hello in ('{"token": "wf_0_0"}', "nonsense", "[" * 10_000):
        with app.client.websocket_connect("/api/v1/ws") as socket:
            socket.send_text(hello)
            assert socket.receive()["type"] == "websocket.close"


# --- who may ----------------------------------------------------------------------------------------------

SCOPES = {
    "ingest": [("POST", "/api/v1/in/own")],
    "read": [("GET", "/api/v1/positions"), ("GET", "/api/v1/events?once=true"), ("GET", "/metrics")],
    "survey": [("GET", "/api/v1/radio-maps"), ("PUT", "/api/v1/devices"), ("POST", "/api/v1/tokens")],
    "admin": [
        ("GET", "/api/v1/tokens"),
        ("GET", "/api/v1/audit"),
        ("POST", "/api/v1/devices/forget?name=nobody"),
        ("GET", "/api/v1/devices/export?name=nobody"),
    ],
}


@pytest.mark.parametrize("scope", SCOPES)
def test_a_scope_opens_its_own_routes_alone(app: Any, scope: str) -> None:
    for wanted, routes in SCOPES.items():
        for method, path in routes:
            status = app.client.request(method, path, headers=app.headers(scope)).status_code
            is_open = scope in {wanted, "admin"}
            assert (status != 403) == is_open, (scope, method, path, status)
            assert app.client.request(method, path).status_code in {401, 429}


def test_every_route_but_the_page_and_health_wants_a_token(app: Any) -> None:
    described = app.client.get("/openapi.json").json()["paths"]
    for path, methods in described.items():
        for method in methods:
            status = app.client.request(method, path.replace("{", "").replace("}", "")).status_code
            assert (status == 200) == (path == "/health"), (method, path, status)


def test_tokens_are_made_used_and_revoked(app: Any) -> None:
    made = app.post("/api/v1/tokens", {"scopes": ["read"], "label": "a screen"}, "admin")
    assert made.status_code == 201
    headers = {"Authorization": f"Bearer {made.json()['token']}"}
    assert app.client.get("/api/v1/positions", headers=headers).status_code == 200
    assert made.json()["token"] not in app.get("/api/v1/tokens", "admin").text
    path = f"/api/v1/tokens/{made.json()['id']}"
    assert app.client.delete(path, headers=app.headers("admin")).status_code == 200
    assert app.client.get("/api/v1/positions", headers=headers).status_code in {401, 429}  # 429: see below
    assert app.client.delete(path, headers=app.headers("admin")).status_code == 404
    done = [row["action"] for row in app.get("/api/v1/audit", "admin").json()["audit"]]
    assert done[:2] == ["revoke token", "create token"]


@pytest.mark.parametrize(
    "body", [{}, {"scopes": []}, {"scopes": ["root"]}, {"scopes": ["read"], "label": "\0"}, [], "x"]
)
def test_what_is_no_wish_for_a_token_is_refused(app: Any, body: Any) -> None:
    answer = app.post("/api/v1/tokens", body, "admin")
    assert answer.status_code == 422
    assert set(answer.json()) == {"error", "remedy"}


def test_a_token_of_another_site_sees_nothing(app: Any, walked: Walked) -> None:
    text, _ = app.server.tokens.create({"read", "ingest"}, app.server.clock(), site="elsewhere")
    headers = {"Authorization": f"Bearer {text}"}
    assert app.client.get(f"/api/v1/tracks/{walked['track']}", headers=headers).status_code == 404
    assert app.client.get("/api/v1/sites", headers=headers).json() == {"sites": []}
    assert app.client.get("/api/v1/positions", headers=headers).status_code == 422
    assert app.client.post("/api/v1/in/own", content=b"{}", headers=headers).status_code == 422


def test_every_answer_has_the_headers_of_safety(app: Any) -> None:
    for path in ("/", "/health", "/nowhere", "/api/v1/positions", "/web/page.js", "/openapi.json"):
        headers = app.client.get(path, headers={"Origin": "https://elsewhere.example"}).headers
        for name, value in HEADERS.items():
            assert headers[name] == value
        assert not [name for name in headers if name.startswith("access-control")]
    for path in ("/web/..%2fapp.py", "/web/../app.py", "/web/__init__.py", "/web/none.js"):
        assert app.client.get(path).status_code == 404


@pytest.mark.parametrize(
    ("address", "more", "is_told"),
    [
        ("http://museum.example:8080", {}, False),
        ("https://museum.example", {}, True),
        ("http://museum.example", {"X-Forwarded-Proto": "https"}, True),
        ("http://localhost:8080", {}, True),
        ("http://127.0.0.1", {}, True),
        ("http://localhost.example:8080", {}, False),
    ],
)
def test_openers_are_shut_out_where_browsers_heed_it(
    app: Any, address: str, more: dict[str, str], is_told: bool
) -> None:
    told = app.client.get(f"{address}/health", headers=more).headers.get("cross-origin-opener-policy")
    assert told == ("same-origin" if is_told else None)


def test_the_page_asks_no_other_host(app: Any) -> None:
    for path in ("/", "/web/page.js", "/web/page.css"):
        text = app.client.get(path).text
        assert len(text) > 100
        assert "//" not in text.replace("// ", "")


def test_names_of_phones_are_nowhere_but_in_the_bodies(app: Any, walked: Walked) -> None:
    for path in ("/api/v1/tracks", "/api/v1/positions", "/api/v1/devices"):
        assert "walker" not in app.get(path, "admin").text
    app.settle()
    for entry in app.server.log.read():
        assert "walker" not in str(entry._replace(body=b""))


# --- radio maps, forgetting ---------------------------------------------------------------------------------


def test_radio_maps_are_uploaded_published_and_rolled_back(app: Any, world: Any) -> None:
    archive = (world.folder / "map.npz").read_bytes()
    assert app.post("/api/v1/radio-maps", b"nonsense", "survey").status_code == 422
    added = app.post("/api/v1/radio-maps?note=again", archive, "survey")
    assert (added.status_code, added.json()["version"]) == (201, 1)  # the same bytes are the same version
    other = app.server.sites.add_radio_map(world.site.name, archive + b"\0", 0.0).version
    assert app.post("/api/v1/radio-maps/publish", {"version": other}, "survey").json()["published"] == other
    assert app.get("/api/v1/radio-maps", "survey").json()["published"] == other
    assert app.post("/api/v1/radio-maps/roll-back", {}, "survey").json()["published"] == 1
    assert app.post("/api/v1/radio-maps/roll-back", {}, "survey").status_code == 422
    assert app.post("/api/v1/radio-maps/publish", {"version": 99}, "survey").status_code == 422


def test_a_forgotten_phone_is_nowhere(app: Any, world: Any) -> None:
    for envelope in envelopes(world.walks[2], "leaver", "s", 10.0):
        track = app.post("/api/v1/in/own", encode(envelope)).json()["accepted"][0]["track"]
    app.settle()
    assert app.get(f"/api/v1/tracks/{track}").status_code == 200
    path = "/api/v1/devices/forget?name=leaver"
    assert app.post(path, {}, "admin").json() == {"tracks": 1, "survey_files": 0}
    assert app.get(f"/api/v1/tracks/{track}").status_code == 404
    assert not [e for e in app.server.log.read() if b"leaver" in e.body]


# --- limits -----------------------------------------------------------------------------------------------


def test_too_many_requests_of_a_token_are_slowed_down(world: Any, tmp_path: Path) -> None:
    with started(world, tmp_path, rate_per_s=0.01, rate_burst=3) as app:
        answers = [app.get("/api/v1/sites") for _ in range(5)]
        assert [a.status_code for a in answers] == [200, 200, 200, 429, 429]
        assert int(answers[-1].headers["retry-after"]) > 0
        assert app.get("/api/v1/sites", "admin").status_code == 200  # another token, another bucket


def test_guessing_tokens_is_slowed_down(app: Any) -> None:
    guesses = [app.client.get("/api/v1/sites", headers={"Authorization": "Bearer wf_0_0"}) for _ in range(30)]
    assert guesses[-1].status_code == 429
    assert app.get("/api/v1/sites").status_code == 200  # who has one is not held up


def test_numbers_that_json_cannot_say_are_null(app: Any) -> None:
    assert msgspec.json.encode(math.nan) == b"null"
    body = {"v": 1, "device": "quiet", "wifi": [{"t": 5.0, "aps": [["00:00:00:00:00:99", -50.0]]}]}
    track = app.post("/api/v1/in/own", body).json()["accepted"][0]["track"]
    app.settle()
    said = app.get(f"/api/v1/tracks/{track}/position").json()["properties"]
    assert said["state"] == "initialising"
    assert said["radius_m_95"] > 0.0
