"""Reader of the ms-indoor text logs (Indoor Location Competition 2.0, both public editions).

One record per line: Unix time in ms, a tab, ``TYPE_...``, tab-separated fields; ``#`` lines are the header. Two
records may share a line where a line end is missing; an SSID may hold anything, tabs too.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

from wayfuse.core.errors import FormatError
from wayfuse.formats.assembly import Piece, Rows, assemble
from wayfuse.sensors.quality import ReadReport
from wayfuse.sensors.recording import Device, Recording
from wayfuse.sensors.records import Waypoint, bssid_id

__all__ = ["blocks", "read"]

BLOCK_BYTES = 4 << 20
_SENSORS = {
    b"TYPE_ACCELEROMETER": "acceleration",
    b"TYPE_GYROSCOPE": "rotation_rate",
    b"TYPE_MAGNETIC_FIELD": "magnetic_field",
}
_RECORD = re.compile(rb"\d{13}\tTYPE_")
_NAMES = {"SiteName", "FloorName", "Brand", "Model", "AndroidName", "startTime", "endTime", "SiteID", "FloorId"}


def read(path: str | Path) -> Recording:
    """Read a whole log.

    Raises
    ------
    FormatError : the file is empty or holds neither a header nor a record of this format.
    """
    path = Path(path)
    report = ReadReport(path=str(path))
    pieces = list(blocks(path, report=report))
    header: dict[str, str] = {}
    for piece in pieces:
        header |= piece.header
    if not header and not report.n_records:
        raise FormatError("not an ms-indoor log", where=path)
    return assemble(
        pieces,
        report,
        name=path.stem,
        clock="Unix time",
        device=Device(header.get("Brand", ""), header.get("Model", ""), f"Android {header.get('AndroidName', '')}"),
        site=header.get("SiteName", ""),
        floor=header.get("FloorName", ""),
    )


def blocks(
    path: str | Path, block_bytes: int = BLOCK_BYTES, *, report: ReadReport | None = None
) -> Iterator[Piece]:
    """Pieces of a log in file order, reading ``block_bytes`` at a time."""
    report = ReadReport(path=str(path)) if report is None else report
    with Path(path).open("rb") as file:
        tail = b""
        while data := file.read(block_bytes):
            data = tail + data
            cut = data.rfind(b"\n") + 1
            tail = data[cut:]
            if cut:
                yield _piece(data[:cut], report)
        if tail:
            yield _piece(tail, report)


def _piece(data: bytes, report: ReadReport) -> Piece:
    rows, header = Rows(), {}
    for line in data.splitlines():
        report.n_lines += 1
        if line.startswith(b"#"):
            for entry in line.decode("utf-8", "replace").split("\t"):
                key, _, value = entry.partition(":")
                if key in _NAMES:
                    header[key] = value
        elif line:
            for record in _records(line):
                _parse(record, report.n_lines, rows, report)
    return Piece(rows.columns(), rows.waypoints, header)


def _records(line: bytes) -> list[bytes]:
    starts = [m.start() for m in _RECORD.finditer(line)]
    if len(starts) < 2:
        return [line]
    return [line[i:j] for i, j in zip(starts, [*starts[1:], len(line)], strict=True)]


def _parse(line: bytes, number: int, rows: Rows, report: ReadReport) -> None:
    f = line.split(b"\t")
    kind = f[1] if len(f) > 1 else b""
    try:
        t = int(f[0]) / 1000
        if kind in _SENSORS:
            rows.add(_SENSORS[kind], number, t, (float(f[2]), float(f[3]), float(f[4])))
        elif kind == b"TYPE_ROTATION_VECTOR":
            x, y, z = float(f[2]), float(f[3]), float(f[4])
            rows.add("orientation", number, t, (max(0.0, 1 - x * x - y * y - z * z) ** 0.5, x, y, z))
        elif kind == b"TYPE_WIFI":
            values = (float(f[-3]), float(f[-2]), int(f[-1]) / 1000)
            rows.add("wifi", number, t, values, bssid_id(f[-4].decode()))
        elif kind == b"TYPE_BEACON":
            rows.add("ble", number, t, (float(f[6]), float(f[5])), bssid_id(f[8].decode()))
        elif kind == b"TYPE_BLUE":
            rows.add("ble", number, t, (float(f[-1]), float("nan")), bssid_id(f[-2].decode()))
        elif kind == b"TYPE_WAYPOINT":
            rows.waypoints.append((number, Waypoint(t, float(f[2]), float(f[3]), "")))
    except (ValueError, IndexError):
        report.add(f"{kind.decode('ascii', 'replace') or 'line'}: not a whole record", number)
        return
    name = kind.decode("ascii", "replace")
    report.n_records[name] = report.n_records.get(name, 0) + 1
