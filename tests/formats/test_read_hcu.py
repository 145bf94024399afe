"""The reader of the HCU Hamburg walks: a folder of number columns, UTM points whose height tells the floor."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from wayfuse.core.errors import FormatError
from wayfuse.core.utm import utm_to_lonlat
from wayfuse.formats import expand, read, sniff
from wayfuse.formats.hcu import floor_at

T0 = 1_615_958_230_958  # ms


@pytest.fixture
def walk(tmp_path: Path) -> Path:
    """Three files of five samples, written as the set writes them, and two points."""
    folder = tmp_path / "Up"
    folder.mkdir()
    for name, values in (("acc", (0.1, 0.2, 9.8)), ("gyr", (0.01, 0.02, 0.03)), ("bar", (1018.05,))):
        rows = [[T0 + 10 * k, *values] for k in range(5)]
        np.savetxt(folder / f"{name}.csv", rows)
    (folder / "ref.csv").write_text(f"{T0} 566560.6 5932846.5 1.3\n{T0 + 40} 566593.9 5932847.5 7.6")
    return folder


def test_a_walk_is_read(walk: Path) -> None:
    assert sniff(walk) == "hcu"
    r = read(walk)
    assert (r.name, r.clock, r.device.model) == ("Up", "Unix time", "Galaxy S10 5G")
    assert r.acceleration.t.tolist() == [(T0 + 10 * k) / 1000 for k in range(5)]
    assert r.acceleration.values[0].tolist() == [0.1, 0.2, 9.8]
    assert r.rotation_rate.values[-1].tolist() == [0.01, 0.02, 0.03]
    assert r.pressure.values.tolist() == [[1018.05]] * 5
    assert len(r.magnetic_field) == 0
    assert [w.floor for w in r.waypoints] == ["EG", "1OG"]
    lonlat = utm_to_lonlat(np.array([566560.6, 5932846.5]), 32)
    assert (r.waypoints[0].lon, r.waypoints[0].lat) == tuple(lonlat)
    assert np.isnan(r.waypoints[0].x)
    assert r.report.n_bad == 0


def test_heights_between_floors_name_none() -> None:
    assert [floor_at(h) for h in (1.3, 7.2, 19.9, 4.0, 13.0, -5.0)] == ["EG", "1OG", "4OG", "", "", ""]


def test_bad_lines_cost_themselves(walk: Path) -> None:
    file = walk / "gyr.csv"
    lines = file.read_text().splitlines()
    lines[1], lines[2], lines[3] = "1 2", lines[2].replace("e-02", "x"), f"{T0 + 30} nan 0 0"
    file.write_text("\n".join(lines))
    r = read(walk)
    assert len(r.rotation_rate) == 2
    assert {k: (i.count, i.lines) for k, i in r.report.issues.items()} == {
        "gyr.csv: 2 fields of 4": (1, [2]),
        "gyr.csv: not a number where one is due": (1, [3]),
        "rotation rate: not finite": (1, [4]),
    }


def test_the_folder_is_one_recording_among_others(walk: Path, tmp_path: Path) -> None:
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / "acc.csv").write_text("time,x,y,z\n1,2,3,4\n")
    (tmp_path / "seconds").mkdir()
    (tmp_path / "seconds" / "acc.csv").write_text("1615958230.9 0 0 9.8\n")
    assert expand([tmp_path]) == [walk]
    with pytest.raises(FormatError, match="no walk of HCU Hamburg"):
        read(tmp_path / "other", format="hcu")


@pytest.mark.real_data
def test_the_walk_to_the_fourth_floor(data_root: Path) -> None:
    folder = data_root / "maps" / "hcu_ipin21" / "SensorLog"
    if not folder.is_dir():
        pytest.skip(f"REAL DATA ABSENT: no folder {folder}; fetch with `wayfuse datasets fetch maps`")
    level, up = (read(path) for path in expand([folder]))
    assert {w.floor for w in level.waypoints} == {"4OG"}
    assert [w.floor for w in up.waypoints] == ["EG"] * 3 + ["1OG"] * 3 + ["4OG"] * 4
    for r in (level, up):
        assert r.report.n_bad == 0
        assert len(r.acceleration) == len(r.pressure) > 10_000
        assert np.mean(np.linalg.norm(r.acceleration.values, axis=1)) == pytest.approx(9.8, abs=0.3)
