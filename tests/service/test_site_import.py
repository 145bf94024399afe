"""Sites that come over the interface: imported, served at once and after a restart, replaced and taken away."""

from __future__ import annotations

import io
import json
import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from service_running import App, packed, started

from wayfuse.cli.site import IMPORTERS as OF_THE_COMMAND
from wayfuse.core.errors import MapError
from wayfuse.service.replay import envelopes
from wayfuse.service.routes.sites import Format
from wayfuse.service.uploaded_sites import FORMATS, UploadedSites, read_upload
from wayfuse.service.wire import encode


def _post(app: App, body: bytes, scope: str = "admin", **query: Any) -> Any:
    return app.post("/api/v1/sites", body, scope, params=query)


@pytest.fixture
def app(world: Any, tmp_path: Path) -> Iterator[App]:
    with started(world, tmp_path) as app:
        yield app


@pytest.fixture(scope="module")
def imdf(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """A house of three floors, as an IMDF archive."""
    from dataclasses import replace

    from wayfuse.simulator.house_demo import house_scenario, write_house_demo

    folder = tmp_path_factory.mktemp("house")
    return write_house_demo(
        folder, 0, replace(house_scenario(), survey_walks=0, test_walks=0)
    ).plan.read_bytes()


def test_the_formats_are_those_of_the_command_line() -> None:
    assert set(FORMATS) == {*OF_THE_COMMAND, "wayfuse"} == set(Format.__args__)


def test_an_imported_site_is_served_and_tracks_at_once_and_after_a_restart(
    world: Any, tmp_path: Path, imdf: bytes
) -> None:
    with started(world, tmp_path) as app:
        said = _post(app, imdf, format="imdf", file="plans.zip", name="Annexe")
        assert said.status_code == 201, said.text
        assert [f["floor"] for f in said.json()["floors"]] == ["0", "1", "2"]
        assert (said.json()["site"], said.json()["errors"]) == ("Annexe", 0)
        assert {s["name"] for s in app.get("/api/v1/sites").json()["sites"]} == {world.site.name, "Annexe"}
        assert len(app.get("/api/v1/plan?site=Annexe").json()["floors"]) == 3
        assert app.get("/api/v1/plan").status_code == 422  # there are two now
        assert app.get("/api/v1/survey/coverage?site=Annexe&floor=0", "survey").json()["next"]
        posted = app.post("/api/v1/in/own?site=Annexe", encode(next(envelopes(world.walks[0], "p", "w"))))
        assert "no radio map yet" in posted.json()["error"]
        assert app.get("/api/v1/audit", "admin").json()["audit"][0]["action"] == "import site"
    with started(world, tmp_path) as app:
        assert len(app.get("/api/v1/plan?site=Annexe").json()["floors"]) == 3


def test_a_server_begins_with_no_site_at_all(world: Any, tmp_path: Path) -> None:
    with started(world, tmp_path, sites=[]) as app:
        assert app.get("/api/v1/sites").json() == {"sites": []}
        body = packed(world.folder / "SITE", "SITE/")
        assert _post(app, body, format="wayfuse").json()["site"] == world.site.name
        archive = (world.folder / "map.npz").read_bytes()
        version = app.post("/api/v1/radio-maps", archive, "survey").json()["version"]
        assert app.post("/api/v1/radio-maps/publish", {"version": version}, "survey").status_code == 200
        for envelope in list(envelopes(world.walks[0], "p", "w", 5.0)):
            assert app.post("/api/v1/in/own", encode(envelope)).status_code == 200
        app.settle()
        assert app.get("/api/v1/positions").json()["features"]
        again = _post(app, body, format="wayfuse", replace=True)
        assert (again.status_code, "in memory" in again.json()["error"]) == (409, True)
        gone = app.client.delete(f"/api/v1/sites?site={world.site.name}", headers=app.headers("admin"))
        assert gone.status_code == 409
        assert app.post("/api/v1/devices/forget?name=p", {}, "admin").json()["tracks"] == 1
        assert _post(app, body, format="wayfuse", replace=True).status_code == 201
        path = f"/api/v1/sites?site={world.site.name}"
        assert app.client.delete(path, headers=app.headers("admin")).status_code == 200
        assert app.client.delete(path, headers=app.headers("admin")).status_code == 404
        assert app.get("/api/v1/sites").json() == {"sites": []}


def test_a_folder_of_plans_comes_as_an_archive(app: App, world: Any) -> None:
    body = packed(world.folder / "site", "some folder/")
    said = _post(app, body, format="ms-indoor", name="Again").json()
    assert [f["floor"] for f in said["floors"]] == list(world.site.floor_names)


def test_who_may_not_and_what_is_refused(app: App, world: Any, imdf: bytes) -> None:
    body = packed(world.folder / "SITE")
    assert _post(app, body, "survey", format="wayfuse").status_code == 403
    text, _ = app.server.tokens.create({"admin"}, app.server.clock(), site=world.site.name)
    of_one = {"Authorization": f"Bearer {text}"}
    path = f"/api/v1/sites?format=wayfuse&site={world.site.name}"
    assert app.client.post(path, content=body, headers=of_one).status_code == 403
    taken = _post(app, body, format="wayfuse", replace=True)
    assert (taken.status_code, "command line" in taken.json()["error"]) == (409, True)
    assert _post(app, imdf, format="imdf", name="B").status_code == 201
    assert _post(app, imdf, format="imdf", name="B").status_code == 409
    other = _post(app, body, format="wayfuse", name="B", replace=True)
    assert (other.status_code, "its floors are" in other.json()["error"]) == (422, True)
    for name in ("\n", " ", "x" * 101):
        assert _post(app, imdf, format="imdf", name=name).status_code == 422
    assert _post(app, imdf, format="dwg").status_code == 422
    assert app.client.delete("/api/v1/sites?site=none", headers=app.headers("admin")).status_code == 404


def _archive(names: dict[str, bytes]) -> bytes:
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in names.items():
            archive.writestr(name, content)
    return out.getvalue()


@pytest.mark.parametrize(
    ("plan_format", "body"),
    [
        ("imdf", b""),
        ("imdf", b"PK\x03\x04 no archive"),
        ("ms-indoor", b"PK\x03\x04 no archive"),
        ("wayfuse", _archive({"../outside/site.json": b"{}"})),
        ("wayfuse", _archive({"/outside/site.json": b"{}"})),
        ("wayfuse", _archive({"..\\outside\\site.json": b"{}"})),
        ("wayfuse", _archive({"site.json": bytes(300 << 20)})),
        ("wayfuse", _archive({f"{n}.json": b"" for n in range(2001)})),
        ("wayfuse", _archive({"site.json": json.dumps({"format": "wayfuse-site", "version": 1}).encode()})),
        ("osm", b"<osm/>"),
        ("osm", _archive({"a.osm": b"", "b.osm": b""})),
        ("image", b"name = 'x'"),
        ("simpleloc", b"<map/>"),
        ("hcu", b"{}"),
    ],
    ids=range(14),
)
def test_what_is_no_plan_is_refused_without_a_word_of_where_it_lay(plan_format: str, body: bytes) -> None:
    with pytest.raises(MapError) as refused:
        read_upload(plan_format, body, "some file")
    assert "/tmp" not in str(refused.value)  # noqa: S108 (a word that must not be told)


def test_a_crash_between_two_moves_loses_no_site(world: Any, tmp_path: Path) -> None:
    kept = UploadedSites(tmp_path)
    kept.write(world.site)
    assert kept.folders() == []
    kept.put(world.site.name)
    (place,) = kept.folders()
    place.rename(place.with_suffix(".old"))
    place.with_suffix(".new").mkdir()
    assert UploadedSites(tmp_path).folders() == [place]
    kept.write(world.site)
    kept.put(world.site.name)
    assert kept.folders() == [place]
    assert sorted(p.name for p in tmp_path.iterdir()) == [place.name]
