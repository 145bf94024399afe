"""Importing the museum of IPIN 2023 Track 3 from its logs: made-up logs, damage, and the real folder."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from wayfuse.core.errors import MapError
from wayfuse.core.frames import metres_per_degree
from wayfuse.maps.connectors import ConnectorKind
from wayfuse.maps.importers.ipin2023 import MARGIN, import_site
from wayfuse.maps.site import Site

LAT, LON = 49.4610, 11.1108
EAST, NORTH = metres_per_degree(LAT)


def posi(x: float, y: float, floor: str, t: float = 61.0) -> str:
    return f"POSI;{t};1;{LAT + y / NORTH:.12f};{LON + x / EAST:.12f};{floor};4"


def write(folder: Path, *lines: str, name: str = "log_01.txt") -> Path:
    folder.mkdir(exist_ok=True)
    (folder / name).write_text("\n".join(("% a comment: POSI;no;1", "WIFI;1;2;a;b;2412;-60", *lines)) + "\n")
    return folder


WHOLE = (
    posi(0.0, 0.0, "0"),
    posi(60.0, 40.0, "0"),
    posi(10.0, 20.0, "-1"),
    posi(30.0, 25.0, "-1.0"),
    posi(20.0, 10.0, "-2"),
    posi(50.0, 30.0, "-2"),
)


def test_floors_are_the_places_stated_with_a_margin(tmp_path: Path) -> None:
    site, report = import_site(write(tmp_path / "logs", *WHOLE))
    assert site.name == "ipin2023"
    assert site.floor_names == ("-2", "-1", "0")
    assert [f.level for f in site.floors] == [-2, -1, 0]
    assert [f.elevation for f in site.floors] == [-5.8, -3.2, 0.0]
    assert site.reference == 2
    assert [f.name for f in report.floors] == ["-2", "-1", "0"]
    assert site.provenance == {"format": "ipin2023", "logs": "1", "positions": "6"}
    width, height = 60.0 + 2 * MARGIN, 40.0 + 2 * MARGIN
    for floor in site.floors:
        assert (floor.width, floor.height) == (
            pytest.approx(width, abs=0.01),
            pytest.approx(height, abs=0.01),
        )
    for name, low, high in (("0", (0, 0), (60, 40)), ("-1", (10, 20), (30, 25)), ("-2", (20, 10), (50, 30))):
        ring = site.floors[site.floor_index(name)].outline[0].exterior
        np.testing.assert_allclose(ring.min(axis=0), low, atol=0.01)
        np.testing.assert_allclose(ring.max(axis=0), np.add(high, 2 * MARGIN), atol=0.01)


def test_all_floors_share_one_frame_with_north_up(tmp_path: Path) -> None:
    site, _ = import_site(write(tmp_path / "logs", *WHOLE))
    for a in range(3):
        for b in range(3):
            np.testing.assert_allclose(site.shift(a, b), 0.0, atol=1e-6)
    assert site.anchor is not None
    assert site.anchor.rotation == pytest.approx(0.0, abs=1e-9)
    np.testing.assert_allclose(site.anchor.to_xy((LON, LAT)), MARGIN, atol=1e-3)


def test_everything_inside_is_walkable_and_nothing_outside(tmp_path: Path) -> None:
    site, _ = import_site(write(tmp_path / "logs", *WHOLE))
    low = site.floors[0]
    inside = low.walkable.contains([45.0, 21.0, 73.0], [35.0, 11.0, 53.0])
    assert inside.tolist() == [True, True, True]
    assert low.walkable.contains([5.0, 80.0], [5.0, 60.0]).tolist() == [False, False]


def test_logs_are_pooled(tmp_path: Path) -> None:
    folder = tmp_path / "logs"
    for i, line in enumerate(WHOLE):
        write(folder, line, name=f"log_{i}.txt")
    (folder / "readme.md").write_text("POSI;broken\n")
    pooled, _ = import_site(folder)
    whole, _ = import_site(write(tmp_path / "one", *WHOLE))
    assert pooled.provenance["logs"] == "6"
    for a, b in zip(pooled.floors, whole.floors, strict=True):
        np.testing.assert_allclose(a.outline[0].exterior, b.outline[0].exterior)


def test_connectors_stop_at_their_floors_only(tmp_path: Path) -> None:
    site, _ = import_site(write(tmp_path / "logs", *WHOLE))
    kinds = {c.id: (c.kind, tuple(site.floor_names[f] for f in c.floors)) for c in site.connectors}
    assert kinds == {
        "stairs-51-upper": (ConnectorKind.STAIRS, ("-1", "0")),
        "stairs-51-lower": (ConnectorKind.STAIRS, ("-2", "-1")),
        "stairs-52": (ConnectorKind.STAIRS, ("-2", "0")),  # past the mezzanine
        "lift-53": (ConnectorKind.LIFT, ("-2", "0")),
    }


def test_a_site_comes_back_from_its_folder(tmp_path: Path) -> None:
    site, _ = import_site(write(tmp_path / "logs", *WHOLE))
    site.save(tmp_path / "SITE")
    back = Site.load(tmp_path / "SITE")
    assert back.floor_names == site.floor_names
    assert [c.id for c in back.connectors] == [c.id for c in site.connectors]
    np.testing.assert_allclose(back.connectors[3].landings[0][1:], site.connectors[3].landings[0][1:])


def test_a_folder_without_logs_is_refused(tmp_path: Path) -> None:
    (tmp_path / "empty").mkdir()
    for path in (tmp_path / "empty", tmp_path / "absent", write(tmp_path / "logs", *WHOLE) / "log_01.txt"):
        with pytest.raises(MapError, match="no logs"):
            import_site(path)


def test_a_floor_nobody_walked_is_named(tmp_path: Path) -> None:
    with pytest.raises(MapError, match=r"no position on floor -2, -1") as fault:
        import_site(write(tmp_path / "logs", *WHOLE[:2]))
    assert "51 to 53" in fault.value.remedy


@pytest.mark.parametrize(
    "line",
    [
        "POSI;61.0;1;49.46",
        "POSI;61.0;1;north;11.11;0;4",
        "POSI;61.0;1;49.46;11.11;ground;4",
        "POSI;61.0;1;49.46;11.11;;4",
        "POSI;61.0;1;nan;11.11;0;4",
        "POSI;61.0;1;49.46;inf;0;4",
        "POSI;61.0;1;49.46;11.11;nan;4",
    ],
)
def test_a_damaged_position_is_named_by_file_and_line(tmp_path: Path, line: str) -> None:
    folder = write(tmp_path / "logs", *WHOLE, line)
    with pytest.raises(MapError, match=r"log_01\.txt:9: damaged position"):
        import_site(folder)


def test_bytes_that_are_no_text_elsewhere_in_a_log_do_not_matter(tmp_path: Path) -> None:
    folder = write(tmp_path / "logs", *WHOLE)
    with (folder / "log_01.txt").open("ab") as log:
        log.write(b"WIFI;1;2;caf\xe9;00:11;2412;-60\n")
    assert len(import_site(folder)[0].floors) == 3


@pytest.mark.real_data
def test_the_real_logs(data_root: Path) -> None:
    folder = data_root / "ipin2023-track3" / "logs"
    if not folder.is_dir():
        pytest.skip(
            f"REAL DATA ABSENT: no folder {folder}; fetch with `wayfuse datasets fetch ipin2023-track3`"
        )
    site, _ = import_site(folder)
    assert site.floor_names == ("-2", "-1", "0")
    assert all(50.0 < f.width < 250.0 and 50.0 < f.height < 250.0 for f in site.floors)
    # each landing is where somebody stood: on walkable ground, and the two ends of a flight are near each other
    for connector in site.connectors:
        places = []
        for at in connector.landings:
            assert site.floors[at.floor].walkable.contains([at.x], [at.y])[0], (connector.id, at.floor)
            places.append((at.x, at.y))
        assert np.hypot(*np.subtract(*places)) < 10.0
