"""Reader of the walks of HCU Hamburg (IPIN 2021): a folder with ``acc.csv``, ``gyr.csv``, ``mag.csv``, ``bar.csv``.

Lines are numbers between blanks, the first one Unix time in ms; axes and units are Android's (m/s² with gravity,
rad/s, µT, hPa). All sensors are resampled to 100 Hz, the barometer by straight lines between its readings. ``ref.csv``
holds the surveyor's points: UTM east and north (zone 32 N, as the plans of the set say) and height above sea, which
tells the floor. There is no Wi-Fi.

References
----------
.. [1] Shoushtari et al., IPIN 2021, ieeexplore.ieee.org/document/9662636; data:
   github.com/Hossein-Shoushtari/IPIN21Data.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from wayfuse.core.errors import FormatError
from wayfuse.core.utm import utm_to_lonlat
from wayfuse.formats.assembly import assemble
from wayfuse.formats.columns import Piece, Rows, is_number
from wayfuse.sensors.quality import ReadReport
from wayfuse.sensors.recording import Device, Recording
from wayfuse.sensors.records import Waypoint

__all__ = ["floor_at", "is_recording", "read"]

_FILES: Mapping[str, tuple[str, int]] = {  # file: kind, count of values
    "acc": ("acceleration", 3),
    "gyr": ("rotation_rate", 3),
    "mag": ("magnetic_field", 3),
    "bar": ("pressure", 1),
}
_POINTS = "ref"
_ZONE = 32  # N; crs of the plans of the set
_HEIGHTS = {1.3: "EG", 7.6: "1OG", 19.6: "4OG"}  # m above sea: floor, named as the plans are
_NEAR = 1.0  # m; storeys are 4 m or more
_EARLIEST_MS = 1e12  # Unix time in ms of the year 2001; seconds would be below it


def is_recording(path: Path) -> bool:
    """Whether a folder holds such a walk: ``acc.csv``, and in it four numbers beginning with a time in ms."""
    file = path / "acc.csv"
    if not path.is_dir() or not file.is_file():
        return False
    with file.open("rb") as lines:
        fields = lines.readline(256).split()
    return len(fields) == 4 and all(map(is_number, fields)) and float(fields[0]) > _EARLIEST_MS


def floor_at(height: float) -> str:
    """Name of the floor at a height (m above sea), empty where the set has none there.

    >>> floor_at(7.6), floor_at(4.0)
    ('1OG', '')
    """
    near = min(_HEIGHTS, key=lambda known: abs(known - height))
    return _HEIGHTS[near] if abs(near - height) <= _NEAR else ""


def read(path: str | Path) -> Recording:
    """Read the folder of a walk.

    Raises
    ------
    FormatError : the folder does not hold such a walk.
    """
    path = Path(path)
    if not is_recording(path):
        raise FormatError(
            "no walk of HCU Hamburg", where=path, remedy="name the folder with acc.csv, gyr.csv, bar.csv"
        )
    report = ReadReport(path=str(path))
    rows = Rows()
    for name, (kind, width) in _FILES.items():
        for line, (ms, *values) in _numbers(path / f"{name}.csv", 1 + width, report):
            rows.add(kind, line, ms / 1000.0, tuple(values))
    for line, (ms, east, north, height) in _numbers(path / f"{_POINTS}.csv", 4, report):
        lon, lat = utm_to_lonlat(np.array([east, north]), _ZONE).tolist()
        point = Waypoint(ms / 1000.0, float("nan"), float("nan"), floor_at(height), lat, lon)
        rows.waypoints.append((line, point))
    return assemble(
        [Piece(rows.columns(), rows.waypoints)],
        report,
        name=path.name,
        clock="Unix time",
        device=Device("Samsung", "Galaxy S10 5G", ""),
        one_stream=False,
    )


def _numbers(file: Path, width: int, report: ReadReport) -> list[tuple[int, list[float]]]:
    """Line number and values of each line of ``width`` numbers; other lines are counted. No file, no lines."""
    if not file.is_file():
        return []
    found = []
    for number, line in enumerate(file.read_bytes().splitlines(), 1):
        report.n_lines += 1
        fields = line.split()
        if not fields:
            continue
        if len(fields) != width:
            report.add(f"{file.name}: {len(fields)} fields of {width}", number)
        elif not all(map(is_number, fields)):
            report.add(f"{file.name}: not a number where one is due", number)
        else:
            found.append((number, [float(field) for field in fields]))
    report.n_records[file.stem] = len(found)
    return found
