"""Finding the format, and what a RECORDING argument means."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

import wayfuse.formats
from wayfuse.core.errors import DataMissingError, FormatError, UsageError
from wayfuse.formats import expand, read, sniff

WALK = "#\tstartTime:1\n1574661471701\tTYPE_ACCELEROMETER\t1\t2\t9\t3\n"


@pytest.fixture
def tree(tmp_path: Path) -> Path:
    """Two walks, a Sensor Logger folder, and things that are no recordings."""
    (tmp_path / "F1").mkdir()
    (tmp_path / "F1" / "b.txt").write_text(WALK, encoding="utf-8")
    (tmp_path / "F1" / "a.txt").write_text("ACCE;0.1;5.1;1;2;9;3\n", encoding="utf-8")
    (tmp_path / "F1" / "floor_info.json").write_text('{"map_info": {"height": 1}}', encoding="utf-8")
    (tmp_path / "F1" / "floor_image.png").write_bytes(b"\x89PNG\r\n\x1a\n")
    (tmp_path / "F1" / ".hidden.txt").write_text(WALK, encoding="utf-8")
    (tmp_path / "phone").mkdir()
    (tmp_path / "phone" / "Metadata.csv").write_text("platform\nandroid\n", encoding="utf-8")
    (tmp_path / "phone" / "Gyroscope.csv").write_text(
        "time,x,y,z\n1679068247375690000,1,2,3\n", encoding="utf-8"
    )
    (tmp_path / "empty").mkdir()
    return tmp_path


def test_formats_are_told_by_their_content(tree: Path) -> None:
    assert sniff(tree / "F1" / "b.txt") == "ms-indoor"
    assert sniff(tree / "F1" / "a.txt") == "getsensordata"
    assert sniff(tree / "phone") == "sensor-logger"
    (tree / "headless.txt").write_text(WALK.split("\n", 1)[1], encoding="utf-8")
    assert sniff(tree / "headless.txt") == "ms-indoor"
    with pytest.raises(
        FormatError, match=r"floor_info\.json.*known formats: ms-indoor, getsensordata, sensor-logger"
    ):
        sniff(tree / "F1" / "floor_info.json")


def test_a_folder_is_all_recordings_below_it(tree: Path) -> None:
    assert expand([tree]) == [tree / "F1" / "a.txt", tree / "F1" / "b.txt", tree / "phone"]
    assert expand([tree / "phone", str(tree / "F1")]) == [
        tree / "phone",
        tree / "F1" / "a.txt",
        tree / "F1" / "b.txt",
    ]


def test_a_list_of_paths(tree: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tree)
    (tree / "list").write_text("# dev set\n\n F1/b.txt \nphone\n", encoding="utf-8")
    assert expand(["@list"]) == [Path("F1/b.txt"), Path("phone")]
    (tree / "nothing").write_text("# only this\n", encoding="utf-8")
    with pytest.raises(DataMissingError, match="no path in this list"):
        expand(["@nothing"])
    with pytest.raises(DataMissingError, match="no such list"):
        expand(["@absent"])


def test_what_is_not_there_is_an_error(tree: Path) -> None:
    with pytest.raises(DataMissingError, match="no recording in this folder"):
        expand([tree / "empty"])
    with pytest.raises(DataMissingError, match="no such file or folder"):
        expand([tree / "absent"])


def test_a_given_format_is_used_and_must_be_known(tree: Path) -> None:
    with pytest.raises(FormatError):
        read(tree / "F1" / "a.txt", format="ms-indoor")
    with pytest.raises(UsageError, match="use one of ms-indoor"):
        read(tree / "F1" / "a.txt", format="excel")
    for kind in ("ms-indoor", "getsensordata"):
        with pytest.raises(FormatError, match="a folder"):
            read(tree / "phone", format=kind)


def test_readers_are_reached_lazily_from_the_package() -> None:
    assert wayfuse.formats.read is read
    with pytest.raises(AttributeError, match="nonsense"):
        _ = wayfuse.formats.nonsense


@pytest.mark.real_data
def test_real_floor_folder(ms_indoor: Path, tmp_path: Path) -> None:
    floor = ms_indoor / "B1"
    walks = sorted((floor / "path_data_files").glob("*.txt"))
    assert expand([floor]) == walks
    assert len(walks) > 10
    shutil.copy(floor / "geojson_map.json", tmp_path)
    with pytest.raises(DataMissingError):
        expand([tmp_path])
