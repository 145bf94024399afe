"""Reader of the SODIndoorLoc tables: static Wi-Fi fingerprints of three buildings, one sample per line.

A table has a header line: the access points (``MAC1`` ..., in no order), then ECoord, NCoord (m, local frame
of the building), FloorID, BuildingID, SceneID, UserID, PhoneID, SampleTimes. A strength is in dBm; 100 says
"not heard" in the sample tables, -105 in the tables of averages. The published file of access-point positions
is no part of the tables and is not read.

References
----------
.. [1] J. Bi et al., Supplementary open dataset for WiFi indoor localization based on received signal
   strength, Satellite Navigation 3:25, 2022, 10.1186/s43020-022-00086-y; data:
   github.com/renwudao24/SODIndoorLoc.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from wayfuse.core.errors import DataMissingError, FormatError
from wayfuse.core.types import Array, Array32, IdArray
from wayfuse.sensors.quality import ReadReport

__all__ = ["StaticSet", "read"]

_TAIL = ("ECoord", "NCoord", "FloorID", "BuildingID", "SceneID", "UserID", "PhoneID", "SampleTimes")
_COLUMN = re.compile(r"MAC(\d{1,6})")
_WEAKEST = -104.0  # dBm; the published range is -104 to 0
_LARGEST = 1e6  # no number of a table is larger: dBm, metres of a building, small counts
_DECIMALS = 4  # of a coordinate: samples of one point are written alike


@dataclass(frozen=True, slots=True, eq=False)
class StaticSet:
    """A table of fingerprints.

    bssid (m,): the numbers of the MAC columns, ascending. rssi (n, m) dBm, NaN where not heard. xy (n, 2) m.
    floor, scene, user, phone (n,): the table's own numbers. report: what was dropped.
    """

    bssid: IdArray
    rssi: Array32
    xy: Array
    floor: NDArray[np.int32]
    scene: NDArray[np.int32]
    user: NDArray[np.int32]
    phone: NDArray[np.int32]
    report: ReadReport


def read(path: str | Path) -> StaticSet:
    """Read a table; lines that are no whole row of finite numbers are dropped and counted.

    Raises
    ------
    DataMissingError : there is no such file. FormatError : the header is another one, or no line is whole.
    """
    path = Path(path)
    if not path.is_file():
        raise DataMissingError(
            "there is no such file", where=path, remedy="fetch with `wayfuse datasets fetch sodindoorloc`"
        )
    lines = path.read_text(encoding="utf-8-sig", errors="replace").splitlines()
    numbers = _header(lines[0] if lines else "", path)
    report = ReadReport(path=str(path), n_lines=len(lines))
    table = _table(lines[1:], len(numbers) + len(_TAIL), report)
    if not len(table):
        raise FormatError("no line holds a whole fingerprint", where=path)
    report.n_records["fingerprint"] = len(table)
    order = np.argsort(numbers)
    rssi = table[:, : len(numbers)][:, order]
    heard = (rssi >= _WEAKEST) & (rssi <= 0.0)
    east, north, floor, _, scene, user, phone, _ = table[:, len(numbers) :].T
    return StaticSet(
        bssid=numbers[order],
        rssi=np.where(heard, rssi, np.nan).astype(np.float32),
        xy=np.round(np.column_stack([east, north]), _DECIMALS),
        floor=floor.astype(np.int32),
        scene=scene.astype(np.int32),
        user=user.astype(np.int32),
        phone=phone.astype(np.int32),
        report=report,
    )


def _header(line: str, path: Path) -> IdArray:
    """Numbers of the MAC columns in file order."""
    names = [name.strip() for name in line.split(",")]
    matches = [_COLUMN.fullmatch(name) for name in names[: -len(_TAIL)]]
    numbers = [int(match[1]) for match in matches if match]
    if tuple(names[-len(_TAIL) :]) != _TAIL or not numbers or len(numbers) != len(matches):
        raise FormatError(
            "not a SODIndoorLoc table",
            where=f"{path}:1",
            remedy="the header is MAC1, ..., ECoord, NCoord, ...",
        )
    if len(set(numbers)) != len(numbers):
        raise FormatError("an access point has two columns", where=f"{path}:1")
    return np.array(numbers, np.uint64)


def _table(lines: list[str], width: int, report: ReadReport) -> Array:
    """(n, width) numbers of the whole lines."""
    if any(line.strip() for line in lines):
        try:
            table = np.loadtxt(lines, delimiter=",", ndmin=2, comments=None)
            if table.shape[1] == width and np.all(np.abs(table) <= _LARGEST):
                return np.asarray(table)
        except ValueError:
            pass  # some line is damaged: read line by line and count
    rows = [row for number, line in enumerate(lines, 2) if (row := _row(line, width, number, report))]
    return np.array(rows).reshape(len(rows), width)


def _row(line: str, width: int, number: int, report: ReadReport) -> list[float] | None:
    if not line.strip():
        return None
    try:
        row = [float(field) for field in line.split(",")]
    except ValueError:
        report.add("not a number", number)
        return None
    if len(row) != width:
        report.add("wrong number of fields", number)
        return None
    if not np.all(np.abs(row) <= _LARGEST):
        report.add("not finite or out of range", number)
        return None
    return row
