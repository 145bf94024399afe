"""Reader of the SODIndoorLoc workbook: where the access points of a building hang, and their columns per band.

The workbook has a sheet per building with a header line: ID, ECoord, NCoord (m, frame of the building's tables),
FloorID, the column of the tables that holds the 2.4 GHz readings (``MAC12``) and its frequency, the same at 5 GHz or
nothing. An .xlsx file is a zip archive of XML; only cell values are read.

References
----------
.. [1] J. Bi et al., Supplementary open dataset for WiFi indoor localization based on received signal
   strength, Satellite Navigation 3:25, 2022, 10.1186/s43020-022-00086-y; data: github.com/renwudao24/SODIndoorLoc.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree
from zipfile import BadZipFile, ZipFile

from wayfuse.core.errors import DataMissingError, FormatError

__all__ = ["WORKBOOK", "PlacedAccessPoint", "read_places"]

WORKBOOK = "Information of pre-installed APs.xlsx"
_SPACE = "{http://schemas.openxmlformats.org/spreadsheetml/2006/main}"
_COLUMN = re.compile(r"MAC(\d{1,6})")
_CELL = re.compile(r"([A-Z]+)\d+")
_HEADER = ("ID", "ECoord", "NCoord", "FloorID", "Attribute_2.4", "Frequency_2.4")
_LARGEST = 10_000_000  # bytes of an unpacked part; the real ones are below 100 000
_DECLARATION = b"<!DOCTYPE"  # a workbook has none; entities could blow up


class PlacedAccessPoint(NamedTuple):
    """x, y (m), floor, and the numbers of its columns, ``column_5`` 0 where it has one band only."""

    x: float
    y: float
    floor: int
    column_24: int
    column_5: int


def read_places(path: str | Path, building: str) -> tuple[PlacedAccessPoint, ...]:
    """Access points of a building (``CETC331``, ``HCXY``, ``SYL``).

    Raises
    ------
    DataMissingError : there is no such file. FormatError : it is no such workbook, or a line of the sheet is damaged.
    """
    path = Path(path)
    if not path.is_file():
        raise DataMissingError(
            "there is no such file", where=path, remedy="fetch with `wayfuse datasets fetch sodindoorloc`"
        )
    try:
        with ZipFile(path) as archive:
            names = [sheet.get("name") for sheet in _part(archive, "xl/workbook.xml").iter(f"{_SPACE}sheet")]
            if building not in names:
                raise FormatError(f"no sheet {building!r} among {names}", where=path)
            shared = _shared(archive)
            sheet = _part(archive, f"xl/worksheets/sheet{names.index(building) + 1}.xml")
    except (BadZipFile, KeyError, ElementTree.ParseError, OSError) as error:
        raise FormatError(f"not a workbook: {error}", where=path) from error
    rows = [_row(row, shared, path) for row in sheet.iter(f"{_SPACE}row")]
    if not rows or tuple(rows[0].get(c) for c in "ABCDEF") != _HEADER:
        raise FormatError("the sheet has another header", where=f"{path}: {building}")
    return tuple(_placed(row, f"{path}: {building}, line {n}") for n, row in enumerate(rows[1:], 2) if row)


def _part(archive: ZipFile, name: str) -> ElementTree.Element:
    if archive.getinfo(name).file_size > _LARGEST:
        raise FormatError(f"{name} is too large", where=archive.filename)
    text = archive.read(name)
    if _DECLARATION in text:
        raise FormatError(f"{name} declares a document type", where=archive.filename)
    return ElementTree.fromstring(text)  # noqa: S314 - no entities without a document type, and small


def _shared(archive: ZipFile) -> list[str]:
    strings = _part(archive, "xl/sharedStrings.xml").findall(f"{_SPACE}si")
    return ["".join(part.text or "" for part in string.iter(f"{_SPACE}t")) for string in strings]


def _row(row: ElementTree.Element, shared: list[str], path: Path) -> dict[str, str]:
    """Texts of a line's cells by column letter; empty cells are left out."""
    out = {}
    for cell in row.findall(f"{_SPACE}c"):
        value, place = cell.find(f"{_SPACE}v"), _CELL.fullmatch(cell.get("r", ""))
        if value is None or not value.text or place is None:
            continue
        try:
            out[place[1]] = shared[int(value.text)] if cell.get("t") == "s" else value.text
        except (ValueError, IndexError) as error:
            raise FormatError("a cell refers to no text", where=f"{path}: {cell.get('r')}") from error
    return out


def _placed(row: dict[str, str], where: str) -> PlacedAccessPoint:
    first, second = _COLUMN.fullmatch(row.get("E", "")), _COLUMN.fullmatch(row.get("G", ""))
    try:
        x, y, floor = float(row["B"]), float(row["C"]), int(float(row["D"]))
    except (KeyError, ValueError, OverflowError) as error:
        raise FormatError("an access point without a place", where=where) from error
    if first is None or not (abs(x) < _LARGEST and abs(y) < _LARGEST):
        raise FormatError("an access point without a column or a place", where=where)
    return PlacedAccessPoint(x, y, floor, int(first[1]), int(second[1]) if second else 0)
