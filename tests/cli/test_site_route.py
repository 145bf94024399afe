"""wayfuse site route, validate and show --graph, through the command line."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import shapely

from wayfuse.core.frames import GeoAnchor
from wayfuse.maps.build import build_floor
from wayfuse.maps.connectors import Connector, ConnectorKind, Landing
from wayfuse.maps.geometry import clean_polygons
from wayfuse.maps.importers.rooms import cut_walls
from wayfuse.maps.site import Site, Unit


def box(x0, y0, x1, y1):
    return clean_polygons([np.array([(x0, y0), (x1, y0), (x1, y1), (x0, y1)], dtype=float)])[0][0]


def storey(name, room):
    door = np.array([10.0, 4.0, 10.0, 5.0])
    gap = shapely.LineString(door.reshape(2, 2)).buffer(0.1, cap_style="flat")
    outline = [box(0, 0, 20, 10)]
    walls = cut_walls(outline, [np.array([(10.0, 0.0), (10.0, 10.0)])], [gap])
    units = [Unit(f"way/{room}", room, "room", box(10, 0, 20, 10)), Unit("wc", "WC", "room", box(0, 0, 2, 2))]
    return build_floor(
        name,
        int(name),
        outline,
        units,
        walls=walls,
        closed=[],
        doors=door[None],
        elevation=4.0 * int(name),
        anchor=GeoAnchor.from_origin(13.0, 51.0),
    )


@pytest.fixture
def saved(tmp_path):
    stairs = Connector(
        "st",
        ConnectorKind.STAIRS,
        (Landing(0, 3.0, 8.0), Landing(1, 5.0, 8.0)),
        (24,),
        0,
        None,
        "Main stairs",
    )
    site = Site("house", (storey("0", "Cafe"), storey("1", "Lab")), connectors=(stairs,))
    site.save(tmp_path / "SITE")
    return tmp_path / "SITE"


def test_a_route_over_floors_is_told(saved, run_cli):
    said = run_cli("site", "route", saved, "Cafe", "Lab")
    assert said.code == 0, said.err
    first, ride, last, total = said.out.splitlines()
    assert first.startswith("floor 0: walk from (15.0, 5.0) to (3.0, 8.0), ")
    assert ride == "  stairs Main stairs up to floor 1, 24 steps, 14 s"
    assert last.startswith("floor 1: walk from (5.0, 8.0) to (15.0, 5.0), ")
    assert total.endswith(" s in all")


def test_a_route_as_json_geojson_and_picture(saved, run_cli, tmp_path):
    picture, lines = tmp_path / "route.png", tmp_path / "route.geojson"
    said = run_cli(
        "site", "route", saved, "15,5,0", "way/Lab", "--json", "--out", picture, "--geojson", lines
    )
    assert said.code == 0, said.err
    document = json.loads(said.out)
    assert [p.get("connector") for p in document["parts"]] == [None, "st", None]
    assert document["parts"][1]["steps"] == 24
    walked = [np.array(p["path_m"]) for p in document["parts"] if "path_m" in p]
    assert document["length_m"] == pytest.approx(
        sum(np.hypot(*np.diff(path, axis=0).T).sum() for path in walked), abs=0.01
    )
    assert picture.read_bytes().startswith(b"\x89PNG")
    features = json.loads(lines.read_text())["features"]
    assert [f["properties"]["floor"] for f in features] == ["0", "1"]
    anchor = GeoAnchor.from_origin(13.0, 51.0)
    np.testing.assert_allclose(
        anchor.to_xy(features[0]["geometry"]["coordinates"][0]), [15.0, 5.0], atol=1e-3
    )


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        (("Kitchen", "Lab"), "no unit has the id or name 'Kitchen'"),
        (("WC", "Lab"), "one of 0/wc, 1/wc"),
        (("-4,5,0", "Lab"), "(-4.0, 5.0) on floor 0 is in a wall or outside (the nearest walkable place is"),
        (("4,5,7", "Lab"), "floors: 0, 1"),
        (("x,5,0", "Lab"), "no unit has the id or name 'x,5,0'"),
        (("Cafe", "Lab", "--out", "route.bmp"), "neither .png nor .svg"),
    ],
)
def test_what_is_wrong_is_said_in_one_line(saved, run_cli, arguments, named):
    said = run_cli("site", "route", saved, *arguments)
    assert said.code != 0
    assert named in said.err
    assert "Traceback" not in said.err


def test_a_name_on_several_floors_is_told_apart_by_its_floor(saved, run_cli):
    said = run_cli("site", "route", saved, "0/WC", "1/wc", "--json")
    assert [p.get("floor") for p in json.loads(said.out)["parts"]] == ["0", None, "1"]


def test_no_path_is_an_error(saved, run_cli):
    site = Site.load(saved)
    Site("cut", site.floors).save(saved.parent / "CUT")
    said = run_cli("site", "route", saved.parent / "CUT", "Cafe", "Lab")
    assert said.code != 0
    assert "nothing leads from" in said.err


def test_validate_ends_with_one_where_there_are_errors(saved, run_cli):
    said = run_cli("site", "validate", saved)
    assert (said.code, said.out) == (0, "site house: 0 errors, 0 warnings\n")
    site = Site.load(saved)
    lost = Connector("lift", ConnectorKind.LIFT, (Landing(0, 3.0, 8.0), Landing(1, 3.0, 18.0)))
    Site("bad", site.floors, connectors=(*site.connectors, lost)).save(saved.parent / "BAD")
    said = run_cli("site", "validate", saved.parent / "BAD")
    assert said.code == 1
    assert said.out.splitlines()[0].startswith(
        "error: floor 1: lift lift: its landing (3.0, 18.0) is not walkable"
    )
    document = json.loads(run_cli("site", "validate", saved.parent / "BAD", "--json").out)
    assert (document["errors"], document["problems"][0]["kind"]) == (1, "connector-in-no-cell")


def test_the_graph_and_the_connectors_are_drawn(saved, run_cli, tmp_path):
    from wayfuse.evaluation.plot_connectors import draw_connectors, served_floors
    from wayfuse.evaluation.plot_graph import draw_graph
    from wayfuse.evaluation.plot_site import floor_figure
    from wayfuse.maps.graph import build_graph

    said = run_cli("site", "show", saved, "--graph", "--out", tmp_path / "with")
    plain = run_cli("site", "show", saved, "--out", tmp_path / "without")
    for a, b in zip(said.out.splitlines(), plain.out.splitlines(), strict=True):
        assert Path(a).read_bytes() != Path(b).read_bytes()
    site = Site.load(saved)
    figure = floor_figure(site.floors[0])
    draw_graph(figure.axes[0], build_graph(site), 0)
    draw_connectors(figure.axes[0], site, 0)
    assert "Main stairs  \u2191 1" in [text.get_text() for text in figure.axes[0].texts]
    assert served_floors(site, site.connectors[0], 1) == "\u2193 0"
    assert served_floors(site, site.connectors[0]) == "0, 1"
