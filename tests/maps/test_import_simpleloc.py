"""Importing simpleLoc buildings: cut-outs, doors in walls, stairs and lifts, what is refused, the real file."""

from __future__ import annotations

import xml.etree.ElementTree as ET

import numpy as np
import pytest
import shapely

from wayfuse.core.errors import MapError
from wayfuse.maps.importers.simpleloc import import_site
from wayfuse.maps.problems import noted_problems
from wayfuse.maps.site import Site


def polygon(method, *points):
    inner = "".join(f'<point x="{x}" y="{y}"/>' for x, y in points)
    return f'<polygon name="p" method="{method}" outdoor="false">{inner}</polygon>'


def box(x0, y0, x1, y1):
    return (x0, y0), (x1, y0), (x1, y1), (x0, y1)


def wall(x1, y1, x2, y2, doors="", tag="wall"):
    return f'<{tag} type="1" x1="{x1}" y1="{y1}" x2="{x2}" y2="{y2}">{doors}</{tag}>'


def door(x01, lr="false", width=1.0):
    return f'<door x01="{x01}" width="{width}" lr="{lr}"/>'


STAIR = (
    '<stair type="0"><part x1="16" y1="2" x2="16" y2="6" z1="0" z2="1.5" w="2"/>'
    '<part x1="18" y1="6" x2="18" y2="2" z1="1.5" z2="3" w="2"/></stair>'
)
LIFT = '<elevator cx="4" cy="8" width="2" depth="1" height="0" rotation="1.5707963"/>'


def floor(name="1. Stock", at="0", outline=None, obstacles="", more=""):
    if outline is None:
        outline = polygon(0, *box(0, 0, 20, 10)) + polygon(1, *box(14.9, 1.9, 19.1, 6.1))
    return (
        f'<floor name="{name}" atHeight="{at}" height="3"><outline>{outline}</outline>'
        f"<obstacles>{obstacles}</obstacles>{more}</floor>"
    )


def write(path, *floors):
    path.write_text(f'<map width="20" depth="10"><floors>{"".join(floors)}</floors></map>')
    return path


def test_doors_open_walls_from_x01_in_their_direction(tmp_path):
    walls = wall(0, 5, 10, 5, door(0.2) + door(0.8, "true")) + wall(12, 0, 12, 3, tag="line")
    (found,) = import_site(write(tmp_path / "house.xml", floor(obstacles=walls)))[0].floors
    x = np.array([1.8, 2.2, 2.8, 3.2, 6.8, 7.2, 7.8, 8.2])
    crossed = found.barrier_index.crosses(x, np.full(8, 4.5), x, np.full(8, 5.5))
    assert crossed.tolist() == [True, False, False, True, True, False, False, True]
    assert found.barrier_index.crosses([11.5], [1.0], [12.5], [1.0]).tolist() == [True]
    assert found.anchor is None


def test_cut_outs_stairs_and_lifts(tmp_path):
    more = f"<stairs>{STAIR}</stairs><elevators>{LIFT}</elevators>"
    path = write(tmp_path / "house.xml", floor("2. Stock", "3"), floor(more=more))
    site, report = import_site(path)
    assert site.floor_names == ("1. Stock", "2. Stock")
    assert [(f.level, f.elevation) for f in site.floors] == [(1, 0.0), (2, 3.0)]
    low, high = site.floors
    assert [u.category for u in low.units] == ["stairs", "elevator"]
    assert [u.category for u in high.units] == ["stairs"]
    assert low.units[0].polygon.area == pytest.approx(16.0, abs=0.1)
    lift = low.units[1].polygon.exterior
    np.testing.assert_allclose((lift.min(axis=0), lift.max(axis=0)), ((3.5, 7.0), (4.5, 9.0)), atol=1e-3)
    (stairs,) = site.connectors
    assert (stairs.id, stairs.kind, stairs.floors) == ("stairs 1/0", "stairs", (0, 1))
    assert all(
        f.walkable.contains([at.x], [at.y])[0] for f, at in zip(site.floors, stairs.landings, strict=True)
    )
    (problem,) = noted_problems(site)
    assert (problem.kind, problem.feature) == ("connector-to-nowhere", "elevator 1/0")
    assert low.walkable.contains([16.0], [4.0]).tolist() == [True]
    assert report.floors[0].warnings == ()
    bare = import_site(write(tmp_path / "bare.xml", floor()))[0].floors[0]
    assert bare.walkable.contains([16.0], [4.0]).tolist() == [False]
    assert bare.area == pytest.approx(200.0 - 4.2 * 4.2, abs=0.01)
    site.save(tmp_path / "SITE")
    assert Site.load(tmp_path / "SITE").floor_names == site.floor_names


def test_a_name_that_does_not_say_its_level_is_reported(tmp_path):
    path = write(tmp_path / "a.xml", floor("Dach", "6"), floor("EG"), floor("Mitte", "3"))
    site, report = import_site(path)
    assert [f.level for f in site.floors] == [0, 1, 2]
    assert ["does not say" in "".join(note.warnings) for note in report.floors] == [False, True, True]


def test_a_door_that_leaves_its_wall_is_reported(tmp_path):
    path = write(tmp_path / "a.xml", floor(obstacles=wall(0, 5, 10, 5, door(0.95) + door(3))))
    (note,) = import_site(path)[1].floors
    assert len(note.warnings) == 2
    assert "leaves its wall" in note.warnings[0]


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ("<map><floors>", "not sound XML"),
        ("<map/>", "no <map> with <floors>"),
        ("<osm><floors><floor/></floors></osm>", "no <map> with <floors>"),
        ('<!DOCTYPE map [<!ENTITY a "b">]><map>&a;</map>', "document type"),
        ("<map><floors><floor name='1'/></floors></map>", "atHeight is None"),
        ("<map><floors>" + floor(at="high") + "</floors></map>", "atHeight is 'high'"),
        ("<map><floors>" + floor(at="nan") + "</floors></map>", "atHeight is 'nan'"),
        ("<map><floors>" + floor(outline="") + "</floors></map>", "no outline"),
        ("<map><floors>" + floor(outline=polygon(0, (0, 0), (1, 1))) + "</floors></map>", "no outline"),
        ("<map><floors>" + floor(outline=polygon(0, *box(0, 0, 9e5, 9))) + "</floors></map>", "spans more"),
        ("<map><floors>" + floor(obstacles="<wall/>") + "</floors></map>", "x1 is None"),
        ("<map><floors>" + floor(obstacles=wall(0, 5, 9, 5, "<door/>")) + "</floors></map>", "x01 is None"),
    ],
)
def test_a_damaged_file_is_named_with_a_remedy(tmp_path, text, named):
    path = tmp_path / "house.xml"
    path.write_text(text)
    with pytest.raises(MapError, match=named) as caught:
        import_site(path)
    assert caught.value.where == str(path)
    assert caught.value.remedy


@pytest.mark.parametrize("seed", range(40))
def test_whatever_a_file_holds_it_is_imported_or_refused_by_name(tmp_path, seed):
    rng = np.random.default_rng(seed)
    more = f"<stairs>{STAIR}</stairs><elevators>{LIFT}</elevators>"
    path = write(tmp_path / "house.xml", floor(obstacles=wall(0, 5, 10, 5, door(0.2)), more=more))
    text = path.read_text()
    for _ in range(rng.integers(1, 5)):
        at = int(rng.integers(len(text)))
        odd = ["", "9", "-", "0", "e3", "nan", ".", " "][rng.integers(8)]
        text = text[:at] + odd + text[at + int(rng.integers(2)) :]
    path.write_text(text)
    try:
        floors, refusal = import_site(path)[0].floors, None
    except MapError as error:
        floors, refusal = (), error
    assert all(found.area > 0 for found in floors)
    assert floors or (str(path) in str(refusal) and refusal.remedy)


@pytest.mark.real_data
def test_the_real_building_holds_its_ground_truth(data_root):
    path = data_root / "maps" / "simpleloc_ipin2024" / "building.xml"
    if not path.is_file():
        pytest.skip(f"REAL DATA ABSENT: no file {path}; fetch with `wayfuse datasets fetch maps`")
    site, report = import_site(path)
    assert (site.name, site.floor_names) == ("simpleloc_ipin2024", ("2. Stock", "3. Stock"))
    assert all(note.warnings == () for note in report.floors)  # every door lies on its wall
    assert [(c.kind, c.floors) for c in site.connectors] == [("stairs", (0, 1))] * 5
    apart = [np.hypot(a.x - b.x, a.y - b.y) for a, b in (c.landings for c in site.connectors)]
    assert sorted(round(d, 1) for d in apart) == [
        1.6,
        1.6,
        1.7,
        6.7,
        7.7,
    ]  # where each flight starts and ends
    assert [len(floor.doors) for floor in site.floors] == [53, 63]
    for node in ET.parse(path).getroot().iter("floor"):  # noqa: S314 - a file of the data set
        found = site.floors[site.floor_index(node.get("name"))]
        assert found.elevation == pytest.approx(float(node.get("atHeight")))
        area = shapely.union_all([shapely.Polygon(p.exterior, p.holes) for p in found.outline])
        points = [(float(g.get("x")), float(g.get("y"))) for g in node.iter("gtpoint")]
        assert len(points) > 20
        assert shapely.contains_xy(area, *np.array(points).T).all()
