"""The demo's files: a simulated site, its survey and its test walks, in the public ms-indoor layout.

::

    FOLDER/site/F1/floor_info.json, geojson_map.json     the floor plans
    FOLDER/survey/F1/<name>.txt                          walks for the radio map
    FOLDER/walks/F1/<name>.txt                           walks to track
"""

from __future__ import annotations

from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path

import numpy as np

from wayfuse.simulator.recordings import write_recording, write_site
from wayfuse.simulator.scenario import Scenario
from wayfuse.simulator.simulate import EPOCH_MS, SimulatedSite, Truth, make_site, simulate_walk

__all__ = ["DemoFiles", "demo_name", "smallest", "write_demo"]

_WALK_EVERY_MS = 180_000


@dataclass(frozen=True, slots=True, eq=False)
class DemoFiles:
    """What was written, and the truth that was not: ``truth`` by recording name, of survey and test walks."""

    site: Path
    survey: tuple[Path, ...]
    walks: tuple[Path, ...]
    truth: dict[str, Truth]


def smallest() -> Scenario:
    """The least that runs every part: one survey walk on each floor and one walk to track."""
    return Scenario(survey_walks=2, test_walks=1, duration_s=(20.0, 25.0), visit_m=(3.0, 14.0))


def write_demo(folder: Path, seed: int, scenario: Scenario | None = None) -> DemoFiles:
    """Write the demo's files into a folder (made where absent); the same seed writes the same bytes.

    Each walk draws from its own generator: more walks leave the others as they are.
    """
    scenario = Scenario() if scenario is None else scenario
    site_seed, survey_seed, test_seed = np.random.SeedSequence(seed).spawn(3)
    site = make_site(scenario, np.random.default_rng(site_seed))
    write_site(folder / "site", site.building)
    truth: dict[str, Truth] = {}
    visits = [np.zeros(len(storey.edges), dtype=np.int64) for storey in site.building.storeys]
    survey = _write_walks(
        folder / "survey", "survey", site, scenario, survey_seed, scenario.survey_walks, truth, visits
    )
    walks = _write_walks(
        folder / "walks", "walk", site, scenario.tracked(), test_seed, scenario.test_walks, truth, None
    )
    return DemoFiles(folder / "site", survey, walks, truth)


def demo_name(role: str, floor: str, number: int) -> str:
    """A recording's name that falls on its side of the split by name, ``sha256(name) % 10``.

    Readers of the public recordings tell survey (2 to 9) from development walks (1) by that number; so a
    command that splits by it treats these files as their folders say.
    """
    for k in range(10_000):
        name = f"{role}-{floor}-{number:02d}-{k:02d}"
        share = int(sha256(name.encode()).hexdigest(), 16) % 10
        if (share >= 2) if role == "survey" else (share == 1):
            return name
    raise AssertionError("no name of ten thousand falls on its side")  # chance 0.9 ** 10000


def _write_walks(
    folder: Path,
    role: str,
    site: SimulatedSite,
    scenario: Scenario,
    seed: np.random.SeedSequence,
    count: int,
    truth: dict[str, Truth],
    visits: list[np.ndarray] | None,
) -> tuple[Path, ...]:
    storeys = site.building.storeys
    ssid = dict(zip(site.radios.bssid.tolist(), site.radios.ssid, strict=True))
    first = 0 if visits is not None else scenario.survey_walks
    paths = []
    for i, child in enumerate(seed.spawn(count)):
        floor = i % len(storeys)
        name = demo_name(role, storeys[floor].name, i)
        recording, truth[name] = simulate_walk(
            site,
            scenario,
            np.random.default_rng(child),
            name,
            floor=floor,
            visits=None if visits is None else visits[floor],
            start_ms=EPOCH_MS + (first + i) * _WALK_EVERY_MS,
        )
        path = folder / storeys[floor].name / f"{name}.txt"
        path.parent.mkdir(parents=True, exist_ok=True)
        write_recording(path, recording, ssid)
        paths.append(path)
    return tuple(paths)
