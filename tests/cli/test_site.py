"""wayfuse site import and show, through the command line."""

from __future__ import annotations

import json
import struct
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from wayfuse.cli.main import cli
from wayfuse.core.errors import MapError

DEGREE = 111319.49079327357  # m of latitude on the sphere of Web-Mercator


def box(x0, y0, x1, y1):
    return [[x / DEGREE, y / DEGREE] for x, y in ((x0, y0), (x1, y0), (x1, y1), (x0, y1), (x0, y0))]


@pytest.fixture
def plans(tmp_path):
    """Two floors at the equator, where a degree is a degree; one with a name that cannot be drawn."""
    for name in ("B1", "F1"):
        folder = tmp_path / "mall" / name
        folder.mkdir(parents=True)
        (folder / "floor_info.json").write_text('{"map_info": {"width": 40, "height": 30}}')
        shops = [("Books $1 & $2", box(5, 5, 15, 25)), ("\u4e2d\u7a7a", box(20, 5, 35, 25))]
        features = [
            {
                "properties": {"name": name},
                "geometry": {"type": "Polygon", "coordinates": [box(0, 0, 40, 30)]},
            }
        ]
        features += [
            {
                "properties": {"id": f"u{i}", "name": shop},
                "geometry": {"type": "Polygon", "coordinates": [ring]},
            }
            for i, (shop, ring) in enumerate(shops)
        ]
        (folder / "geojson_map.json").write_text(json.dumps({"features": features}))
    return tmp_path / "mall"


def run(*arguments):
    return CliRunner().invoke(cli, ["site", *map(str, arguments)])


def test_import_prints_a_table_and_show_draws_every_floor(plans, tmp_path):
    site = tmp_path / "site"
    done = run("import", "ms-indoor", plans, "--out", site)
    assert done.exit_code == 0, done.output
    assert [line.split()[0] for line in done.output.splitlines()] == ["floor", "B1", "F1", "site"]
    assert "40.0 x 30.0" in done.output
    shown = run("show", site, "--out", tmp_path / "pictures")
    assert shown.exit_code == 0, shown.output
    assert shown.output.splitlines() == [str(tmp_path / "pictures" / f"{name}.png") for name in ("B1", "F1")]
    for line in shown.output.splitlines():
        picture = Path(line).read_bytes()
        assert picture.startswith(b"\x89PNG")
        width, height = struct.unpack(">II", picture[16:24])
        assert width > height > 500


def test_show_one_floor_as_svg_beside_the_site(plans, tmp_path):
    run("import", "ms-indoor", plans, "--out", tmp_path / "site")
    shown = run("show", tmp_path / "site", "--floor", "f1", "--svg")
    assert shown.output.splitlines() == [str(tmp_path / "site" / "pictures" / "F1.svg")]
    svg = (tmp_path / "site" / "pictures" / "F1.svg").read_text()
    assert svg.count("<svg") == 1
    run("show", tmp_path / "site", "--floor", "F1", "--svg", "--out", tmp_path)
    assert (tmp_path / "F1.svg").read_text() == svg


def test_json(plans, tmp_path):
    (plans / "F1" / "geojson_map.json").unlink()
    done = CliRunner().invoke(
        cli, ["site", "import", "ms-indoor", str(plans), "--out", str(tmp_path / "s"), "--json"]
    )
    document = json.loads(done.output)
    basement, ground = document["floors"]
    assert (basement["floor"], basement["level"], basement["units"], basement["walls"]) == ("B1", -1, 2, 12)
    free = (40 * 30 - 200 - 300 + 0.3 * (60 + 70)) / (40 * 30)
    assert basement["walkable_share"] == pytest.approx(free, abs=0.02)
    assert ground["anchor_residual_m"] is None
    assert "geojson_map.json" in ground["warnings"][0]


def test_an_unknown_format_or_floor_or_site_says_what_there_is(plans, tmp_path):
    assert "ms-indoor" in run("import", "visio", plans, "--out", tmp_path / "s").output
    assert isinstance(run("show", tmp_path / "none").exception, MapError)
    run("import", "ms-indoor", plans, "--out", tmp_path / "s")
    assert "B1, F1" in str(run("show", tmp_path / "s", "--floor", "F7").exception)


def test_a_site_is_overwritten_only_when_told(plans, tmp_path):
    arguments = ("import", "ms-indoor", plans, "--out", tmp_path / "s")
    assert run(*arguments).exit_code == 0
    assert "--overwrite" in str(run(*arguments).exception)
    assert run(*arguments, "--overwrite").exit_code == 0


def test_names_stay_in_their_units(plans, tmp_path):
    """Every name written lies inside the unit that bears it; one without glyphs is left out."""
    import shapely

    from wayfuse.evaluation.plot_site import floor_figure
    from wayfuse.maps.importers.ms_indoor import import_site

    floor = import_site(plans)[0].floors[1]
    figure = floor_figure(floor, "F1")
    figure.draw_without_rendering()
    (ax,) = figure.axes
    names = [
        text for text in ax.texts if text.get_text() not in ("", "N") and not text.get_text().endswith(" m")
    ]
    assert [text.get_text() for text in names] == ["Books $1 & $2"]
    corners = ax.transData.inverted().transform(names[0].get_window_extent().get_points())
    shop = shapely.Polygon(floor.units[0].polygon.exterior)
    assert shop.contains(shapely.box(*np.ravel(corners)))
