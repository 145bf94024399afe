"""Reading ms-indoor logs: the compiled reader against a plain Python line loop that does the same job.

Both return a whole `Recording`: motion sensors, orientation, Wi-Fi grouped into scans without exact repeats,
Bluetooth with tx power, waypoints, header. The two take turns over several real files, so that a busy
machine slows both; minima and medians are compared. Run ``python -m benchmarks.reading [FOLDER] [--files N]
[--rounds N]``.
"""

from __future__ import annotations

import argparse
import gc
import math
import os
import statistics
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from wayfuse.formats import ms_indoor
from wayfuse.sensors.recording import Device, Recording, Series
from wayfuse.sensors.records import BleReading, Waypoint, WifiScan, bssid_id


def plain_read(path: Path) -> Recording:
    """One line after the other: split, convert, append."""
    rows: dict[str, list[tuple[float, ...]]] = {
        "TYPE_ACCELEROMETER": [],
        "TYPE_GYROSCOPE": [],
        "TYPE_MAGNETIC_FIELD": [],
    }
    orientation: list[tuple[float, ...]] = []
    scans: dict[float, dict[tuple[object, ...], None]] = {}
    ble: list[tuple[float, int, float]] = []
    beacons: list[tuple[float, int, float, float]] = []
    waypoints: list[Waypoint] = []
    header: dict[str, str] = {}
    ids: dict[str, int] = {}
    with path.open(encoding="utf-8") as file:
        for line in file:
            if line[0] == "#":
                for entry in line.rstrip("\n").split("\t"):
                    key, _, value = entry.partition(":")
                    header[key] = value
                continue
            f = line.rstrip("\n").split("\t")
            kind = f[1]
            if kind in rows:
                rows[kind].append((int(f[0]) / 1000, float(f[2]), float(f[3]), float(f[4])))
            elif kind == "TYPE_WIFI":
                if (i := ids.get(f[3])) is None:
                    i = ids[f[3]] = bssid_id(f[3])
                t = int(f[0]) / 1000
                reading = (i, float(f[4]), int(f[5]), int(f[6]) / 1000)
                if (scan := scans.get(t)) is None:
                    scan = scans[t] = {}
                scan[reading] = None
            elif kind == "TYPE_ROTATION_VECTOR":
                x, y, z = float(f[2]), float(f[3]), float(f[4])
                w = math.sqrt(max(0.0, 1.0 - x * x - y * y - z * z))
                orientation.append((int(f[0]) / 1000, w, x, y, z))
            elif kind == "TYPE_BLUE":
                if (i := ids.get(f[3])) is None:
                    i = ids[f[3]] = bssid_id(f[3])
                ble.append((int(f[0]) / 1000, i, float(f[4])))
            elif kind == "TYPE_BEACON":
                if (i := ids.get(f[8])) is None:
                    i = ids[f[8]] = bssid_id(f[8])
                beacons.append((int(f[0]) / 1000, i, float(f[6]), float(f[5])))
            elif kind == "TYPE_WAYPOINT":
                waypoints.append(Waypoint(int(f[0]) / 1000, float(f[2]), float(f[3]), header["FloorName"]))
    power = {i: p for _, i, _, p in beacons}
    heard = {i for _, i, _ in ble}
    readings = [BleReading(t, i, rssi, power.get(i, math.nan)) for t, i, rssi in ble]
    readings += [BleReading(t, i, rssi, p) for t, i, rssi, p in beacons if i not in heard]
    acceleration, rotation_rate, magnetic_field = (_series(r, 3) for r in rows.values())
    return Recording(
        name=path.stem,
        acceleration=acceleration,
        rotation_rate=rotation_rate,
        magnetic_field=magnetic_field,
        orientation=_series(orientation, 4),
        wifi=tuple(_scan(t, list(scan)) for t, scan in sorted(scans.items())),
        ble=tuple(sorted(readings, key=lambda r: r.t)),
        waypoints=tuple(sorted(waypoints, key=lambda w: w.t)),
        site=header.get("SiteName", ""),
        floor=header.get("FloorName", ""),
        device=Device(
            header.get("Brand", ""), header.get("Model", ""), f"Android {header.get('AndroidName', '')}"
        ),
    )


def _series(rows: list[tuple[float, ...]], k: int) -> Series:
    table = np.array(rows, np.float64).reshape(len(rows), k + 1)
    table = table[np.argsort(table[:, 0], kind="stable")]
    return Series(table[:, 0], table[:, 1:])


def _scan(t: float, readings: list[tuple[object, ...]]) -> WifiScan:
    ids, rssi, frequency, seen = zip(*readings, strict=True)
    return WifiScan(
        t,
        np.array(ids, np.uint64),
        np.array(rssi, np.float32),
        np.array(frequency, np.int32),
        np.array(seen, np.float64),
    )


if TYPE_CHECKING:
    from benchmarks.report import Table, Target

READERS: dict[str, Callable[[Path], Recording]] = {"plain loop": plain_read, "wayfuse": ms_indoor.read}


def timed(paths: list[Path], rounds: int) -> dict[str, list[list[float]]]:
    """CPU seconds per reader, file and round; in each round one reader reads all files, then the other."""
    times: dict[str, list[list[float]]] = {name: [[] for _ in paths] for name in READERS}
    for path in paths:
        for reader in READERS.values():
            reader(path)  # compiled, and the file in the page cache
    for _ in range(rounds):
        for name, reader in READERS.items():
            gc.collect()
            for k, path in enumerate(paths):
                start = time.thread_time()
                reader(path)
                times[name][k].append(time.thread_time() - start)
    return times


def logs(folder: Path, n: int) -> list[Path]:
    """About n logs of ms-indoor, spread over the folder."""
    found = sorted(folder.rglob("path_data_files/*.txt"))
    return found[:: max(1, len(found) // n)][:n]


def motion_only(paths: list[Path], folder: Path) -> list[Path]:
    """Copies without the lines of Wi-Fi and Bluetooth: header and motion sensors."""
    kept = []
    for path in paths:
        lines = path.read_bytes().splitlines(keepends=True)
        radio = (b"TYPE_WIFI", b"TYPE_BLUE", b"TYPE_BEACON")
        kept.append(folder / path.name)
        kept[-1].write_bytes(b"".join(line for line in lines if not any(kind in line for kind in radio)))
    return kept


def measure(seconds: float) -> tuple[list[Table], list[Target]]:
    """The table of whole and of motion-only logs and their goals; nothing but a note where ms-indoor is not there."""
    from benchmarks.report import Table, Target  # a test reads this file for its plain loop alone

    root = Path(os.environ.get("WAYFUSE_DATA") or Path.home() / ".cache" / "wayfuse-data")
    paths = logs(root / "ms-indoor", 8)
    columns = ("log", "MB", "plain loop, MB/s", "wayfuse, MB/s", "ratio")
    goals = {"whole log": 5.0, "motion sensors only": 10.0}
    if not paths:
        note = "**Not measured: ms-indoor is not there.** `wayfuse datasets fetch ms-indoor`."
        missing = [Target(f"reading, {name}, plain Python loop", goal, None) for name, goal in goals.items()]
        return [Table("Reading logs", note, columns, ())], missing
    rows, targets = [], []
    with tempfile.TemporaryDirectory() as folder:
        for (name, goal), files in zip(goals.items(), (paths, motion_only(paths, Path(folder))), strict=True):
            times = timed(files, max(2, int(seconds / 2.0)))
            size = sum(p.stat().st_size for p in files) / 1e6
            low = {reader: sum(min(f) for f in v) for reader, v in times.items()}
            mid = {reader: sum(statistics.median(f) for f in v) for reader, v in times.items()}
            speed = [f"{size / low[r]:.0f} ({size / mid[r]:.0f})" for r in READERS]
            a, b = (low["plain loop"] / low["wayfuse"], mid["plain loop"] / mid["wayfuse"])
            rows.append((name, f"{size:.1f}", *speed, f"{a:.1f} ({b:.1f})"))
            targets.append(Target(f"reading, {name}, plain Python loop", goal, a))
    note = (
        f"{len(paths)} logs of ms-indoor; both readers make a whole `Recording`, the plain loop line by line."
    )
    return [Table("Reading logs", note, columns, tuple(rows))], targets


def main(arguments: list[str] | None = None) -> float:
    """Print the figures of a folder of logs; return the ratio of the summed minima (plain loop over wayfuse)."""
    root = Path(os.environ.get("WAYFUSE_DATA") or Path.home() / ".cache" / "wayfuse-data")
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path, nargs="?", default=root / "ms-indoor")
    parser.add_argument("--files", type=int, default=12)
    parser.add_argument("--rounds", type=int, default=9)
    options = parser.parse_args(arguments)
    paths = logs(options.folder, options.files)
    if not paths:
        raise SystemExit(f"no ms-indoor logs under {options.folder}; run `wayfuse datasets fetch ms-indoor`")
    times = timed(paths, options.rounds)
    size = sum(p.stat().st_size for p in paths) / 1e6
    low = {name: sum(min(f) for f in v) for name, v in times.items()}
    mid = {name: sum(statistics.median(f) for f in v) for name, v in times.items()}
    for name in READERS:
        print(f"{name:12s} {size / low[name]:6.0f} MB/s (minima) {size / mid[name]:6.0f} MB/s (medians)")
    ratio = low["plain loop"] / low["wayfuse"]
    print(
        f"ratio {ratio:.1f} (minima), {mid['plain loop'] / mid['wayfuse']:.1f} (medians), {len(paths)} files"
    )
    return ratio


if __name__ == "__main__":
    main()
