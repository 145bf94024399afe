"""Walk through docs/tutorial-server.md as a new user would, and draw the pictures of the server's pages:
``python scripts/draw_server_pictures.py demo-out``, a folder of ``wayfuse demo``.

In place of a phone there is a sender that posts what Sensor Logger posts: scans that the demo's surveyors heard, at
the places where the tutorial says to stand, and then a walk. The browser is a real Chromium without a screen. About
three minutes.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from playwright.sync_api import sync_playwright

from wayfuse.formats.reading import read
from wayfuse.maps.site import Site
from wayfuse.models.survey_walk import survey_walk
from wayfuse.sensors.recording import Recording
from wayfuse.sensors.records import WifiScan, bssid_text
from wayfuse.service.replay import envelopes
from wayfuse.service.wire import encode

__all__ = ["main"]

IMAGES = Path(__file__).resolve().parent.parent / "docs" / "images"
_PLACES = ((9.0, 27.0), (30.0, 27.5), (50.0, 26.0), (50.0, 11.0), (30.0, 9.0), (11.0, 10.0))  # m, of floor 0
_STAND_S, _SCANS = 6.0, 6
_WIDE, _SMALL = {"width": 1280, "height": 800}, {"width": 390, "height": 780}
_DRAWS_WITHOUT_A_GPU = ("--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist")
_NAME = "machine.example"  # what the browser calls this machine, for phones cannot reach 127.0.0.1
_ON_0 = "ul.tracks button[data-level='0']"
Json = dict[str, Any]


class Heard(NamedTuple):
    """Scans of a floor and where each was heard: xy (n, 2) m."""

    xy: np.ndarray[Any, np.dtype[np.float64]]
    scans: list[WifiScan]

    def near(self, place: tuple[float, float], n: int) -> list[WifiScan]:
        """The scans heard nearest to a place."""
        order = np.argsort(np.hypot(*(self.xy - place).T), kind="stable")
        return [self.scans[i] for i in order[:n]]


def heard_on(site: Site, folder: Path, floor: int) -> Heard:
    """What the demo's surveyors heard on a floor."""
    places, scans = [], []
    for path in sorted((folder / "survey").iterdir()):
        walk, _ = survey_walk(site, read(path))
        if walk is not None and set(walk.floor.tolist()) == {floor}:
            for scan in walk.scans:
                places.append([np.interp(scan.t, walk.t, walk.xy[:, k]) for k in (0, 1)])
                scans.append(scan)
    return Heard(np.array(places), scans)


def wifi_items(scan: WifiScan, t: float) -> list[Json]:
    """A scan as Sensor Logger says it, one item per access point."""
    rows = zip(scan.bssid.tolist(), scan.rssi.tolist(), scan.frequency.tolist(), strict=True)
    return [
        _item("wifi", t, {"bssid": bssid_text(b), "level": r, "frequency": f, "ssid": "demo"})
        for b, r, f in rows
    ]


def walk_items(recording: Recording) -> list[Json]:
    """A recording as Sensor Logger says it, in the order of time."""
    axes = {"totalacceleration": recording.acceleration, "gyroscope": recording.rotation_rate}
    axes |= {"magnetometer": recording.magnetic_field}
    items = [
        _item(name, t, dict(zip("xyz", values, strict=True)))
        for name, series in axes.items()
        for t, values in zip(series.t.tolist(), series.values.tolist(), strict=True)
    ]
    turned = zip(recording.orientation.t.tolist(), recording.orientation.values.tolist(), strict=True)
    items += [_item("orientation", t, dict(zip(("qw", "qx", "qy", "qz"), q, strict=True))) for t, q in turned]
    pressed = zip(recording.pressure.t.tolist(), recording.pressure.values.ravel().tolist(), strict=True)
    items += [_item("barometer", t, {"pressure": p}) for t, p in pressed]
    for scan in recording.wifi:
        items += wifi_items(scan, scan.t)
    return sorted(items, key=lambda item: float(item["time"]))


def _item(name: str, t: float, values: Json) -> Json:
    return {"name": name, "time": round(t * 1e9), "values": values}


class SensorLogger:
    """The app: pushes what it has to the address it was given."""

    def __init__(self, address: str, session: str) -> None:
        self._address, self._session, self._n = address, session, 0

    def push(self, items: list[Json]) -> None:
        """Post one message."""
        said = {"messageId": self._n, "sessionId": self._session, "deviceId": "my phone", "payload": items}
        self._n += 1
        post(self._address, json.dumps(said).encode())

    def record(self, recording: Recording, seconds: float) -> None:
        """Push so much of a recording, a second at a time."""
        items = walk_items(recording)
        start = recording.span[0]
        for k in range(round(seconds)):
            edges = (1e9 * (start + k), 1e9 * (start + k + 1))
            self.push([i for i in items if edges[0] <= i["time"] < edges[1]])


def post(address: str, body: bytes, token: str = "") -> Json:
    """Post a body; the answer."""
    headers = {"Content-Type": "application/json"} | ({"Authorization": f"Bearer {token}"} if token else {})
    request = urllib.request.Request(address, body, headers)  # noqa: S310 (the server below)
    with urllib.request.urlopen(request) as answer:  # noqa: S310
        said: Json = json.loads(answer.read())
    return said


@contextmanager
def serving(demo: Path, **settings: str) -> Iterator[tuple[str, str]]:
    """`wayfuse serve` as the tutorial has it; its address and the administrator's token."""
    with tempfile.TemporaryDirectory() as data:
        command = [
            sys.executable,
            "-m",
            "wayfuse",
            "serve",
            demo / "site",
            "--radio-map",
            demo / "radio-map.npz",
        ]
        environment = os.environ | {f"WAYFUSE_SERVER_{k.upper()}": v for k, v in settings.items()}
        process = subprocess.Popen(  # noqa: S603
            [*map(str, command), "--port", "0", "--data", data],
            stdout=subprocess.PIPE,
            text=True,
            env=environment | {"PYTHONUNBUFFERED": "1"},
        )
        try:
            assert process.stdout is not None  # noqa: S101
            said = [process.stdout.readline() for _ in range(2)]
            yield said[1].split()[-1], said[0].split()[-1]
        finally:
            process.send_signal(signal.SIGTERM)
            process.wait(30)


class Page:
    """The page in the browser."""

    def __init__(self, browser: Any, address: str, token: str, **options: Any) -> None:
        self.page = browser.new_page(**options)
        self.page.goto(f"{address}/")
        self.page.fill("#token", token)
        self.page.click("text=Show the map")
        self.page.wait_for_selector("#connection[data-state=on]")

    def draw(self, name: str, wait: float = 1.5) -> None:
        """Write a picture when all is drawn."""
        self.page.wait_for_timeout(1000 * wait)
        self.page.screenshot(path=IMAGES / f"server-{name}.png")
        sys.stdout.write(f"{IMAGES / f'server-{name}.png'}\n")

    def at(self, x: float, y: float) -> list[float]:
        """Where on the screen a place (m) of floor 0 is."""
        say = (
            "([x, y]) => fetch('/api/v1/plan', {headers: {Authorization: `Bearer ${"
            "sessionStorage.getItem('wayfuse-token')}`}}).then((r) => r.json()).then(({floors: [f]}) => {"
            "const map = document.querySelector('#map').map, box = map.getContainer().getBoundingClientRect();"
            "const at = map.project([0, 1].map((k) => f.origin[k] + f.matrix[k][0] * x + f.matrix[k][1] * y));"
            "return [box.x + at.x, box.y + at.y]; })"
        )
        found: list[float] = self.page.evaluate(say, [x, y])
        return found


def walk_about(demo: Path, address: str, token: str) -> list[str]:
    """Let the phones of the demo walk for a while; their tracks."""
    tracks = []
    for n, path in enumerate(sorted((demo / "data" / "walks").iterdir())):
        for envelope in list(envelopes(read(path), f"phone {n}", "walk"))[: 12 + 2 * n]:
            said = post(f"{address}/api/v1/in/own", encode(envelope), token)
        tracks.append(said["accepted"][0]["track"])
    return tracks


def draw_walks(browser: Any, demo: Path) -> None:
    """Sections 2 and 3: the map, phones that walk, replay."""
    with serving(demo) as (address, token):
        page = Page(browser, address, token, viewport=_WIDE)
        tracks = walk_about(demo, address, token)
        page.page.wait_for_selector(f"[data-track='{tracks[-1]}']")
        page.page.locator(_ON_0).first.click()
        page.page.check("#show-particles")
        page.draw("map")
        dark = Page(browser, address, token, viewport=_WIDE, color_scheme="dark")
        dark.page.locator(_ON_0).first.click()
        dark.draw("dark")
        small = Page(browser, address, token, viewport=_SMALL, has_touch=True)
        small.page.locator(_ON_0).first.click()
        small.draw("phone")
        page.page.uncheck("#show-particles")
        page.page.click("#tab-replay")
        page.page.wait_for_function("() => document.querySelectorAll('#replay-track option').length > 1")
        page.page.select_option("#replay-track", tracks[-1])
        page.page.fill("#replay-time", "15")
        page.draw("replay")


def draw_zones(browser: Any, demo: Path, fences: Path) -> None:
    """docs/server.md: a geofence with somebody inside."""
    with serving(demo, geofences=str(fences)) as (address, token):
        page = Page(browser, address, token, viewport=_WIDE)
        page.page.click("#tab-zones")
        walk_about(demo, address, token)
        page.draw("zones", 3.0)


def draw_survey(browser: Any, demo: Path, heard: Heard) -> None:
    """Sections 4 to 6: six places, a radio map, and one's own phone on it."""
    with serving(demo) as (address, token):
        page = Page(browser, address.replace("127.0.0.1", _NAME), token, viewport=_WIDE)
        page.page.click("#tab-survey")
        page.page.click("text=Connect a phone")
        page.page.click("text=Make a push address")
        page.page.wait_for_selector("#push-address:not([hidden])")
        pushed = page.page.input_value("#push-address").replace(_NAME, "127.0.0.1")
        app = SensorLogger(pushed, "survey")
        app.push(wifi_items(heard.scans[0], time.time()))
        page.page.wait_for_selector("button:has-text('Stand here'):enabled")
        for n, place in enumerate(_PLACES):
            stand(page, app, heard.near(place, _SCANS), place, is_drawn=n == 3)
        page.page.click("text=Build a radio map")
        page.page.wait_for_selector("text=Publish it below")
        page.page.locator("tr", has_text="walks").get_by_role("button", name="Publish").click()
        page.page.wait_for_selector("tr:has-text('walks') >> text=in use")
        page.page.check("[value=coverage]")
        page.page.evaluate("() => document.querySelector('#view-survey').scrollTo(0, 0)")
        page.draw("coverage", 2.5)
        page.page.check("[value=none]")
        page.page.click("#tab-tracks")
        walks = [read(path) for path in sorted((demo / "data" / "walks").iterdir())]
        SensorLogger(pushed.replace("/survey/", "/"), "first walk").record(walks[0], 14.0)
        page.page.wait_for_selector("ul.tracks li:nth-child(2)")
        page.page.locator("ul.tracks button").last.click()
        page.page.check("#show-particles")
        page.draw("own-phone", 2.0)


def stand(
    page: Page, app: SensorLogger, scans: list[WifiScan], place: tuple[float, float], *, is_drawn: bool
) -> None:
    """Stand at a place while the phone pushes what is heard there."""
    page.page.get_by_role("button", name="Stand here").click()
    page.page.mouse.click(*page.at(*place))
    page.page.wait_for_selector("text=Stand still:")
    pushing = threading.Thread(target=_push_slowly, args=(app, scans))
    pushing.start()
    while pushing.is_alive():
        page.page.wait_for_timeout(100)
    page.page.wait_for_timeout(1200)
    if is_drawn:
        page.page.evaluate("() => document.querySelector('#view-survey').scrollTo(0, 0)")
        page.draw("survey", 0.2)
    page.page.click("text=Finish")
    page.page.wait_for_selector("text=Kept, with")


def _push_slowly(app: SensorLogger, scans: list[WifiScan]) -> None:
    for scan in scans:
        app.push(wifi_items(scan, time.time()))
        time.sleep(_STAND_S / len(scans))


def fence(site: Site) -> Json:
    """A geofence over a part of the ground floor, as docs/server.md has it."""
    floor = site.floors[0]
    if floor.anchor is None:
        raise SystemExit("the demo's site has lost its place on earth")
    ring = floor.anchor.to_lonlat(
        np.array([(28, 14.6), (51.8, 14.6), (51.8, 28), (28, 28), (28, 14.6)])
    ).tolist()
    said = {"name": "Exhibition", "level": floor.name}
    geometry = {"type": "Polygon", "coordinates": [ring]}
    return {
        "type": "FeatureCollection",
        "features": [{"type": "Feature", "properties": said, "geometry": geometry}],
    }


def main() -> None:
    """Draw all pictures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("demo", type=Path, help="folder that `wayfuse demo` wrote")
    demo = parser.parse_args().demo
    chromium = shutil.which("chromium") or shutil.which("chromium-browser")
    if chromium is None:
        raise SystemExit("Chromium is not installed")
    site = Site.load(demo / "site")
    heard = heard_on(site, demo / "data", 0)
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as playwright:
        fences = Path(folder) / "fences.json"
        fences.write_text(json.dumps(fence(site)), encoding="utf-8")
        browser = playwright.chromium.launch(
            executable_path=chromium,
            args=[*_DRAWS_WITHOUT_A_GPU, "--no-sandbox", f"--host-resolver-rules=MAP {_NAME} 127.0.0.1"],
        )
        draw_walks(browser, demo)
        draw_zones(browser, demo, fences)
        draw_survey(browser, demo, heard)
        browser.close()


if __name__ == "__main__":
    main()
