"""Anchors in the page: uploaded, what is wrong with a file, a phone that goes by them, taken away."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from service_running import running

from wayfuse.maps.site import Site
from wayfuse.radio.channel_model import ChannelModel
from wayfuse.radio.csi import subcarriers_of
from wayfuse.radio.ranging import RangeRegression
from wayfuse.sensors.records import bssid_id, bssid_text

pytestmark = pytest.mark.slow  # a browser that draws without a GPU takes seconds to start and to draw

HEADER = "bssid,x,y,floor,height\n"


def _anchors(site: Site) -> list[tuple[str, float, float]]:
    """In three corners of the ground floor."""
    ring = site.floors[0].outline[0].exterior
    (west, south), (east, north) = ring.min(axis=0).tolist(), ring.max(axis=0).tolist()
    return [("an-1", west, south), ("an-2", east, south), ("an-3", west, north)]


def test_a_phone_with_ranges_appears_when_its_anchors_are_uploaded(
    look: Callable[..., Any], house: Any, tmp_path: Path
) -> None:
    site = Site.load(house.folder / "SITE")
    anchors = _anchors(site)
    lines = [f"{name},{x},{y},{site.floor_names[0]},2.5\n" for name, x, y in anchors]
    (tmp_path / "bad.csv").write_text(HEADER + lines[0] + "an-2,east,3,0,\n", encoding="utf-8")
    (tmp_path / "good.csv").write_text(HEADER + "".join(lines), encoding="utf-8")
    model = {bssid_id(name): (RangeRegression(-3.0, -0.08),) for name in ("an-1", "an-9")}
    ChannelModel(model, subcarriers_of(30), site.name).save(tmp_path / "channel.npz")
    with running(house.folder, tmp_path / "data", sites=[], particles=300) as server:
        with server.client() as client:
            plan = (house.folder / "plan.imdf.zip").read_bytes()
            assert client.post("/api/v1/sites?format=imdf", content=plan).status_code == 201
        page = look(server.address)
        page.enter(server.token)
        view = page.page.locator("#view-survey")

        def upload(button: str, field: str, name: str) -> None:
            page.page.set_input_files(field, tmp_path / name)
            page.page.get_by_role("button", name=button, exact=True).click()

        page.page.click("#tab-survey")
        page.page.click("text=Anchors that measure ranges")
        page.until(lambda: "0 anchors." in view.inner_text())
        upload("Upload model", "#anchor-channel", "channel.npz")
        page.until(lambda: "without the places of its anchors (upload the places first)" in view.inner_text())
        upload("Upload places", "#anchor-places", "bad.csv")
        page.until(lambda: "line 3: x 'east' is no such number" in view.inner_text())
        assert page.complaints
        assert all("422" in said for said in page.complaints)  # the browser's own word for it
        page.complaints.clear()
        upload("Upload places", "#anchor-places", "good.csv")
        page.until(lambda: "3 anchors." in view.inner_text())
        upload("Upload model", "#anchor-channel", "channel.npz")
        missing = f"No place is known of {bssid_text(bssid_id('an-9'))}"
        page.until(lambda: "3 anchors, a channel model of 2." in view.inner_text())
        assert missing in view.inner_text()
        with server.client() as client:
            x, y = ((anchors[1][k] + anchors[2][k]) / 2 for k in (1, 2))  # in the middle
            for n in range(10):
                ranges = [[float(n), name, math.hypot(x - ax, y - ay)] for name, ax, ay in anchors]
                said = client.post("/api/v1/in/own", json={"v": 1, "device": "p", "id": n, "ranges": ranges})
                assert said.status_code == 200, said.text
        track = said.json()["accepted"][0]["track"]
        page.page.click("#tab-tracks")
        page.page.click(f"[data-track='{track}']")  # the map goes to its floor, whichever that is
        page.until(lambda: page.level == site.floor_names[0] and track in page.dots())
        page.page.click("#tab-survey")
        page.page.get_by_role("button", name="Take all away", exact=True).click()
        page.until(lambda: "0 anchors." in view.inner_text())
        page.page.goto("about:blank")


def test_of_a_folder_the_page_says_where_anchors_are_changed(look: Callable[..., Any], served: Any) -> None:
    page = look()
    page.enter(served.token)
    page.page.click("#tab-survey")
    page.page.click("text=Anchors that measure ranges")
    page.until(lambda: "changed in the folder" in page.page.inner_text("#view-survey"))
    assert not page.page.is_visible("#anchor-places")
