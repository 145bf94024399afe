"""Reader of the ms-indoor text logs (Indoor Location Competition 2.0, both public editions).

One record per line: Unix time in ms, a tab, ``TYPE_...``, tab-separated fields; ``#`` lines are the header.
Two records may share a line where a line end is missing; an SSID may hold anything, tabs too. The larger
edition has digests in place of BSSIDs. A compiled scanner reads the lines that are as they should be,
`_Careful` all others; together they equal the plain loop exactly.

``TYPE_BLUE`` is every Bluetooth advertisement; ``TYPE_BEACON`` and ``TYPE_BLU4`` repeat those that are
iBeacons. A beacon heard as ``BLUE`` is therefore read once, with the tx power that ``BEACON`` adds.

References
----------
.. [1] Indoor Location Competition 2.0 data set,
github.com/location-competition/indoor-location-competition-20.
"""

from __future__ import annotations

import math
import os
import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from wayfuse.core.errors import FormatError
from wayfuse.core.types import Array
from wayfuse.formats._kernels import KINDS, scan_ms_indoor
from wayfuse.formats.assembly import assemble
from wayfuse.formats.columns import Column, Piece, Rows, is_number, quaternions
from wayfuse.sensors.quality import ReadReport
from wayfuse.sensors.recording import Device, Recording
from wayfuse.sensors.records import Waypoint, bssid_id

__all__ = ["blocks", "read"]

BLOCK_BYTES = 1 << 19  # the scanner's arrays then stay below the size that gets huge pages, slow to touch
_PADDING = 64  # zeros behind a block: the scanner looks ahead without asking where the block ends
_SHORTEST_RECORD = 24  # bytes: time, tab, TYPE_BLUE, three tabs
_FIRST_RADIO = 4  # index into _COLUMNS

# What the columns of the scanner's kinds become; ``beacon`` is joined with ``ble`` once the file is whole.
_COLUMNS = ("acceleration", "rotation_rate", "magnetic_field", "orientation", "wifi", "ble", "beacon")
_FIELDS = {"WIFI": 7, "BLUE": 5, "BEACON": 9, "WAYPOINT": 4} | dict.fromkeys(KINDS[:4], 6)
_IGNORED = {*KINDS[7:], "DIST1", "DIST2", "PRESSURE", "LIGHT", "PROXIMITY"}
_HEADER = {
    "startTime",
    "endTime",
    "SiteID",
    "SiteName",
    "FloorId",
    "FloorName",
    "Brand",
    "Model",
    "AndroidName",
}
_RECORD = re.compile(rb"\d{13}\tTYPE_[A-Z]")
_WHOLE = re.compile(rb"\d+")


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
        what = (
            "the file is empty" if path.stat().st_size == 0 else "neither a header nor a record of ms-indoor"
        )
        raise FormatError(what, where=path, remedy="give --format, or leave the file out")
    system = f"Android {header['AndroidName']}" if header.get("AndroidName") else ""
    return assemble(
        pieces,
        report,
        name=path.stem,
        clock="Unix time",
        device=Device(header.get("Brand", ""), header.get("Model", ""), system),
        site=header.get("SiteName", ""),
        floor=header.get("FloorName", ""),
    )


def blocks(
    path: str | Path, block_bytes: int = BLOCK_BYTES, *, report: ReadReport | None = None
) -> Iterator[Piece]:
    """Pieces of a log in file order, reading ``block_bytes`` at a time; ``report`` is filled on the way."""
    report = ReadReport(path=str(path)) if report is None else report
    scanner = _Scanner(report)
    with Path(path).open("rb", buffering=0) as file:
        size = min(block_bytes, os.fstat(file.fileno()).st_size)
        buffer, filled = bytearray(size + _PADDING), 0
        while n := file.readinto(memoryview(buffer)[filled : len(buffer) - _PADDING]):
            cut = buffer.rfind(b"\n", filled, filled + n) + 1
            filled += n
            if cut:
                tail = buffer[cut:filled]
                yield scanner.scan(buffer, cut)
                filled = len(tail)
                buffer[:filled] = tail
            if filled + _PADDING >= len(buffer):  # a line longer than the block
                buffer = buffer + bytes(len(buffer))
        if filled:
            yield scanner.last_line(bytes(buffer[:filled]))


class _Scanner:
    """Runs the compiled scanner over the blocks of one file, in arrays that the blocks share."""

    def __init__(self, report: ReadReport) -> None:
        self._report, self._floor = report, ""
        self._known: dict[bytes, int] = {}
        self._size = 0

    def _allocate(self, size: int) -> None:
        m = size // _SHORTEST_RECORD + 1
        self._line, self._t = np.empty((m, 7), np.int64), np.empty((m, 7))
        self._ids, self._values = np.empty((m, 7), np.uint64), np.empty((m, 7, 3))
        self._token, self._care = np.empty((m, 4), np.int64), np.empty((size // 2 + 1, 3), np.int32)
        self._size = size

    def scan(self, buffer: bytearray, n: int) -> Piece:
        """Records of whole lines in the first n bytes: the scanner's, then the careful path's."""
        report = self._report
        if n > self._size:
            self._allocate(len(buffer))
        kept = bytes(buffer[n : n + _PADDING])
        buffer[n : n + _PADDING] = bytes(_PADDING)
        buf = np.frombuffer(buffer, np.uint8)
        word = np.ndarray((n + _PADDING - 8,), "<u8", buf, strides=(1,))
        counts = np.zeros(13, np.int64)
        with np.errstate(over="ignore"):  # sums of bytes wrap around, which only uncompiled code mentions
            n_lines = scan_ms_indoor(
                buf, word, n, self._line, self._t, self._values, self._ids, self._token, self._care, counts
            )
        self._name_tokens(buffer, int(counts[11]))
        careful = _Careful(report, self._floor)
        for number, start, stop in self._care[: counts[12]].tolist():
            careful.line(bytes(buffer[start:stop]), report.n_lines + number)
        del buf, word
        buffer[n : n + _PADDING] = kept
        for name, count in zip(KINDS, counts[:11].tolist(), strict=True):
            if count:
                report.n_records[name] = report.n_records.get(name, 0) + count
        columns = {
            kind: self._column(row, int(counts[row])) for row, kind in enumerate(_COLUMNS) if counts[row]
        }
        report.n_lines += int(n_lines)
        self._floor = careful.header.get("FloorName", "")
        return Piece(_merged(columns, careful.rows.columns()), careful.rows.waypoints, careful.header)

    def last_line(self, data: bytes) -> Piece:
        """The last line, which has no line end: kept where it is whole, and counted."""
        self._report.n_lines += 1
        careful = _Careful(self._report, self._floor, truncated=True)
        careful.line(data, self._report.n_lines)
        return Piece(careful.rows.columns(), careful.rows.waypoints, careful.header)

    def _name_tokens(self, buffer: bytearray, n: int) -> None:
        """Identifiers of BSSIDs that are no hardware address; each text is digested once."""
        for kind, row, start, stop in self._token[:n].tolist():
            text = bytes(buffer[start:stop])
            if text not in self._known:
                self._known[text] = _identifier(text)
            self._ids[row, kind] = self._known[text]

    def _column(self, row: int, n: int) -> Column:
        return Column(
            self._line[:n, row] + self._report.n_lines,
            self._t[:n, row].copy(),
            _shaped(_COLUMNS[row], self._values[:n, row]),
            self._ids[: n if row >= _FIRST_RADIO else 0, row].copy(),
        )


def _shaped(kind: str, values: Array) -> Array:
    if kind == "orientation":
        return quaternions(values)
    return values[:, :2].copy() if kind in {"ble", "beacon"} else values.copy()


def _merged(columns: dict[str, Column], careful: dict[str, Column]) -> dict[str, Column]:
    """Columns of both paths in line order (stable: records of one line keep their order)."""
    for kind, more in careful.items():
        column = columns.get(kind)
        if column is None:
            columns[kind] = more
            continue
        joined = [np.concatenate(pair) for pair in zip(column, more, strict=True)]
        order = np.argsort(joined[0], kind="stable")
        columns[kind] = Column(*joined).take(order)
    return columns


class _Careful:
    """Reads single lines as they come: header, joined records, SSIDs with tabs, faults."""

    def __init__(self, report: ReadReport, floor: str, *, truncated: bool = False) -> None:
        self.rows, self.header = Rows(), {"FloorName": floor} if floor else {}
        self._report, self._truncated = report, truncated

    def line(self, line: bytes, number: int) -> None:
        """Read one line without its line end."""
        line = line.removesuffix(b"\r")
        if line.startswith(b"#"):
            if not line.startswith(b"#\ttype:"):  # the data sheets of the sensors
                self._read_header(line)
            return
        if not line.strip():
            return
        starts = [m.start() for m in _RECORD.finditer(line)]
        if len(starts) > 1:
            self._report.add("two records on a line, both read", number)
        if starts and starts[0] > 0:
            self._report.add("unreadable text before a record", number)
        if not starts:
            self._fault("not a record", number)
            return
        for k, (start, stop) in enumerate(zip(starts, [*starts[1:], len(line)], strict=True)):
            self._record(line[start:stop].split(b"\t"), number, last=k == len(starts) - 1)

    def _read_header(self, line: bytes) -> None:
        for entry in line.decode("utf-8", "replace").split("\t"):
            key, _, value = entry.partition(":")
            if key in _HEADER:
                self.header[key] = value.strip()

    def _fault(self, what: str, number: int) -> None:
        self._report.add("truncated last line" if self._truncated else what, number)

    def _record(self, f: list[bytes], number: int, *, last: bool) -> None:
        kind = f[1][5:].decode("ascii", "replace")
        if kind not in _FIELDS:
            if kind not in _IGNORED and not kind.endswith("_ACCURACY_CHANGED"):
                self._fault(f"unknown kind TYPE_{kind[:40]}", number)
                return
        elif len(f) < _FIELDS[kind]:
            self._fault(f"{kind}: {len(f)} fields of {_FIELDS[kind]}", number)
            return
        elif not self._take(kind, int(f[0]) / 1000, f, number):
            self._fault(f"{kind}: not a number where one is due", number)
            return
        if self._truncated and last:
            self._report.add("last line has no line end, kept", number)
        self._report.n_records[kind] = self._report.n_records.get(kind, 0) + 1

    def _take(self, kind: str, t: float, f: list[bytes], number: int) -> bool:
        """Add a record whose fields are enough; False where one of them is no number."""
        if kind in KINDS[:4]:
            if len(f) != 6 or not all(map(is_number, f[2:])):
                return False
            x, y, z = float(f[2]), float(f[3]), float(f[4])
            values: tuple[float, ...] = (x, y, z)
            if kind == "ROTATION_VECTOR":
                values = (math.sqrt(max(0.0, 1.0 - x * x - y * y - z * z)), x, y, z)
            self.rows.add(_COLUMNS[KINDS.index(kind)], number, t, values)
        elif kind == "WIFI":
            if not (is_number(f[-3]) and is_number(f[-2]) and _WHOLE.fullmatch(f[-1]) and f[-4]):
                return False
            if len(f[-1]) != len(f[0]):  # cut short or grown together with something else
                return False
            values = (float(f[-3]), float(f[-2]), int(f[-1]) / 1000)
            self.rows.add("wifi", number, t, values, _identifier(f[-4]))
        elif kind == "BLUE":
            if not (is_number(f[-1]) and f[-2]):
                return False
            self.rows.add("ble", number, t, (float(f[-1]), math.nan), _identifier(f[-2]))
        elif kind == "BEACON":
            if not (len(f) in {9, 10} and is_number(f[5]) and is_number(f[6]) and f[8]):
                return False
            self.rows.add("beacon", number, t, (float(f[6]), float(f[5])), _identifier(f[8]))
        else:
            if len(f) != 4 or not (is_number(f[2]) and is_number(f[3])):
                return False
            floor = self.header.get("FloorName", "")
            self.rows.waypoints.append((number, Waypoint(t, float(f[2]), float(f[3]), floor)))
        return True


def _identifier(text: bytes) -> int:
    return bssid_id(text.decode("utf-8", "replace"))
