"""CPU time until the command line says something: help, and the first position from a warm kernel cache.

python -m benchmarks.startup
"""

from __future__ import annotations

import os
import resource
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

from benchmarks.report import Table, Target

__all__ = ["measure"]

PROGRAM = "from wayfuse.cli.main import main; main()"


def cpu_of(folder: Path, *arguments: str, program: str = PROGRAM) -> float:
    """User and system seconds of a process of its own; ``folder`` keeps the byte code, as an installation would."""
    environment = {k: v for k, v in os.environ.items() if k != "PYTHONDONTWRITEBYTECODE"}
    environment["PYTHONPYCACHEPREFIX"] = str(folder / "bytecode")
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    command = [sys.executable, "-c", program, *arguments]
    subprocess.run(command, check=True, capture_output=True, env=environment)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime - before.ru_utime + after.ru_stime - before.ru_stime


def measure(seconds: float) -> tuple[list[Table], list[Target]]:
    """The table of start-up times and the goals."""
    times = max(3, min(15, int(seconds / 2.0)))
    with tempfile.TemporaryDirectory() as folder:
        site, radio_map, walk = small_world(Path(folder))
        out = str(Path(folder) / "EST.csv")
        commands = {
            "python alone": ((), "pass"),
            "wayfuse --help": (("--help",), PROGRAM),
            "wayfuse track --help": (("track", "--help"), PROGRAM),
            "wayfuse track, a walk of a few seconds": (
                ("track", site, walk, "--radio-map", radio_map, "--out", out),
                PROGRAM,
            ),
        }
        taken: dict[str, list[float]] = {name: [] for name in commands}
        for arguments, program in commands.values():
            cpu_of(Path(folder), *arguments, program=program)  # fills the caches
        for _ in range(times):
            for name, (arguments, program) in commands.items():
                taken[name].append(cpu_of(Path(folder), *arguments, program=program))
    rows = [(name, f"{min(t):.2f} ({statistics.median(t):.2f})") for name, t in taken.items()]
    names = list(commands)
    goals = [
        Target("wayfuse --help, CPU", 0.15, min(taken[names[1]]), "s", less=True),
        Target("first position, warm cache, CPU", 0.8, min(taken[names[3]]), "s", less=True),
    ]
    note = "CPU seconds of a process, user and system, least (median). Which modules are loaded is held by a test."
    return [Table("Start-up", note, ("command", "s"), tuple(rows))], goals


def small_world(folder: Path) -> tuple[str, str, str]:
    """Site, radio map and one short walk, made by the simulator."""
    from wayfuse.formats.reading import read
    from wayfuse.maps.importers.ms_indoor import import_site
    from wayfuse.models.survey_walk import survey_walk
    from wayfuse.radio.walk_survey import SurveyParameters, WalkRadioMap, survey_from_walks
    from wayfuse.simulator.demo import write_demo
    from wayfuse.simulator.scenario import Scenario

    files = write_demo(folder, 3, Scenario(survey_walks=16, test_walks=4, duration_s=(10.0, 15.0)))
    site, _ = import_site(files.site)
    site.save(folder / "SITE")
    walks = [survey_walk(site, read(path))[0] for path in files.survey]
    survey = survey_from_walks([w for w in walks if w is not None], site.floor_names)
    WalkRadioMap(survey, SurveyParameters(), site.name).save(folder / "map.npz")
    return str(folder / "SITE"), str(folder / "map.npz"), os.fspath(files.walks[0])


def main() -> None:
    tables, goals = measure(10.0)
    print(*tables[0].rows, *goals, sep="\n")


if __name__ == "__main__":
    main()
