"""A server of a small house in a process of its own, and a real browser that looks at it."""

from __future__ import annotations

import json
import shutil
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import pytest

from programs import skip_without
from wayfuse.maps.site import Site
from wayfuse.sensors.recording import Recording
from wayfuse.service.replay import envelopes
from wayfuse.service.web.build import ASSETS
from wayfuse.service.wire import encode

sys.path.append(str(Path(__file__).parent.parent / "service"))  # how a server is run is written there, once
from service_running import Running, running, wait_until

_DRAWS_WITHOUT_A_GPU = (
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--ignore-gpu-blocklist",
    "--no-sandbox",
)


@dataclass(frozen=True)
class House:
    """A simulated house in files, its surveyors' recordings, and the walk of a phone through it that changes floors."""

    folder: Path
    survey: list[Path]
    walk: Recording


@pytest.fixture(scope="session")
def house(tmp_path_factory: pytest.TempPathFactory) -> House:
    """Three floors with stairs and lift, surveyed, and one walk to track."""
    from wayfuse.formats.reading import read
    from wayfuse.maps.importers.imdf import import_site
    from wayfuse.models.survey_walk import survey_walk
    from wayfuse.radio.walk_survey import SurveyParameters, WalkRadioMap, survey_from_walks
    from wayfuse.simulator.house_demo import house_scenario, write_house_demo

    folder = tmp_path_factory.mktemp("house")
    demo = write_house_demo(folder, 0, replace(house_scenario(), survey_walks=3, test_walks=1))
    site, _ = import_site(demo.plan)
    site.save(folder / "SITE")
    walks = [survey_walk(site, read(path))[0] for path in demo.survey]
    survey = survey_from_walks([w for w in walks if w is not None], site.floor_names)
    WalkRadioMap(survey, SurveyParameters(), site.name).save(folder / "map.npz")
    return House(folder, demo.survey, read(demo.walks[0]))


@dataclass
class Phone:
    """A simulated phone that posts its records while it walks."""

    server: Running
    posts: list[bytes]
    done: int = 0
    track: str = ""

    def walk(self, seconds: int) -> dict[str, Any]:
        """Go on for so long (s of the walk; in no time here); where the server then says it is."""
        with self.server.client() as client:
            for body in self.posts[self.done : self.done + seconds]:
                answer = client.post("/api/v1/in/own", content=body)
                assert answer.status_code == 200, answer.text
                accepted = answer.json()["accepted"][0]
            self.done += seconds
            self.track = accepted["track"]
            wait_until(lambda: client.get("/health").json()["applied"] >= accepted["seq"])
            return client.get(f"/api/v1/tracks/{self.track}/position").json()["properties"]

    @property
    def is_done(self) -> bool:
        """Whether the walk is over."""
        return self.done >= len(self.posts)


@pytest.fixture(scope="session")
def served(house: House, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Running]:
    """The house, served; a geofence covers each floor."""
    data = tmp_path_factory.mktemp("server")
    fences = data / "fences.json"
    fences.write_text(json.dumps(_fences(Site.load(house.folder / "SITE"))), encoding="utf-8")
    more = {"particles": 300, "geofences": fences}
    with running(house.folder, data, "--radio-map", house.folder / "map.npz", **more) as server:
        yield server


def _fences(site: Site) -> dict[str, Any]:
    features = []
    for floor in site.floors:
        ring = floor.anchor.to_lonlat(floor.outline[0].exterior).tolist()
        said = {"name": f"all of {floor.name}", "level": floor.name}
        shape = {"type": "Polygon", "coordinates": [ring]}
        features.append({"type": "Feature", "properties": said, "geometry": shape})
    return {"type": "FeatureCollection", "features": features}


@pytest.fixture(scope="session")
def new_phone(house: House, served: Running) -> Callable[[str], Phone]:
    """A phone of a name, at the start of the walk."""

    def make(name: str) -> Phone:
        return Phone(served, [encode(e) for e in envelopes(house.walk, name, f"walk of {name}", 1.0)])

    return make


@dataclass
class Looked:
    """A page of the browser, and what must not happen in it."""

    page: Any
    address: str
    complaints: list[str] = field(default_factory=list)
    outside: list[str] = field(default_factory=list)

    def enter(self, token: str) -> None:
        """Type the token; the map is there when this returns."""
        self.page.goto(f"{self.address}/")
        self.page.fill("#token", token)
        self.page.click("text=Show the map")
        self.wait()

    def wait(self) -> None:
        """Until the page shows a building and is connected."""
        self.page.wait_for_selector("#floors button")
        self.page.wait_for_selector("#connection[data-state=on]")

    def dots(self) -> dict[str, tuple[float, float, str]]:
        """Longitude, latitude and state of every dot that the map draws now."""
        found = self.page.evaluate(
            "() => document.querySelector('#map').map.queryRenderedFeatures({layers: ['dots']})"
            ".map((f) => [f.properties.track, ...f.geometry.coordinates, f.properties.state])"
        )
        return {track: (lon, lat, state) for track, lon, lat, state in found}

    def until(self, is_so: Callable[[], Any], seconds: float = 60.0) -> None:
        """Wait until something is so, letting the page work meanwhile."""
        for _ in range(round(seconds / 0.05)):
            if is_so():
                return
            self.page.wait_for_timeout(50)
        raise AssertionError(f"waited in vain; the page complained: {self.complaints}")

    @property
    def level(self) -> str:
        """The floor that is shown."""
        return str(self.page.inner_text("#floors [aria-checked=true] span:first-child"))


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    """Chromium without a screen; it is closed with the file, for its driver keeps an event loop running."""
    path = next(
        (p for name in ("chromium", "chromium-browser", "google-chrome") if (p := shutil.which(name))), ""
    )
    if not path:
        skip_without("Chromium", "it is not installed (Debian: apt-get install chromium)")
    if not (ASSETS / "maplibre-gl.mjs").is_file():
        skip_without("Chromium", "the page is not built (make web)")
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=path, args=list(_DRAWS_WITHOUT_A_GPU))
        yield browser
        browser.close()


@pytest.fixture
def look(browser: Any, served: Running) -> Iterator[Callable[..., Looked]]:
    """Open the page (options: those of a browser's context); afterwards nothing may have been wrong with it."""
    opened: list[Looked] = []

    def open_page(address: str = served.address, **options: Any) -> Looked:
        context = browser.new_context(**{"viewport": {"width": 1280, "height": 800}} | options)
        context.set_default_timeout(60_000.0)  # other tests want the cores too
        looked = Looked(context.new_page(), address)
        looked.page.on(
            "console", lambda m: m.type in {"error", "warning"} and looked.complaints.append(m.text)
        )
        looked.page.on("pageerror", lambda e: looked.complaints.append(str(e)))
        own = (address, "data:", f"blob:{address}")
        context.on("request", lambda r: r.url.startswith(own) or looked.outside.append(r.url))
        opened.append(looked)
        return looked

    yield open_page
    for looked in opened:
        looked.page.context.close()
        assert looked.outside == []
        assert looked.complaints == []
