"""Shared fixtures: where the real recordings are, and a loud skip where they are not."""

from __future__ import annotations

import functools
import os
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import pytest
from hypothesis import settings

from wayfuse.maps.site import Site
from wayfuse.radio.survey import Survey
from wayfuse.sensors.recording import Recording
from wayfuse.simulator.simulate import Truth

settings.register_profile("wayfuse", deadline=None)  # the first example may have to wait for the compiler
settings.load_profile("wayfuse")


@pytest.fixture(scope="session")
def data_root() -> Path:
    """Folder of the real recordings ($WAYFUSE_DATA, else ~/.cache/wayfuse-data)."""
    root = Path(os.environ.get("WAYFUSE_DATA") or Path.home() / ".cache" / "wayfuse-data")
    if not root.is_dir():
        pytest.skip(f"REAL DATA ABSENT: no folder {root}; fetch with `wayfuse datasets fetch NAME`")
    return root


@pytest.fixture(scope="session")
def ms_indoor(data_root: Path) -> Path:
    """Folder of the ms-indoor site1 (B1, F1, ...)."""
    site = data_root / "ms-indoor" / "site1"
    if not site.is_dir():
        pytest.skip(f"REAL DATA ABSENT: no folder {site}; fetch with `wayfuse datasets fetch ms-indoor`")
    return site


@pytest.fixture(scope="session")
def read_log() -> Callable[[Path], Recording]:
    """Reads a real log, each once for all tests; nobody writes into its arrays."""
    from wayfuse.formats.reading import read

    return functools.cache(read)


@dataclass(frozen=True)
class SmallWorld:
    """A simulated site as a user has it: files in the ms-indoor layout, the site and radio map made of them.

    ``folder`` holds site/ (plans), survey/, walks/, SITE (imported) and map.npz. walks : recordings read back.
    """

    folder: Path
    site: Site
    survey: Survey
    walks: tuple[Recording, ...]
    truth: dict[str, Truth]


@pytest.fixture(scope="session")
def world(tmp_path_factory: pytest.TempPathFactory) -> SmallWorld:
    """One small simulated world for all tests that track; nobody writes into it."""
    from wayfuse.formats.reading import read
    from wayfuse.maps.importers.ms_indoor import import_site
    from wayfuse.models.survey_walk import survey_walk
    from wayfuse.radio.walk_survey import SurveyParameters, WalkRadioMap, survey_from_walks
    from wayfuse.simulator.demo import write_demo
    from wayfuse.simulator.scenario import Scenario

    folder = tmp_path_factory.mktemp("world")
    files = write_demo(folder, 3, Scenario(survey_walks=16, test_walks=4, duration_s=(25.0, 35.0)))
    site, _ = import_site(files.site)
    site.save(folder / "SITE")
    walks = [survey_walk(site, read(path))[0] for path in files.survey]
    survey = survey_from_walks([w for w in walks if w is not None], site.floor_names)
    WalkRadioMap(survey, SurveyParameters(), site.name).save(folder / "map.npz")
    return SmallWorld(folder, site, survey, tuple(read(path) for path in files.walks), files.truth)


class Said(NamedTuple):
    """What a run of the command line gave."""

    code: int
    out: str
    err: str


@pytest.fixture
def run_cli(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> Callable[..., Said]:
    """Run ``wayfuse ARGUMENTS`` as its entry point does, in this process."""
    from wayfuse.cli.main import main

    def run(*arguments: object) -> Said:
        monkeypatch.setattr(sys, "argv", ["wayfuse", *map(str, arguments)])
        capsys.readouterr()
        code = 0
        try:
            main()
        except SystemExit as stop:
            code = int(stop.code or 0)
        return Said(code, *capsys.readouterr())

    return run
