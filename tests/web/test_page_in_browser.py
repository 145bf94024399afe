"""The page in a real browser: a phone walks, the dot moves, the floor changes."""

from __future__ import annotations

import json
import time
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from service_running import running

pytestmark = pytest.mark.slow  # a browser that draws without a GPU takes seconds to start and to draw


def _near(dot: tuple[float, float, str], lonlat: list[float]) -> bool:
    """Within about 5 cm: what is drawn is cut into tiles."""
    return abs(dot[0] - lonlat[0]) < 6e-7 and abs(dot[1] - lonlat[1]) < 6e-7


def _place(server: Any, track: str) -> Any:
    with server.client() as client:
        return client.get(f"/api/v1/tracks/{track}/position").json()


def test_a_phone_walks_the_dot_moves_and_the_floor_changes(
    look: Callable[..., Any], new_phone: Callable[[str], Any], served: Any
) -> None:
    phone = new_phone("walker")
    phone.walk(6)
    page = look()
    page.enter(served.token)
    page.page.click(f"[data-track='{phone.track}']")
    levels, places = [], []
    while True:
        feature = _place(served, phone.track)
        p, lonlat = feature["properties"], feature["geometry"]["coordinates"]
        page.until(lambda p=p: page.level == p["level"])
        page.until(lambda at=lonlat: _near(page.dots().get(phone.track, (0.0, 0.0, "")), at))
        assert page.dots()[phone.track][2] == p["state"]
        levels.append(p["level"])
        places.append(tuple(lonlat))
        if phone.is_done:
            break
        phone.walk(8)
    assert len(set(levels)) > 1
    assert len(set(places)) == len(places)
    said = page.page.inner_text(".detail .state")
    assert said == f"{phone.track[:6]}: ended, was {p['state']} on level {p['level']}"


def test_radii_trail_and_particles_of_the_chosen_track_are_drawn(
    look: Callable[..., Any], new_phone: Callable[[str], Any], served: Any
) -> None:
    phone = new_phone("cloud")
    phone.walk(10)
    page = look()
    page.enter(served.token)
    page.page.click(f"[data-track='{phone.track}']")
    page.page.check("#show-particles")

    def drawn(layer: str) -> int:
        count = (
            "(layer) => document.querySelector('#map').map.queryRenderedFeatures({layers: [layer]}).length"
        )
        return int(page.page.evaluate(count, layer))

    for layer in ("radii-95", "radii-68", "trails", "outline", "units", "walls", "unit-names"):
        page.until(lambda layer=layer: drawn(layer) > 0)
    page.until(lambda: drawn("particles") > 20)
    page.page.uncheck("#show-particles")
    page.until(lambda: drawn("particles") == 0)
    facts = page.page.inner_text(".detail .facts")
    assert "Access points heard" in facts
    page.page.click("text=Counters of its input")
    page.until(lambda: "messages" in page.page.inner_text(".detail details"))


def test_a_past_track_is_replayed(
    look: Callable[..., Any], new_phone: Callable[[str], Any], served: Any
) -> None:
    phone = new_phone("past")
    phone.walk(30)
    page = look()
    page.enter(served.token)
    page.page.click("#tab-replay")
    page.until(lambda: page.page.locator(f"#replay-track option[value='{phone.track}']").count())
    page.page.select_option("#replay-track", phone.track)
    page.page.wait_for_selector("#replay-time")
    with served.client() as client:
        said = client.get(f"/api/v1/tracks/{phone.track}/estimates").json()["features"]
    start = said[0]["properties"]["t"]
    for t in (5.0, 25.0):
        page.page.fill("#replay-time", str(t))
        then = [f for f in said if f["properties"]["t"] <= start + t][-1]
        page.until(lambda then=then: page.level == then["properties"]["level"])
        at = then["geometry"]["coordinates"]
        page.until(lambda at=at: _near(page.dots().get(phone.track, (0.0, 0.0, "")), at))
    page.page.fill("#replay-time", "0")
    page.page.get_by_role("button", name="Play", exact=True).click()
    page.until(lambda: float(page.page.input_value("#replay-time")) > 0.5)
    page.page.click("text=Pause")
    page.page.click("text=Back to live")
    assert not page.page.is_visible("#replay-time")


def test_floors_and_tabs_are_operated_from_the_keyboard(look: Callable[..., Any], served: Any) -> None:
    page = look()
    page.enter(served.token)
    page.page.focus("#floors [aria-checked=true]")
    before = page.level
    page.page.keyboard.press("ArrowUp")
    assert page.level != before
    assert page.page.evaluate("() => document.activeElement.getAttribute('aria-checked')") == "true"
    page.page.focus("#tab-tracks")
    for shown in ("#view-zones", "#view-replay"):
        page.page.keyboard.press("ArrowRight")
        assert page.page.is_visible(shown)
    assert not page.page.is_visible("#view-tracks")
    page.page.keyboard.press("End")
    assert page.page.is_visible("#view-admin")
    page.page.keyboard.press("ArrowLeft")
    assert page.page.is_visible("#view-survey")


def test_the_token_stays_in_the_tab_and_a_wrong_one_is_refused(look: Callable[..., Any], served: Any) -> None:
    page = look()
    page.page.goto(f"{served.address}/")
    page.page.fill("#token", "wf_0_0")
    page.page.click("text=Show the map")
    page.until(lambda: "no valid token" in page.page.inner_text("#login-said"))
    assert any("401" in said for said in page.complaints)  # the browser's own word for it
    page.complaints.clear()
    page.page.fill("#token", served.token)
    page.page.click("text=Show the map")
    page.page.wait_for_selector("#floors button")
    kept = page.page.evaluate("() => [JSON.stringify(localStorage), document.cookie, location.href].join()")
    assert served.token not in kept
    assert json.loads(page.page.evaluate("() => JSON.stringify(sessionStorage)")) == {
        "wayfuse-token": served.token
    }
    page.page.reload()
    page.page.wait_for_selector("#floors button")
    page.page.click("#leave")
    page.page.wait_for_selector("#login[open]")
    assert page.page.evaluate("() => sessionStorage.length") == 0


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_light_and_dark_follow_the_system_and_the_button(
    look: Callable[..., Any], served: Any, scheme: str
) -> None:
    page = look(color_scheme=scheme)
    page.enter(served.token)

    def ground() -> str:
        paint = "() => document.querySelector('#map').map.getPaintProperty('ground', 'background-color')"
        return str(page.page.evaluate(paint))

    first = ground()
    assert page.page.evaluate("() => document.documentElement.dataset.theme") == scheme
    page.page.click("#theme")  # light
    page.page.click("#theme")  # dark
    assert page.page.inner_text("#theme") == "Theme: dark"
    assert (ground() == first) == (scheme == "dark")


def test_a_phones_screen_has_room_for_all_of_it(look: Callable[..., Any], served: Any) -> None:
    page = look(viewport={"width": 360, "height": 740}, has_touch=True)
    page.enter(served.token)
    wide = "() => document.documentElement.scrollWidth <= document.documentElement.clientWidth"
    for tab in ("#tab-tracks", "#tab-zones", "#tab-replay", "#tab-survey", "#tab-admin"):
        page.page.click(tab)
        assert page.page.evaluate(wide)
        box = page.page.locator(tab).bounding_box()
        assert box["height"] >= 40
    assert page.page.locator("#map").bounding_box()["height"] > 250


def test_without_the_map_library_the_page_says_how_to_build_it(look: Callable[..., Any], served: Any) -> None:
    page = look()
    page.page.route("**/web/assets/*", lambda route: route.fulfill(status=404, body="{}"))
    page.page.goto(f"{served.address}/")
    page.until(lambda: "make web" in page.page.inner_text("#notice"))
    assert all("404" in said for said in page.complaints)
    page.complaints.clear()


def test_survey_pictures_are_drawn_and_go_away(look: Callable[..., Any], served: Any) -> None:
    page = look()
    page.enter(served.token)
    page.page.click("#tab-survey")
    page.page.check("[value=coverage]")
    page.until(lambda: "fingerprints" in page.page.inner_text("#view-survey"))
    page.until(lambda: page.page.is_visible("#legend"))
    has_raster = "() => Boolean(document.querySelector('#map').map.getLayer('raster'))"
    page.until(lambda: page.page.evaluate(has_raster))
    page.page.check("[value=heat]")
    page.until(lambda: "heard by" in page.page.inner_text("#view-survey"))
    page.until(lambda: "dBm" in page.page.inner_text("#legend"))
    page.page.click("#tab-tracks")
    page.until(lambda: not page.page.evaluate(has_raster))
    assert not page.page.is_visible("#legend")


def test_a_place_is_recorded_by_a_press_on_the_map(look: Callable[..., Any], served: Any) -> None:
    page = look()
    page.enter(served.token)
    page.page.click("#tab-survey")
    page.page.click("text=Connect a phone")
    page.page.click("text=Make a push address")
    page.page.wait_for_selector("#push-address:not([hidden])")
    address = page.page.input_value("#push-address").replace("sensor-logger?platform=android", "own")
    assert address.startswith(f"{served.address}/in/wf_")
    page.page.select_option("#push-purpose", label="to be tracked alone")
    page.page.click("text=Make a push address")
    page.until(lambda: "/survey/" not in page.page.input_value("#push-address"))

    def push(number: int) -> None:
        t = time.time()
        aps = [[f"02:00:00:00:00:{k:02x}", -50.0 - k, 2412.0, t] for k in range(6)]
        body = {"v": 1, "device": "hand", "track": "survey", "id": number, "wifi": [{"t": t, "aps": aps}]}
        with served.client() as client:
            assert client.post(address, json=body).status_code == 200

    push(0)
    page.until(lambda: page.page.is_enabled("text=Stand here"))
    page.page.click("text=Stand here")
    at = page.page.evaluate(
        "() => { const map = document.querySelector('#map').map; const at = map.project(map.getCenter());"
        " const box = map.getContainer().getBoundingClientRect(); return [box.x + at.x + 40, box.y + at.y + 30]; }"
    )
    page.page.mouse.click(*at)
    page.until(lambda: "Stand still" in page.page.inner_text("#view-survey"))
    for number in range(1, 4):
        push(number)
        page.page.wait_for_timeout(700)
    page.until(lambda: "3 scans so far" in page.page.inner_text("#view-survey"))
    page.page.click("text=Finish")
    page.until(lambda: "1 walks by hand" in page.page.inner_text("#view-survey"))
    with served.client() as client:
        (walk,) = client.get("/api/v1/survey").json()["walks"]
        lon, lat = page.page.evaluate(
            "(at) => { const map = document.querySelector('#map').map;"
            " const box = map.getContainer().getBoundingClientRect();"
            " const p = map.unproject([at[0] - box.x, at[1] - box.y]); return [p.lng, p.lat]; }",
            at,
        )
        frame = client.get("/api/v1/plan").json()["floors"][walk["taps"][0]["floor"]]
        (a, b), (c, d) = frame["matrix"]
        for tap in walk["taps"]:  # to a pixel, which is some centimetres
            assert frame["origin"][0] + a * tap["x"] + b * tap["y"] == pytest.approx(lon, abs=1e-6)
            assert frame["origin"][1] + c * tap["x"] + d * tap["y"] == pytest.approx(lat, abs=1e-6)
    assert walk["taps"][1]["t"] - walk["taps"][0]["t"] > 1.5
    page.page.click("text=Build a radio map")
    page.until(lambda: "1 walks. Publish it" in page.page.inner_text("#view-survey"))
    page.page.click("#view-survey details:has(.parts) summary")
    page.page.click("text=Delete")
    page.until(lambda: "0 walks by hand" in page.page.inner_text("#view-survey"))

    page.page.get_by_role("button", name="Walk", exact=True).click()
    page.page.mouse.click(*at)
    assert not page.page.is_visible("text=Finish")  # one place is no way
    page.page.wait_for_timeout(300)
    page.page.mouse.click(at[0] + 100, at[1])
    push(9)
    page.page.click("text=Finish")
    page.until(lambda: "1 walks by hand" in page.page.inner_text("#view-survey"))
    with served.client() as client:
        (walk,) = client.get("/api/v1/survey").json()["walks"]
    first, last = walk["taps"]
    assert last["x"] > first["x"] + 1.0
    assert last["t"] > first["t"]
    page.page.click("text=Delete")
    page.until(lambda: "0 walks by hand" in page.page.inner_text("#view-survey"))


def test_zones_are_drawn_with_who_is_inside(
    look: Callable[..., Any], new_phone: Callable[[str], Any], served: Any
) -> None:
    phone = new_phone("visitor")
    page = look()
    page.enter(served.token)
    page.page.click("#tab-zones")
    entered: list[Any] = []
    with served.client() as client:
        while not entered and not phone.is_done:
            phone.walk(5)
            inside = client.get("/api/v1/zones/inside").json()["inside"]
            entered = [zone for zone, tracks in inside.items() if phone.track in tracks]
        (zone,) = [
            f["properties"]
            for f in client.get("/api/v1/zones").json()["features"]
            if f["properties"]["id"] == entered[0]
        ]
    row = f"#view-zones [data-zone='{zone['id']}']"
    page.until(lambda: page.page.is_visible(row))
    page.until(lambda: f"entered {zone['name']}" in page.page.inner_text("#view-zones .crossings"))
    page.page.click(row)
    page.until(lambda: page.level == zone["level"])
    drawn = (
        "(id) => document.querySelector('#map').map.queryRenderedFeatures({layers: ['zones']})"
        ".filter((f) => f.properties.id === id).map((f) => [f.properties.n, f.properties.chosen])"
    )
    page.until(lambda: any(n > 0 and chosen for n, chosen in page.page.evaluate(drawn, zone["id"])))
    page.page.locator("#view-zones .zones .who").filter(has_text=phone.track[:6]).first.click()
    page.page.click("#tab-tracks")
    assert page.page.inner_text(".detail .state").startswith(phone.track[:6])


def test_a_building_is_imported_where_there_was_none(
    look: Callable[..., Any], house: Any, tmp_path: Path
) -> None:
    with running(house.folder, tmp_path / "data", sites=[]) as server:
        page = look(server.address)
        page.page.goto(f"{server.address}/")
        page.page.fill("#token", server.token)
        page.page.click("text=Show the map")
        page.until(lambda: "no building yet" in page.page.inner_text("#notice"))
        page.page.set_input_files("#plan-file", house.folder / "plan.imdf.zip")
        page.page.fill("#plan-name", "Annexe")
        page.page.get_by_role("button", name="Import", exact=True).click()
        page.wait()
        page.until(lambda: not page.page.is_visible("#notice"))
        page.until(lambda: "Annexe: 3 floors." in page.page.inner_text("#view-survey"))
        page.page.check("[value=coverage]")
        page.until(lambda: "0 fingerprints" in page.page.inner_text("#view-survey"))
        page.page.goto("about:blank")


def test_who_may_only_read_sees_neither_survey_nor_administration(
    look: Callable[..., Any], served: Any
) -> None:
    with served.client() as client:
        token = client.post("/api/v1/tokens", json={"scopes": ["read"]}).json()["token"]
    page = look()
    page.enter(token)
    assert page.page.is_visible("#tab-zones")
    assert not page.page.is_visible("#tab-survey")
    assert not page.page.is_visible("#tab-admin")
    page.page.focus("#tab-tracks")
    page.page.keyboard.press("End")
    assert page.page.is_visible("#view-replay")


def test_tokens_are_made_and_ended_and_a_phone_is_given_out_and_deleted(
    look: Callable[..., Any], new_phone: Callable[[str], Any], served: Any, tmp_path: Path
) -> None:
    phone = new_phone("leaver")
    phone.walk(8)
    page = look()
    page.enter(served.token)
    page.page.click("#tab-admin")
    page.page.fill("#token-label", "a screen in the hall")
    page.page.click("text=Make a token")
    page.page.wait_for_selector("#new-token:not([hidden])")
    headers = {"Authorization": f"Bearer {page.page.input_value('#new-token')}"}
    with served.client() as client:
        assert client.get("/api/v1/token", headers=headers).json()["scopes"] == ["read"]
    page.page.click("text=All tokens")
    row = page.page.locator("tr", has_text="a screen in the hall")
    row.get_by_role("button", name="End").click()
    page.until(lambda: "ended" in row.inner_text())
    page.page.fill("#phone-name", "leaver")
    with page.page.expect_download() as saved:
        page.page.click("text=Give out")
    saved.value.save_as(tmp_path / "phone.zip")
    with zipfile.ZipFile(tmp_path / "phone.zip") as archive:
        assert f"tracks/{phone.track}.csv" in archive.namelist()
    delete = page.page.get_by_role("button", name="Delete", exact=True)
    delete.click()
    page.until(lambda: "Say that you are sure" in page.page.inner_text("#view-admin"))
    page.page.check("#phone-sure")
    delete.click()
    page.until(lambda: "1 tracks and 0 files" in page.page.inner_text("#view-admin"))
    page.until(lambda: "forget device" in page.page.inner_text("#view-admin .deeds"))
    with served.client() as client:
        assert client.get(f"/api/v1/tracks/{phone.track}").status_code == 404
    page.page.click("#tab-tracks")
    page.page.click("#tab-admin")
    assert not page.page.is_visible("#new-token")
