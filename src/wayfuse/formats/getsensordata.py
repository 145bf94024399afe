"""Reader of GetSensorData logs (LOPSI; the logs of the IPIN competitions).

One record per line, four letters and fields between ``;``, ``%`` lines are comments. ``AppTimestamp`` (s
since the start of the recording) is common to all sensors and becomes ``t``; ``SensorTimestamp`` is a
sensor's own clock and serves only for the time a Wi-Fi access point was last seen. ``WIFI`` has the frequency
or not, and its SSID may hold ``;``, so it is split from both ends. ``AHRS`` holds the last three parts of the
rotation vector: device to east-north-up (its ``YawZ`` is the right-handed turn about up, minus the azimuth
that Android's own API gives).

References
----------
.. [1] Jiménez, Seco, Torres-Sospedra, Tools for smartphone multi-sensor data registration and GT mapping for
   positioning applications, IPIN 2019, doi:10.1109/IPIN.2019.8911784.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

from wayfuse.core.errors import FormatError
from wayfuse.formats.assembly import assemble
from wayfuse.formats.columns import Piece, Rows, is_number
from wayfuse.sensors.quality import ReadReport
from wayfuse.sensors.recording import Device, Recording
from wayfuse.sensors.records import Waypoint, bssid_id

__all__ = ["KINDS", "blocks", "read", "read_stream"]

BLOCK_BYTES = 1 << 20
_SERIES = {  # kind: column, index of the first value, count of values, fields without the accuracy at the end
    b"ACCE": ("acceleration", 3, 3, 6),
    b"GYRO": ("rotation_rate", 3, 3, 6),
    b"MAGN": ("magnetic_field", 3, 3, 6),
    b"PRES": ("pressure", 3, 1, 4),
    b"AHRS": ("orientation", 6, 3, 9),
}
_IGNORED = {b"GNSS", b"LIGH", b"PROX", b"HUMI", b"TEMP", b"SOUN", b"RFID", b"IMUL", b"IMUX", b"IMUI"}
KINDS = tuple(k.decode() for k in [*_SERIES, b"WIFI", b"BLUE", b"BLE4", b"POSI", *sorted(_IGNORED)])
_START = re.compile(("(?:" + "|".join(KINDS) + r");-?\d").encode())
_ADDRESS = re.compile(rb"(?:[0-9A-Fa-f]{2}[:-]?){5}[0-9A-Fa-f]{2}|[^;.\s]{12,}")
_HEADER = {"Manufacturer": "brand", "Model": "model", "Android version Release": "release"}


def read(path: str | Path) -> Recording:
    """Read a whole log.

    Raises
    ------
    FormatError : the file is empty or holds neither the header nor a record of this format.
    """
    path = Path(path)
    with path.open("rb") as file:
        return read_stream(file, name=path.stem, path=str(path))


def read_stream(file: BinaryIO, *, name: str, path: str = "") -> Recording:
    """Read a whole log from an open file, or from bytes that came over the network (`io.BytesIO`).

    Raises
    ------
    FormatError : it is empty or holds neither the header nor a record of this format.
    """
    report = ReadReport(path=path)
    pieces = list(_blocks(file, BLOCK_BYTES, report))
    header: dict[str, str] = {}
    for piece in pieces:
        header |= piece.header
    if not header and not report.n_records:
        what = "neither a header nor a record of GetSensorData" if report.n_lines else "the file is empty"
        raise FormatError(what, where=path, remedy="give --format, or leave the file out")
    release = header.get("release", "")
    return assemble(
        pieces,
        report,
        name=name,
        clock="AppTimestamp",
        device=Device(
            header.get("brand", ""), header.get("model", ""), f"Android {release}" if release else ""
        ),
        foreign_last_seen=True,
    )


def blocks(
    path: str | Path, block_bytes: int = BLOCK_BYTES, *, report: ReadReport | None = None
) -> Iterator[Piece]:
    """Pieces of a log in file order, about ``block_bytes`` at a time; last seen is still the sensor's."""
    report = ReadReport(path=str(path)) if report is None else report
    with Path(path).open("rb") as file:
        yield from _blocks(file, block_bytes, report)


def _blocks(file: BinaryIO, block_bytes: int, report: ReadReport) -> Iterator[Piece]:
    while lines := file.readlines(block_bytes):
        reader = _Lines(report)
        for line in lines:
            report.n_lines += 1
            reader.line(line, report.n_lines)
        yield Piece(reader.rows.columns(), reader.rows.waypoints, reader.header)


class _Lines:
    """Reads the lines of one piece."""

    def __init__(self, report: ReadReport) -> None:
        self.rows, self.header = Rows(), dict[str, str]()
        self._report = report

    def line(self, line: bytes, number: int) -> None:
        """Read one line, with its line end unless it is the last."""
        text = line.rstrip(b"\r\n")
        if text.startswith(b"%"):
            self._read_header(text)
            return
        if not text.strip():
            return
        whole = len(text) < len(line)
        fault = self._record(text, number)
        if fault:
            starts = [m.start() for m in _START.finditer(text)]
            if len(starts) > 1 or (starts and starts[0] > 0):
                what = (
                    "two records on a line, both read"
                    if len(starts) > 1
                    else "unreadable text before a record"
                )
                self._report.add(what, number)
                parts = [text[i:j] for i, j in zip(starts, [*starts[1:], len(text)], strict=True)]
                faults = [f for part in parts if (f := self._record(part, number))]
            else:
                faults = [fault]
            for each in faults:
                self._report.add(each if whole else "truncated last line", number)
        elif not whole:
            self._report.add("last line has no line end, kept", number)

    def _read_header(self, text: bytes) -> None:
        try:
            comment = text.decode("utf-8")
        except UnicodeDecodeError:
            comment = text.decode("latin-1")
        if "GetSensorData" in comment:
            self.header.setdefault("app", "GetSensorData")
        key, _, value = comment.lstrip("% ").partition(":")
        if key.strip() in _HEADER:
            self.header[_HEADER[key.strip()]] = value.strip()

    def _record(self, text: bytes, number: int) -> str:
        """Take one record; what is wrong with it, empty where nothing is."""
        f = text.split(b";")
        if len(f) > 1 and not f[-1].strip():
            f.pop()  # some versions end each line with the separator
        kind, name = f[0], f[0].decode("ascii", "replace")[:40]
        if kind in _IGNORED:
            fault = ""
        elif len(f) < 3 or not is_number(f[1]):
            fault = f"{name}: no time" if name in KINDS else "not a record"
        elif kind in _SERIES:
            fault = self._sensor(f, number)
        elif kind == b"WIFI":
            fault = self._wifi(f, number)
        elif kind in {b"BLUE", b"BLE4"}:
            fault = self._ble(f, number)
        elif kind == b"POSI":
            fault = self._posi(f, number)
        else:
            fault = f"unknown kind {name}"
        if not fault:
            self._report.n_records[name] = self._report.n_records.get(name, 0) + 1
        return fault

    def _sensor(self, f: list[bytes], number: int) -> str:
        column, first, count, n_fields = _SERIES[f[0]]
        if len(f) not in {n_fields, n_fields + 1}:
            return f"{f[0].decode()}: {len(f)} fields of {n_fields + 1}"
        try:
            values = tuple(map(float, f[first : first + count]))
        except ValueError:
            return f"{f[0].decode()}: not a number where one is due"
        if column == "orientation":
            x, y, z = values
            values = (math.sqrt(max(0.0, 1.0 - x * x - y * y - z * z)), x, y, z)
        self.rows.add(column, number, float(f[1]), values)
        return ""

    def _wifi(self, f: list[bytes], number: int) -> str:
        if len(f) < 6:
            return f"WIFI: {len(f)} fields of 6 or 7"
        has_frequency = is_number(f[-2]) and len(f) > 6
        address, frequency = (f[-3], f[-2]) if has_frequency else (f[-2], b"0")
        if not (is_number(f[2]) and is_number(frequency) and is_number(f[-1])):
            return "WIFI: not a number where one is due"
        if not _ADDRESS.fullmatch(address):
            return "WIFI: no BSSID"
        values = (float(f[-1]), float(frequency), float(f[2]))
        self.rows.add("wifi", number, float(f[1]), values, bssid_id(address.decode("latin-1")))
        return ""

    def _ble(self, f: list[bytes], number: int) -> str:
        power = math.nan
        if f[0] == b"BLUE":
            address, rssi = (f[-2], f[-1]) if len(f) >= 5 else (b"", b"")
        else:
            address, rssi = (f[3], f[4]) if len(f) >= 5 else (b"", b"")
            if f[2] == b"iBeacon" and len(f) > 5 and is_number(f[5]):
                power = float(f[5])
        if not _ADDRESS.fullmatch(address) or not is_number(rssi):
            return f"{f[0].decode()}: no address or no RSSI"
        self.rows.add("ble", number, float(f[1]), (float(rssi), power), bssid_id(address.decode("latin-1")))
        return ""

    def _posi(self, f: list[bytes], number: int) -> str:
        if len(f) not in {6, 7}:
            return f"POSI: {len(f)} fields of 7"
        if not all(map(is_number, f[3:6])):
            return "POSI: not a number where one is due"
        lat, lon, floor = map(float, f[3:6])
        if not (
            math.isfinite(float(f[1])) and abs(lat) <= 90.0 and abs(lon) <= 180.0 and floor == round(floor)
        ):
            return "POSI: out of range"
        if lat == 0.0 and lon == 0.0:
            return "POSI: no place given (0;0)"
        self.rows.waypoints.append(
            (number, Waypoint(float(f[1]), math.nan, math.nan, str(int(floor)), lat, lon))
        )
        return ""
