"""A server in a process of its own, as `wayfuse serve` starts it, with what it uses of the machine; and its world."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import time
import urllib.request
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import IO

from wayfuse.evaluation.results_folds import gather
from wayfuse.formats.datasets import data_root
from wayfuse.formats.reading import read
from wayfuse.maps.importers.ms_indoor import import_site
from wayfuse.maps.site import Site
from wayfuse.models.survey_walk import survey_walk
from wayfuse.radio.survey import Survey
from wayfuse.radio.walk_survey import SurveyParameters, WalkRadioMap, survey_from_walks
from wayfuse.sensors.recording import Recording
from wayfuse.simulator.demo import write_demo
from wayfuse.simulator.scenario import Scenario

__all__ = ["Process", "Scene", "development", "serving", "simulated"]

_START_S = 60.0
_TICKS = os.sysconf("SC_CLK_TCK")
_PAGE_BYTES = os.sysconf("SC_PAGE_SIZE")
_DEVELOPMENT = 1  # fold of `evaluation.results_folds`


@dataclass(frozen=True, slots=True, eq=False)
class Scene:
    """A site and radio map in files, as `wayfuse serve` takes them, and the walks of phones."""

    name: str
    folder: Path
    site: Site
    survey: Survey
    walks: tuple[Recording, ...]

    @property
    def arguments(self) -> list[str]:
        """Of the command line."""
        return [str(self.folder / "SITE"), "--radio-map", str(self.folder / "map.npz")]


def simulated(
    folder: Path, seed: int, walks: int = 12, duration_s: tuple[float, float] = (95.0, 120.0)
) -> Scene:
    """A simulated site of two floors, surveyed by 40 walks, and walks of phones."""
    files = write_demo(folder, seed, Scenario(survey_walks=40, test_walks=walks, duration_s=duration_s))
    site, _ = import_site(files.site)
    surveyed = [survey_walk(site, read(path))[0] for path in files.survey]
    survey = survey_from_walks([walk for walk in surveyed if walk is not None], site.floor_names)
    return _written("simulated", folder, site, survey, tuple(read(path) for path in files.walks))


def development(folder: Path) -> Scene:
    """The development walks of ms-indoor (share 1), surveyed by all walks of share 2 and above."""
    folds = gather(data_root() / "ms-indoor" / "site1", (_DEVELOPMENT,))
    walks = tuple(folds.of(_DEVELOPMENT))
    return _written("ms-indoor", folder, folds.site, folds.surveys[_DEVELOPMENT], walks)


def _written(name: str, folder: Path, site: Site, survey: Survey, walks: tuple[Recording, ...]) -> Scene:
    site.save(folder / "SITE")
    WalkRadioMap(survey, SurveyParameters(), site.name).save(folder / "map.npz")
    return Scene(name, folder, site, survey, walks)


@dataclass(frozen=True, slots=True)
class Process:
    """A server that runs. token : the administrator's."""

    pid: int
    host: str
    port: int
    token: str

    @property
    def url(self) -> str:
        """Where it is."""
        return f"http://{self.host}:{self.port}"

    def get(self, path: str) -> bytes:
        """Body of an answer."""
        request = urllib.request.Request(self.url + path, headers={"Authorization": f"Bearer {self.token}"})  # noqa: S310
        with _OPENER.open(request, timeout=60.0) as answer:
            body: bytes = answer.read()
        return body

    def cpu(self) -> float:
        """CPU seconds so far, of all its threads."""
        fields = Path(f"/proc/{self.pid}/stat").read_text(encoding="ascii").rpartition(")")[2].split()
        return (int(fields[11]) + int(fields[12])) / _TICKS

    def resident(self) -> int:
        """Bytes of memory."""
        fields = Path(f"/proc/{self.pid}/statm").read_text(encoding="ascii").split()
        return int(fields[1]) * _PAGE_BYTES


_OPENER = urllib.request.build_opener(urllib.request.ProxyHandler({}))  # the server is on this machine


@contextmanager
def serving(
    scene: Scene,
    data: Path,
    *,
    core: int | None = None,
    start: Sequence[str] = (),
    errors: IO[bytes] | None = None,
    **settings: object,
) -> Iterator[Process]:
    """A server on a free port of the loopback, with as many requests as anybody likes; ends with the block.

    core : the one that it may use. start : what is run instead of `wayfuse`. errors : file of its log. settings :
    of `service.settings`.
    """
    environment = {k: v for k, v in os.environ.items() if not k.startswith("WAYFUSE_SERVER_")}
    settings = {"rate_per_s": 0} | settings
    environment |= {f"WAYFUSE_SERVER_{k.upper()}": str(v) for k, v in settings.items()}
    environment |= {"PYTHONUNBUFFERED": "1", "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    command = [sys.executable, *(start or ("-m", "wayfuse")), "serve", *scene.arguments]
    process = subprocess.Popen(
        [*command, "--port", "0", "--data", str(data)],
        stdout=subprocess.PIPE,
        stderr=errors,
        text=True,
        env=environment,
    )
    if core is not None:
        os.sched_setaffinity(process.pid, {core})  # threads that begin later inherit it
    try:
        yield _ready(process)
    finally:
        process.send_signal(signal.SIGTERM)
        try:
            process.wait(30)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait(30)


def _ready(process: subprocess.Popen[str]) -> Process:
    token = ""
    assert process.stdout is not None
    for line in process.stdout:
        if line.startswith("administrator's token"):
            token = line.split()[-1]
        said = re.match(r"serving .* at http://(.*):(\d+)$", line)
        if said is not None:
            server = Process(process.pid, said[1], int(said[2]), token)
            _wait(server)
            return server
    raise RuntimeError("the server did not start")


def _wait(server: Process) -> None:
    end = time.monotonic() + _START_S
    while True:
        try:
            server.get("/health")
        except OSError:
            if time.monotonic() > end:
                raise
            time.sleep(0.05)
        else:
            return
