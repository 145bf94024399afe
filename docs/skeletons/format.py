"""Skeleton of a reader: semicolon-separated lines, ``seconds;kind;fields``.

::

    12.040;acc;0.1;0.3;9.7                 acceleration with gravity, m/s²
    12.040;gyro;0.01;0.00;-0.02            rotation rate, rad/s
    12.300;wifi;00:11:22:33:44:55;-61;2437 a Wi-Fi reading: BSSID, dBm, MHz
    15.000;place;3.50;7.25;F1              a waypoint: x, y (m), floor

Copy this file to ``src/wayfuse/formats/<format>.py`` and replace `_record`. Then add the name to ``FORMATS`` and a
branch to ``read`` and ``_sniff`` in ``wayfuse/formats/reading.py``, a section to ``docs/formats.md`` and a line to
``CHANGELOG.md``. What the contract asks (``tests/docs/test_docs.py`` runs it on this file):

* ``read(path) -> Recording``; units and axes of the records (`wayfuse.sensors.records`) are made here, nowhere else;
* a bad line costs that line: it is counted with its number, and the reader goes on;
* nothing is guessed: what the file does not say stays unknown (NaN, 0 or empty, as the record says);
* ``blocks`` yields bounded parts, so that a large file is never held as text, and their size changes nothing;
* `assemble` applies what is the same for all formats: ranges, clock, order, repeats, scans.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path

from wayfuse.core.errors import FormatError
from wayfuse.formats.assembly import assemble
from wayfuse.formats.columns import Piece, Rows, is_number
from wayfuse.sensors.quality import ReadReport
from wayfuse.sensors.recording import Recording
from wayfuse.sensors.records import Waypoint, bssid_id

__all__ = ["blocks", "read"]

BLOCK_BYTES = 1 << 20
_SERIES = {b"acc": "acceleration", b"gyro": "rotation_rate"}


def read(path: str | Path) -> Recording:
    """Read a whole file.

    Raises
    ------
    FormatError : the file holds no record of this format.
    """
    path = Path(path)
    report = ReadReport(path=str(path))
    pieces = list(blocks(path, report=report))
    if not report.n_records:
        raise FormatError(
            "no record of this format", where=path, remedy="give --format, or leave the file out"
        )
    return assemble(pieces, report, name=path.stem, clock="seconds of the file")


def blocks(
    path: str | Path, block_bytes: int = BLOCK_BYTES, *, report: ReadReport | None = None
) -> Iterator[Piece]:
    """Pieces of a file in its order, about ``block_bytes`` at a time; ``report`` is filled on the way."""
    report = ReadReport(path=str(path)) if report is None else report
    with Path(path).open("rb") as file:
        while lines := file.readlines(block_bytes):
            rows = Rows()
            for line in lines:
                report.n_lines += 1
                fields = line.strip().split(b";")
                if fields == [b""]:
                    continue
                if fault := _record(fields, report.n_lines, rows):
                    report.add(fault, report.n_lines)
                else:
                    kind = fields[1].decode()
                    report.n_records[kind] = report.n_records.get(kind, 0) + 1
            yield Piece(rows.columns(), rows.waypoints)


def _record(f: list[bytes], line: int, rows: Rows) -> str:
    """Take one record; what is wrong with it, empty where nothing is."""
    if len(f) != 5 or not is_number(f[0]):
        return "not a record"
    t, kind = float(f[0]), f[1]
    if kind in _SERIES and all(map(is_number, f[2:])):
        rows.add(_SERIES[kind], line, t, (float(f[2]), float(f[3]), float(f[4])))
    elif kind == b"wifi" and f[2] and is_number(f[3]) and is_number(f[4]):
        values = (float(f[3]), float(f[4]), math.nan)  # last seen is not recorded
        rows.add("wifi", line, t, values, bssid_id(f[2].decode("utf-8", "replace")))
    elif kind == b"place" and is_number(f[2]) and is_number(f[3]):
        floor = f[4].decode("utf-8", "replace")
        rows.waypoints.append((line, Waypoint(t, float(f[2]), float(f[3]), floor)))
    elif kind in {*_SERIES, b"wifi", b"place"}:
        return f"{kind.decode()}: not a number where one is due"
    else:
        return f"unknown kind {kind.decode('utf-8', 'replace')[:40]}"
    return ""
