"""Importing Simple Indoor Tagging: levels, walls and doors, connectors, what is refused, and real buildings."""

from __future__ import annotations

import numpy as np
import pytest

from wayfuse.core.errors import MapError
from wayfuse.core.frames import GeoAnchor
from wayfuse.maps.importers.osm import import_site, parse_levels
from wayfuse.maps.problems import noted_problems
from wayfuse.maps.site import Site

ANCHOR = GeoAnchor.from_origin(13.0, 51.0)


class Drawing:
    """Writes `.osm`: points in metres of the south-west corner."""

    def __init__(self):
        self.lines, self.count, self.known = [], 0, {}

    def tags(self, tags):
        return "".join(f'<tag k="{k}" v="{v}"/>' for k, v in tags.items())

    def node(self, x, y, **tags):
        if (x, y) not in self.known:
            self.count += 1
            self.known[x, y] = [self.count, {}]
        self.known[x, y][1].update(tags)
        return self.known[x, y][0]

    def way(self, points, **tags):
        self.count += 1
        refs = "".join(f'<nd ref="{self.node(*p)}"/>' for p in points)
        self.lines.append(f'<way id="{self.count}">{refs}{self.tags(tags)}</way>')
        return self.count

    def relation(self, outer, inner, **tags):
        self.count += 1
        members = "".join(
            f'<member type="way" ref="{ref}" role="{role}"/>'
            for role, refs in (("outer", outer), ("inner", inner))
            for ref in refs
        )
        self.lines.append(f'<relation id="{self.count}">{members}{self.tags(tags)}</relation>')

    def write(self, path):
        nodes = []
        for (x, y), (ident, tags) in self.known.items():
            lon, lat = ANCHOR.to_lonlat([x, y])
            nodes.append(f'<node id="{ident}" lat="{lat:.9f}" lon="{lon:.9f}">{self.tags(tags)}</node>')
        path.write_text("<osm>" + "\n".join(nodes + self.lines) + "</osm>")
        return path


def box(x0, y0, x1, y1):
    return [(x0, y0), (x1, y0), (x1, y1), (x0, y1), (x0, y0)]


def house():
    """Room over corridor on levels 0 and 1; a door between them at (5, 4) on level 0, none on level 1."""
    drawing = Drawing()
    drawing.way(box(0, 0, 20, 4), indoor="corridor", level="0-1", name="hall")
    room = [(0, 4), (5, 4), (20, 4), (20, 10), (0, 10), (0, 4)]
    drawing.way(room, indoor="room", level="0;1", name="R1")
    drawing.node(5, 4, door="hinged", level="0", width="1.2")
    return drawing


@pytest.mark.parametrize(
    ("text", "levels"),
    [
        ("0", (0,)),
        ("0;1", (0, 1)),
        ("-1-3", (-1, 0, 1, 2, 3)),
        ("-3--1", (-3, -2, -1)),
        ("2-0", (0, 1, 2)),
        ("-1;-2; 0", (-2, -1, 0)),
        ("0,5", ()),
        ("0.5;1", (1,)),
        ("0.5-2.5", (1, 2)),
        ("0-99999999", ()),
        ("roof", ()),
        ("", ()),
    ],
)
def test_levels_of_a_tag(text, levels):
    assert parse_levels(text) == levels


def test_rooms_are_walked_in_through_their_doors(tmp_path):
    site, report = import_site(house().write(tmp_path / "house.osm"))
    assert site.floor_names == ("0", "1")
    assert [floor.elevation for floor in site.floors] == [0.0, 4.5]
    assert (site.floors[0].width, site.floors[0].height) == pytest.approx((20.0, 10.0), abs=2e-3)
    for floor in site.floors:
        assert floor.walkable.contains([5.0, 5.0, 5.0], [2.0, 7.0, 12.0]).tolist() == [True, True, False]
        assert sorted((u.name, u.category) for u in floor.units) == [("R1", "room"), ("hall", "corridor")]
        np.testing.assert_allclose(floor.to_lonlat([5.0, 4.0]), ANCHOR.to_lonlat([5.0, 4.0]), atol=1e-7)
    x = np.array([5.0, 5.5, 5.7, 15.0])
    paths = (x, np.full(4, 3.0), x, np.full(4, 5.0))
    assert site.floors[0].barrier_index.crosses(*paths).tolist() == [False, False, True, True]
    assert site.floors[1].barrier_index.crosses(*paths).tolist() == [True, True, True, True]
    assert report.floors[0].warnings == ()
    assert "1 of 1 rooms have no door" in report.floors[1].warnings[0]


def test_no_way_round_the_end_of_a_wall(tmp_path):
    floor = import_site(house().write(tmp_path / "house.osm"))[0].floors[1]
    x = np.linspace(0.002, 19.998, 4001)
    assert floor.barrier_index.crosses(x, np.full(4001, 3.5), x, np.full(4001, 4.5)).all()


def test_repeat_on_holes_walls_and_solid_walls(tmp_path):
    drawing = house()
    outer, inner = drawing.way(box(30, 0, 50, 20)), drawing.way(box(35, 5, 40, 10))
    drawing.relation([outer], [inner], type="multipolygon", indoor="area", level="0", repeat_on="2")
    drawing.way([(30, 15), (50, 15)], indoor="wall", level="0")
    drawing.way(box(45, 2, 47, 4), indoor="wall", level="2")
    site, _ = import_site(drawing.write(tmp_path / "house.osm"))
    assert site.floor_names == ("0", "1", "2")
    ground, _, top = site.floors
    assert ground.walkable.contains([37.5, 32.5, 46.0], [7.5, 7.5, 3.0]).tolist() == [False, True, True]
    assert top.walkable.contains([37.5, 32.5, 46.0], [7.5, 7.5, 3.0]).tolist() == [False, True, False]
    assert ground.barrier_index.crosses([42.0], [14.0], [42.0], [16.0]).tolist() == [True]
    assert top.barrier_index.crosses([42.0], [14.0], [42.0], [16.0]).tolist() == [False]


def test_connectors_are_units_of_the_levels_they_serve(tmp_path):
    drawing = house()
    drawing.way([(10, 1), (16, 1)], highway="steps", level="0;1", width="2")
    drawing.node(2, 2, highway="elevator", level="-1-1")
    drawing.way(box(17, 1, 19, 3), indoor="room", stairs="yes", level="0", repeat_on="1")
    drawing.way([(10, 3), (16, 3)], highway="steps", conveying="forward", level="0;0.5")
    site, _ = import_site(drawing.write(tmp_path / "house.osm"))
    kinds = [
        sorted(u.category for u in f.units if u.category not in ("room", "corridor")) for f in site.floors
    ]
    assert site.floor_names == ("-1", "0", "1")  # people get to -1 by lift, and away again
    assert kinds == [
        ["elevator"],
        ["elevator", "escalator", "stairs", "stairs"],
        ["elevator", "stairs", "stairs"],
    ]
    steps = next(u for u in site.floors[1].units if u.category == "stairs" and u.polygon.area > 5)
    assert steps.polygon.area == pytest.approx(12.0, abs=0.05)
    assert sorted((c.kind, c.floors) for c in site.connectors) == [
        ("lift", (0, 1, 2)),
        ("stairs", (1, 2)),
        ("stairs", (1, 2)),
    ]
    (problem,) = noted_problems(site)  # the escalator to half a level
    assert problem.kind == "connector-to-nowhere"
    site.save(tmp_path / "SITE")
    assert Site.load(tmp_path / "SITE").provenance == site.provenance


def test_what_cannot_be_drawn_is_left_out_and_named(tmp_path):
    path = house().write(tmp_path / "house.osm")
    extra = '<way id="900"><nd ref="1"/><nd ref="77777"/><nd ref="2"/><tag k="indoor" v="room"/></way>'
    lost = '<node id="901" lat="x" lon="13"/>'
    path.write_text(path.read_text().replace("</osm>", extra + lost + "</osm>"))
    site, report = import_site(path)
    assert len(site.floors[0].units) == 2
    assert any("way/900" in warning and "left out" in warning for warning in report.warnings)
    assert any("node/901" in warning for warning in report.warnings)


BOMB = '<!DOCTYPE osm [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;">]><osm>&b;</osm>'
FETCH = '<!DOCTYPE osm [<!ENTITY a SYSTEM "file:///etc/hostname">]><osm><note>&a;</note></osm>'


@pytest.mark.parametrize(
    ("name", "text", "named"),
    [
        ("a.osm", "<osm><node", "not sound XML"),
        ("a.osm", "", "not sound XML"),
        ("a.osm", BOMB, "document type"),
        ("a.osm", FETCH, "document type"),
        ("a.osm", "<gpx/>", "not <osm>"),
        ("a.osm", "<osm/>", "holds no indoor"),
        ("a.geojson", "{", "not JSON"),
        ("a.geojson", "[" * 100_000, "not JSON"),
        ("a.geojson", "[]", "FeatureCollection"),
        ("a.geojson", '{"features": [null, 3]}', "holds no indoor"),
        ("a.pbf", "x", "osmium"),
    ],
)
def test_a_damaged_file_is_named_with_a_remedy(tmp_path, name, text, named):
    path = tmp_path / name
    path.write_text(text)
    with pytest.raises(MapError, match=named) as caught:
        import_site(path)
    assert caught.value.where == str(path)
    assert caught.value.remedy


def test_a_missing_or_huge_file_is_refused_before_it_is_parsed(tmp_path, monkeypatch):
    with pytest.raises(MapError, match="cannot be read"):
        import_site(tmp_path / "none.osm")
    path = house().write(tmp_path / "house.osm")
    monkeypatch.setattr("wayfuse.maps.importers.plan_file.read_limited.__defaults__", (100,))
    with pytest.raises(MapError, match="larger than"):
        import_site(path)


def test_a_city_is_no_building(tmp_path):
    drawing = house()
    drawing.way(box(9000, 0, 9010, 10), indoor="room", level="0")
    with pytest.raises(MapError, match="spans more"):
        import_site(drawing.write(tmp_path / "city.osm"))


@pytest.mark.parametrize("seed", range(60))
def test_whatever_a_file_holds_it_is_imported_or_refused_by_name(tmp_path, seed):
    rng = np.random.default_rng(seed)
    path = house().write(tmp_path / "house.osm")
    text = path.read_text()
    for _ in range(rng.integers(1, 6)):
        at = int(rng.integers(len(text)))
        odd = ["", "9", "-", '"', "<", "nan", "0;1", "e9", "</osm>"][rng.integers(9)]
        text = text[:at] + odd + text[at + int(rng.integers(3)) :]
    path.write_text(text)
    try:
        floors, refusal = import_site(path)[0].floors, None
    except MapError as error:
        floors, refusal = (), error
    assert all(floor.area > 0 for floor in floors)
    assert floors or (refusal.where == str(path) and refusal.remedy)


@pytest.fixture
def osm_folder(data_root):
    folder = data_root / "maps" / "osm_apb" / "public" / "geojson"
    if not folder.is_dir():
        pytest.skip(f"REAL DATA ABSENT: no folder {folder}; fetch with `wayfuse datasets fetch maps`")
    return folder


@pytest.mark.real_data
def test_a_real_university_building(osm_folder):
    site, report = import_site(osm_folder / "APBorig.osm")
    assert site.floor_names == ("-1", "0", "1", "2", "3")
    assert [len(floor.units) for floor in site.floors] == [3, 90, 124, 128, 131]
    assert max(note.residual for note in report.floors) < 0.005
    assert (
        sum(len(note.warnings) for note in report.floors) == 4
    )  # a room of 400 without door, 3 doors of nothing
    served = sorted((c.kind.value, c.floors) for c in site.connectors)
    assert (
        served
        == [("lift", (1, 2, 3, 4))] * 2 + [("stairs", (0, 1, 2, 3, 4))] * 3 + [("stairs", (1, 2, 3, 4))] * 4
    )
    for c in site.connectors:
        assert all(site.floors[at.floor].walkable.contains([at.x], [at.y])[0] for at in c.landings)
    for floor in site.floors[1:]:
        assert floor.walkable_share > 0.99
        assert len(reached(floor)) > 0.95 * np.count_nonzero(floor.walkable.mask)


def reached(floor):
    """Cells of the largest part of a floor that can be walked without crossing a barrier: a flood fill."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    mask = floor.walkable.mask.astype(bool)
    number = np.cumsum(mask.ravel()).reshape(mask.shape) - 1
    ys, xs = np.nonzero(mask)
    x = floor.walkable.origin[0] + (xs + 0.5) * floor.walkable.cell
    y = floor.walkable.origin[1] + (ys + 0.5) * floor.walkable.cell
    pairs = [np.column_stack([number[:, :-1][m], number[:, 1:][m]]) for m in [mask[:, :-1] & mask[:, 1:]]] + [
        np.column_stack([number[:-1][m], number[1:][m]]) for m in [mask[:-1] & mask[1:]]
    ]
    a, b = np.concatenate(pairs).T
    free = ~floor.barrier_index.crosses(x[a], y[a], x[b], y[b])
    graph = coo_array((np.ones(free.sum()), (a[free], b[free])), shape=(len(x), len(x)))
    _, part = connected_components(graph, directed=False)
    return np.nonzero(part == np.argmax(np.bincount(part)))[0]


@pytest.mark.real_data
@pytest.mark.parametrize(("xml", "geojson"), [("APBorig", "apb"), ("berlin_hbf", "berlin_hbf")])
def test_both_forms_of_a_real_building_give_the_same_site(osm_folder, xml, geojson):
    a, b = import_site(osm_folder / f"{xml}.osm")[0], import_site(osm_folder / f"{geojson}.geojson")[0]
    assert a.floor_names == b.floor_names
    for one, other in zip(a.floors, b.floors, strict=True):
        assert sorted((u.name, u.category) for u in one.units) == sorted(
            (u.name, u.category) for u in other.units
        )
        assert one.area == pytest.approx(other.area, rel=1e-6)
        assert one.walkable.area == pytest.approx(other.walkable.area, rel=1e-3)
        assert len(one.walls) == pytest.approx(len(other.walls), rel=0.02)
