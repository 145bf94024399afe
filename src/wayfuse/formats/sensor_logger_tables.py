"""The containers of Sensor Logger: a folder or ZIP of CSV files, or a flat JSON array, as batches of text
rows.

All three are streamed: a ZIP is never unpacked to disk (so that no member name can lead outside), its
declared sizes are limited before anything is read, and the JSON array is decoded object by object.
"""

from __future__ import annotations

import csv
import io
import json
import re
import zipfile
import zlib
from collections.abc import Iterator
from pathlib import Path, PurePosixPath
from typing import IO, NamedTuple

from wayfuse.core.errors import FormatError
from wayfuse.sensors.quality import ReadReport

__all__ = ["Batch", "batches", "is_recording"]

MAX_BYTES = 4 << 30  # of all members of a ZIP, unpacked: days of recording
MAX_MEMBERS = 10_000
MAX_RATIO = 250  # unpacked over packed; sensor text packs 3-20 times
_BATCH_ROWS = 4096
_CHUNK = 1 << 20
_MARKS = {
    "metadata",
    "accelerometer",
    "totalacceleration",
    "gyroscope",
    "gravity",
    "magnetometer",
    "wifi",
    "barometer",
}
_BOUNDARY = re.compile(r"\}\s*,\s*\{")


class Batch(NamedTuple):
    """Rows of one sensor: its name as in the file, columns in lower case, line numbers, fields."""

    sensor: str
    columns: tuple[str, ...]
    lines: list[int]
    rows: list[list[str]]


def is_recording(path: Path) -> bool:
    """Whether a folder or ZIP holds the CSV files of a recording, or a file its JSON export."""
    if path.is_dir():
        names = [p.stem.lower() for p in path.glob("*.csv")]
        return "metadata" in names or len(_MARKS.intersection(names)) > 1
    with path.open("rb") as file:
        head = file.read(4096)
    if head.startswith(b"PK\x03\x04"):
        try:
            with zipfile.ZipFile(path) as archive:
                names = [PurePosixPath(n).stem.lower() for n in archive.namelist()]
        except zipfile.BadZipFile:
            return False
        return bool(_MARKS.intersection(names))
    return head.lstrip(b"\xef\xbb\xbf \t\r\n").startswith(b"[") and b'"sensor"' in head


def batches(path: Path, report: ReadReport) -> Iterator[Batch]:
    """All rows of a recording, sensor by sensor (CSV) or as they come (JSON).

    Raises
    ------
    FormatError : the ZIP is broken, encrypted, over the limits or holds more than one recording.
    """
    if path.is_dir():
        for file in sorted(p for p in path.iterdir() if p.suffix.lower() == ".csv"):
            with file.open("rb") as stream:
                yield from _csv_batches(file.stem, stream, report)
    elif zipfile.is_zipfile(path):
        yield from _zip_batches(path, report)
    else:
        with path.open(encoding="utf-8", errors="replace") as text:
            yield from _json_batches(text, report)


def _zip_batches(path: Path, report: ReadReport) -> Iterator[Batch]:
    try:
        with zipfile.ZipFile(path) as archive:
            for info in _members(archive, path, report):
                with archive.open(info) as stream:
                    if info.filename.lower().endswith(".json"):
                        yield from _json_batches(io.TextIOWrapper(stream, "utf-8", "replace"), report)
                    else:
                        yield from _csv_batches(PurePosixPath(info.filename).stem, stream, report)
    except (
        zipfile.BadZipFile,
        RuntimeError,
        NotImplementedError,
    ) as error:  # broken, encrypted, unknown packing
        raise FormatError(
            f"unreadable ZIP: {error}", where=path, remedy="export the recording again"
        ) from error


def _members(archive: zipfile.ZipFile, path: Path, report: ReadReport) -> list[zipfile.ZipInfo]:
    """CSV or JSON members of the one recording in an archive, within the limits."""
    infos = archive.infolist()
    size, packed = sum(i.file_size for i in infos), sum(i.compress_size for i in infos)
    if len(infos) > MAX_MEMBERS or size > MAX_BYTES or size > MAX_RATIO * max(packed, _CHUNK):
        raise FormatError(
            f"the ZIP would unpack to {size / 1e6:.0f} MB in {len(infos)} files from {packed / 1e6:.1f} MB",
            where=path,
            remedy="unpack it yourself if you trust it, and give the folder",
        )
    by_folder: dict[PurePosixPath, list[zipfile.ZipInfo]] = {}
    for info in infos:
        name = PurePosixPath(info.filename.replace("\\", "/"))
        if name.is_absolute() or ".." in name.parts:
            report.add("ZIP: member name that leads outside, not read", 0)
        elif name.suffix.lower() in {".csv", ".json"} and "__MACOSX" not in name.parts:
            by_folder.setdefault(name.parent, []).append(info)
    folders = [
        f
        for f, files in by_folder.items()
        if any(PurePosixPath(i.filename).stem.lower() in _MARKS for i in files)
    ] or list(by_folder)
    if len(folders) != 1:
        raise FormatError(
            f"the ZIP holds {len(folders)} recordings", where=path, remedy="unpack it and give the folders"
        )
    return sorted(by_folder[folders[0]], key=lambda i: i.filename)


def _csv_batches(sensor: str, stream: IO[bytes], report: ReadReport) -> Iterator[Batch]:
    """Rows of one CSV file; rows of another length than the header are counted, a cut last row too."""
    lines = _Lines(stream)
    reader = csv.reader(lines)
    try:
        header = next(reader, None)
        if header is None:
            return  # an empty file: the sensor was off
        columns = tuple(name.strip().lower() for name in header)
        batch = Batch(sensor, columns, [], [])
        for row in reader:
            if len(row) == len(columns):
                batch.lines.append(lines.count)
                batch.rows.append(row)
            elif row:
                cut = lines.cut and len(row) < len(columns)
                what = "truncated last line" if cut else f"{sensor}: {len(row)} fields of {len(columns)}"
                report.add(what, lines.count)
            if len(batch.rows) >= _BATCH_ROWS:
                yield batch
                batch = Batch(sensor, columns, [], [])
        ended = sensor.lower() == "metadata" or not lines.cut  # the app never ends its metadata's line
        if not ended and batch.rows and batch.lines[-1] == lines.count:
            report.add(f"{sensor}: last line has no line end, kept", lines.count)
        yield batch
    except (csv.Error, EOFError, zlib.error, zipfile.BadZipFile) as error:
        if "batch" in locals():
            yield batch
        report.add(f"{sensor}: unreadable from here on ({error})", lines.count)
    finally:
        report.n_lines += lines.count


class _Lines:
    """Decoded lines of a stream, counted; NUL bytes, which csv refuses, are replaced."""

    def __init__(self, stream: IO[bytes]) -> None:
        self._lines = iter(stream)
        self.count, self.cut = 0, False

    def __iter__(self) -> Iterator[str]:
        return self

    def __next__(self) -> str:
        line = next(self._lines)
        self.count += 1
        self.cut = not line.endswith(b"\n")
        return line.replace(b"\0", b"\xff").decode("utf-8-sig" if self.count == 1 else "utf-8", "replace")


def _json_batches(text: IO[str], report: ReadReport) -> Iterator[Batch]:
    """Objects of a flat array, those of one sensor in a row together; the line of a record is its ordinal."""
    batch: Batch | None = None
    for number, record in _objects(text, report):
        report.n_lines = number
        sensor = str(record.pop("sensor", record.pop("name", "")))
        columns = tuple(key.lower() for key in record)
        full = batch is not None and len(batch.rows) >= _BATCH_ROWS
        if batch is None or full or (sensor, columns) != batch[:2]:
            if batch is not None:
                yield batch
            batch = Batch(sensor, columns, [], [])
        batch.lines.append(number)
        batch.rows.append(["" if value is None else str(value) for value in record.values()])
    if batch is not None:
        yield batch


def _objects(text: IO[str], report: ReadReport) -> Iterator[tuple[int, dict[str, object]]]:
    """Objects of a JSON array with their ordinals; an unreadable one is counted and skipped."""
    decoder = json.JSONDecoder()
    buffer, at, number = text.read(_CHUNK), 0, 0
    at = buffer.find("[") + 1
    ended = False
    while True:
        while at < len(buffer) and buffer[at] in " \t\r\n,":
            at += 1
        if at >= len(buffer) or (not ended and len(buffer) - at < _CHUNK // 4):
            more = text.read(_CHUNK)
            ended = not more
            buffer, at = buffer[at:] + more, 0
            if not buffer:
                break
            if more:
                continue
        if buffer[at : at + 1] == "]":
            return
        number += 1
        try:
            value, at = decoder.raw_decode(buffer, at)
        except ValueError:
            boundary = _BOUNDARY.search(buffer, at)
            if boundary is None and not ended:
                more = text.read(_CHUNK)
                ended = not more
                buffer, at, number = buffer[at:] + more, 0, number - 1
                continue
            if boundary is None:
                report.add("truncated last record", number)
                return
            report.add("not a JSON object", number)
            at = boundary.end() - 1
            continue
        if isinstance(value, dict):
            yield number, value
        else:
            report.add("not a JSON object", number)
    report.add("the JSON array is not closed", number)
