"""The files of a scenario that was simulated.

::

    DIR/SITE/              the site
    DIR/scenario.toml      the scenario with its seed and the version: simulating it again gives the same files
    DIR/survey/ walks/     recordings in the first format; further formats in DIR/FORMAT/survey, DIR/FORMAT/walks
    DIR/truth.csv          where everybody was, ten times a second, also readable as estimates
    DIR/truth/             recordings of the true places alone, for `wayfuse evaluate`
    DIR/access_points.csv  places of the survey's access points, access_points_later.csv of the walks' if they changed
    DIR/walks.csv          one row per walk

Truth goes nowhere else: recordings of walks to track hold no waypoint.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from wayfuse.core.errors import ConfigError
from wayfuse.sensors.recording import Recording, Series
from wayfuse.sensors.records import bssid_text
from wayfuse.simulator.experiment import Plan, SimulatedWalk, World, simulate_plan
from wayfuse.simulator.getsensordata_log import write_log
from wayfuse.simulator.passages import Activity
from wayfuse.simulator.recordings import write_recording
from wayfuse.simulator.simulate import EPOCH_MS, SimulatedSite
from wayfuse.simulator.wayfuse_log import write_wayfuse_log

__all__ = ["WalkFiles", "check_formats", "scenario_copy", "write_access_points", "write_tables", "write_walk"]

SUFFIX = {"wayfuse": ".jsonl", "getsensordata": ".txt", "ms-indoor": ".txt"}
_TRUTH = "walk,t_ms,x,y,floor,lat,lon,z,heading,activity"
_WALKS = "walk,role,phone,duration_s,length_m,floors,scans,ranges,csi"
_PICTURE_S = 0.5  # s between the places kept for the picture


@dataclass(frozen=True, slots=True)
class WalkFiles:
    """What was written of a walk. row : of walks.csv. truth : rows of truth.csv.

    places : ((x, y, floor), ...) every half second, for the picture.
    """

    name: str
    role: str
    row: str
    truth: str
    places: tuple[tuple[float, float, int], ...]


def check_formats(world: World, plans: tuple[Plan, ...]) -> None:
    """Refuse formats that cannot say what is simulated.

    Raises
    ------
    ConfigError : names the format and what it lacks.
    """
    names = [storey.name for storey in world.building.storeys]
    for kind in world.scenario.output.formats:
        fault = ""
        if kind == "getsensordata" and not world.georeferenced:
            fault = "states places in degrees, and the site has no anchor"
        if kind == "getsensordata" and not all(re.fullmatch(r"-?\d+", name) for name in names):
            fault = f"knows whole numbers as floors, not {', '.join(names)}"
        if kind == "ms-indoor" and any(leg.passage >= 0 for plan in plans for leg in plan.journey.legs):
            fault = "has one floor per recording, and some walks change it"
        if fault:
            raise ConfigError(f"{kind} {fault}", where="output.formats", remedy="leave it out")


def write_walk(world: World, plan: Plan, folder: Path) -> WalkFiles:
    """Simulate a walk and write its recordings and its true places."""
    made = simulate_plan(world, plan)
    part = "survey" if plan.role == "survey" else "walks"
    for k, kind in enumerate(world.scenario.output.formats):
        place = (folder if k == 0 else folder / kind) / part / f"{plan.name}{SUFFIX[kind]}"
        _write(place, kind, world, made)
    if plan.role != "survey":
        heard = made.recording
        known = Recording(
            plan.name,
            wifi=heard.wifi[:1],  # from the first on a tracker can know anything: scores count from there
            ranges=heard.ranges[:1],
            csi=heard.csi[:1],
            waypoints=made.places,
            site=heard.site,
            clock=heard.clock,
            device=heard.device,
        )
        write_wayfuse_log(folder / "truth" / f"{plan.name}.jsonl", known)
    return WalkFiles(plan.name, plan.role, _row(world, made), _truth_rows(world, made), _places(made))


def write_tables(folder: Path, done: list[WalkFiles]) -> None:
    """Write truth.csv and walks.csv."""
    _write_text(folder / "truth.csv", "\n".join([_TRUTH, *(one.truth for one in done)]) + "\n")
    _write_text(folder / "walks.csv", "\n".join([_WALKS, *(one.row for one in done)]) + "\n")


def write_access_points(path: Path, world: World, site: SimulatedSite) -> None:
    """Write the places of all networks that are there: bssid, x, y (m, floor's frame), floor, height (m)."""
    radios = site.radios
    rows = ["bssid,x,y,floor,height"]
    for bssid, radio in zip(radios.bssid.tolist(), radios.radio.tolist(), strict=True):
        if not radios.is_there[radio]:
            continue
        ap = int(radios.ap[radio])
        floor = int(radios.ap_floor[ap])
        x, y = (radios.ap_xy[ap] + world.shift[floor]).tolist()
        height = radios.model.ap_height
        rows.append(f"{bssid_text(bssid)},{x:.3f},{y:.3f},{_cell(radios.storeys[floor].name)},{height:.2f}")
    _write_text(path, "\n".join(rows) + "\n")


def scenario_copy(text: str, seed: int, version: str, *, has_folder: bool) -> str:
    """The scenario's text with the seed used, the version, and the copy of the site as its folder."""
    first = re.search(r"^\s*\[", text, re.MULTILINE)  # the first table
    head, body = (text, "") if first is None else (text[: first.start()], text[first.start() :])
    head = re.sub(r"^\s*(seed|version)\s*=.*\n?", "", head, flags=re.MULTILINE)
    if has_folder:
        body = re.sub(r"^(\s*folder\s*=).*$", r'\1 "SITE"', body, count=1, flags=re.MULTILINE)
    return f'seed = {seed}\nversion = "{version}"\n{head}{body}'


def _write(path: Path, kind: str, world: World, made: SimulatedWalk) -> None:
    radios = world.before.radios
    ssid = dict(zip(radios.bssid.tolist(), radios.ssid, strict=True))
    if kind == "wayfuse":
        write_wayfuse_log(path, made.recording)
    elif kind == "getsensordata":
        write_log(path, made.recording, ssid)
    else:
        floor = world.building.storeys[int(made.truth.floor[0])].name
        write_recording(path, replace(_since_epoch(made.recording), floor=floor), ssid)


def _since_epoch(recording: Recording) -> Recording:
    """On Unix time: the start of every walk is the same moment."""
    start = EPOCH_MS / 1000

    def moved(series: Series) -> Series:
        return Series(start + series.t, series.values)

    return replace(
        recording,
        acceleration=moved(recording.acceleration),
        rotation_rate=moved(recording.rotation_rate),
        magnetic_field=moved(recording.magnetic_field),
        orientation=moved(recording.orientation),
        wifi=tuple(replace(s, t=start + s.t, last_seen=start + s.last_seen) for s in recording.wifi),
        waypoints=tuple(w._replace(t=start + w.t) for w in recording.waypoints),
        clock="Unix time",
    )


def _row(world: World, made: SimulatedWalk) -> str:
    """The walk's row of walks.csv."""
    truth, recording = made.truth, made.recording
    passed = [world.building.storeys[k].name for k in truth.floor[_changes(truth.floor)].tolist()]
    cells = [
        made.plan.name,
        made.plan.role,
        _cell(recording.device.model),
        f"{truth.t[-1]:.2f}",
        f"{float(truth.step_length.sum()):.1f}",
        _cell(" ".join(passed)),
        *(str(len(events)) for events in (recording.wifi, recording.ranges, recording.csi)),
    ]
    return ",".join(cells)


def _changes(floor: np.ndarray) -> np.ndarray:
    return np.concatenate([[0], np.flatnonzero(np.diff(floor)) + 1])


def _truth_rows(world: World, made: SimulatedWalk) -> str:
    truth, names = made.truth, [_cell(storey.name) for storey in world.building.storeys]
    step = round(100.0 / world.scenario.output.truth_hz)  # of the grid of 100 Hz
    rows = []
    for k in range(0, len(truth.t), step):
        floor = int(truth.floor[k])
        x, y = (truth.xy[k] + world.shift[floor]).tolist()
        lon, lat = world.building.anchor.to_lonlat(truth.xy[k]).tolist()
        degrees = f"{lat:.8f},{lon:.8f}" if world.georeferenced else ","
        doing = Activity(int(truth.activity[k])).name.lower()
        place = f"{x:.3f},{y:.3f},{names[floor]},{degrees},{truth.z[k]:.3f},{truth.heading[k]:.4f}"
        rows.append(f"{made.plan.name},{1000.0 * truth.t[k]:.0f},{place},{doing}")
    return "\n".join(rows)


def _places(made: SimulatedWalk) -> tuple[tuple[float, float, int], ...]:
    step = round(100.0 * _PICTURE_S)
    xy, floor = made.truth.xy[::step].tolist(), made.truth.floor[::step].tolist()
    return tuple((x, y, k) for (x, y), k in zip(xy, floor, strict=True))


def _cell(text: str) -> str:
    """A text as a cell of CSV."""
    return '"' + text.replace('"', '""') + '"' if any(c in text for c in ',"\n\r') else text


def _write_text(path: Path, text: str) -> None:
    path.write_text(text, encoding="utf-8", newline="\n")
