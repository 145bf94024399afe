"""The workbook of access-point places: a made-up one, damaged ones, the published one."""

from __future__ import annotations

from pathlib import Path
from zipfile import ZipFile

import pytest

from wayfuse.core.errors import DataMissingError, FormatError
from wayfuse.formats.sodindoorloc_places import WORKBOOK, PlacedAccessPoint, read_places

SPACE = 'xmlns="http://schemas.openxmlformats.org/spreadsheetml/2006/main"'
HEADER = ("ID", "ECoord", "NCoord", "FloorID", "Attribute_2.4", "Frequency_2.4", "Attribute_5", "Frequency_5")
GOOD = (
    ("1", "48.5", "18.25", "1", "MAC1", "2412", "MAC2", "5745"),
    ("2", "-3", "4", "2", "MAC7", "2437", "", ""),
)


def workbook(folder: Path, rows: tuple[tuple[str, ...], ...] = GOOD, head: str = "") -> Path:
    """A workbook of an empty sheet A and a sheet B; texts shared, numbers plain, empty cells written without value."""
    texts: list[str] = []

    def cell(place: str, text: str) -> str:
        if not text:
            return f'<c r="{place}"/>'
        if text.lstrip("-").replace(".", "").isdigit():
            return f'<c r="{place}"><v>{text}</v></c>'
        texts.append(text)
        return f'<c r="{place}" t="s"><v>{len(texts) - 1}</v></c>'

    lines = "".join(
        f"<row>{''.join(cell('ABCDEFGH'[k] + str(n), text) for k, text in enumerate(row))}</row>"
        for n, row in enumerate((HEADER, *rows), 1)
    )
    path = folder / "places.xlsx"
    with ZipFile(path, "w") as archive:
        archive.writestr(
            "xl/workbook.xml", f'{head}<workbook {SPACE}><sheet name="A"/><sheet name="B"/></workbook>'
        )
        archive.writestr("xl/worksheets/sheet1.xml", f"<worksheet {SPACE}/>")
        archive.writestr("xl/worksheets/sheet2.xml", f"<worksheet {SPACE}>{lines}</worksheet>")
        strings = "".join(f"<si><t>{text}</t></si>" for text in texts)
        archive.writestr("xl/sharedStrings.xml", f"<sst {SPACE}>{strings}</sst>")
    return path


def test_places_and_columns_are_read(tmp_path: Path) -> None:
    assert read_places(workbook(tmp_path), "B") == (
        PlacedAccessPoint(48.5, 18.25, 1, 1, 2),
        PlacedAccessPoint(-3.0, 4.0, 2, 7, 0),
    )


def test_a_sheet_that_is_not_there_or_empty_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(FormatError, match="no sheet 'C'"):
        read_places(workbook(tmp_path), "C")
    with pytest.raises(FormatError, match="another header"):
        read_places(workbook(tmp_path), "A")


@pytest.mark.parametrize("column", [1, 2, 3, 4])
def test_an_access_point_without_place_or_column_is_an_error(tmp_path: Path, column: int) -> None:
    row = tuple("" if k == column else text for k, text in enumerate(GOOD[0]))
    with pytest.raises(FormatError, match="line 3"):
        read_places(workbook(tmp_path, (GOOD[0], row)), "B")


def test_no_file_no_archive_and_a_document_type_are_errors(tmp_path: Path) -> None:
    with pytest.raises(DataMissingError):
        read_places(tmp_path / "absent.xlsx", "B")
    (tmp_path / "text.xlsx").write_text("not a zip")
    with pytest.raises(FormatError, match="not a workbook"):
        read_places(tmp_path / "text.xlsx", "B")
    with pytest.raises(FormatError, match="document type"):
        read_places(workbook(tmp_path, head='<!DOCTYPE x [<!ENTITY a "b">]>'), "B")


@pytest.mark.real_data
def test_the_published_workbook(data_root: Path) -> None:
    path = data_root / "sodindoorloc" / WORKBOOK
    if not path.is_file():
        pytest.skip("REAL DATA ABSENT: no sodindoorloc; fetch with `wayfuse datasets fetch sodindoorloc`")
    found = {name: read_places(path, name) for name in ("CETC331", "HCXY", "SYL")}
    assert {name: len(places) for name, places in found.items()} == {"CETC331": 26, "HCXY": 56, "SYL": 23}
    assert found["CETC331"][0].column_24 == 1 and found["CETC331"][0].column_5 == 2  # noqa: PT018
    assert not any(ap.column_5 for ap in found["HCXY"])
