"""Every answer that is right, as the OpenAPI description has it: nothing is missing, nothing is said besides."""

from __future__ import annotations

import re
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import jsonschema_rs
import numpy as np
import pytest
from service_running import App, packed, started, wait_until

from wayfuse.radio.channel_model import ChannelModel
from wayfuse.radio.csi import subcarriers_of
from wayfuse.radio.ranging import RangeRegression
from wayfuse.service.replay import envelopes
from wayfuse.service.routes import admin
from wayfuse.service.routes.examples import EXAMPLES
from wayfuse.service.wire import encode

JSON = "application/json"


def strict(part: Any) -> Any:
    """A schema that allows no more than it names; where more is allowed, it says so."""
    if isinstance(part, list):
        return [strict(each) for each in part]
    if not isinstance(part, dict):
        return part
    made = {key: strict(value) for key, value in part.items()}
    if made.get("type") == "object" and "properties" in made:
        made.setdefault("additionalProperties", False)
    return made


class Checked:
    """Sends requests and holds every answer against the description."""

    def __init__(self, app: App) -> None:
        self.app = app
        said = app.client.get("/openapi.json").json()
        self._components = strict(said["components"])
        self.operations: dict[tuple[str, str], dict[str, Any]] = {
            (method.upper(), path): one["responses"]
            for path, some in said["paths"].items()
            for method, one in some.items()
        }
        self._paths = {re.compile(re.sub(r"{\w+}", "[^/]+", path) + "$"): path for _, path in self.operations}
        self.seen: set[tuple[str, str]] = set()

    def __call__(
        self, method: str, address: str, body: Any = None, scope: str = "admin", **query: Any
    ) -> Any:
        """The JSON of an answer, which is right and as described."""
        content = {"content": body} if isinstance(body, bytes) else {} if body is None else {"json": body}
        answer = self.app.client.request(
            method, address, headers=self.app.headers(scope), params=query, **content
        )
        assert answer.is_success, f"{method} {address}: {answer.text}"
        found = [path for pattern, path in self._paths.items() if pattern.match(address)]
        operation = (method, min(found, key=lambda path: path.count("{")))
        schema = strict(self.operations[operation][str(answer.status_code)]["content"][JSON]["schema"])
        said = answer.json()
        jsonschema_rs.validator_for({**schema, "components": self._components}).validate(said)
        self.seen.add(operation)
        return said


@pytest.fixture
def checked(world: Any, tmp_path: Path) -> Iterator[Checked]:
    """A server that begins with nothing."""
    with started(world, tmp_path, sites=[]) as app:
        yield Checked(app)


def test_every_answer_is_as_described(checked: Checked, world: Any, tmp_path: Path) -> None:
    _administrate(checked, world)
    _lay_anchors(checked, world, tmp_path)
    track = _track(checked, world)
    _survey(checked, world)
    _look(checked, track)
    _leave(checked, world)
    described = {
        operation
        for operation, responses in checked.operations.items()
        if any(
            JSON in said.get("content", {}) for status, said in responses.items() if status.startswith("2")
        )
    }
    assert len(described) > 40
    assert described - checked.seen == set()


def _administrate(checked: Checked, world: Any) -> None:
    checked("GET", "/health")
    assert checked("GET", "/api/v1/token")["scopes"] == ["admin"]
    made = checked("POST", "/api/v1/tokens", {"scopes": ["ingest", "read"], "expires": 9e9, "label": "x"})
    assert checked("DELETE", f"/api/v1/tokens/{made['id']}") == {"revoked": made["id"]}
    gone = [t for t in checked("GET", "/api/v1/tokens")["tokens"] if t["revoked"] is not None]
    assert [t["id"] for t in gone] == [made["id"]]
    checked("PUT", "/api/v1/devices", {"name": "a1b2", "platform": "ios", "standardised": True})
    assert len(checked("GET", "/api/v1/devices")["devices"]) == 1
    folder = packed(world.folder / "SITE")
    other = packed(world.folder / "site", "folder/")
    assert checked("POST", "/api/v1/sites", other, format="ms-indoor", name="Other")["floors"][0]["walls"]
    assert checked("DELETE", "/api/v1/sites", site="Other") == {"removed": "Other"}
    checked("POST", "/api/v1/sites", folder, format="wayfuse")
    assert checked("GET", "/api/v1/radio-maps")["published"] is None
    archive = (world.folder / "map.npz").read_bytes()
    version = checked("POST", "/api/v1/radio-maps", archive, note="first")["version"]
    assert checked("POST", "/api/v1/radio-maps/publish", {"version": version})["published"] == version


def _lay_anchors(checked: Checked, world: Any, folder: Path) -> None:
    lines = [
        "bssid,x,y,floor,height",
        f"an-1,1,2,{world.site.floor_names[0]},2.5",
        f"an-2,5,2,{world.site.floor_names[0]},",
    ]
    assert checked("PUT", "/api/v1/anchors", "\n".join(lines).encode())["anchors"] == 2
    model = {7: (RangeRegression(-3.0, -0.08),)}
    ChannelModel(model, subcarriers_of(30), world.site.name).save(folder / "channel.npz")
    assert checked("PUT", "/api/v1/anchors/channel", (folder / "channel.npz").read_bytes())["unplaced"]
    assert [p["height_m"] for p in checked("GET", "/api/v1/anchors")["places"]] == [2.5, None]
    assert [s["anchors"] for s in checked("GET", "/api/v1/sites")["sites"]] == [2]
    checked("DELETE", "/api/v1/anchors/channel")
    assert checked("DELETE", "/api/v1/anchors")["anchors"] == 0


def _track(checked: Checked, world: Any) -> str:
    for way, body in EXAMPLES.items():
        content = body.encode() if isinstance(body, str) else body
        query = (
            {"platform": "android"}
            if way == "sensor-logger"
            else {"device": "x"}
            if way == "getsensordata"
            else {}
        )
        assert checked("POST", f"/api/v1/in/{way}", content, **query)["accepted"]
    for envelope in envelopes(world.walks[0], "p", "w", 5.0):
        said = checked("POST", "/api/v1/in/own", encode(envelope))
    checked.app.settle()
    return str(said["accepted"][0]["track"])


def _survey(checked: Checked, world: Any) -> None:
    token = checked("POST", "/api/v1/tokens", {"scopes": ["ingest"]})["token"]
    client = checked.app.client
    for envelope in envelopes(replace(world.walks[1], waypoints=()), "surveyor", "survey", 10.0):
        assert client.post(f"/in/{token}/survey/own", content=encode(envelope)).status_code == 200
    (phone,) = checked("GET", "/api/v1/survey")["phones"]
    now = time.time()
    taps = [{"t": now - 30.0, "floor": 0, "x": 2.0, "y": 3.0}, {"t": now, "floor": 0, "x": 9.0, "y": 3.0}]
    walk = checked("POST", "/api/v1/survey/walks", {"device": phone["device"], "now": now, "taps": taps})
    for path in sorted((world.folder / "survey").glob("**/*.txt"))[:2]:
        kept = checked("POST", "/api/v1/survey/recordings", path.read_bytes(), name=path.name)
        assert kept["scans"] > 0
    assert checked("GET", "/api/v1/survey")["recordings"]
    job = checked("POST", "/api/v1/survey/jobs")
    address = f"/api/v1/survey/jobs/{job['id']}"
    wait_until(lambda: checked("GET", address)["state"] != "running")
    result = checked("GET", address)["result"]
    assert result["rooms"]
    assert checked("GET", "/api/v1/survey")["job"]["state"] == "done"
    checked("POST", "/api/v1/radio-maps/publish", {"version": result["version"]})
    assert checked("POST", "/api/v1/radio-maps/roll-back")["published"] == 1
    assert len(checked("GET", "/api/v1/radio-maps")["versions"]) == 2
    assert checked("DELETE", f"/api/v1/survey/parts/{walk['id']}") == {"removed": walk["id"]}
    assert checked("GET", "/api/v1/survey/coverage", floor=0)["next"]
    ap = checked("GET", "/api/v1/survey/access-points", limit=5)["access_points"][0]
    floor = int(np.argmax(ap["fingerprints"]))
    assert checked("GET", "/api/v1/survey/heat", bssid=ap["bssid"], floor=floor)["fingerprints"] > 0


def _look(checked: Checked, track: str) -> None:
    assert checked("GET", "/api/v1/positions")["features"]
    assert checked("GET", "/api/v1/tracks")["tracks"]
    assert checked("GET", f"/api/v1/tracks/{track}")["estimates"] > 5
    assert checked("GET", f"/api/v1/tracks/{track}/position")["properties"]["x"] is not None
    assert len(checked("GET", f"/api/v1/tracks/{track}/estimates")["features"]) > 5
    assert len(checked("GET", f"/api/v1/tracks/{track}/particles")["x"]) == 100
    floors = checked("GET", "/api/v1/plan")["floors"]
    kinds = {f["properties"]["kind"] for f in checked("GET", "/api/v1/plan/0")["features"]}
    assert {"outline", "unit", "wall"} <= kinds
    assert len(floors) == len(
        {checked("GET", f"/api/v1/plan/{f['floor']}")["type"] + f["level"] for f in floors}
    )
    assert checked("GET", "/api/v1/zones")["features"]
    checked("GET", "/api/v1/zones/inside")


def _leave(checked: Checked, world: Any) -> None:
    gone = checked("POST", "/api/v1/devices/forget", name="p")
    assert gone["tracks"] == 1
    assert checked("GET", "/api/v1/audit", limit=5)["audit"][0]["action"] == "forget device"


def test_the_check_finds_what_is_not_described(checked: Checked, monkeypatch: pytest.MonkeyPatch) -> None:
    store = checked.app.server.tokens
    known = store.all()
    monkeypatch.setattr(store, "all", lambda: [known[0]._replace(created="yesterday")])
    with pytest.raises(jsonschema_rs.ValidationError, match="yesterday"):
        checked("GET", "/api/v1/tokens")
    monkeypatch.setattr(store, "all", lambda: known)
    monkeypatch.setattr(admin, "_token", lambda token: {**token._asdict(), "scopes": [], "digest": "x"})
    with pytest.raises(jsonschema_rs.ValidationError, match="digest"):
        checked("GET", "/api/v1/tokens")
